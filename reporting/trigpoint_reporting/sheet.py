"""A drawing sheet to scale: panels of coloured pixels, their heights, a scale bar, a legend."""

from __future__ import annotations

import io
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray
from PIL import Image

from trigpoint_reporting.splat import pixels_of
from trigpoint_reporting.style import BLACK, GREY, TEXT_MM, canvas

# Ten pixels a millimetre: on a page of `TEXT_MM` a sheet is to scale when it is printed.
PER_MM = 10
WIDTH = int(TEXT_MM * PER_MM)
TALLEST = 2250
# Room in pixels: left of a panel for its heights, right of it for its zones, above for its title.
LEFT, BETWEEN, RIGHT, ABOVE, BELOW, LEGEND = 90, 45, 50, 60, 40, 190
NOTE = 29  # pixels: a line of a panel's note
BAND = 34  # pixels: height of a colour in the legend
HATCH = 7  # pixels from line to line
SMALL = 6.5  # points
SCALES = np.array([m * 10.0**k for k in range(1, 6) for m in (1, 1.25, 1.5, 2, 2.5, 3, 4, 5, 7.5)])

Colours = NDArray[np.uint8]


@dataclass(frozen=True, slots=True, eq=False)
class Panel:
    """One view on a sheet.

    Attributes
    ----------
    title : str
    window : ndarray of shape (4,)
        left, bottom, right, top in metres.
    heights : bool
        Whether up is height, so that it is ticked and its zones are marked.
    note : str
        Stands below the panel; may have several lines.
    """

    title: str
    window: NDArray[np.float64]
    heights: bool = True
    note: str = ""


@dataclass(frozen=True, slots=True, eq=False)
class Legend:
    """The colours of a sheet, exactly as its pixels have them.

    Attributes
    ----------
    title : str
    colours : ndarray of shape (k, 3)
        Of the bands, in order.
    edges : sequence of str
        What stands at the k + 1 ends of the bands; empty for none.
    extra : sequence of (colour, text)
        Further colours, each with its meaning.
    hatched : colour, optional
        One of them that is crossed by black lines, to be known in a grey print too.
    """

    title: str
    colours: Colours
    edges: Sequence[str]
    extra: Sequence[tuple[Colours, str]] = field(default_factory=tuple)
    hatched: Colours | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Plan:
    """Where a sheet's panels stand, and at what scale.

    Attributes
    ----------
    scale : float
        The denominator, as in 1:500, at the size stated in the file.
    pixel : float
        Metres on the object that a pixel shows.
    corners : list of (int, int)
        Of each panel's pixels: left, top.
    sizes : list of (int, int)
        Width and height of each panel's pixels.
    height : int
        Of the sheet, in pixels.
    """

    scale: float
    pixel: float
    corners: list[tuple[int, int]]
    sizes: list[tuple[int, int]]
    height: int


def lay_out(panels: Sequence[Panel], *, tallest: int = TALLEST) -> Plan:
    """Place panels in rows, at the largest round scale at which all of them fit.

    Parameters
    ----------
    panels : sequence of Panel
    tallest : int
        Of the sheet, in pixels.
    """
    for scale in SCALES:
        plan = _rows(panels, float(scale))
        if plan is not None and plan.height <= tallest:
            return plan
    message = f"The panels are too wide for any scale up to 1:{SCALES[-1]:.0f}."
    raise ValueError(message)


def draw(
    panels: Sequence[Panel],
    plan: Plan,
    pictures: Sequence[Colours],
    legend: Legend,
    *,
    zones: Sequence[tuple[str, float]] = (),
) -> bytes:
    """Draw a sheet.

    Parameters
    ----------
    panels : sequence of Panel
    plan : Plan
        As `lay_out` made it of them.
    pictures : sequence of ndarray of shape (height, width, 3)
        The pixels of each panel, of the plan's sizes. They reach the file unchanged.
    legend : Legend
    zones : sequence of (str, float)
        Each zone's name and its lower edge in metres, from the lowest up.

    Returns
    -------
    bytes
        A PNG that states its size, so that it prints to scale, and nothing else.
    """
    with canvas(plan.height / PER_MM) as figure:
        figure.set_layout_engine("none")
        figure.set_dpi(PER_MM * 25.4)
        ink = _Ink(figure, plan.height)
        for k, panel in enumerate(panels):
            # The zones are named once in a row, beside its last elevation.
            after = panels[k + 1 : k + 2]
            ends = not after or not after[0].heights or plan.corners[k + 1][0] == LEFT
            _label(ink, panel, plan, k, zones if ends else ())
        _scale_bar(ink, plan)
        swatches = _legend(ink, legend, plan)
        agg = FigureCanvasAgg(figure)
        agg.draw()  # type: ignore[no-untyped-call]
        # The ink is grey: sixty-four levels of it leave the palette to the colours.
        drawn = agg.buffer_rgba()  # type: ignore[no-untyped-call]
        grey = np.array(drawn)[..., :1].astype(np.int64)
    sheet = np.repeat(np.minimum((grey + 2) // 4 * 4, 255).astype(np.uint8), 3, axis=2)
    # Colours are set by hand, so that nothing blends with those that the legend explains.
    for left, top, width, height, colour in swatches:
        sheet[top : top + height, left : left + width] = colour
    for k, picture in enumerate(pictures):
        (left, top), (width, height) = plan.corners[k], plan.sizes[k]
        place = sheet[top : top + height, left : left + width]
        inked = (picture != 255).any(axis=2)
        place[inked] = picture[inked]
        for _, edge in zones[1:] if panels[k].heights else ():
            row = height - round((edge - panels[k].window[1]) / plan.pixel)
            dashes = np.arange(width) % 20 < 12
            place[max(0, row - 1) : row + 1, dashes] = 0
    if legend.hatched is not None:
        lines = np.add.outer(np.arange(plan.height), np.arange(WIDTH)) % HATCH < 2
        sheet[lines & (sheet == legend.hatched).all(axis=2)] = 0
    return to_png(sheet)


def to_png(pixels: Colours) -> bytes:
    """Return pixels as a PNG without date or comment; with a palette where 256 colours do."""
    codes = pixels.astype(np.int32) @ np.array([65536, 256, 1], np.int32)
    table = np.zeros(2**24, np.uint8)
    table[codes] = 1
    colours = np.flatnonzero(table)
    if len(colours) > 256:
        image = Image.fromarray(pixels)
    else:
        table[colours] = np.arange(len(colours))
        image = Image.fromarray(table[codes])
        palette = np.stack([colours >> 16, colours >> 8 & 255, colours & 255], axis=1)
        image.putpalette(palette.astype(np.uint8).tobytes())
    stream = io.BytesIO()
    image.save(stream, "PNG", optimize=True, dpi=(PER_MM * 25.4, PER_MM * 25.4))
    return stream.getvalue()


@dataclass(frozen=True, slots=True, eq=False)
class _Ink:
    """Grey text and lines, placed in pixels from the sheet's upper left corner."""

    figure: Figure
    height: int

    def text(self, x: float, y: float, text: str, **style: Any) -> None:
        style = {"fontsize": SMALL, "va": "center", **style}
        self.figure.text(x / WIDTH, 1 - y / self.height, text, **style)

    def line(self, x: Sequence[float], y: Sequence[float], **style: Any) -> None:
        places = np.array(x) / WIDTH, 1 - np.array(y) / self.height
        style = {"color": BLACK, "linewidth": 0.6, "solid_capstyle": "butt", **style}
        self.figure.add_artist(Line2D(*places, **style))


def _rows(panels: Sequence[Panel], scale: float) -> Plan | None:
    """Fill rows from the left; None where a panel is wider than the sheet."""
    pixel = scale / 1000 / PER_MM
    sizes = [pixels_of(panel.window, pixel) for panel in panels]
    rows: list[list[int]] = []
    right = WIDTH + 1
    lefts = []
    for k, (width, _) in enumerate(sizes):
        left = right + BETWEEN
        if left + width + RIGHT > WIDTH:
            rows.append([])
            left = LEFT
        if left + width + RIGHT > WIDTH:
            return None
        rows[-1].append(k)
        lefts.append(left)
        right = left + width
    corners, top = [(0, 0)] * len(panels), 0
    for row in rows:
        tallest = max(sizes[k][1] for k in row)
        for k in row:
            corners[k] = (lefts[k], top + ABOVE + tallest - sizes[k][1])
        notes = max(len(panels[k].note.splitlines()) for k in row)
        top += ABOVE + tallest + BELOW + NOTE * notes
    return Plan(scale, pixel, corners, sizes, top + LEGEND)


def _label(ink: _Ink, panel: Panel, plan: Plan, k: int, zones: Sequence[tuple[str, float]]) -> None:
    (left, top), (width, height) = plan.corners[k], plan.sizes[k]
    bottom, right = top + height, left + width
    ink.text(left, top - 28, panel.title, fontweight="bold", fontsize=8)
    for line, note in enumerate(panel.note.splitlines()):
        ink.text(left, bottom + 24 + NOTE * line, note, color=GREY)
    if not panel.heights:
        ink.line([left, right, right, left, left], [top, top, bottom, bottom, top], color=GREY)
        return
    ink.line([left, right], [bottom, bottom])
    low, high = panel.window[1], panel.window[3]

    def row(value: float) -> float:
        return float(bottom - (value - low) / plan.pixel)

    if left == LEFT:
        ticks = MaxNLocator(max(1, height // 120), steps=[1, 2, 5, 10]).tick_values(low, high)
        for tick in ticks[(ticks >= low) & (ticks <= high)]:
            ink.line([left - 14, left - 4], [row(tick)] * 2)
            ink.text(left - 20, row(tick), f"{tick:g}".replace("-", "\N{MINUS SIGN}"), ha="right")
    edges = [edge for _, edge in zones[1:]]
    spans = zip(zones, [low, *edges], [*edges, high], strict=True) if zones else ()
    for (name, _), start, end in spans:
        if (end - start) / plan.pixel > 22 * len(name) * SMALL / 8:
            ink.text(right + 24, row((start + end) / 2), name, rotation=90, ha="center", color=GREY)


def _scale_bar(ink: _Ink, plan: Plan) -> None:
    lengths = np.array([m * 10.0**k for k in range(-2, 5) for m in (1, 2, 5)])
    length = float(lengths[lengths / plan.pixel <= 330][-1])
    top, end = plan.height - LEGEND + 66, LEFT + length / plan.pixel
    ink.text(LEFT, top - 36, f"1:{plan.scale:g} printed {TEXT_MM:g} mm wide", fontweight="bold")
    ink.line([LEFT, end], [top, top], linewidth=1.6)
    for place, text in ((LEFT, "0"), (end, f"{length:g} m")):
        ink.line([place, place], [top - 9, top + 9], linewidth=0.9)
        ink.text(place, top + 30, text, ha="center")


def _legend(ink: _Ink, legend: Legend, plan: Plan) -> list[tuple[int, int, int, int, Colours]]:
    """Write the legend, and return its swatches: left, top, width, height, colour."""
    top, left = plan.height - LEGEND + 50, 640
    ink.text(left, top - 22, legend.title, fontweight="bold")
    swatches = []
    width = min(100, 620 // max(1, len(legend.colours)))
    for k, colour in enumerate(legend.colours):
        swatches.append((left + k * width, top, width, BAND, colour))
    for k, text in enumerate(legend.edges):
        ink.text(left + k * width, top + BAND + 20, text, ha="center")
    right = left + width * len(legend.colours) + (60 if len(legend.colours) else 0)
    for k, (colour, text) in enumerate(legend.extra):
        swatches.append((right, top + k * (BAND + 10), BAND, BAND, colour))
        ink.text(right + BAND + 14, top + k * (BAND + 10) + BAND / 2, text)
    return swatches
