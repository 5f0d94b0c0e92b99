"""Reconstructions against each other, on the same points of the reference."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from trigpoint.pairing import MIXED
from trigpoint_reporting.blocks import Block, Entry, Passage, Table
from trigpoint_reporting.content.distances import is_outside, with_interval
from trigpoint_reporting.evidence import Evidence
from trigpoint_reporting.numbers import Numbers

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
            yield Passage((f"{told[0].upper()}{told[1:]}: {pair['statement']}",))
        yield _differences(names, found)


def _differences(names: tuple[str, ...], found: Mapping[str, Numbers]) -> Table:
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
        [tuple(_row(stages)) for stages in rows],
        (
            "Paired: both from the same points of the reference. Difference: in percentage points, "
            "in brackets the 95 % interval; one that holds zero is not told apart from none."
            f"{MOVED if any(map(_beside_its_interval, told)) else ''}"
            " Not resolvable: a threshold not above the voxel."
            f"{DISAGREE if any(row['verdict'] == MIXED for row in told) else ''}",
        ),
    )


def _beside_its_interval(row: Numbers) -> bool:
    return is_outside(*(row[key] for key in ("difference_pct", "low_pct", "high_pct")))


def _row(stages: Sequence[Numbers]) -> Iterator[Entry]:
    yield stages[0]["zone"]
    yield stages[0].value("threshold_m")
    for row in stages:
        yield row.value("one_pct")
        yield row.value("other_pct")
        yield with_interval(row, "difference_pct", "low_pct", "high_pct")
        yield row["verdict"]
