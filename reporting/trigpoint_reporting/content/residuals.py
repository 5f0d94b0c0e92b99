"""Every control pick with its residual, the rejected ones included."""

# ruff: noqa: RUF001 - formulas are printed with their own signs, which look like letters

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np
import pandas as pd

from trigpoint_reporting.blocks import Block, Cell, Passage, Table, Value
from trigpoint_reporting.evidence import Evidence
from trigpoint_reporting.numbers import Numbers, derived, number_text

AXES = ("dx_m", "dy_m", "dz_m")
COLUMNS = ("dE (m)", "dN (m)", "dh (m)", "Horizontal (m)", "3D (m)")
NONE = "\N{EN DASH}"
SIGMAS = ("σ, source", "σ, reference (m)")
# Rows that a table prints; thousands of matched points are told by their worst.
MOST = 400


def picks(evidence: Evidence, name: str) -> list[Block]:
    """Return residuals of the control picks with their summary, and the picks' coordinates."""
    found = Numbers(evidence.results).below("reconstructions", name)
    if found["alignment"] is None:
        return [no_picks(name)]
    residuals = found.below("alignment", "residuals")
    rows, left = worst(residuals)
    used = [row for row in residuals.stored if row["used"]]
    table = Table(
        f"{name}: residuals at the control picks",
        ("Pick", "Use", *COLUMNS),
        [(row["id"], "used" if row["used"] else "REJECTED", *errors(row)) for row in rows]
        + list(_summary(found, used)),
        (
            "Residual = reference − transformed pick. RMSE = √(Σ|e|²/n) over the ",
            found.value("alignment", "n"),
            " picks used; by degrees of freedom, 3n − 7 = ",
            found.value("alignment", "dof"),
            ", it is ",
            found.value("alignment", "rmse_dof_m"),
            f" m. Standard deviation about the mean, with n − 1. {_threshold(found)}{left}",
        ),
    )
    return [table, *_coordinates(evidence, name)]


def no_picks(name: str) -> Passage:
    """Say in place of a table of picks why there is none."""
    return Passage((f"{name} came georeferenced: it has no picks and no similarity.",), "note")


def worst(part: Numbers, key: str = "d_m") -> tuple[list[Numbers], str]:
    """Return the rows that a table can print, the largest by a key, and a note on the rest."""
    count = len(part.stored)
    chosen, left = list(range(count)), ""
    if count > MOST:
        sizes = [math.inf if row[key] is None else abs(row[key]) for row in part.stored]
        chosen = sorted(np.argsort(-np.array(sizes), kind="stable")[:MOST].tolist())
        left = f" Printed are the {MOST} largest of {number_text(count)}; all are in data/."
    return [part.below(position) for position in chosen], left


def errors(row: Numbers) -> tuple[Value, ...]:
    """Print an error along each axis, horizontally and in space."""
    flat = None if row["dx_m"] is None else math.hypot(row["dx_m"], row["dy_m"])
    return (*(row.value(axis) for axis in AXES), derived(flat, 3), row.value("d_m"))


def _summary(found: Numbers, used: Sequence[dict[str, float]]) -> Iterator[tuple[Cell, ...]]:
    """Yield mean, standard deviation, RMSE and largest; a mean of lengths is no error, so none."""
    if not used:
        return
    table = np.array([[row[axis] for axis in AXES] for row in used])
    flat = np.hypot(table[:, 0], table[:, 1])
    rms = np.sqrt((table**2).mean(axis=0))
    yield (
        "Mean",
        "of used",
        *(found.value("alignment", "mean_m", k) for k in range(3)),
        NONE,
        NONE,
    )
    spread = table.std(axis=0, ddof=1) if len(table) > 1 else [None] * 3
    yield "Standard deviation", "of used", *(derived(each, 3) for each in spread), NONE, NONE
    yield (
        "RMSE",
        "of used",
        *(derived(each, 3) for each in rms),
        derived(float(np.sqrt((flat**2).mean())), 3),
        found.value("alignment", "rmse_m"),
    )
    yield (
        "Largest",
        "of used",
        *(derived(each, 3) for each in np.abs(table).max(axis=0)),
        derived(float(flat.max()), 3),
        derived(max(row["d_m"] for row in used), 3),
    )


def _threshold(found: Numbers) -> str:
    alignment = found["alignment"]
    if alignment["method"] == "all" or alignment["threshold_m"] is None:
        return "All control picks are used: no consensus was asked for."
    threshold = number_text(alignment["threshold_m"])
    rejected = len(alignment["outliers"])
    return (
        f"Rejected: beyond {threshold} m in space under the consensus, {rejected} of "
        f"{len(alignment['residuals'])}; they enter no row below the picks."
    )


def _coordinates(evidence: Evidence, name: str) -> list[Block]:
    path = evidence.folder / "data" / f"correspondences-{name}.csv"
    if not path.is_file():
        return []
    table = evidence.table(f"correspondences-{name}")
    kept = table.head(MOST)
    left = "" if len(kept) == len(table) else f" The first {MOST} of {len(table)}."
    return [
        Table(
            f"{name}: coordinates as picked",
            (
                "No.",
                "Pick",
                "Role",
                "x",
                "y",
                "z",
                "Easting (m)",
                "Northing (m)",
                "Height (m)",
                *SIGMAS,
            ),
            [
                (
                    number_text(number),
                    row["id"],
                    row["role"],
                    *(derived(float(row[f"source_{axis}"]), 4) for axis in "xyz"),
                    *(derived(float(row[f"target_{axis}"]), 3) for axis in "xyz"),
                    _sigma(row["sigma_source"], 4),
                    _sigma(row["sigma_target"], 3),
                )
                for number, row in enumerate(kept.to_dict(orient="records"), start=1)
            ],
            (
                "x, y, z: in the reconstruction's own frame and units. σ: of the pick, per axis; "
                f"source: in its own units.{left} To the last digit: "
                f"data/correspondences-{name}.csv.",
            ),
        )
    ]


def _sigma(value: float, digits: int) -> Cell:
    return "not stated" if pd.isna(value) else derived(float(value), digits)
