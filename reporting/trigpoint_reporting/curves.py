"""How much of a cloud lies within a distance: curves and zone shares of every reconstruction."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Literal

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from trigpoint.zones import HeightZones
from trigpoint_reporting.blocks import Passage, Picture
from trigpoint_reporting.elevations import limit_of
from trigpoint_reporting.evidence import Evidence
from trigpoint_reporting.style import (
    BLACK,
    GREY,
    PALE,
    canvas,
    labels,
    lines_of,
    listed,
    metres,
    percent,
    to_svg,
)

Direction = Literal["accuracy", "completeness"]

# The mark that the alternative text and the curves are read at, if the project measures there.
MARK_M = 0.10
STEPS = 251

# Why a share may lie below its own interval.
BELOW = (
    " of the share at the true pose, which the error of the pose has lowered: what was measured "
    "lies near a bar's lower end, or just below it"
)
TOLD = {
    "accuracy": "of the reconstruction's points",
    "completeness": "of the reference's points",
}


def accuracy_curves(evidence: Evidence) -> Picture | Passage:
    """Draw the share of each reconstruction's points within any distance of the reference."""
    return _curves(evidence, "accuracy")


def completeness_curves(evidence: Evidence) -> Picture | Passage:
    """Draw the share of the reference's points within any distance of each reconstruction."""
    return _curves(evidence, "completeness")


def accuracy_by_zone(evidence: Evidence) -> Picture | Passage:
    """Draw each reconstruction's share within each threshold, zone by zone."""
    return _by_zone(evidence, "accuracy")


def completeness_by_zone(evidence: Evidence) -> Picture | Passage:
    """Draw the share of the reference that each reconstruction covers, zone by zone."""
    return _by_zone(evidence, "completeness")


def share_within(
    distances: NDArray[np.float64], limits: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the percentage of distances ``<=`` each ascending limit; of no distances, NaN.

    Examples
    --------
    >>> share_within(np.array([0.1, 0.2, np.inf, 0.3]), np.array([0.0, 0.2, 0.5])).tolist()
    [0.0, 50.0, 75.0]
    """
    if not len(distances):
        return np.full(len(limits), np.nan)
    first = np.searchsorted(limits, distances, side="left")
    return 100 * np.bincount(first, minlength=len(limits) + 1)[:-1].cumsum() / len(distances)


def _curves(evidence: Evidence, direction: Direction) -> Picture | Passage:
    names = evidence.names
    styles, shown = lines_of(names), dict(zip(names, labels(names), strict=True))
    rows = {name: _rows(evidence, name, direction) for name in names}
    zones = list(rows[names[0]])
    limit = limit_of(evidence)
    limits = np.linspace(0.0, limit, STEPS)
    voxel = evidence.results["project"]["settings"]["comparison"]["voxel_m"]
    split = {name: _by_own_zone(evidence, name, direction, zones[1:]) for name in names}
    columns = min(4, len(zones))
    lines = -(-len(zones) // columns)
    with canvas(18 + 44 * lines) as figure:
        panels = figure.subplots(lines, columns, sharex=True, sharey=True, squeeze=False)
        for axes in panels.flat[len(zones) :]:
            axes.set_visible(False)
        for axes, zone in zip(panels.flat, zones, strict=False):
            if voxel:
                axes.axvspan(0, voxel, color="#EEEEEE", zorder=0)
            floor = rows[names[0]][zone]["floor_rmse_m"]
            if floor is not None and floor <= limit:
                axes.axvline(floor, color=GREY, linestyle="dotted", linewidth=1.2)
            axes.axvline(_mark(evidence), color=BLACK, linewidth=0.7)
            for name in names:
                line = styles[name]
                axes.plot(
                    limits,
                    share_within(split[name][zone], limits),
                    color=line.color,
                    linestyle=line.linestyle,
                    marker=line.marker,
                    markevery=(12, 50),
                    markersize=4,
                )
            count = _count(rows, zone)
            axes.set_title("All" if zone == "all" else zone.replace("_", " ").capitalize())
            axes.text(0.97, 0.04, count, transform=axes.transAxes, ha="right", fontsize=6.5)
            axes.set_xlim(0, limit)
            axes.xaxis.set_major_locator(MaxNLocator(3))
            axes.set_ylim(0, 100)
            axes.grid(True)
            axes.tick_params(labelbottom=True)
        for axes in panels[-1]:
            axes.set_xlabel("distance, metres")
        figure.supylabel(f"% {TOLD[direction]}", fontsize=8)
        handles: list[Any] = [_handle(styles[name], shown[name]) for name in names]
        handles.append(
            Line2D([], [], color=BLACK, linewidth=0.7, label=metres(_mark(evidence), None))
        )
        if voxel:
            handles.append(Patch(color="#EEEEEE", label=f"below the voxel, {metres(voxel, None)}"))
        handles.append(
            Line2D([], [], color=GREY, linestyle="dotted", label="floor of the reference (RMSE)")
        )
        figure.legend(handles=handles, loc="outside lower center", ncols=min(5, len(handles)))
        content = to_svg(figure)
    caption = (
        f"{direction.capitalize()}: share {TOLD[direction]} within each distance, as "
        "delivered, after thinning."
        + (
            f" Grey: below the voxel size of {metres(voxel, None)}, not resolvable."
            if voxel
            else ""
        )
        + " Dotted: what the reference scores against itself, half against half."
    )
    return Picture(
        f"{direction}-curves", caption, _finding(evidence, rows, direction), content, "svg"
    )


def _by_zone(evidence: Evidence, direction: Direction) -> Picture | Passage:
    names = evidence.names
    styles, shown = lines_of(names), dict(zip(names, labels(names), strict=True))
    rows = {name: _rows(evidence, name, direction) for name in names}
    zones = list(rows[names[0]])
    thresholds = [row["threshold_m"] for row in rows[names[0]]["all"]["within"]]
    step = 0.62 / max(1, len(names))
    intervals = below = False
    with canvas(18 + (6 + 3.2 * len(names)) * len(zones)) as figure:
        panels = figure.subplots(1, len(thresholds), sharey=True, squeeze=False)[0]
        for k, (axes, threshold) in enumerate(zip(panels, thresholds, strict=True)):
            for which, name in enumerate(names):
                line = styles[name]
                at = np.arange(len(zones)) + (which - (len(names) - 1) / 2) * step
                found = [rows[name][zone]["within"][k] for zone in zones]
                share = np.array([_float(each["pct"]) for each in found])
                share[[rows[name][zone]["n"] == 0 for zone in zones]] = np.nan
                low = np.array([_float(each["low_pct"]) for each in found])
                high = np.array([_float(each["high_pct"]) for each in found])
                intervals = intervals or bool(np.isfinite(low).any())
                below = below or bool((share < low).any())
                axes.hlines(at, low, high, color=line.color, linewidth=3, alpha=0.45)
                axes.plot(share, at, line.marker, color=line.color, markersize=3.8, clip_on=False)
                for value, left, right, y in zip(share, low, high, at, strict=True):
                    _beside(axes, value, np.fmin(value, left), np.fmax(value, right), y)
            axes.set_title(f"within {metres(threshold, None)}")
            axes.set_xlabel("% of the cloud" if direction == "accuracy" else "% of the reference")
            axes.set_xlim(0, 100)
            axes.grid(True, axis="x")
            axes.set_yticks(range(len(zones)), [zone.replace("_", " ") for zone in zones])
            axes.set_ylim(len(zones) - 0.45, -0.55)
            axes.tick_params(axis="y", length=0)
            for edge in np.arange(len(zones) - 1) + 0.5:
                axes.axhline(edge, color=PALE, linewidth=0.6)
        handles = [_handle(styles[name], shown[name], joined=False) for name in names]
        figure.legend(handles=handles, loc="outside lower center", ncols=min(5, len(handles)))
        content = to_svg(figure)
    caption = (
        f"{direction.capitalize()} by zone: share {TOLD[direction]} within each threshold, as "
        "delivered."
        + (" Bars: 95 % intervals" if intervals else "")
        + (f"{BELOW}." if below else "." if intervals else "")
    )
    alt = _finding(evidence, rows, direction)
    return Picture(f"{direction}-by-zone", caption, alt, content, "svg")


def _rows(evidence: Evidence, name: str, direction: Direction) -> Mapping[str, Any]:
    """Return a table's rows as results.json holds them, ``all`` first."""
    rows = evidence.results["reconstructions"][name]["comparison"]["delivered"][direction]
    return dict(sorted(rows.items(), key=lambda item: item[0] != "all"))


def _by_own_zone(
    evidence: Evidence, name: str, direction: Direction, zones: Sequence[str]
) -> dict[str, NDArray[np.float64]]:
    keys = f"delivered_{direction}_m", f"delivered_{direction}_height_m", "zone_edges_m"
    distances, heights, edges = evidence.distances(name, *keys).values()
    own = HeightZones(tuple(zones), edges).of(heights)
    return {"all": distances} | {zone: distances[own == k] for k, zone in enumerate(zones)}


def _mark(evidence: Evidence) -> float:
    within = evidence.results["project"]["settings"]["comparison"]["within_m"]
    return float(MARK_M if MARK_M in within else within[len(within) // 2])


def _finding(evidence: Evidence, rows: Mapping[str, Any], direction: Direction) -> str:
    """Say what the figure shows: each reconstruction at the mark, and its weakest zone."""
    mark, told = _mark(evidence), []
    for name, zones in rows.items():
        share = {
            zone: next(each["pct"] for each in row["within"] if each["threshold_m"] == mark)
            for zone, row in zones.items()
            if row["n"]
        }
        if "all" not in share:
            told.append(f"{name} has no points to judge")
            continue
        parts = {zone: value for zone, value in share.items() if zone != "all"}
        worst = min(parts, key=parts.__getitem__, default="")
        told.append(
            f"{percent(share['all'])} for {name}"
            + (f" (least in the {worst} zone, {percent(parts[worst])})" if worst else "")
        )
    return f"Within {metres(mark, None)} lie, {TOLD[direction]}, {listed(told)}."


def _beside(axes: Axes, value: float, left: float, right: float, at: float) -> None:
    """Write a share beside its mark, on the side where the frame leaves room, or on the bar."""
    after, before = not right > 78, not left < 14
    side = -1 if before and not after else 1
    end = right if after else left if before else value
    axes.annotate(
        f"{value:.1f}" if np.isfinite(value) else "no points",
        (end if np.isfinite(value) else 0.0, at),
        (5 * side, 0),
        textcoords="offset points",
        ha="left" if side > 0 else "right",
        va="center",
        fontsize=6.5,
        bbox=None if after or before else {"facecolor": "white", "edgecolor": "none", "pad": 0.8},
    )


def _count(rows: Mapping[str, Any], zone: str) -> str:
    counts = [f"{each[zone]['n']:,}" for each in rows.values()]
    # The reference is the same for all of them.
    return f"n = {counts[0]}" if len(set(counts)) == 1 else "\n".join(["n =", *counts])


def _handle(line: Any, label: str, *, joined: bool = True) -> Line2D:
    return Line2D(
        [],
        [],
        color=line.color,
        linestyle=line.linestyle if joined else "none",
        marker=line.marker,
        label=label,
        markersize=4,
    )


def _float(value: float | None) -> float:
    return np.nan if value is None else value
