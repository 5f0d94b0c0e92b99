"""Accuracy and completeness: the distances both ways, by height zone."""

# ruff: noqa: RUF001 - formulas are printed with their own signs, which look like letters

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from typing import Literal

from trigpoint_reporting.blocks import Block, Cell, Entry, Passage, Table
from trigpoint_reporting.evidence import Evidence
from trigpoint_reporting.numbers import Numbers, number_text

Direction = Literal["accuracy", "completeness"]
STATISTICS = ("n", "mean_m", "median_m", "nmad_m", "rmse_m", "p95_m", "max_m", "floor_rmse_m")
# Said once in a section: of the first reconstruction.
TERMS = (
    "RMSE = √(Σd²/n); NMAD = 1.4826 × the median absolute deviation from the median; P95 by linear "
    "interpolation. Floor: the RMSE between two random halves of the reference, thinned alike: its "
    "own spacing and noise, below which a distance says nothing. Points outside the heights belong "
    "to the lowest or highest zone."
)
# Of what was measured and lies outside its own interval.
WORSENED = (
    " It is of the value at the true pose: the error of the pose has worsened what was measured, "
    "which lies near the worse end of its interval, or just outside it."
)
BELOW_FLOOR = (
    " An end below the floor, the reference's own spacing and noise, tells nothing and is not "
    "printed: “up to”, or “below the floor” where both ends are."
)
MEANING = {
    "accuracy": "from each point of the reconstruction to the nearest of the reference",
    "completeness": "from each point of the reference to the nearest of the reconstruction",
}


def accuracy(evidence: Evidence, name: str) -> list[Block]:
    """Return how near the reconstruction lies to the reference, zone by zone."""
    return _direction(evidence, name, "accuracy")


def completeness(evidence: Evidence, name: str) -> list[Block]:
    """Return how much of the reference the reconstruction has, zone by zone."""
    return _direction(evidence, name, "completeness")


def _direction(evidence: Evidence, name: str, direction: Direction) -> list[Block]:
    comparison = Numbers(evidence.results).below("reconstructions", name, "comparison")
    delivered = comparison.below("delivered")
    zones = delivered.below(direction)
    blocks: list[Block] = [
        _statistics(evidence, name, direction, zones),
        _shares(evidence, name, direction, zones),
    ]
    empty = [zone for zone, part in zones.items() if not part["n"]]
    if empty:
        blocks.append(
            Passage(
                (
                    f"No points in: {', '.join(empty)}. Empty is 0 % within any distance and has "
                    "no distance of its own.",
                ),
                "warning",
            )
        )
    blocks += _intervals(delivered, direction)
    if comparison["after_icp"] is not None:
        blocks.append(_after_icp(name, direction, comparison.below("after_icp", direction)))
    return blocks


def _statistics(evidence: Evidence, name: str, direction: Direction, zones: Numbers) -> Table:
    heights = _heights(evidence, name, [zone for zone, _ in zones.items()])
    return Table(
        f"{name}: {direction}, distances as delivered",
        (
            "Zone",
            "Heights (m)",
            "n",
            "Mean (m)",
            "Median (m)",
            "NMAD (m)",
            "RMSE (m)",
            "P95 (m)",
            "Largest (m)",
            "Floor (m)",
        ),
        [
            (zone, heights[zone], *(part.value(key) for key in STATISTICS))
            for zone, part in zones.items()
        ],
        (
            f"Distances {MEANING[direction]}: exact, unsigned, never cut off. "
            + (TERMS if name == evidence.names[0] else f"Columns as for {evidence.names[0]}."),
        ),
    )


def _heights(evidence: Evidence, name: str, zones: Sequence[str]) -> dict[str, Cell]:
    edges = evidence.distances(name, "zone_edges_m")["zone_edges_m"].tolist()
    spans = [(edges[0], edges[-1]), *itertools.pairwise(edges)]
    texts = [f"{number_text(low, 1)} to {number_text(high, 1)}" for low, high in spans]
    return dict(zip(zones, texts, strict=True))


def _shares(evidence: Evidence, name: str, direction: Direction, zones: Numbers) -> Table:
    voxel = evidence.results["project"]["settings"]["comparison"]["voxel_m"]
    parts = list(zones.items())
    within = parts[0][1]["within"]
    spread = any(share["low_pct"] is not None for _, part in parts for share in part["within"])
    thinned = any(share["raw_pct"] is not None for _, part in parts for share in part["within"])
    columns = ["Zone", f"RMSE (m){', 95 %' if spread else ''}"]
    for share in within:
        mark = " *" if share["threshold_m"] <= voxel else ""
        columns.append(f"≤ {number_text(share['threshold_m'])} m{mark} (%)")
        columns += ["unthinned"] if thinned else []
    rows: list[tuple[Entry, ...]] = []
    for zone, part in parts:
        row: list[Entry] = [zone, _with_floor(part)]
        for share in part.rows("within"):
            row.append(with_interval(share, "pct", "low_pct", "high_pct"))
            row += [share.value("raw_pct")] if thinned else []
        rows.append(tuple(row))
    return Table(
        f"{name}: {direction} within distances, as delivered",
        columns,
        rows,
        (
            "Share of the points thinned to ",
            Numbers(evidence.results).value("project", "settings", "comparison", "voxel_m"),
            f" m{', and of all points (unthinned)' if thinned else ''}. * not resolvable: a "
            "threshold that is not above the voxel depends on where the lattice starts"
            f"{'; read the unthinned share beside it.' if thinned else '.'}",
            " In brackets: the 95 % interval." if spread else " 95 % intervals: not available.",
            BELOW_FLOOR if any(_below_floor(part) for _, part in parts) else "",
            WORSENED if any(_beside_its_interval(part) for _, part in parts) else "",
        ),
    )


def _beside_its_interval(part: Numbers) -> bool:
    return is_outside(part["rmse_m"], part["rmse_low_m"], part["rmse_high_m"]) or any(
        is_outside(row["pct"], row["low_pct"], row["high_pct"]) for row in part["within"]
    )


def is_outside(value: float | None, low: float | None, high: float | None) -> bool:
    """Return whether a value lies outside its interval, where there are both."""
    return None not in (value, low, high) and not low <= value <= high  # type: ignore[operator]


def with_interval(part: Numbers, key: str, low: str, high: str) -> Entry:
    """Return a number with its interval, where there is one."""
    if part[low] is None or part[high] is None:
        return part.value(key)
    return part.value(key), " [", part.value(low), " to ", part.value(high), "]"


def _with_floor(part: Numbers) -> Entry:
    """Return the RMSE with its interval, whose ends below the floor are said to be just that."""
    if not _below_floor(part):
        return with_interval(part, "rmse_m", "rmse_low_m", "rmse_high_m")
    if part["rmse_high_m"] < part["floor_rmse_m"]:
        return part.value("rmse_m"), " [below the floor]"
    return part.value("rmse_m"), " [up to ", part.value("rmse_high_m"), "]"


def _below_floor(part: Numbers) -> bool:
    low, high, floor = (part[key] for key in ("rmse_low_m", "rmse_high_m", "floor_rmse_m"))
    return None not in (low, high, floor) and bool(low < floor)


def _intervals(delivered: Numbers, direction: Direction) -> Iterator[Passage]:
    notes = delivered.stored.get("intervals")
    if not notes:
        return
    yield Passage((notes["statement"],), "note")
    if direction == "completeness" and notes["perfect"] is not None:
        yield Passage((notes["perfect"]["statement"],), "note")


def _after_icp(name: str, direction: Direction, zones: Numbers) -> Table:
    parts = list(zones.items())
    marks = [row["threshold_m"] for row in parts[0][1]["within"]]
    rows: list[tuple[Entry, ...]] = [
        (
            zone,
            *(part.value(key) for key in ("n", "median_m", "rmse_m", "p95_m")),
            *(share.value("pct") for share in part.rows("within")),
        )
        for zone, part in parts
    ]
    return Table(
        f"{name}: {direction} after ICP, for comparison only",
        (
            "Zone",
            "n",
            "Median (m)",
            "RMSE (m)",
            "P95 (m)",
            *(f"≤ {number_text(mark)} m (%)" for mark in marks),
        ),
        rows,
        ("The same after the rigid ICP of the section before: the pose of no delivered cloud.",),
    )
