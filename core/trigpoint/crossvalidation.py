"""Leave-one-out cross-validation: what the fit says about a pick it has not seen."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from trigpoint.cautions import Caution
from trigpoint.consensus import Consensus
from trigpoint.errors import ConsensusError, DegeneratePicksError
from trigpoint.similarity import Points, Similarity, canonical_order, check_pairs, umeyama

# Above so many inliers one refit each would say nothing that the closed form does not.
REFITS = 50

COLUMNS = [
    "position",
    "dx_m",
    "dy_m",
    "dz_m",
    "d_m",
    "scale",
    "scale_change_pct",
    "rotation_change_deg",
    "shift_m",
    "inliers_changed",
]

# A pick whose removal leaves a direction unfixed has a redundancy block with no inverse; below
# this smallest eigenvalue (1 is a pick without any influence) the inverse is rounding.
UNFIXED = 1e-9


class Procedure(Protocol):
    """A way from picks to a consensus, such as `ransac` with its settings bound."""

    def __call__(
        self, source: Points, target: Points, *, weights: NDArray[np.float64] | None
    ) -> Consensus:
        """Find the consensus of picks of shape (n, 3)."""
        ...


@dataclass(frozen=True, slots=True, eq=False)
class LeaveOneOut:
    """Prediction errors of withheld inliers.

    Attributes
    ----------
    rmse_m : float or None
        Each inlier withheld in turn and predicted by a fit to the other inliers. None where that
        can't be done for every one of them; a caution says why.
    rmse_procedure_m : float or None
        The same with the consensus redone on all remaining picks, so that the withheld pick had
        no say in which are inliers. None without a procedure, or where a fold failed.
    max_scale_change_pct : float or None
        Largest change of scale over the folds, ``100 * max |s_i - s| / s``.
    closed_form : bool
        True where no fold was refitted: above 50 inliers.
    folds : DataFrame
        A row for each inlier, in order: `position` of the pick in the arrays given; `dx_m`,
        `dy_m`, `dz_m` target minus prediction, and its length `d_m`; `scale` of the fold,
        `scale_change_pct`; `rotation_change_deg`; `shift_m`, how far the centroid of the inliers
        moves; `inliers_changed`, whether the procedure, withheld pick apart, chose other inliers
        (missing where it was not run). NaN where a fold could not be fitted.
    cautions : tuple of Caution
    """

    rmse_m: float | None
    rmse_procedure_m: float | None
    max_scale_change_pct: float | None
    closed_form: bool
    folds: pd.DataFrame
    cautions: tuple[Caution, ...]


def leave_one_out(
    source: Points,
    target: Points,
    inliers: NDArray[np.bool_] | None = None,
    *,
    weights: NDArray[np.float64] | None = None,
    procedure: Procedure | None = None,
) -> LeaveOneOut:
    """Withhold each inlier in turn, refit on the others, and predict it.

    Up to 50 inliers every fold is a fit of its own. Above, all folds follow at once from the
    residuals and redundancy matrices of the one fit, `e_i` becoming ``R_ii^-1 e_i``: exact but
    for terms of second order in the change of the fit. The procedure is not repeated then.

    Parameters
    ----------
    source, target : ndarray of shape (n, 3)
        Matching picks. `target` is in metres.
    inliers : ndarray of shape (n,), optional
        True for the picks of the fit; all if omitted. The others are seen by `procedure` alone.
    weights : ndarray of shape (n,), optional
        Above zero; those of the fit.
    procedure : callable, optional
        ``procedure(source, target, weights=weights)`` returns the Consensus that the inliers
        came from.

    Returns
    -------
    LeaveOneOut

    Raises
    ------
    DegeneratePicksError
        If the inliers are fewer than three, coincide, or lie on a line, in either frame.
    ValueError
        If shapes do not match, a coordinate is not finite, or a weight is not above zero.

    References
    ----------
    For ``R_ii^-1 e_i`` see Cook and Weisberg (1982), Residuals and Influence in Regression,
    section 2.2, here with blocks of three coordinates.

    Examples
    --------
    >>> corners = np.array([[0.0, 0, 0], [9, 0, 0], [0, 8, 0], [0, 0, 7], [9, 8, 7]])
    >>> off = np.array([[0.0, 0, 0], [0, 0, 0], [0, 0, 0], [0, 0, 0], [0, 0, 0.3]])
    >>> withheld = leave_one_out(corners, 2 * corners + off)
    >>> withheld.folds["d_m"].round(2).tolist()[-1]
    0.3
    """
    source, target, known = check_pairs(source, target, weights)
    used = np.ones(len(source), np.bool_) if inliers is None else np.asarray(inliers, np.bool_)
    if used.shape != (len(source),):
        message = f"inliers {used.shape} must be {len(source)} truth values."
        raise ValueError(message)
    order = canonical_order(source, target)  # so that sums do not depend on the picks' order
    positions = order[used[order]]
    chosen = source[positions], target[positions], known[positions]
    fit = umeyama(chosen[0], chosen[1], weights=chosen[2])

    closed_form = len(positions) > REFITS
    folds = pd.DataFrame(
        (_closed_form if closed_form else _refits)(*chosen, fit),
        columns=["dx_m", "dy_m", "dz_m", "scale", "rotation_change_deg", "shift_m"],
    )
    folds["position"] = positions
    folds["d_m"] = np.sqrt((folds[["dx_m", "dy_m", "dz_m"]].to_numpy() ** 2).sum(axis=1))
    folds["scale_change_pct"] = 100 * (folds["scale"] - fit.scale) / fit.scale
    folds["inliers_changed"] = pd.array([None] * len(folds), dtype="boolean")

    cautions = []
    failed = sorted(positions[folds["d_m"].isna()].tolist())
    if len(positions) == 3:
        message = (
            "Three inliers leave two when one is withheld, and two fix no similarity: "
            "leave-one-out needs four."
        )
        cautions.append(Caution("picks_few", message))
    elif failed:
        message = (
            f"Withholding the pick at position {', '.join(map(str, failed))} (counted from 0) "
            f"leaves inliers on a line: leave-one-out can't be given. Add a pick well off the line."
        )
        cautions.append(Caution("fold_failed", message))

    rmse_procedure = None
    if procedure is not None and not closed_form and len(positions) > 3:
        distances, changed = _repeat(source, target, weights, used, positions, procedure)
        folds["inliers_changed"] = changed
        lost = sorted(positions[np.isnan(distances)].tolist())
        if lost:
            message = (
                f"Withholding the pick at position {', '.join(map(str, lost))} (counted from 0) "
                f"leaves no consensus among the others: leave-one-out of the whole procedure "
                f"can't be given. Add picks."
            )
            cautions.append(Caution("fold_failed", message))
        else:
            rmse_procedure = _rms(distances)
    return LeaveOneOut(
        None if failed else _rms(folds["d_m"].to_numpy()),
        rmse_procedure,
        None if failed else float(folds["scale_change_pct"].abs().max()),
        closed_form,
        folds[COLUMNS].sort_values("position", ignore_index=True),
        tuple(cautions),
    )


def _refits(
    source: Points, target: Points, weights: NDArray[np.float64], fit: Similarity
) -> NDArray[np.float64]:
    """Rows of residual, scale, rotation in degrees, and shift: NaN where a fold has no fit."""
    centre = _centroid(source, weights)
    rows = np.full((len(source), 6), np.nan)
    for withheld in range(len(source)):
        others = np.arange(len(source)) != withheld
        try:
            fold = umeyama(source[others], target[others], weights=weights[others])
        except DegeneratePicksError:
            continue
        turned = Rotation.from_matrix(fold.rotation @ fit.rotation.T)
        rows[withheld, :3] = (target - fold(source))[withheld]
        rows[withheld, 3] = fold.scale
        rows[withheld, 4] = np.degrees(turned.magnitude())
        rows[withheld, 5] = np.linalg.norm(fold(centre[None]) - fit(centre[None]))
    return rows


def _closed_form(
    source: Points, target: Points, weights: NDArray[np.float64], fit: Similarity
) -> NDArray[np.float64]:
    """Return the same rows from one linearised adjustment about the fit."""
    e = target - fit(source)
    p = fit.scale * fit.turn(source - _centroid(source, weights))
    w = weights[:, None, None]
    # About the centroid the normal matrix falls into three blocks: position, rotation, ln scale.
    total = weights.sum()
    outer = p[:, :, None] * p[:, None, :]
    inertia = (w * ((p**2).sum(axis=1)[:, None, None] * np.eye(3) - outer)).sum(axis=0)
    square = (weights * (p**2).sum(axis=1)).sum()
    turning = np.linalg.inv(inertia)
    cross = np.cross(p[:, None, :], np.eye(3)).transpose(0, 2, 1)  # cross @ v = p x v
    swing = np.einsum("mij,jk,mlk->mil", cross, turning, cross)
    redundancy = np.eye(3) - w * (np.eye(3) / total + swing + outer / square)

    fixed = np.linalg.eigvalsh(redundancy)[:, 0] > UNFIXED
    withheld = np.full_like(e, np.nan)
    withheld[fixed] = np.linalg.solve(redundancy[fixed], e[fixed][:, :, None])[:, :, 0]
    # What the pick had pulled, it lets go of.
    pull = weights[:, None] * withheld
    turns = np.einsum("ij,mj->mi", turning, np.cross(p, pull))
    stretch = (p * pull).sum(axis=1) / square
    return np.column_stack(
        [
            withheld,
            fit.scale * np.exp(-stretch),
            np.degrees(np.sqrt((turns**2).sum(axis=1))),
            np.sqrt((pull**2).sum(axis=1)) / total,
        ]
    )


def _repeat(
    source: Points,
    target: Points,
    weights: NDArray[np.float64] | None,
    used: NDArray[np.bool_],
    positions: NDArray[np.intp],
    procedure: Procedure,
) -> tuple[NDArray[np.float64], pd.arrays.BooleanArray]:
    """Return each withheld pick's error, NaN without consensus, and whether inliers changed."""
    distances = np.full(len(positions), np.nan)
    changed = pd.array([None] * len(positions), dtype="boolean")
    for row, withheld in enumerate(positions):
        others = np.arange(len(source)) != withheld
        try:
            fold = procedure(
                source[others],
                target[others],
                weights=None if weights is None else weights[others],
            )
        except (ConsensusError, DegeneratePicksError):
            continue
        distances[row] = np.linalg.norm(fold.residuals(source, target)[withheld])
        changed[row] = bool((fold.inliers != used[others]).any())
    return distances, changed


def _centroid(points: Points, weights: NDArray[np.float64]) -> NDArray[np.float64]:
    # About the first point before averaging: a mean taken at UTM coordinates loses digits.
    shares = (weights / weights.sum())[:, None]
    return np.asarray(points[0] + (shares * (points - points[0])).sum(axis=0))


def _rms(distances: NDArray[np.float64]) -> float:
    return float(np.sqrt((distances**2).mean()))
