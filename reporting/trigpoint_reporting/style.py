"""The one look of every figure: colours, marks, fonts and reproducible bytes."""

from __future__ import annotations

import io
import unicodedata
import warnings
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from functools import cache
from itertools import cycle
from typing import Any, Literal, NamedTuple

from trigpoint.errors import MissingPackageError
from trigpoint_reporting.blocks import Passage
from trigpoint_reporting.evidence import Evidence
from trigpoint_reporting.numbers import NOT_AVAILABLE, number_text

try:
    import matplotlib as mpl
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.font_manager import FontProperties, findfont, get_font
except ImportError as error:
    _MESSAGE = 'Figures need matplotlib: pip install "trigpoint[reporting]"'
    raise MissingPackageError(_MESSAGE) from error

# Okabe and Ito's colours, told apart by every kind of colour vision.
BLACK, GREY, PALE = "#000000", "#6E6E6E", "#D9D9D9"
BLUE, VERMILLION, GREEN, PURPLE, ORANGE = "#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00"

TEXT_MM = 170.0  # between the margins of an A4 page
LABEL = 26  # letters of a name that fit beside an axis
NUMBER = "no. "  # before the number of a name that can't be shown
# Marks above this are drawn as one bitmap: as vectors they make a PDF seven times slower.
RASTER = 500

LOOK: dict[Any, Any] = {
    "font.family": "DejaVu Sans",
    "font.size": 8.0,
    "axes.titlesize": 8.5,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.edgecolor": "#444444",
    "axes.linewidth": 0.7,
    "axes.axisbelow": True,
    "axes.unicode_minus": True,
    "axes.formatter.useoffset": False,
    "axes.formatter.use_locale": False,
    "grid.color": "#E3E3E3",
    "grid.linewidth": 0.6,
    "legend.frameon": False,
    "lines.linewidth": 1.5,
    "lines.markersize": 5.0,
    "hatch.linewidth": 0.6,
    "text.parse_math": False,  # a name may hold a dollar sign
    "savefig.dpi": 220,
    "svg.fonttype": "path",
    "svg.hashsalt": "trigpoint",
}


class Line(NamedTuple):
    """How one reconstruction is drawn wherever it appears: never by colour alone."""

    color: str
    linestyle: str
    marker: str


LINES = (
    Line(BLUE, "solid", "o"),
    Line(VERMILLION, "dashed", "s"),
    Line(GREEN, "dashdot", "^"),
    Line(PURPLE, "dotted", "D"),
    Line(ORANGE, "dashed", "v"),
    Line(BLACK, "solid", "P"),
)


def lines_of(names: Sequence[str]) -> dict[str, Line]:
    """Give each reconstruction its line, the same in every figure."""
    return dict(zip(names, cycle(LINES), strict=False))


@contextmanager
def canvas(height_mm: float, *, width_mm: float = TEXT_MM) -> Iterator[Figure]:
    """Yield an empty figure; draw it and turn it into bytes while this lasts."""
    # A machine's own matplotlibrc would change the bytes.
    with mpl.rc_context(), warnings.catch_warnings():
        mpl.rcdefaults()
        mpl.rcParams.update(LOOK)
        warnings.filterwarnings("ignore", message="constrained_layout not applied")
        yield Figure(figsize=(width_mm / 25.4, height_mm / 25.4), layout="constrained")


def to_svg(figure: Figure) -> bytes:
    """Return a figure as SVG: letters as outlines, no date, the same bytes every time."""
    stream = io.BytesIO()
    empty = dict.fromkeys(("Date", "Creator", "Format", "Type"))
    figure.savefig(stream, format="svg", metadata=empty)
    return stream.getvalue()


def labels(names: Sequence[str]) -> list[str]:
    """Return names as a figure can show them.

    Long ones are cut. One that the figure's font can't write, that runs from right to left, or
    that can't be told from another once it is cut, is shown by its number instead.

    Examples
    --------
    >>> labels(["roof $1", "塔", "a  very long name of some clock's corner"])
    ['roof $1', 'no. 2', 'a very long name of some …']
    """
    shown = [_label(" ".join(name.split())) for name in names]
    alike = Counter(shown)
    return [
        f"{NUMBER}{row}" if label is None or alike[label] > 1 else label
        for row, label in enumerate(shown, start=1)
    ]


def pick_labels(evidence: Evidence, name: str) -> dict[str, str]:
    """Return what a reconstruction's picks are called in every figure, by id.

    A number is the one that the table of the picks' coordinates has.
    """
    found = evidence.results["reconstructions"][name]
    if (evidence.folder / "data" / f"correspondences-{name}.csv").is_file():
        ids = evidence.table(f"correspondences-{name}")["id"].tolist()
    else:
        rows = found["alignment"]["residuals"] + found["checks"]["residuals"]
        ids = [row["id"] for row in rows]
    return dict(zip(ids, labels(ids), strict=True))


def numbered(shown: Iterable[str]) -> str:
    """Return a sentence for a caption where picks are shown by their numbers."""
    if not any(label.startswith(NUMBER) for label in shown):
        return ""
    return f" “{NUMBER.strip()}”: the pick's number in the table of coordinates as picked."


def _label(name: str) -> str | None:
    backwards = any(
        unicodedata.bidirectional(letter) in ("R", "AL", "RLO", "RLE") for letter in name
    )
    if not name or backwards or not all(map(_drawable, name)):
        return None
    return name if len(name) <= LABEL else name[: LABEL - 1].rstrip() + " …"


@cache
def _drawable(letter: str) -> bool:
    font = get_font(findfont(FontProperties(family=LOOK["font.family"])))
    return letter.isprintable() and font.get_char_index(ord(letter)) != 0


def metres(value: float | None, digits: int | None = 3) -> str:
    """Write a length in metres as the tables do; a missing one is not available."""
    return _with_unit(value, digits, " m")


def percent(value: float | None, digits: int = 1) -> str:
    """Write a share in per cent as the tables do; a missing one is not available."""
    return _with_unit(value, digits, " %")


def _with_unit(value: float | None, digits: int | None, unit: str) -> str:
    text = number_text(value, digits)
    return text if text == NOT_AVAILABLE else text + unit


def listed(words: Sequence[str]) -> str:
    """Join words as a sentence does.

    Examples
    --------
    >>> listed(["nerf", "sfm", "als"])
    'nerf, sfm and als'
    """
    return " and ".join([", ".join(words[:-1]), words[-1]] if len(words) > 1 else words)


def rule(
    axes: Axes,
    at: float,
    label: str,
    *,
    along: Literal["x", "y"] = "x",
    color: str = BLACK,
    linestyle: str = "dashed",
) -> None:
    """Draw a line across at one value, named in the legend."""
    draw = axes.axvline if along == "x" else axes.axhline
    draw(at, color=color, linestyle=linestyle, linewidth=1.0, label=label)


def not_drawn(what: str, why: str) -> Passage:
    """Say in a figure's place why it is not there."""
    return Passage((f"{what}: not drawn, because {why}.",), "note")


def no_picks(name: str) -> Passage:
    """Stand for any figure of picks of a cloud that came georeferenced."""
    return not_drawn("Picks", f"{name} came georeferenced and has none")
