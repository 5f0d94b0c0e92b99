"""What a fitted similarity is worth: its covariance, and whether a bad pick would have shown."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from trigpoint.adjustment import linearise
from trigpoint.blunders import pick_cautions, pick_table
from trigpoint.cautions import Caution
from trigpoint.distributions import chi2_isf, chi2_sf, normal_isf, t_isf
from trigpoint.geometry import Verdict, judge, rotation_axes
from trigpoint.propagation import covariance_at, matrix_covariance, sigma_at
from trigpoint.similarity import (
    Points,
    Similarity,
    canonical_order,
    check_pairs,
    principal_spreads,
)

CONFIDENCE = 0.95
# Where the source frame has twice the target's share of the picks' variance, it decides alone.
DOMINANT = 2 / 3
REFUTED = 0.025  # on either side, of the test of residuals against stated sigmas


@dataclass(frozen=True, slots=True, eq=False)
class Reliability:
    """What a fitted similarity is worth.

    Attributes
    ----------
    similarity : Similarity
        The fit that is judged.
    noise : str
        Where the picks' sigma comes from: "stated" with the picks, or their "residuals".
    dof : int
        Redundant equations, 3n-7.
    sigma_m : float
        Standard deviation of one (average) pick per axis, that all else rests on; both frames'
        errors together, in target metres.
    sigma0_m, sigma0_low_m, sigma0_high_m : float
        The same as the residuals show it, with its 95 % interval.
    global_statistic, global_p_value : float
        Chi-square test of the residuals against the stated sigmas, upper tail. NaN without any.
    scale_low, scale_high : float
        95 % interval of the scale.
    centroid : ndarray of shape (3,)
        Of the picks in the target frame, weighted as the fit was.
    covariance : ndarray of shape (7, 7)
        Of ln scale; of small rotations about the target's x, y, z (rad, applied after the
        rotation); of the position of `centroid` (m).
    rotation_sigma_deg : ndarray of shape (3,)
        Standard deviation of the rotation about the rows of `rotation_axes`, worst first.
    rotation_axes : ndarray of shape (3, 3)
        Principal axes of the rotation's covariance: unit vectors of the target frame, one a row.
    picks : DataFrame
        A row per pick as given: position, redundancy (trace, 0 to 3), standardised (length of the
        residual in its own standard deviations: its square is 3 on average), p_value, suspected
        (p below 0.05 / n), detectable_blunder_m (along the worst direction, at alpha 0.001 and
        power 0.80; inf where none would show).
    spreads_m : ndarray of shape (3,)
        RMS extent of the picks along their principal axes, largest first.
    extrapolation : float
        Distance from the centroid to the reference's farthest corner over that to the farthest
        pick. NaN without an extent.
    corners : DataFrame
        The reference's eight corners: x, y, z, sigma_e_m, sigma_n_m, sigma_h_m. Empty without.
    geometry : str
        "sound", "weak" or "refused".
    statement : str
        The verdict in one sentence.
    cautions : tuple of Caution
    """

    similarity: Similarity
    noise: Literal["stated", "residuals"]
    dof: int
    sigma_m: float
    sigma0_m: float
    sigma0_low_m: float
    sigma0_high_m: float
    global_statistic: float
    global_p_value: float
    scale_low: float
    scale_high: float
    centroid: NDArray[np.float64]
    covariance: NDArray[np.float64]
    rotation_sigma_deg: NDArray[np.float64]
    rotation_axes: NDArray[np.float64]
    picks: pd.DataFrame
    spreads_m: NDArray[np.float64]
    extrapolation: float
    corners: pd.DataFrame
    geometry: Verdict
    statement: str
    cautions: tuple[Caution, ...]

    @property
    def quantile(self) -> float:
        """How many sigmas make a 95 % interval: normal if sigma is stated, else t with `dof`."""
        return _quantile(self.noise, self.dof)

    def sigma(self, points: Points) -> Points:
        """Return sigmas (n, 3) of points of the target frame: easting, northing, height."""
        return sigma_at(points, self.centroid, self.covariance)

    def covariance_at(self, points: Points) -> NDArray[np.float64]:
        """Return the covariance (n, 3, 3) in m² of points of the target frame."""
        return covariance_at(points, self.centroid, self.covariance)

    def m3c2_covariance(self, reference: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the covariance (12, 12) that M3C2-EP propagates, for the georeferenced cloud.

        M3C2-EP takes a 3x4 matrix that carries its second epoch. Give it the cloud that the
        similarity has georeferenced, the unit matrix, this covariance as `Cxx` and `reference`
        (a point of the target frame, such as `centroid`) as `refPointMov`. py4dgeo looks its
        neighbours up before it moves them, so the similarity itself can't be the matrix.
        """
        still = Similarity(1.0, np.eye(3), np.zeros(3))
        return matrix_covariance(still, self.centroid, self.covariance, reference=reference)


def assess(
    source: Points,
    target: Points,
    similarity: Similarity,
    *,
    sigma_source: NDArray[np.float64] | None = None,
    sigma_target: NDArray[np.float64] | None = None,
    weights: NDArray[np.float64] | None = None,
    extent: NDArray[np.float64] | None = None,
    names: Sequence[str] | None = None,
) -> Reliability:
    """Assess a similarity from the picks it was fitted to.

    The picks' errors are taken as equal along all axes and independent:
    ``sigma² = sigma_target² + scale² sigma_source²``. Where every pick states one of its sigmas,
    they are used; where not, sigma is found from the residuals. The covariance is that of the fit
    that was made, also where its weights are not the inverse variances.

    Parameters
    ----------
    source, target : ndarray of shape (n, 3)
        The picks that the similarity was fitted to; `target` in metres.
    similarity : Similarity
        `umeyama(source, target, weights=weights)`.
    sigma_source, sigma_target : ndarray of shape (n,), optional
        Standard deviation per axis, in source units and metres. NaN where unknown.
    weights : ndarray of shape (n,), optional
        As used in the fit.
    extent : ndarray of shape (2, 3), optional
        Lowest and highest coordinates of the reference.
    names : sequence of str, optional
        Of the picks, for the sentences; their positions if omitted.

    Returns
    -------
    Reliability

    Raises
    ------
    ValueError
        If shapes do not match, or a sigma is not above zero.

    References
    ----------
    Baarda (1968), A testing procedure for use in geodetic networks, Netherlands Geodetic
    Commission 2(5).

    Examples
    --------
    >>> from trigpoint.similarity import umeyama
    >>> rng = np.random.default_rng(0)
    >>> source = rng.uniform(0, 10, (6, 3))
    >>> target = 2 * source + rng.normal(0, 0.02, (6, 3))
    >>> worth = assess(source, target, umeyama(source, target))
    >>> worth.dof, worth.geometry, bool(worth.scale_low < 2 < worth.scale_high)
    (11, 'sound', True)
    """
    source, target, weights = check_pairs(source, target, weights)
    count = len(source)
    names = [str(i) for i in range(count)] if names is None else list(names)
    stated, cautions = _stated(similarity, sigma_source, sigma_target, count)

    order = canonical_order(source, target)
    adjustment = linearise(source[order], target[order], similarity, weights[order])
    dof = 3 * count - 7
    shape = 1 / adjustment.weights if stated is None else stated[order] ** 2
    unit = 1 / (1 / shape).mean()  # the variance of an average pick
    misfit = adjustment.misfit(shape / unit)
    sigma0 = float(np.sqrt(misfit / dof))
    tail = (1 - CONFIDENCE) / 2
    low, high = np.sqrt(dof / chi2_isf([tail, 1 - tail], dof))
    sigma = sigma0 if stated is None else float(np.sqrt(unit))
    noise: Literal["stated", "residuals"] = "residuals" if stated is None else "stated"
    global_statistic = np.nan if stated is None else misfit / unit
    global_p = float(chi2_sf(global_statistic, dof))

    variances = shape / unit * sigma**2
    covariance = adjustment.covariance(variances)
    rotation_sigmas, axes = rotation_axes(covariance[1:4, 1:4])
    half = _quantile(noise, dof) * np.sqrt(covariance[0, 0])

    exact = sigma0 <= _rounding(source, target, similarity)
    tested = pick_table(
        adjustment, shape / unit, sigma, misfit, known=stated is not None, exact=exact
    )
    picks = tested.iloc[np.argsort(order)].reset_index(drop=True)
    picks.insert(0, "position", np.arange(count))

    corners, extrapolation = _corners(extent, target, adjustment.centroid, covariance)
    corner = float(corners.to_numpy()[:, 3:].max(initial=0.0))
    # A stated sigma that the residuals refute does not talk the layout sound.
    excess = sigma0 / sigma if global_p < REFUTED else 1.0
    geometry = judge(
        source[order],
        target[order],
        adjustment,
        covariance[1:4, 1:4] * excess**2,
        doubt=1.0 if stated is not None else float(high),
        corner_ratio=corner / sigma if sigma > 0 else 0.0,
        names=[names[i] for i in order],
    )
    statement = _statement(geometry.verdict, geometry.reasons, count, noise, sigma, exact)
    cautions += pick_cautions(picks, names, known=stated is not None)
    if stated is not None and not REFUTED <= global_p <= 1 - REFUTED:
        word = "larger" if global_p < 0.5 else "smaller"
        message = (
            f"The residuals are {word} than the stated sigmas allow: they show {sigma0:.3g} m per "
            f"axis where {sigma:.3g} m is stated (chi-square p {global_p:.2g}, {dof} degrees of "
            f"freedom)."
        )
        cautions.append(Caution("sigmas_doubtful", message))
    if geometry.verdict != "sound":
        cautions.append(Caution("weak_geometry", statement))
    return Reliability(
        similarity=similarity,
        noise=noise,
        dof=dof,
        sigma_m=sigma,
        sigma0_m=sigma0,
        sigma0_low_m=float(sigma0 * low),
        sigma0_high_m=float(sigma0 * high),
        global_statistic=float(global_statistic),
        global_p_value=global_p,
        scale_low=float(similarity.scale * np.exp(-half)),
        scale_high=float(similarity.scale * np.exp(half)),
        centroid=adjustment.centroid,
        covariance=covariance,
        rotation_sigma_deg=np.degrees(rotation_sigmas),
        rotation_axes=axes,
        picks=picks,
        spreads_m=principal_spreads(target[order]),
        extrapolation=extrapolation,
        corners=corners,
        geometry=geometry.verdict,
        statement=statement,
        cautions=tuple(cautions),
    )


def _stated(
    similarity: Similarity,
    sigma_source: NDArray[np.float64] | None,
    sigma_target: NDArray[np.float64] | None,
    count: int,
) -> tuple[NDArray[np.float64] | None, list[Caution]]:
    columns = [
        np.full(count, np.nan) if sigma is None else np.asarray(sigma, np.float64)
        for sigma in (sigma_source, sigma_target)
    ]
    for frame, sigma in zip(("source", "target"), columns, strict=True):
        if sigma.shape != (count,) or (sigma < 0).any() or np.isinf(sigma).any():
            message = f"sigma_{frame} {sigma.shape} must be {count} finite numbers, not below zero."
            raise ValueError(message)
    both = np.column_stack([similarity.scale * columns[0], columns[1]])
    missing = np.isnan(both)
    if missing.all():
        return None, []
    silent = int(missing.all(axis=1).sum())
    if silent:
        message = (
            f"{silent} of {count} picks state no sigma: the sigmas of the others are not used "
            f"either, and the residuals give one for all."
        )
        return None, [Caution("sigmas_doubtful", message)]
    cautions = []
    for frame, column in (("source", missing[:, 0]), ("target", missing[:, 1])):
        if column.any():
            message = (
                f"{int(column.sum())} of {count} picks state no sigma_{frame}: it counts as zero, "
                f"so the sigma of the other frame must hold all of the error."
            )
            cautions.append(Caution("sigmas_doubtful", message))
    total = np.sqrt(np.nansum(both**2, axis=1))
    if not (total > 0).all():
        message = (
            f"Picks {np.flatnonzero(total == 0).tolist()} state a sigma of zero: leave it empty."
        )
        raise ValueError(message)
    shares = both[:, 0] ** 2 / total**2
    if np.nan_to_num(shares).mean() > DOMINANT:
        message = (
            f"Picking in the source frame makes {100 * float(np.nan_to_num(shares).mean()):.0f} % "
            f"of the picks' variance: {similarity.scale:.4g} times its sigma in the target frame."
        )
        cautions.append(Caution("source_noise_dominates", message))
    return total, cautions


def _corners(
    extent: NDArray[np.float64] | None,
    target: Points,
    centroid: NDArray[np.float64],
    covariance: NDArray[np.float64],
) -> tuple[pd.DataFrame, float]:
    columns = ["x", "y", "z", "sigma_e_m", "sigma_n_m", "sigma_h_m"]
    if extent is None:
        return pd.DataFrame(columns=columns, dtype=np.float64), np.nan
    ends = np.asarray(extent, np.float64)
    if ends.shape != (2, 3) or not np.isfinite(ends).all():
        message = f"extent {ends.shape} must hold the lowest and highest coordinates, (2, 3)."
        raise ValueError(message)
    points = np.stack(np.meshgrid(*ends.T, indexing="ij"), axis=-1).reshape(8, 3)
    sigmas = sigma_at(points, centroid, covariance)
    reach = np.linalg.norm(target - centroid, axis=1).max()
    ratio = float(np.linalg.norm(points - centroid, axis=1).max() / reach)
    return pd.DataFrame(np.column_stack([points, sigmas]), columns=columns), ratio


def _statement(
    verdict: Verdict,
    reasons: tuple[str, ...],
    count: int,
    noise: str,
    sigma: float,
    exact: bool,
) -> str:
    if count == 3:
        check = (
            "2 redundant equations, so no pick can be tested and reliability is not assessable: "
            "add at least one, better three"
        )
    elif exact and noise == "residuals":
        check = "they fit exactly, which real picks do not, so their sigma is not known"
    else:
        origin = "as stated" if noise == "stated" else f"from {3 * count - 7} redundant equations"
        check = f"one pick is good to {sigma:.3g} m per axis, {origin}"
    if verdict == "sound":
        layout = "are laid out well" if count == 3 else "pin the similarity down"
        return f"Sound: the {count} picks {layout}; {check}."
    return f"{verdict.capitalize()}: {'; also, '.join(reasons)} ({check})."


def _quantile(noise: str, dof: int) -> float:
    tail = (1 - CONFIDENCE) / 2
    return normal_isf(tail) if noise == "stated" else t_isf(tail, dof)


def _rounding(source: Points, target: Points, similarity: Similarity) -> float:
    # What float64 makes of the coordinates is noise that nobody picked.
    steps = np.spacing(np.abs(target).max()), similarity.scale * np.spacing(np.abs(source).max())
    return 64 * float(max(steps))
