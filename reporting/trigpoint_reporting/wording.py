"""What the report says in sentences that numbers decide: result, verdict, plot scale."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

from trigpoint.criteria import PRECONDITIONS
from trigpoint.distributions import chi2_isf
from trigpoint.trial import MOST_FOLDS
from trigpoint_reporting.blocks import Cell, Passage, Value
from trigpoint_reporting.evidence import Evidence
from trigpoint_reporting.numbers import Numbers, derived, number_text

# Metric surveys are drawn with a line of this width, in millimetres: what is smaller is not drawn.
LINE_MM = 0.18
CONFIDENCE = 0.95
# The mark at which a share is told where only one can be.
MARK_M = 0.10


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
    "alignment.rmse_dof_m": "RMSE at the control picks by degrees of freedom (m)",
    "loocv.rmse_m": "Leave-one-out RMSE, 3D (m)",
    "loocv.rmse_procedure_m": "Leave-one-out RMSE, consensus redone (m)",
    "loocv.max_scale_change_pct": "Largest change of scale, one pick left out (%)",
    "checks.n": "Check picks",
    "checks.rmse_m": "RMSE at the check picks, 3D (m)",
    "checks.total_m": "RMSE at the check picks with the reference's accuracy (m)",
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


def rmse_interval(rmse_dof_m: float, dof: int) -> tuple[float, float]:
    """Return the 95 % interval of a 3D error whose square has `dof` degrees of freedom.

    The errors are taken as normal and alike along every axis.

    Examples
    --------
    >>> [round(bound, 3) for bound in rmse_interval(0.1753, 11)]
    [0.124, 0.298]
    """
    tail = (1 - CONFIDENCE) / 2
    low, high = (dof / chi2_isf([tail, 1 - tail], dof)) ** 0.5
    return float(rmse_dof_m * low), float(rmse_dof_m * high)


def verdict(evidence: Evidence) -> Passage:
    """Tell the verdict in words, with the reason where it is not plain."""
    results = evidence.results
    told = VERDICTS[results["verdict"]]
    parts: list[Cell] = [f"{told.sign} ", Value(results["verdict"], "verdict"), ": ", told.sentence]
    if results["verdict"] == "CONDITIONAL":
        codes = dict.fromkeys(each["code"] for each in results["warnings"])
        doubts = [code.replace("_", " ") for code in codes if code in PRECONDITIONS]
        parts.append(f"{', '.join(doubts)}.")
    elif results["verdict"] == "FAIL":
        unmet = sum(not row["met"] for row in results["criteria"])
        parts.append(f"{unmet} of {len(results['criteria'])} {'fails' if unmet == 1 else 'fail'}.")
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


@dataclass(frozen=True, slots=True)
class HeldOut:
    """What decided about ICP: the RMSE at picks held out, without it and with it.

    Attributes
    ----------
    n : int
        Picks.
    before_m, after_m : float
    """

    n: int
    before_m: float
    after_m: float

    @property
    def known_to_m(self) -> float:
        """How well so many picks know it: an RMSE of 3 n errors, to 1/sqrt(6 n) of itself."""
        return self.before_m / math.sqrt(6 * self.n)

    @property
    def shows(self) -> bool:
        """Whether the change is larger than that."""
        return abs(self.after_m - self.before_m) > self.known_to_m


def held_out_of_icp(found: Numbers | Mapping[str, Any]) -> HeldOut | None:
    """Return what decided about ICP: the check picks, or leave-one-out where there are none."""
    icp = found["icp"]
    for part, count in (("check", _checks(found)), ("loocv", folds_of_icp(found))):
        before, after = icp[f"{part}_rmse_before_m"], icp[f"{part}_rmse_after_m"]
        if before is not None:
            return None if after is None else HeldOut(count, before, after)
    return None


def verdict_of_icp(found: Numbers | Mapping[str, Any]) -> str:
    """Say what came of ICP in a sentence, the same on the first page and at a terminal."""
    icp = found["icp"]
    if icp["check_rmse_before_m"] is None and icp["loocv_rmse_before_m"] is None:
        return "ICP is not judged."
    # Retained is the hypothesis: what is delivered, and what is told here, is the fit.
    if not icp["retained"]:
        return "ICP is not retained."
    asked = held_out_of_icp(found)
    if asked is None or asked.shows:
        return "ICP, not delivered, lowers the held-out error."
    return f"{number_text(asked.n)} {picks(asked.n)} can't tell whether ICP helps."


def folds_of_icp(found: Numbers | Mapping[str, Any]) -> int:
    """Return how many of the picks used the trial of ICP leaves out in turn."""
    return 0 if found["alignment"] is None else min(found["alignment"]["n"], MOST_FOLDS)


def _checks(found: Numbers | Mapping[str, Any]) -> int:
    return 0 if found["checks"] is None else int(found["checks"]["n"])


def mark_of(within: Sequence[Mapping[str, Any]]) -> int:
    """Return the position of the threshold at which a single share is told."""
    marks = [row["threshold_m"] for row in within]
    return marks.index(MARK_M) if MARK_M in marks else len(marks) // 2


def picks(count: int) -> str:
    """Return the word beside a number of them."""
    return "pick" if count == 1 else "picks"


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
        yield f" check {picks(found['checks']['n'])} it is "
        yield found.value("checks", "rmse_m")
        yield " m. "


def _icp(found: Numbers) -> Iterator[Cell]:
    if found["icp"] is not None:
        yield f"{verdict_of_icp(found)} "


def _distances(found: Numbers) -> Iterator[Cell]:
    """Tell the two shares at the mark."""
    row = found.below("comparison", "delivered")
    position = mark_of(row["accuracy"]["all"]["within"])
    yield "Within "
    yield row.value("accuracy", "all", "within", position, "threshold_m")
    yield " m of each other lie "
    yield row.value("accuracy", "all", "within", position, "pct")
    yield " % of the cloud and "
    yield row.value("completeness", "all", "within", position, "pct")
    yield " % of the reference."


def _frame(evidence: Evidence) -> str:
    crs = evidence.results["crs"]
    stated = crs["code"] or crs["name"]
    return "a frame without a stated CRS" if stated == "none" else stated
