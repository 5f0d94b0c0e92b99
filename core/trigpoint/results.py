"""The shape of results.json: each room's result under the keys that users and archives rely on."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Mapping
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from trigpoint.alignment import Alignment
from trigpoint.cautions import Caution
from trigpoint.checks import measure_checks
from trigpoint.comparison import Comparison
from trigpoint.errors import SimilarityError
from trigpoint.flawless import Flawless
from trigpoint.intervals import Intervals
from trigpoint.propagation import sigma_at
from trigpoint.repeats import Frame, Repeats
from trigpoint.similarity import Points, Similarity
from trigpoint.trial import Trial

AXES = ["dx_m", "dy_m", "dz_m"]
BOUNDS = ("low_pct", "high_pct")
UNKNOWN_SHARES = dict.fromkeys(
    [
        "threshold_m",
        "pct",
        *(f"{part}{bound}" for part in ("", "pose_", "sampling_") for bound in BOUNDS),
    ]
)
UNKNOWN_RMSE = dict.fromkeys(["rmse_low_m", "rmse_high_m"])


def alignment_results(
    alignment: Alignment,
    *,
    accuracy: float | None = None,
    repeats: Mapping[Frame, Repeats] | None = None,
) -> dict[str, Any]:
    """Return `alignment`, `loocv`, `checks`, `reliability` and `warnings`.

    Parameters
    ----------
    alignment : Alignment
    accuracy : float, optional
        Of the reference, in metres per axis: it is added to the check picks' error in quadrature.
    repeats : mapping of str to Repeats, optional
        Where repeated picks gave the sigmas, what they showed, by frame.
    """
    control, inliers = alignment.picks.control, alignment.consensus.inliers
    table = alignment.residuals(control).assign(used=inliers)
    kept = table[inliers]
    consensus, fit = alignment.consensus, alignment.similarity
    squares = float((kept["d_m"] ** 2).sum())
    return {
        "alignment": {
            "method": consensus.method,
            "seed": consensus.seed,
            "trials": consensus.trials,
            "degenerate_trials": consensus.degenerate_trials,
            "exhaustive_agrees": alignment.exhaustive_agrees,
            "threshold_m": consensus.threshold,
            "weighted": alignment.weights is not None,
            "n": len(kept),
            "dof": 3 * len(kept) - 7,
            "scale": fit.scale,
            "rotation": fit.rotation,
            "translation": fit.translation,
            "matrix": fit.matrix,
            "rmse_m": np.sqrt(squares / len(kept)),
            "rmse_dof_m": np.sqrt(squares / (len(kept) - 7 / 3)),
            "mean_m": kept[AXES].mean().to_numpy(),
            "inliers": kept["id"].tolist(),
            "outliers": table["id"][~inliers].tolist(),
            "residuals": table,
        },
        "loocv": _loocv(alignment),
        "checks": _checks(alignment, accuracy),
        "reliability": {
            **_reliability(alignment),
            "repeats": [_repeats(*item) for item in (repeats or {}).items()],
        },
        "warnings": warning_results(alignment.cautions),
    }


def comparison_results(
    comparison: Comparison, intervals: Intervals | None = None
) -> dict[str, Any]:
    """Return `accuracy`, `completeness` and `counts`.

    Parameters
    ----------
    comparison : Comparison
    intervals : Intervals, optional
        Of its shares and RMSE; their bounds are None without.
    """
    found: dict[str, Any] = {}
    for direction, table in (
        ("accuracy", comparison.accuracy),
        ("completeness", comparison.completeness),
    ):
        shares = _of_direction(comparison.within, direction)
        if intervals is not None:
            known = _of_direction(intervals.shares, direction).drop(columns="pct")
            shares = shares.drop(columns=["low_pct", "high_pct"])
            shares = shares.merge(known, on=["zone", "threshold_m"], validate="one_to_one")
            spread = _of_direction(intervals.rmse, direction).set_index("zone")
            table = table.assign(rmse_low_m=spread["low_m"], rmse_high_m=spread["high_m"])
        rows = zip(table.index, table.to_dict(orient="records"), strict=True)
        found[direction] = {
            zone: {**UNKNOWN_RMSE, **row, "within": _shares_of(shares, str(zone))}
            for zone, row in rows
        }
    return found | {"counts": dict(comparison.counts)}


def interval_results(
    intervals: Intervals | None, perfect: Flawless | None
) -> dict[str, Any] | None:
    """Return the `intervals` object: what the bounds mean, and what perfection would score."""
    if intervals is None:
        return None
    return {
        "statement": intervals.statement,
        "has_pose": intervals.has_pose,
        "block_m": intervals.block_m,
        "draws": intervals.draws,
        "seed": intervals.seed,
        "perfect": None
        if perfect is None
        else {"statement": perfect.statement, "shares": perfect.shares},
    }


def trial_results(trial: Trial | None) -> dict[str, Any] | None:
    """Return the `icp` object; None where ICP was not asked for."""
    if trial is None:
        return None
    moved = trial.refinement
    return {
        "translation_m": moved.translation_m,
        "shift_m": moved.shift_m,
        "rotation_deg": moved.rotation_deg,
        "iterations": moved.iterations,
        "overlap_pct": moved.overlap_pct,
        "surface_rmse_before_m": moved.surface_rmse_before_m,
        "surface_rmse_after_m": moved.surface_rmse_after_m,
        "control_rmse_before_m": trial.control_rmse_before_m,
        "control_rmse_after_m": trial.control_rmse_after_m,
        "loocv_rmse_before_m": trial.loocv_rmse_before_m,
        "loocv_rmse_after_m": trial.loocv_rmse_after_m,
        "check_rmse_before_m": trial.check_rmse_before_m,
        "check_rmse_after_m": trial.check_rmse_after_m,
        "retained": trial.retained,
        "rule": trial.rule,
    }


def warning_results(cautions: Iterable[Caution]) -> list[dict[str, str]]:
    """Return cautions as `warnings`, each once, in the order they were met."""
    return [{"code": each.code, "message": each.message} for each in dict.fromkeys(cautions)]


def read_similarity(path: str | Path) -> tuple[Similarity, str | None]:
    """Read a similarity, and the CRS of its target where the file states one.

    Parameters
    ----------
    path : path
        JSON: what `align --out` writes, the whole output of `align --json`, or just ``scale``,
        ``rotation`` and ``translation``.

    Raises
    ------
    SimilarityError
        If the file is missing, is not JSON, or holds no proper similarity.
    """
    path, stored = Path(path), _stored(path)
    try:
        stored = stored.get("alignment", stored)
        fit = Similarity(
            float(stored["scale"]),
            np.array(stored["rotation"], np.float64).reshape(3, 3),
            np.array(stored["translation"], np.float64).reshape(3),
        )
    except (AttributeError, KeyError, OverflowError, TypeError, ValueError) as error:
        message = (
            f"{path.name} holds no similarity: it needs 'scale', a 'rotation' of 3 x 3 numbers and "
            "a 'translation' of 3."
        )
        raise SimilarityError(message) from error
    if not fit.is_proper:
        turned = float(np.linalg.det(fit.rotation))
        message = (
            f"{path.name} holds no similarity: its scale is {fit.scale:g} (it must be above 0) and "
            f"its rotation has determinant {turned:.6g} (1) and is {fit.skew:.2g} (0) from "
            "orthogonal."
        )
        raise SimilarityError(message)
    crs = stored.get("crs")
    return fit, str(crs) if crs else None


def read_sigma(path: str | Path) -> Callable[[Points], Points]:
    """Read what a similarity's covariance gives points of the target frame: sigmas (n, 3), metres.

    Parameters
    ----------
    path : path
        JSON: the whole output of `align --json`.

    Raises
    ------
    SimilarityError
        If it holds no covariance.
    """
    path, stored = Path(path), _stored(path)
    try:
        worth = stored["reliability"]
        centroid = np.array(worth["centroid_m"], np.float64).reshape(3)
        covariance = np.array(worth["covariance"], np.float64).reshape(7, 7)
        if not np.isfinite([*centroid, *covariance.ravel()]).all():
            raise ValueError
    except (AttributeError, KeyError, OverflowError, TypeError, ValueError) as error:
        message = (
            f"{path.name} holds no covariance to take sigmas from: give the whole output of "
            "`trigpoint align --json`, of picks that determine it."
        )
        raise SimilarityError(message) from error
    return partial(sigma_at, centroid=centroid, covariance=covariance)


def _stored(path: str | Path) -> Any:
    try:
        return json.loads(Path(path).read_text(encoding="utf-8-sig"))
    except (OSError, RecursionError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) else "it is not JSON"
        message = f"{Path(path).name} can't be read as a similarity: {reason}."
        raise SimilarityError(message) from error


def _of_direction(table: pd.DataFrame, direction: str) -> pd.DataFrame:
    return table[table["direction"] == direction].drop(columns="direction")


def _shares_of(shares: pd.DataFrame, zone: str) -> list[dict[str, Any]]:
    rows = shares[shares["zone"] == zone].drop(columns="zone").to_dict(orient="records")
    return [UNKNOWN_SHARES | {str(key): value for key, value in row.items()} for row in rows]


def _loocv(alignment: Alignment) -> dict[str, Any]:
    loocv, ids = alignment.loocv, alignment.picks.control.ids
    folds = loocv.folds.copy()
    folds.insert(0, "id", [ids[position] for position in folds.pop("position")])
    # Before it is an object column, pandas has no way to say that a truth value is missing.
    changed = folds["inliers_changed"].astype(object)
    folds["inliers_changed"] = changed.where(changed.notna(), None)
    return {
        "rmse_m": loocv.rmse_m,
        "rmse_procedure_m": loocv.rmse_procedure_m,
        "max_scale_change_pct": loocv.max_scale_change_pct,
        "closed_form": loocv.closed_form,
        "folds": folds,
    }


def _checks(alignment: Alignment, accuracy: float | None) -> dict[str, Any]:
    picks = alignment.picks.check
    found = measure_checks(picks.source, picks.target, alignment.similarity, accuracy=accuracy)
    return {
        "n": found.n,
        "mean_m": found.mean_m,
        "rmse_m": found.rmse_m,
        "total_m": found.total_m,
        "residuals": alignment.residuals(picks),
    }


def _reliability(alignment: Alignment) -> dict[str, Any]:
    worth, ids = alignment.reliability, alignment.inliers.ids
    picks = worth.picks.copy()
    picks.insert(0, "id", [ids[position] for position in picks.pop("position")])
    return {
        "noise": worth.noise,
        "sigma_m": worth.sigma_m,
        "global_p_value": worth.global_p_value,
        "sigma0_m": worth.sigma0_m,
        "sigma0_low_m": worth.sigma0_low_m,
        "sigma0_high_m": worth.sigma0_high_m,
        "scale_low": worth.scale_low,
        "scale_high": worth.scale_high,
        "centroid_m": worth.centroid,
        "covariance": worth.covariance,
        "rotation_sigma_deg": worth.rotation_sigma_deg,
        "picks": picks,
        "geometry": worth.geometry,
        "statement": worth.statement,
        # What needs more than the picks is left to the audit.
        "zones": {},
        "next_picks": [],
        "cross_checks": [],
    }


def _repeats(frame: Frame, found: Repeats) -> dict[str, Any]:
    """Return what repeated picking showed, in the units of its frame."""
    return {
        "frame": frame,
        "sessions": len(found.sessions),
        "places": int((found.picks["times"] > 1).sum()),
        "sigma": found.sigma,
        "sigma_low": found.sigma_low,
        "sigma_high": found.sigma_high,
        "dof": found.dof,
        "bias_p_value": found.bias_p_value,
    }
