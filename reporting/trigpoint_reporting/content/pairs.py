"""Reconstructions against each other, on the same points of the reference."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from trigpoint.pairing import BETTER, NEITHER, UNKNOWN, WORSE
from trigpoint.preparation import ALL
from trigpoint_reporting.blocks import Block, Entry, Passage, Table
from trigpoint_reporting.content.distances import is_outside, with_interval
from trigpoint_reporting.evidence import Evidence
from trigpoint_reporting.numbers import Numbers, number_text

UNRESOLVED, MIXED = "not resolvable", "not told"
STAGES = {"delivered": "as delivered", "after_icp": "after ICP, pose taken out"}
# Of a difference that was measured and lies outside its own interval.
DISAGREE = " Not told: what was measured and its interval lie on different sides of zero."
MOVED = (
    " It is of the difference at the true poses, from which an error of a pose has moved the one "
    "measured."
)
SHORT = {"delivered": "", "after_icp": "after ICP: "}


def paired(evidence: Evidence) -> list[Block]:
    """Return the difference in completeness between every two, or why there is none."""
    blocks = list(_pairs(evidence))
    if blocks:
        return blocks
    why = (
        "There is one reconstruction, and so nothing to compare it with."
        if len(evidence.names) == 1
        else "Not available: the reconstructions were not compared in pairs."
    )
    return [Passage((why,), "note")]


def _pairs(evidence: Evidence) -> Iterator[Block]:
    """Yield what each pair's differences say, and one table of them: delivered, then after ICP."""
    stages = {stage: Numbers(evidence.results).rows("paired", stage) for stage in STAGES}
    pairs = dict.fromkeys(tuple(pair["names"]) for each in stages.values() for pair in each)
    for names in pairs:
        found = {
            stage: pair
            for stage, each in stages.items()
            for pair in each
            if tuple(pair["names"]) == names
        }
        for stage, pair in found.items():
            told = STAGES[stage]
            statement = _statement(evidence, stage, pair)
            yield Passage((f"{told[0].upper()}{told[1:]}: {statement}",))
        yield _differences(evidence, names, found)


def _statement(evidence: Evidence, stage: str, pair: Numbers) -> str:
    """Say what holds over all zones at each threshold, and what that takes for granted."""
    one, other = pair["names"]
    phrases = {
        BETTER: f"{one} is more complete than {other} within {{}} m",
        WORSE: f"{one} is less complete than {other} within {{}} m",
        NEITHER: f"{one} and {other} are not distinguishable in completeness within {{}} m",
        UNKNOWN: f"{one} and {other} can't be compared within {{}} m (too few blocks)",
        MIXED: "which is more complete within {} m is not told, for what was measured and its "
        "interval disagree",
        UNRESOLVED: "nothing is said within {} m, not above the voxel",
    }
    marks: dict[str, list[str]] = {verdict: [] for verdict in phrases}
    for row in pair["differences"]:
        if row["zone"] == ALL:
            marks[_verdict(evidence, row)].append(number_text(row["threshold_m"]))
    told = [phrases[verdict].format(", ".join(found)) for verdict, found in marks.items() if found]
    compared = {
        name: evidence.results["reconstructions"][name]["comparison"] for name in (one, other)
    }
    as_it_is = [
        name
        for name, part in compared.items()
        if not (part[stage] and (part[stage]["intervals"] or {}).get("has_pose"))
    ]
    proviso = f", the pose of {' and '.join(as_it_is)} being taken as it is" if as_it_is else ""
    return f"Over all zones, {'; '.join(told)} (95 % intervals{proviso})."


def _verdict(evidence: Evidence, row: Mapping[str, Any]) -> str:
    """Return the stored verdict, unless the threshold or the interval says that there is none."""
    if row["threshold_m"] <= evidence.results["project"]["settings"]["comparison"]["voxel_m"]:
        return UNRESOLVED
    gap = row["difference_pct"]
    if (row["verdict"] == BETTER and gap <= 0) or (row["verdict"] == WORSE and gap >= 0):
        return MIXED
    return str(row["verdict"])


def _differences(evidence: Evidence, names: tuple[str, ...], found: Mapping[str, Numbers]) -> Table:
    one, other = names
    columns = ["Zone", "Within (m)"]
    for stage in found:
        start = SHORT[stage]
        columns += [f"{start}{one} (%)", f"{other} (%)", "Difference, 95 %", f"{one} is"]
    # One pair's rows are the same places in every stage.
    rows = zip(*(pair.rows("differences") for pair in found.values()), strict=True)
    told = [row for pair in found.values() for row in pair.rows("differences")]
    return Table(
        f"{one} less {other}: completeness, {' and '.join(STAGES[stage] for stage in found)}",
        columns,
        [tuple(_row(evidence, stages)) for stages in rows],
        (
            "Paired: both from the same points of the reference. Difference: in percentage points, "
            "in brackets the 95 % interval; one that holds zero is not told apart from none."
            f"{MOVED if any(map(_beside_its_interval, told)) else ''}"
            " Not resolvable: a threshold not above the voxel."
            f"{DISAGREE if any(_verdict(evidence, row.stored) == MIXED for row in told) else ''}",
        ),
    )


def _beside_its_interval(row: Numbers) -> bool:
    return is_outside(*(row[key] for key in ("difference_pct", "low_pct", "high_pct")))


def _row(evidence: Evidence, stages: Sequence[Numbers]) -> Iterator[Entry]:
    yield stages[0]["zone"]
    yield stages[0].value("threshold_m")
    for row in stages:
        yield row.value("one_pct")
        yield row.value("other_pct")
        yield with_interval(row, "difference_pct", "low_pct", "high_pct")
        yield _verdict(evidence, row.stored)
