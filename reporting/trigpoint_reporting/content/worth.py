"""How reliable the similarity is: what its picks can show, and where more would help."""

# ruff: noqa: RUF001 - formulas are printed with their own signs, which look like letters

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from trigpoint_reporting.blocks import Block, Cell, Passage, Table
from trigpoint_reporting.content.residuals import no_picks, worst
from trigpoint_reporting.evidence import Evidence
from trigpoint_reporting.numbers import Numbers, derived

PARAMETERS = (
    "Scale (%)",
    "Turn about x (°)",
    "Turn about y (°)",
    "Turn about z (°)",
    "Easting (m)",
    "Northing (m)",
    "Height (m)",
)
SHORT = ("ln s", "ωx", "ωy", "ωz", "E", "N", "h")
# From a standard deviation of the parameter to the unit that its row is printed in.
UNITS = np.array([100.0, *[180 / np.pi] * 3, 1.0, 1.0, 1.0])
SUSPECTED = {True: "SUSPECTED", False: "no", None: "not tested"}


def reliability(evidence: Evidence, name: str) -> list[Block]:
    """Return the verdict on the picks' layout, covariance, tests of each pick and cross checks."""
    found = Numbers(evidence.results).below("reconstructions", name)
    if found["alignment"] is None:
        return [no_picks(name)]
    worth = found.below("reliability")
    blocks: list[Block] = [
        Passage(
            (f"Geometry of the picks. {worth['statement']}",),
            "plain" if worth["geometry"] == "sound" else "warning",
        )
    ]
    blocks += _repeats(name, worth)
    blocks += _covariance(name, worth)
    blocks.append(_picks(name, found))
    blocks += _zones(name, worth)
    blocks += _next(name, worth)
    blocks += _cross_checks(name, worth)
    return blocks


def _repeats(name: str, worth: Numbers) -> Iterator[Table]:
    rows = worth.rows("repeats")
    if rows:
        yield Table(
            f"{name}: the picking sigma, from the same places picked again",
            ("Frame", "Times", "Places", "σ of one pick, per axis", "95 % from", "to", "p"),
            [
                (
                    {"source": "source (units)", "target": "target (m)"}[row["frame"]],
                    *(row.value(key) for key in ("sessions", "places")),
                    *(row.value(key) for key in ("sigma", "sigma_low", "sigma_high")),
                    row.value("bias_p_value"),
                )
                for row in rows
            ],
            (
                "These sigmas take the place of stated ones. p: how often those who picked would "
                "differ as much, were there chance alone.",
            ),
        )


def _covariance(name: str, worth: Numbers) -> Iterator[Block]:
    stored = worth["covariance"]
    variances = [None] * 7 if stored is None else [stored[k][k] for k in range(7)]
    if any(each is None or each <= 0 for each in variances):
        yield Passage(("The covariance of the similarity is not available.",), "note")
        return
    covariance = np.array(stored, np.float64)
    sigma = np.sqrt(np.diag(covariance))
    correlation = covariance / np.outer(sigma, sigma)
    yield Table(
        f"{name}: standard deviations of the similarity, and their correlations",
        ("Parameter", "σ", *SHORT),
        [
            (
                PARAMETERS[k],
                derived(float(sigma[k] * UNITS[k]), 4),
                *(derived(float(each), 2) for each in correlation[k]),
            )
            for k in range(7)
        ],
        (
            "Turns are small rotations about the axes of the target frame, the position is that "
            "of the picks' centroid. About the axes of its own covariance, the rotation is known "
            "to ",
            worth.value("rotation_sigma_deg", 0),
            "°, ",
            worth.value("rotation_sigma_deg", 1),
            "° and ",
            worth.value("rotation_sigma_deg", 2),
            "° (σ): the first is the weakest. All digits: data/results.json, "
            "reliability.covariance.",
        ),
    )


def _picks(name: str, found: Numbers) -> Table:
    picks = found.below("reliability", "picks")
    rows, left = worst(picks, "standardised")
    count = len(picks.stored)
    if any(row["detectable_blunder_m"] is None for row in rows):
        left += " Not available: no error of that pick, however large, would show."
    return Table(
        f"{name}: what would show if a pick were wrong",
        ("Pick", "Redundancy", "Standardised", "p", "Suspected", "Detectable blunder (m)"),
        [
            (
                row["id"],
                row.value("redundancy"),
                row.value("standardised"),
                row.value("p_value"),
                SUSPECTED[row["suspected"]],
                row.value("detectable_blunder_m"),
            )
            for row in rows
        ],
        (
            "Redundancy: how much of a pick's own error shows in its residual, 0 to 3; all "
            "together ",
            found.value("alignment", "dof"),
            ". Standardised: the residual in its own standard deviations; its square is 3 on "
            "average. Two error levels: a suspect is named where p < 0.05 / n",
            *((" = ", derived(0.05 / count, 4)) if count else ()),
            "; the detectable blunder is what a test at α = 0.001 finds with power 0.80, along "
            f"the direction where it shows least. Smaller blunders stay hidden.{left}",
        ),
    )


def _zones(name: str, worth: Numbers) -> Iterator[Table]:
    rows = [(zone, part.value("sigma_m")) for zone, part in worth.items("zones")]
    if rows:
        yield Table(
            f"{name}: how well the similarity is known in each height zone",
            ("Zone", "σ, 3D (m)"),
            rows,
            (
                "Root mean square over the reference's points in the zone of the standard "
                "deviation that the picks' noise leaves in the position, all axes together.",
            ),
        )


def _next(name: str, worth: Numbers) -> Iterator[Table]:
    rows = worth.rows("next_picks")
    if rows:
        yield Table(
            f"{name}: where one more pick would help most",
            ("Place", "Easting (m)", "Northing (m)", "Height (m)", "Gain (m)"),
            [
                (f"{k + 1}", *(row.value(key) for key in ("x", "y", "z", "gain_m")))
                for k, row in enumerate(rows)
            ],
            (
                "Places on the reference. Gain: by how much the largest standard deviation at the "
                "corners of its extent would fall, for that one pick alone.",
            ),
        )


def _cross_checks(name: str, worth: Numbers) -> Iterator[Block]:
    rows = worth.rows("cross_checks")
    if not rows:
        message = "No cross check was given: no scale bar, vertical or camera positions."
        yield Passage((message,), "note")
        return
    table: list[tuple[Cell, ...]] = [
        (
            row["kind"].replace("_", " "),
            row.value("discrepancy"),
            row.value("sigma"),
            row["unit"],
            row.value("p_value"),
            row["statement"],
        )
        for row in rows
    ]
    yield Table(
        f"{name}: cross checks, which entered no fit",
        ("Kind", "Found", "σ expected", "Unit", "p", "Meaning"),
        table,
        ("p: how often a difference as large would come up, were both sides right.",),
    )
