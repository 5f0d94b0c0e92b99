"""Reconstructions against each other, on the same points of the reference."""

from __future__ import annotations

from collections.abc import Iterator

from trigpoint_reporting.blocks import Block, Passage, Table
from trigpoint_reporting.evidence import Evidence
from trigpoint_reporting.numbers import Numbers

STAGES = {"delivered": "as delivered", "after_icp": "after ICP, pose taken out"}
SHARES = ("one_pct", "other_pct", "difference_pct", "low_pct", "high_pct")


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
    for stage, told in STAGES.items():
        for pair in Numbers(evidence.results).rows("paired", stage):
            one, other = pair["names"]
            yield Passage((f"{told[0].upper()}{told[1:]}: {pair['statement']}",))
            yield Table(
                f"{one} less {other}: completeness, {told}",
                (
                    "Zone",
                    "Within (m)",
                    f"{one} (%)",
                    f"{other} (%)",
                    "Difference (points)",
                    "95 % from",
                    "95 % to",
                    f"{one} is",
                ),
                [
                    (
                        row["zone"],
                        row.value("threshold_m"),
                        *(row.value(key) for key in SHARES),
                        row["verdict"],
                    )
                    for row in pair.rows("differences")
                ],
                (
                    "Paired: both from the same points of the reference. Points: percentage "
                    "points. A difference whose interval holds zero is not told apart from none.",
                ),
            )
