"""What the report says in sentences that numbers decide: result, verdict, accuracy, plot scale."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

from scipy import stats

from trigpoint.criteria import PRECONDITIONS
from trigpoint_reporting.blocks import Cell, Passage, Value
from trigpoint_reporting.evidence import Evidence
from trigpoint_reporting.numbers import Numbers, derived, number_text

# Metric surveys are drawn with a line of this width, in millimetres: what is smaller is not drawn.
LINE_MM = 0.18
FEWEST_CHECKS = 30
CONFIDENCE = 0.95
# The mark at which a share is told where only one can be.
MARK_M = 0.10

STANDARD = (
    "ASPRS Positional Accuracy Standards for Digital Geospatial Data, Edition 2, Version 2 (2024)"
)
WORDING_SOURCE = f"{STANDARD}, section 7.16, as public report tools quote it"
# The primary text is for the society's members: until someone has compared, this says so.
WORDING_CHECKED_ON = "not yet compared with the primary text"
BLANK = "___"


@dataclass(frozen=True, slots=True)
class Told:
    """How a verdict is told: by a sign, a tone and a sentence, never by colour alone."""

    sign: str
    tone: Literal["pass", "conditional", "fail", "untested"]
    sentence: str


VERDICTS: Mapping[str, Told] = {
    "PASS": Told("✓", "pass", "every limit that the project states is met."),
    "CONDITIONAL": Told(
        "◐", "conditional", "every stated limit is met, but what they rest on is in doubt: "
    ),
    "FAIL": Told("✗", "fail", "not every limit that the project states is met: "),
    "NOT TESTED": Told(
        "○", "untested", "the project states no limits, so nothing is judged; numbers are reported."
    ),
}

QUANTITIES: Mapping[str, str] = {
    "alignment.n": "Control picks used",
    "alignment.rmse_m": "RMSE at the control picks, 3D (m)",
    "alignment.rmse_dof_m": "The same by degrees of freedom (m)",
    "loocv.rmse_m": "Leave-one-out RMSE, 3D (m)",
    "loocv.rmse_procedure_m": "Leave-one-out RMSE, consensus redone (m)",
    "loocv.max_scale_change_pct": "Largest change of scale, one pick left out (%)",
    "checks.n": "Check picks",
    "checks.rmse_m": "RMSE at the check picks, 3D (m)",
    "checks.total_m": "The same with the reference's accuracy (m)",
}
ZONE_QUANTITIES: Mapping[str, str] = {
    "n": "points",
    "mean_m": "mean distance (m)",
    "median_m": "median distance (m)",
    "rmse_m": "RMSE (m)",
    "nmad_m": "NMAD (m)",
    "p95_m": "95th percentile (m)",
    "max_m": "largest distance (m)",
    "floor_rmse_m": "floor (m)",
}


def plot_scale(error_m: float) -> int:
    """Return n of the largest plot scale 1:n at which an error stays within the drawn line.

    Examples
    --------
    >>> plot_scale(0.137), plot_scale(0.205)
    (761, 1139)
    """
    return round(error_m / (LINE_MM / 1000))


def plot_scale_text(error_m: float | None) -> Value:
    """Print that scale, such as 1:761."""
    return Value(number_text(None) if not error_m else f"1:{plot_scale(error_m)}")


def combined(fit: float, survey: float) -> float:
    """Add the error of what was compared with to the error found against it (ASPRS Ed. 2, 7.11).

    Examples
    --------
    >>> round(combined(1.0, 2.0), 2), round(combined(10.0, 2.0), 2)
    (2.24, 10.2)
    """
    return math.hypot(fit, survey)


def rmse_interval(rmse_dof_m: float, dof: int) -> tuple[float, float]:
    """Return the 95 % interval of a 3D error whose square has `dof` degrees of freedom.

    The errors are taken as normal and alike along every axis.

    Examples
    --------
    >>> [round(bound, 3) for bound in rmse_interval(0.1753, 11)]
    [0.124, 0.298]
    """
    tail = (1 - CONFIDENCE) / 2
    low, high = (dof / stats.chi2.isf([tail, 1 - tail], dof)) ** 0.5
    return float(rmse_dof_m * low), float(rmse_dof_m * high)


def verdict(evidence: Evidence) -> Passage:
    """Tell the verdict in words, with the reason where it is not plain."""
    results = evidence.results
    told = VERDICTS[results["verdict"]]
    parts: list[Cell] = [f"{told.sign} ", Value(results["verdict"], "verdict"), ": ", told.sentence]
    if results["verdict"] == "CONDITIONAL":
        codes = dict.fromkeys(each["code"] for each in results["warnings"])
        parts.append(f"{', '.join(code for code in codes if code in PRECONDITIONS)}.")
    elif results["verdict"] == "FAIL":
        unmet = sum(not row["met"] for row in results["criteria"])
        parts.append(f"{unmet} of {len(results['criteria'])} fail.")
    return Passage(parts, told.tone)


def result(evidence: Evidence, name: str) -> Passage:
    """Tell what was found of one reconstruction, in at most 90 words."""
    numbers = Numbers(evidence.results)
    found = numbers.below("reconstructions", name)
    where = _frame(evidence)
    if found["alignment"] is None:
        parts: list[Cell] = [f"{name} came georeferenced in {where}; no similarity was fitted. "]
        return Passage([*parts, *_distances(found), " No pick tests its position."])
    given = len(found["alignment"]["residuals"])
    parts = [
        f"{name} was carried into {where} by one similarity (scale ",
        found.value("alignment", "scale"),
        ") fitted to ",
        found.value("alignment", "n"),
        f" of {given} control picks. It leaves ",
        found.value("alignment", "rmse_m"),
        " m RMSE at them",
        *_allowing(found),
        ". ",
        *_held_out(found),
        *_icp(found),
        *_distances(found),
    ]
    error, basis = held_out_error(found)
    if error is not None:
        parts += [f" Largest plot scale ({LINE_MM:g} mm line): ", plot_scale_text(error)]
        parts += [f" ({basis})."]
    return Passage(parts)


def held_out_error(found: Numbers) -> tuple[float | None, str]:
    """Return the error at picks that the fit did not see (m), and which picks those were."""
    if found["checks"]["rmse_m"] is not None:
        return found["checks"]["rmse_m"], "check picks"
    return found["loocv"]["rmse_m"], "leave-one-out"


def mark_of(within: Sequence[Mapping[str, Any]]) -> int:
    """Return the position of the threshold at which a single share is told."""
    marks = [row["threshold_m"] for row in within]
    return marks.index(MARK_M) if MARK_M in marks else len(marks) // 2


def quantity_label(quantity: str) -> str:
    """Return what a limit's quantity is called in a table, with its unit.

    Examples
    --------
    >>> quantity_label("loocv.rmse_m")
    'Leave-one-out RMSE, 3D (m)'
    >>> quantity_label("comparison.delivered.completeness.upper.within[0.10].pct")
    'Completeness, upper zone: within 0.10 m (%)'
    """
    if quantity in QUANTITIES:
        return QUANTITIES[quantity]
    steps = quantity.split(".", 4)
    if len(steps) < 5 or steps[0] != "comparison":
        return quantity
    _, stage, direction, zone, rest = steps
    place = "all zones" if zone == "all" else f"{zone} zone"
    after = " after ICP" if stage == "after_icp" else ""
    if rest.startswith("within[") and "]" in rest:
        threshold, _, key = rest.removeprefix("within[").partition("]")
        kind = {".pct": "", ".raw_pct": ", unthinned"}.get(key, f", {key.removeprefix('.')}")
        rest = f"within {threshold} m{kind} (%)"
    else:
        rest = ZONE_QUANTITIES.get(rest, rest)
    return f"{direction.capitalize()}{after}, {place}: {rest}"


def asprs_sentence(checks: int, *, class_cm: float | None, tested_cm: float | None) -> str:
    """Return the standard's own sentence for a 3D product, its numbers filled in.

    Parameters
    ----------
    checks : int
        Independent check points that are at least twice as accurate as the product.
    class_cm : float or None
        RMSE of the accuracy class that the project asks for.
    tested_cm : float or None
        RMSE found at them, the check points' own error included.

    Returns
    -------
    str
        With thirty check points, tested to meet; with fewer, tested with ONLY so many; without,
        produced to meet, for which the standard has a horizontal form and none in three dimensions.
    """
    asked = BLANK if class_cm is None else number_text(class_cm, 1)
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
    """Whether the reference is at least twice as accurate as what it judges (ASPRS Ed. 2, 7.12).

    Attributes
    ----------
    reference_m : float or None
        Accuracy of the reference in space, metres; None where the project does not state it.
    judged_m : float or None
        What it is compared with, metres.
    basis : str
        What that is: the class asked for, or an error found.
    holds : bool or None
        None where it can't be told.
    """

    reference_m: float | None
    judged_m: float | None
    basis: str
    holds: bool | None


def twice_rule(evidence: Evidence, name: str) -> TwiceRule:
    """Compare the reference's stated accuracy with the class asked for, or the error found."""
    found = Numbers(evidence.results).below("reconstructions", name)
    axis = evidence.results["project"]["settings"]["reference"]["accuracy_m"]
    reference = None if axis is None else math.sqrt(3) * axis
    asked = class_asked(evidence, name)
    if asked is not None:
        judged, basis = asked, "the accuracy class asked for"
    elif found["alignment"] is None:
        judged, basis = None, ""
    else:
        judged, picks = held_out_error(found)
        basis = f"the error found ({picks})"
    known = reference is not None and judged is not None
    return TwiceRule(reference, judged, basis, 2 * reference <= judged if known else None)  # type: ignore[operator]


def class_asked(evidence: Evidence, name: str) -> float | None:
    """Return the 3D accuracy class that a limit on check picks asks for, in metres."""
    for row in evidence.results["criteria"]:
        if row["of"] == name and row["quantity"] in ("checks.total_m", "checks.rmse_m"):
            word, _, bound = row["limit"].partition(" ")
            if word == "max":
                return float(bound)
    return None


def accuracy_statement(evidence: Evidence, name: str) -> list[Passage]:
    """State the accuracy of one reconstruction in the words that its evidence allows."""
    found = Numbers(evidence.results).below("reconstructions", name)
    reference = evidence.results["project"]["settings"]["reference"]["name"]
    passages = []
    if found["alignment"] is not None:
        rule, count = twice_rule(evidence, name), found["checks"]["n"]
        asked, total = class_asked(evidence, name), found["checks"]["total_m"]
        sentence = asprs_sentence(
            count if rule.holds else 0,
            class_cm=None if asked is None else 100 * asked,
            tested_cm=None if total is None else 100 * total,
        )
        passages = [
            Passage((f"{name}: {sentence}",), "warning"),
            Passage(tuple(_why(count, rule)), "note"),
        ]
    passages.append(
        Passage(
            (
                f"LiDAR-referenced agreement: the distances and errors of {name} are relative to "
                f"{reference}, errors of that reference are not in them unless a table says so, "
                "and leave-one-out is internal validation.",
            ),
            "note",
        )
    )
    return passages


def _why(count: int, rule: TwiceRule) -> Iterator[Cell]:
    """Explain which of the standard's sentences was taken."""
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
        yield "There are check picks, but the reference is good to "
        yield derived(rule.reference_m, 3)
        yield " m in space, which is not twice as accurate as "
        yield derived(rule.judged_m, 3)
        yield f" m, {rule.basis}: they can't stand for check points. "
    else:
        yield (
            "The check picks entered nothing; they were read from the reference, whose stated "
            "accuracy is part of the number. "
        )
    yield (
        f"{BLANK}: not stated by the project, or not tested. Wording: {WORDING_SOURCE}; "
        f"checked: {WORDING_CHECKED_ON}."
    )


def _allowing(found: Numbers) -> Iterator[Cell]:
    alignment = found["alignment"]
    if alignment["rmse_dof_m"] is None or alignment["dof"] < 1:
        return
    yield ", or "
    yield found.value("alignment", "rmse_dof_m")
    yield " m allowing for its seven parameters (95 % range "
    low, high = rmse_interval(alignment["rmse_dof_m"], alignment["dof"])
    yield derived(low, 3)
    yield " to "
    yield derived(high, 3)
    yield " m)"


def _held_out(found: Numbers) -> Iterator[Cell]:
    if found["loocv"]["rmse_m"] is not None:
        yield "Predicting each pick from the others gives "
        yield found.value("loocv", "rmse_m")
        yield " m. "
    else:
        yield "No pick could be left out. "
    if found["checks"]["n"]:
        yield "At "
        yield found.value("checks", "n")
        yield " check picks it is "
        yield found.value("checks", "rmse_m")
        yield " m. "


def _icp(found: Numbers) -> Iterator[Cell]:
    if found["icp"] is None:
        return
    retained = found["icp"]["retained"]
    yield "ICP lowers the held-out error and is retained. " if retained else "ICP is not retained. "


def _distances(found: Numbers) -> Iterator[Cell]:
    """Tell the two shares at the mark."""
    row = found.below("comparison", "delivered")
    position = mark_of(row["accuracy"]["all"]["within"])
    yield "Within "
    yield row.value("accuracy", "all", "within", position, "threshold_m")
    yield " m of the reference lies "
    yield row.value("accuracy", "all", "within", position, "pct")
    yield " % of it; within as much of it, "
    yield row.value("completeness", "all", "within", position, "pct")
    yield " % of the reference."


def _frame(evidence: Evidence) -> str:
    crs = evidence.results["crs"]
    stated = crs["code"] or crs["name"]
    return "a frame without a stated CRS" if stated == "none" else stated
