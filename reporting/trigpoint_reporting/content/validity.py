"""Whether the similarity predicts picks that it was not fitted to."""

# ruff: noqa: RUF001 - formulas are printed with their own signs, which look like letters

from __future__ import annotations

from collections.abc import Iterator

from trigpoint_reporting import wording
from trigpoint_reporting.blocks import Block, Cell, Passage, Table
from trigpoint_reporting.content.residuals import COLUMNS, NONE, errors, no_picks, worst
from trigpoint_reporting.evidence import Evidence
from trigpoint_reporting.numbers import Numbers, derived

# A 95 % interval whose ends lie further apart than this, as a ratio, knows its error poorly.
POORLY = 1.5
CHANGED = {True: "yes", False: "no", None: "not redone"}


def validation(evidence: Evidence, name: str) -> list[Block]:
    """Return leave-one-out, check picks, and how well so few picks know an error at all."""
    found = Numbers(evidence.results).below("reconstructions", name)
    if found["alignment"] is None:
        return [no_picks(name)]
    return [
        *_leave_one_out(found, name),
        *_checks(evidence, found, name),
        Passage(tuple(_interval(found))),
    ]


def _leave_one_out(found: Numbers, name: str) -> Iterator[Block]:
    loocv = found.below("loocv")
    rows, left = worst(loocv.below("folds"))
    changes = any(row["inliers_changed"] for row in loocv["folds"])
    how = (
        "By the closed form (residual over redundancy), one fit for all."
        if loocv["closed_form"]
        else "Each pick used is withheld in turn, the similarity refitted to the others, and the "
        "withheld pick predicted."
    )
    yield Passage(tuple(_ratio(found)))
    if loocv["rmse_m"] is None and all(row["d_m"] is None for row in loocv["folds"]):
        return
    redone: tuple[Cell, ...] = ()
    if loocv["rmse_procedure_m"] is not None:
        redone = (
            " With the consensus redone in each fold, so that a withheld pick has no say in "
            "choosing the inliers: ",
            loocv.value("rmse_procedure_m"),
            f" m{', with other inliers in some folds' if changes else ''}.",
        )
    yield Table(
        f"{name}: leave-one-out",
        ("Withheld", *COLUMNS, "Scale change (%)", "Rotation (°)", "Shift (m)", "Inliers change"),
        [
            (
                row["id"],
                *errors(row),
                row.value("scale_change_pct"),
                row.value("rotation_change_deg"),
                row.value("shift_m"),
                CHANGED[row["inliers_changed"]],
            )
            for row in rows
        ]
        + [("RMSE", *[NONE] * 4, loocv.value("rmse_m"), *[NONE] * 4)],
        (
            f"{how} Error = reference − prediction; RMSE = √(Σ|e|²/n). Largest change of scale, "
            "100 max|sᵢ − s|/s: ",
            loocv.value("max_scale_change_pct"),
            " %. Shift: how far the reference's centroid moves.",
            *redone,
            left,
        ),
    )


def _ratio(found: Numbers) -> Iterator[Cell]:
    error, fit = found["loocv"]["rmse_m"], found["alignment"]["rmse_m"]
    if error is None:
        yield (
            "Leave-one-out needs at least four picks that still hold a similarity when one is "
            "withheld: not available here, so nothing shows how far the fit can be trusted."
        )
        return
    yield "Predicted from the others, a pick is missed by "
    yield found.value("loocv", "rmse_m")
    yield " m (RMSE); in the fit, by "
    yield found.value("alignment", "rmse_m")
    if fit:
        yield " m: "
        yield derived(error / fit, 2)
        yield " times as much."
    else:
        yield " m."


def _checks(evidence: Evidence, found: Numbers, name: str) -> Iterator[Block]:
    checks = found.below("checks")
    if not checks["n"]:
        yield Passage(("There are no check picks.",), "note")
        return
    rows, left = worst(checks.below("residuals"))
    reference = Numbers(evidence.results).below("project", "settings", "reference")
    stated: tuple[Cell, ...] = ("The reference's accuracy is not stated, so it is in no number.",)
    if reference["accuracy_m"] is not None:
        stated = (
            "With the reference's stated accuracy, ",
            reference.value("accuracy_m"),
            " m per axis, added in quadrature: ",
            checks.value("total_m"),
            " m (ASPRS Ed. 2, 7.11).",
        )
    yield Table(
        f"{name}: check picks",
        ("Pick", *COLUMNS),
        [(row["id"], *errors(row)) for row in rows]
        + [
            ("Mean", *(checks.value("mean_m", k) for k in range(3)), NONE, NONE),
            ("RMSE", *[NONE] * 4, checks.value("rmse_m")),
        ],
        (
            "Error = reference − transformed pick, at the ",
            checks.value("n"),
            " picks that entered nothing; RMSE = √(Σ|e|²/n), nothing was fitted to them. ",
            *stated,
            left,
        ),
    )


def _interval(found: Numbers) -> Iterator[Cell]:
    alignment, worth = found["alignment"], found.below("reliability")
    if alignment["rmse_dof_m"] is None or alignment["dof"] < 1:
        yield "Too few picks to say how well the error itself is known."
        return
    low, high = wording.rmse_interval(alignment["rmse_dof_m"], alignment["dof"])
    poorly = high > POORLY * low
    yield "So few picks know their error poorly: allowing for " if poorly else "Allowing for "
    yield found.value("alignment", "dof")
    yield f" degrees of freedom {'it' if poorly else 'the error at the control picks'} is "
    yield found.value("alignment", "rmse_dof_m")
    yield " m in space, with a 95 % interval from "
    yield derived(low, 3)
    yield " to "
    yield derived(high, 3)
    yield " m (χ², errors normal and alike along every axis). Per axis: "
    yield worth.value("sigma0_m")
    yield " m, from "
    yield worth.value("sigma0_low_m")
    yield " to "
    yield worth.value("sigma0_high_m")
    yield " m."
