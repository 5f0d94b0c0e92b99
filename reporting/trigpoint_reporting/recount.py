"""Printed numbers, counted again from the tables and distances that lie beside results.json."""

from collections.abc import Iterator
from typing import Any

import numpy as np

from trigpoint_reporting.blocks import Table
from trigpoint_reporting.evidence import Evidence

# What is stored is rounded to 1e-9 m and 1e-12, so that sums of it differ by little more.
TOLERANCE = 1e-8
STAGES = {"delivered": "as delivered", "after_icp": "after ICP"}


def recount(evidence: Evidence) -> Table:
    """Recompute every number that the tables determine; refuse to go on where one differs."""
    found: dict[str, dict[str, str]] = {}
    for name in evidence.names:
        for what, pairs in _recounted(evidence, name):
            agree = [_same(stored, again) for stored, again in pairs]
            if not all(agree):
                stored, again = pairs[agree.index(False)]
                raise AssertionError(f"{name}, {what}: {stored} is stored, {again} recomputed")  # noqa: EM102
            found.setdefault(what, {})[name] = f"{sum(agree)} of {len(pairs)}"
    return Table(
        "Numbers recomputed from the stored tables and distances",
        ("Quantity", *(f"{name}: agree" for name in evidence.names)),
        [
            (what, *(told.get(name, "\N{EN DASH}") for name in evidence.names))
            for what, told in found.items()
        ],
        ("Agreement is to 10⁻⁸ in metres or per cent; what is stored is rounded to 10⁻⁹ m.",),
    )


def _recounted(
    evidence: Evidence, name: str
) -> Iterator[tuple[str, list[tuple[float | None, float]]]]:
    found: dict[str, Any] = evidence.results["reconstructions"][name]
    if found["alignment"] is not None:
        picks, folds = evidence.table(f"picks-{name}"), evidence.table(f"loocv-{name}")
        used = picks[picks["used"]]
        squares, n = float((used[["dx_m", "dy_m", "dz_m"]] ** 2).to_numpy().sum()), len(used)
        yield (
            "RMSE at the picks; the same by degrees of freedom",
            [
                (found["alignment"]["rmse_m"], np.sqrt(squares / n)),
                (found["alignment"]["rmse_dof_m"], np.sqrt(squares / (n - 7 / 3))),
            ],
        )
        predicted = folds["d_m"].to_numpy(np.float64)
        changes = folds["scale_change_pct"].abs().to_numpy(np.float64)
        yield (
            "Leave-one-out RMSE; largest change of scale",
            [
                (found["loocv"]["rmse_m"], np.sqrt((predicted**2).mean())),
                (found["loocv"]["max_scale_change_pct"], changes.max(initial=0.0)),
            ],
        )
        if found["checks"]["n"]:
            errors = evidence.table(f"checks-{name}")["d_m"].to_numpy(np.float64)
            yield "RMSE at the check picks", [(found["checks"]["rmse_m"], _rms(errors))]
    stored = evidence.distances(name)
    for stage, comparison in found["comparison"].items():
        if comparison is not None:
            for direction in ("accuracy", "completeness"):
                distances = stored[f"{stage}_{direction}_m"]
                heights = stored[f"{stage}_{direction}_height_m"]
                # A height on an edge belongs to the zone above it.
                own = np.searchsorted(stored["zone_edges_m"][1:-1], heights, side="right")
                pairs = []
                for position, (zone, row) in enumerate(comparison[direction].items(), -1):
                    pairs += _zone(row, distances if zone == "all" else distances[own == position])
                yield f"{direction.capitalize()} by zone, {STAGES[stage]}", pairs


def _zone(row: dict[str, Any], distances: Any) -> list[tuple[float | None, float]]:
    shares = [
        (
            share["pct"],
            100 * float((distances <= share["threshold_m"]).sum()) / max(1, len(distances)),
        )
        for share in row["within"]
    ]
    return [(row["n"], len(distances)), (row["rmse_m"], _rms(distances)), *shares]


def _rms(distances: Any) -> float:
    return float(np.sqrt(np.mean(distances**2))) if len(distances) else np.nan


def _same(stored: float | None, again: float) -> bool:
    if stored is None:  # null is how results.json says that there is none
        return not np.isfinite(again)
    return abs(stored - again) <= TOLERANCE
