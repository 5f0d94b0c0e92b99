"""How to read the pictures."""

from __future__ import annotations

from trigpoint_reporting.blocks import Block, Passage
from trigpoint_reporting.evidence import Evidence


def elevations(evidence: Evidence) -> list[Block]:
    """Return what all pictures have in common."""
    reference = evidence.results["project"]["settings"]["reference"]["name"]
    return [
        Passage(
            (
                "Elevations are orthographic and to scale: lengths may be measured on them at the "
                "stated scale. Colours of distance have the same limits in every picture, and "
                "what lies beyond them has a colour of its own and is counted in the legend. "
                f"Distances are to {reference}.",
            )
        )
    ]


def views(_: Evidence) -> list[Block]:
    """Return what pictures in perspective are for."""
    return [Passage(("For orientation: nothing can be measured in perspective.",))]
