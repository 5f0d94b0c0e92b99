"""Limitations in a person's words, then every doubt that the work raised."""

from __future__ import annotations

import re

from trigpoint_reporting.blocks import Block, Passage, Table
from trigpoint_reporting.evidence import Evidence
from trigpoint_reporting.numbers import MINUS

# Of a number with its unit: the hyphen of a name is the name's.
MINUS_SIGN = re.compile(r"(?<=[ (])-(?=[\d.]+ (ppm|mm|m)\b)")


def limitations(evidence: Evidence) -> list[Block]:
    """Return what a person stated, or that nobody did, and the warnings by code."""
    stated = evidence.results["project"]["limitations"]
    paragraphs = [line for line in stated.splitlines() if line.strip()]
    blocks: list[Block] = [Passage((line,)) for line in paragraphs] or [
        Passage(("No limitations statement was supplied.",), "warning")
    ]
    # What is said twice under one code, such as of two statistics, is one doubt.
    warnings: dict[str, list[str]] = {}
    for each in evidence.results["warnings"]:
        warnings.setdefault(each["code"], []).append(each["message"])
    if not warnings:
        return [*blocks, Passage(("No warnings were raised.",))]
    return [
        *blocks,
        Table(
            "Warnings",
            ("Code", "What was found"),
            [(code, MINUS_SIGN.sub(MINUS, " ".join(said))) for code, said in warnings.items()],
            ("Codes are a fixed vocabulary. A warning stops nothing: it says what is in doubt.",),
        ),
    ]
