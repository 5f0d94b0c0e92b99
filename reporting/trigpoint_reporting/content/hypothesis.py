"""ICP as a hypothesis that held-out picks may reject."""

from __future__ import annotations

from collections.abc import Iterator

from trigpoint_reporting import wording
from trigpoint_reporting.blocks import Block, Cell, Passage, Table
from trigpoint_reporting.evidence import Evidence
from trigpoint_reporting.numbers import Numbers, derived, number_text

CANNOT_FALL = (
    "The error at the control picks cannot fall: the fit has made it as small as any similarity "
    "can, so that ICP can only raise it, and it decides nothing. The error between the surfaces "
    "is what ICP minimises, and decides nothing either."
)
ERRORS = (
    ("Between the surfaces, RMSE (m)", "surface_rmse", "nothing: ICP minimises it"),
    ("At the control picks, RMSE (m)", "control_rmse", "nothing: the fit minimises it"),
    ("Leave-one-out RMSE (m)", "loocv_rmse", "where there are no check picks"),
    ("At the check picks, RMSE (m)", "check_rmse", "where there are check picks"),
)


# What every other section is about, whichever way the trial of ICP ends.
DELIVERED = (
    "Delivered, and described by every number that does not say otherwise, is {what}, without "
    "ICP. Clouds after ICP serve only to compare reconstructions with their difference of pose "
    "taken out."
)


def icp(evidence: Evidence, name: str) -> list[Block]:
    """Return what is delivered and the rule, then the numbers, then what follows."""
    found = Numbers(evidence.results).below("reconstructions", name)
    if found["icp"] is None:
        return [Passage(("The project asked for no ICP.",), "note")]
    trial, picked = found.below("icp"), found["alignment"] is not None
    what = "the cloud as the similarity carries it" if picked else "the cloud as it came"
    return [
        Passage((DELIVERED.format(what=what),)),
        Passage((f"Rule, set before the numbers: {trial['rule']}",)),
        *([Passage((CANNOT_FALL,))] if picked else []),
        Table(
            f"{name}: errors without and with ICP",
            ("Error", "Without", "With", "Change", "Decides"),
            [
                (
                    _label(found, key, label),
                    trial.value(f"{key}_before_m"),
                    trial.value(f"{key}_after_m"),
                    derived(_change(trial, key), 3),
                    decides,
                )
                for label, key, decides in (ERRORS if picked else ERRORS[:1])
            ],
            (
                "Rigid and centred; rotation ",
                trial.value("rotation_deg"),
                "°, shift of the reference's centroid ",
                trial.value("shift_m"),
                " m (E ",
                trial.value("translation_m", 0),
                ", N ",
                trial.value("translation_m", 1),
                ", h ",
                trial.value("translation_m", 2),
                "); ",
                trial.value("iterations"),
                " iterations; overlap ",
                trial.value("overlap_pct"),
                " %.",
            ),
        ),
        Passage(tuple(_decision(found)), "plain" if trial["retained"] else "note"),
    ]


def _change(trial: Numbers, key: str) -> float | None:
    before, after = trial[f"{key}_before_m"], trial[f"{key}_after_m"]
    return None if before is None or after is None else after - before


def _label(found: Numbers, key: str, label: str) -> str:
    """Say over which picks leave-one-out was done, where a trial of each would take too long."""
    folds = wording.folds_of_icp(found)
    if key != "loocv_rmse" or folds == found["alignment"]["n"]:
        return label
    given = number_text(found["alignment"]["n"])
    return f"Leave-one-out over {folds} of the {given} picks, spread evenly: RMSE (m)"


def _decision(found: Numbers) -> Iterator[Cell]:
    trial = found.below("icp")
    if trial["retained"]:
        yield (
            "The rule is met: with ICP the held-out error is smaller. The pose after ICP stays a "
            "hypothesis all the same, and is not delivered."
        )
    else:
        parts = ("loocv", "check")
        judged = any(trial[f"{part}_rmse_before_m"] is not None for part in parts)
        why = "the held-out error did not fall" if judged else "nothing was held out to judge it by"
        yield f"Not retained: {why}."
    asked = wording.held_out_of_icp(found)
    if asked is not None and not asked.shows:
        count = f"{asked.n} {wording.picks(asked.n)}"
        yield f" What that can show: an RMSE of {count} is itself known to about "
        yield derived(asked.known_to_m, 3)
        yield (
            " m, 1/√(6n) of it. The change is smaller: these picks do not tell which of the two "
            "poses is the better one."
        )
