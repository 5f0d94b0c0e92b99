"""What the accuracy standard allows to be said, given what was tested and against what."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

from trigpoint_reporting.blocks import Cell, Passage, Value
from trigpoint_reporting.evidence import Evidence
from trigpoint_reporting.numbers import Numbers, derived, number_text
from trigpoint_reporting.wording import held_out_error

FEWEST_CHECKS = 30
STANDARD = (
    "ASPRS Positional Accuracy Standards for Digital Geospatial Data, Edition 2, Version 2 (2024)"
)
WORDING_SOURCE = f"{STANDARD}, section 7.16"
# What was consulted, and when.
WORDING_CHECKED_ON = (
    "2026-11-22, in a public report tool that quotes it; that tool carries the form for fewer than "
    "thirty points over from horizontal products. The standard itself, open to the society's "
    "members, was not consulted"
)
BLANK = "___"
HORIZONTAL = (
    "For what is not tested the standard has a horizontal form only; the class asked for is one in "
    "space. "
)
NO_CLASS = (
    "no limit on the RMSE at the check picks asks for an accuracy class, so no sentence of the "
    "standard is quoted. "
)


def combined(fit: float, survey: float) -> float:
    """Add the error of what was compared with to the error found against it (ASPRS Ed. 2, 7.11).

    Examples
    --------
    >>> round(combined(1.0, 2.0), 2), round(combined(10.0, 2.0), 2)
    (2.24, 10.2)
    """
    return math.hypot(fit, survey)


def asprs_sentence(checks: int, *, class_cm: float, tested_cm: float | None) -> str:
    """Return the standard's own sentence for a 3D product, its numbers filled in.

    Parameters
    ----------
    checks : int
        Independent check points that are at least twice as accurate as the product.
    class_cm : float
        RMSE of the accuracy class that the project asks for.
    tested_cm : float or None
        RMSE found at them, the check points' own error included.

    Returns
    -------
    str
        With thirty check points, tested to meet; with fewer, tested with ONLY so many; without,
        produced to meet, for which the standard has a horizontal form and none in three dimensions.
    """
    asked = number_text(class_cm, 1)
    found = BLANK if tested_cm is None else number_text(tested_cm, 1)
    three = (
        f"{asked}(cm) RMSE_3D Three-Dimensional Positional Accuracy Class. The tested "
        f"three-dimensional accuracy was found to be RMSE_3D = {found}(cm) within the NVA tested "
        f"area and RMSE_3D = {BLANK}(cm) within the VVA tested area"
    )
    if checks >= FEWEST_CHECKS:
        return f"This data set was tested to meet {STANDARD} for a {three}."
    if checks > 0:
        return (
            f"This data set was tested as required by {STANDARD}. Although the Standards call for "
            f"a minimum of thirty ({FEWEST_CHECKS}) checkpoints, this test was performed using "
            f"ONLY {checks} checkpoints. This data set was produced to meet a {three} using the "
            "reduced number of checkpoints."
        )
    return (
        f"This data set was produced to meet {STANDARD} for a {asked}(cm) RMSE_H Horizontal "
        "Positional Accuracy Class."
    )


@dataclass(frozen=True, slots=True)
class TwiceRule:
    """Whether the check picks are at least twice as accurate as what they judge (Ed. 2, 7.12).

    Attributes
    ----------
    accuracy_m : float or None
        Accuracy of the reference along an axis, metres; None where the project does not state it.
    picking_m : float or None
        Sigma along an axis with which the check picks were read from it, as the picks state it.
    reference_m : float or None
        Both together in space, metres; None where the reference's is not stated.
    judged_m : float or None
        What it is compared with, metres.
    basis : str
        What that is.
    asked : bool
        Whether it is the class that a limit asks for, and not an error found.
    holds : bool or None
        None where it can't be told.
    """

    accuracy_m: float | None
    picking_m: float | None
    reference_m: float | None
    judged_m: float | None
    basis: str
    asked: bool
    holds: bool | None


def twice_rule(evidence: Evidence, name: str) -> TwiceRule:
    """Compare what the check picks are good to with the class asked for, or the error found."""
    found = Numbers(evidence.results).below("reconstructions", name)
    axis = evidence.results["project"]["settings"]["reference"]["accuracy_m"]
    picking = evidence.picking_sigma(name, "target", "check")
    # A point read from the reference has the error of both: of where it lies and of the reading.
    reference = None if axis is None else math.sqrt(3) * math.hypot(axis, picking or 0.0)
    asked = class_asked(evidence, name)
    if asked is not None:
        judged, basis = asked, "the accuracy class asked for"
    elif found["alignment"] is None:
        judged, basis = None, ""
    else:
        judged, picks = held_out_error(found)
        basis = f"the error found ({picks})"
    holds = None if reference is None or judged is None else 2 * reference <= judged
    return TwiceRule(axis, picking, reference, judged, basis, asked is not None, holds)


def class_asked(evidence: Evidence, name: str) -> float | None:
    """Return the 3D accuracy class that a limit on check picks asks for, in metres."""
    for row in evidence.results["criteria"]:
        if row["of"] == name and row["quantity"] in ("checks.total_m", "checks.rmse_m"):
            word, _, bound = row["limit"].partition(" ")
            if word == "max":
                return float(bound)
    return None


def accuracy_statement(evidence: Evidence, name: str) -> list[Passage]:
    """State one reconstruction's accuracy in the standard's words, as far as its picks allow.

    The words name a class: where the project asks for none, nobody has claimed one, and the
    standard is not quoted.
    """
    found = Numbers(evidence.results).below("reconstructions", name)
    if found["alignment"] is None:
        return []
    rule, count = twice_rule(evidence, name), found["checks"]["n"]
    asked = class_asked(evidence, name)
    if asked is None:
        return [Passage((f"{name}: {NO_CLASS}", *_why(count, rule)), "note")]
    tested = count if rule.holds else 0
    total = combined(found["checks"]["rmse_m"], rule.reference_m or 0.0) if tested else None
    sentence = asprs_sentence(
        tested, class_cm=100 * asked, tested_cm=None if total is None else 100 * total
    )
    blank = f"{BLANK}: not tested. " if BLANK in sentence else ""
    form = "" if tested else HORIZONTAL
    return [
        Passage((f"{name}: “{sentence}”",)),
        Passage(
            (*_why(count, rule), f"{form}{blank}Source of the wording: section 2."),
            "note",
        ),
    ]


def agreement(evidence: Evidence) -> Passage:
    """Say what all distances and errors are relative to."""
    reference = evidence.results["project"]["settings"]["reference"]["name"]
    return Passage(
        (
            f"LiDAR-referenced agreement: every distance and error here is relative to {reference}."
            " Its own errors are in none of them unless a table says so, and leave-one-out is "
            "internal validation.",
        ),
        "note",
    )


def _why(count: int, rule: TwiceRule) -> Iterator[Cell]:
    """Explain what the picks can stand for, and what went into that."""
    if count == 0:
        yield (
            "There are no check picks: the picks that were fitted are not independent, nor is "
            "leave-one-out, so the standard allows no word of testing. "
        )
    elif rule.holds is None:
        yield (
            "There are check picks, but the project does not state the reference's accuracy: they "
            "can't stand for check points, which have to be twice as accurate as what they test. "
        )
    elif not rule.holds:
        yield "There are check picks, but a point read from the reference is good to "
        yield derived(rule.reference_m, 3)
        yield " m in space ("
        yield from _went_in(rule)
        yield "), which is not twice as accurate as "
        yield derived(rule.judged_m, 3)
        yield f" m, {rule.basis}: they can't stand for check points. "
    else:
        yield "The check picks entered nothing; what they are good to themselves, "
        yield derived(rule.reference_m, 3)
        yield " m in space ("
        yield from _went_in(rule)
        yield "), is part of any accuracy stated from them. "


def _went_in(rule: TwiceRule) -> Iterator[Cell]:
    """Say what a point read from the reference has its error from."""
    yield "per axis "
    yield Value(number_text(rule.accuracy_m))
    yield " m of the reference"
    if rule.picking_m is None:
        yield "; the picks state no sigma of their own"
    else:
        yield " and "
        yield derived(rule.picking_m, 3)
        yield " m of picking"


def wording_source() -> Passage:
    """Say where the sentences come from, and what they were checked against."""
    return Passage(
        (f"Accuracy sentence: {WORDING_SOURCE}; wording consulted on {WORDING_CHECKED_ON}.",),
        "note",
    )
