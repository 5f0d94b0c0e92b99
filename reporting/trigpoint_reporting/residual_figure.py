"""The residual figure: an arrow at every pick, in plan and in two elevations."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from trigpoint_reporting.blocks import Passage, Picture
from trigpoint_reporting.evidence import Evidence
from trigpoint_reporting.style import (
    BLACK,
    BLUE,
    GREEN,
    RASTER,
    TEXT_MM,
    VERMILLION,
    canvas,
    metres,
    no_picks,
    not_drawn,
    numbered,
    pick_labels,
    to_svg,
)

POSITION = ["target_x", "target_y", "target_z"]
RESIDUAL = ["dx_m", "dy_m", "dz_m"]
# Picks named in the figure: with more, the names would hide the arrows.
NAMED = 12
# Picks beyond this many are small marks, so that the arrows are seen.
CROWD = 40
# The longest arrow, as a share of the picks' extent.
ARROW = 0.22
ROUND = np.array([m * 10.0**k for k in range(7) for m in (1, 2, 5)])
VIEWS = (("Plan", 0, 1), ("From the south", 0, 2), ("From the east", 1, 2))
AXES = ("easting", "northing", "height")
MARKS = {"used": ("o", BLUE), "rejected": ("X", VERMILLION), "check": ("^", GREEN)}
# Room in millimetres around the panels, and for the tallest of them.
BESIDE, BELOW, ABOVE, TALLEST = 15.0, 18.0, 6.0, 68.0


def residual_vectors(evidence: Evidence, name: str) -> Picture | Passage:
    """Draw the residual at each pick in plan and in two elevations, exaggerated as stated."""
    found = evidence.results["reconstructions"][name]
    if found["alignment"] is None:
        return no_picks(name)
    try:
        places = evidence.table(f"correspondences-{name}").set_index("id")[POSITION]
    except FileNotFoundError:
        return not_drawn("Residual vectors", "the bundle holds no coordinates of the picks")
    table = _picks(evidence, name, found).join(places, on="id")
    centre = np.round(table[POSITION].mean().to_numpy())
    place = table[POSITION].to_numpy() - centre
    error = table[RESIDUAL].to_numpy()
    judged = (table["kind"] != "rejected").to_numpy()
    extent = float(np.ptp(place, axis=0).max())
    longest = float(table["d_m"][judged].max()) if judged.any() else float(table["d_m"].max())
    factor = _exaggeration(ARROW * extent, longest)
    # A rejected pick may be off by metres: its arrow is cut where it would leave the figure.
    length = factor * table["d_m"].to_numpy()
    cut = np.minimum(1.0, 1.5 * ARROW * extent / np.maximum(length, 1e-12))
    arrow = error * (factor * cut)[:, None]

    low, high = place.min(axis=0), place.max(axis=0)
    low, high = (
        np.minimum(low, (place + arrow).min(axis=0)),
        np.maximum(high, (place + arrow).max(axis=0)),
    )
    low, high = low - 0.1 * extent, high + 0.1 * extent
    mm, corners, total = _layout(high - low)
    bar = _round_below(ARROW * extent / factor)
    page = np.array([TEXT_MM, total])
    named: set[int] = set()
    with canvas(total) as figure:
        figure.set_layout_engine("none")
        for (title, i, j), corner in zip(VIEWS, corners, strict=True):
            size = mm * (high - low)[[i, j]]
            box = (*(corner / page), *(size / page))
            axes = figure.add_axes(box, xlim=(low[i], high[i]), ylim=(low[j], high[j]))
            _arrows(axes, place[:, [i, j]], arrow[:, [i, j]], table, cut < 1)
            middles = place + arrow / 2
            named |= _names(axes, place[:, [i, j]], middles[:, [i, j]], table, cut < 1, mm)
            axes.set_title(title)
            axes.set_xlabel(f"{AXES[i]} \N{MINUS SIGN} {centre[i]:.0f} m")
            axes.set_ylabel(f"{AXES[j]} \N{MINUS SIGN} {centre[j]:.0f} m")
            axes.xaxis.set_major_locator(
                MaxNLocator(max(2, int(size[0] / 12)), steps=[1, 2, 5, 10])
            )
            axes.yaxis.set_major_locator(
                MaxNLocator(max(2, int(size[1] / 12)), steps=[1, 2, 5, 10])
            )
            axes.grid(True)
        kinds = [kind for kind in MARKS if kind in set(table["kind"])]
        legend = figure.legend(
            handles=[_handle(kind) for kind in kinds],
            loc="lower left",
            ncols=len(kinds),
            bbox_to_anchor=(0.0, 0.0),
            borderaxespad=0.2,
        )
        legend.set_in_layout(False)
        ends = 1 - np.array([mm * factor * bar + 4, 4]) / TEXT_MM
        figure.add_artist(
            Line2D(ends, [3 / total] * 2, color=BLACK, linewidth=2, solid_capstyle="butt")
        )
        figure.text(
            ends[0] - 2 / TEXT_MM,
            3 / total,
            f"a residual of {metres(bar, 3 if bar < 0.01 else 2)}",
            ha="right",
            va="center",
        )
        content = to_svg(figure)

    used = table[table["kind"] == "used"]
    worst = used.sort_values("d_m", kind="stable").iloc[-1]
    rejected = int((table["kind"] == "rejected").sum())
    checks = found["checks"]
    checked = f"RMSE at check picks (n = {checks['n']}): {metres(checks['rmse_m'])}."
    checked = checked if checks["n"] else "There are no check picks."
    alt = (
        f"The {len(used)} picks used keep residuals of up to {metres(worst['d_m'])} "
        f"({worst['label']}), {metres(found['alignment']['rmse_m'])} RMSE; "
        + (f"{rejected} rejected. " if rejected else "none was rejected. ")
        + checked
    )
    caption = (
        f"{name}: residuals (reference \N{MINUS SIGN} transformed), drawn {factor:g} times their "
        "size at the picks' places, all views at one scale."
        + (" A dashed arrow is cut; its length is written beside it." if (cut < 1).any() else "")
        + _unnamed(table, named)
        + numbered(table["label"][sorted(named)])
    )
    return Picture(f"residual-vectors-{name}", caption, alt, content, "svg")


def _handle(kind: str) -> Line2D:
    marker, color = MARKS[kind]
    text = {"used": "used in the fit", "rejected": "rejected", "check": "check pick"}[kind]
    return Line2D([], [], color=color, marker=marker, linestyle="none", label=text)


def _picks(evidence: Evidence, name: str, found: dict[str, Any]) -> pd.DataFrame:
    """Control picks as used or rejected, then check picks, in the order of the tables."""
    control = evidence.table(f"picks-{name}")
    parts = [control.assign(kind=np.where(control["used"], "used", "rejected"))]
    if found["checks"]["n"]:
        parts.append(evidence.table(f"checks-{name}").assign(kind="check"))
    table = pd.concat(parts, ignore_index=True)
    return table.assign(label=table["id"].map(pick_labels(evidence, name)))


def _arrows(
    axes: Axes,
    place: NDArray[np.float64],
    arrow: NDArray[np.float64],
    table: pd.DataFrame,
    cut: NDArray[np.bool_],
) -> None:
    raster = len(table) > RASTER
    size = 4.5 if len(table) <= CROWD else 2.0
    for kind, (marker, color) in MARKS.items():
        own = (table["kind"] == kind).to_numpy()
        axes.plot(
            *place[own].T, marker, color=color, markersize=size, linestyle="none", rasterized=raster
        )
        for whole, linestyle in ((own & ~cut, "solid"), (own & cut, "dashed")):
            axes.quiver(
                *place[whole].T,
                *arrow[whole].T,
                angles="xy",
                scale_units="xy",
                scale=1,
                units="inches",
                width=0.013,
                headwidth=4,
                color=color,
                linestyle=linestyle,
                rasterized=raster,
                clip_on=False,
            )


def _layout(size: NDArray[np.float64]) -> tuple[float, list[NDArray[np.float64]], float]:
    """Place the three views in millimetres: in a row, or the elevations one above the other.

    Returns the millimetres drawn for a metre, each view's lower left corner, and the height of it
    all; whichever arrangement draws larger.
    """
    east, north, up = size
    gap, base = ABOVE + BESIDE, np.array([BESIDE, BELOW])
    row = min((TEXT_MM - 3 * BESIDE - 2) / (2 * east + north), TALLEST / max(north, up))
    stack = min(
        (TEXT_MM - 2 * BESIDE - 2) / (east + max(east, north)),
        min(TALLEST / north, (TALLEST - gap) / (2 * up)),
    )
    if row >= 0.8 * stack:  # a row is easier to read
        step = np.array([row * east + BESIDE, 0.0])
        return row, [base, base + step, base + 2 * step], row * max(north, up) + BELOW + ABOVE
    right = base + np.array([stack * east + BESIDE, 0.0])
    tall = max(stack * north, 2 * stack * up + gap)
    return stack, [base, right + np.array([0.0, tall - stack * up]), right], tall + BELOW + ABOVE


def _names(
    axes: Axes,
    place: NDArray[np.float64],
    middles: NDArray[np.float64],
    table: pd.DataFrame,
    cut: NDArray[np.bool_],
    mm: float,
) -> set[int]:
    """Name the worst picks where there is room: on no mark, arrow or other name.

    Return the rows of those that are named.
    """
    named = set()
    taken = [(x, y, 2.4, 2.4) for x, y in mm * np.concatenate([place, middles])]
    low, high = (mm * np.array(ends) for ends in zip(axes.get_xlim(), axes.get_ylim(), strict=True))
    # What lies beyond the panel counts as taken.
    for k, side in ((0, low[0] - 50), (0, high[0] + 50), (1, low[1] - 50), (1, high[1] + 50)):
        taken.append((side, 0.0, 100.0, 1e9) if k == 0 else (0.0, side, 1e9, 100.0))
    for row in table["d_m"].nlargest(NAMED).index:
        text = table["label"][row]
        if cut[row]:
            text += f" ({metres(table['d_m'][row], 2)})"
        width, height = 1.25 * len(text) + 0.5, 2.4  # mm, of letters this size
        spots = [
            (
                side * (1.8 + width / 2) + mm * place[row, 0],
                rise + mm * place[row, 1],
                width,
                height,
            )
            for rise in (0.0, -2.2, 2.2, -4.0, 4.0)
            for side in (1, -1)
        ]
        covered = [sum(_overlap(spot, other) for other in taken) for spot in spots]
        if min(covered) > 1.5:  # mm²; its other views may have room
            continue
        spot = spots[int(np.argmin(covered))]
        taken.append(spot)
        named.add(int(row))
        axes.text(
            spot[0] / mm,
            spot[1] / mm,
            text,
            ha="center",
            va="center",
            fontsize=6.5,
            color=MARKS[table["kind"][row]][1],
        )
    return named


def _unnamed(table: pd.DataFrame, named: Collection[int]) -> str:
    """Say that not every pick is named, and which are."""
    left = len(table) - len(named)
    if not left:
        return ""
    worst = f"only the {NAMED} largest are" if len(table) > NAMED else "there is no room for it"
    return f" {left:,} of {len(table):,} picks are not named: {worst}, and the tables list all."


def _overlap(one: Sequence[float], other: Sequence[float]) -> float:
    """Return the area that two boxes, given by centre and size, share."""
    sides = [(one[2 + k] + other[2 + k]) / 2 - abs(one[k] - other[k]) for k in (0, 1)]
    return max(sides[0], 0.0) * max(sides[1], 0.0)


def _exaggeration(room: float, longest: float) -> float:
    fits = ROUND[ROUND * longest <= room]
    return float(fits[-1]) if len(fits) else 1.0


def _round_below(value: float) -> float:
    fits = ROUND[value * 1e4 >= ROUND]
    return float(fits[-1]) / 1e4 if len(fits) else value
