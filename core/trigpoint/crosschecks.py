"""Independent evidence about a similarity, none of which enters its fit.

Each check compares something that was measured without the picks (a length, the direction of the
vertical, GNSS positions) with what the similarity makes of it, and asks whether the difference is
within what both uncertainties allow.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from trigpoint.adjustment import design_matrix
from trigpoint.cautions import Caution
from trigpoint.distributions import chi2_sf, f_sf
from trigpoint.reliability import Reliability
from trigpoint.similarity import Points, check_pairs

ALPHA = 0.05  # below this p-value a check is said to disagree


@dataclass(frozen=True, slots=True, eq=False)
class CrossCheck:
    """One independent check.

    Attributes
    ----------
    kind : str
        "scale_bar", "up_direction" or "camera_positions".
    discrepancy, sigma : float
        What was found, and the standard deviation to expect of it, in `unit`.
    unit : str
        "m" or "deg".
    p_value : float
        Of a discrepancy as large or larger, were both sides right.
    statement : str
        One sentence.
    """

    kind: str
    discrepancy: float
    sigma: float
    unit: str
    p_value: float
    statement: str

    @property
    def caution(self) -> Caution | None:
        """A doubt, where the two sides disagree."""
        return Caution("cross_check_disagrees", self.statement) if self.p_value < ALPHA else None


def scale_bar(
    reliability: Reliability,
    start: ArrayLike,
    end: ArrayLike,
    *,
    length: float,
    sigma: float,
    sigma_source: float = 0.0,
) -> CrossCheck:
    """Check the scale with a known length between two source points.

    Parameters
    ----------
    reliability : Reliability
        Of the fit.
    start, end : array_like of shape (3,)
        In the source frame.
    length, sigma : float
        The length and its standard deviation, in metres of the target frame: on a map grid, a
        taped length times the grid's scale.
    sigma_source : float
        Standard deviation of `start` and `end` along each axis, source units.

    Returns
    -------
    CrossCheck
        Its discrepancy is the length found less the length given.

    Raises
    ------
    ValueError
        If the ends are one point, or the length is not above zero.
    """
    apart = float(np.linalg.norm(np.subtract(end, start)))
    if not (apart > 0 and length > 0):
        message = f"A scale bar {apart:.3g} source units and {length:.3g} m long checks nothing."
        raise ValueError(message)
    scale = reliability.similarity.scale
    fitted = (scale * apart) ** 2 * float(reliability.covariance[0, 0])
    given = sigma**2 + 2 * (scale * sigma_source) ** 2
    found = scale * apart - length
    p = _p_value(np.array([found]), np.array([[fitted]]), np.array([[given]]), reliability)
    spread = float(np.sqrt(fitted + given))
    statement = (
        f"Scale bar: {scale * apart:.4f} m where {length:.4f} m is given, {found:+.4f} m with a "
        f"sigma of {spread:.4f} m (p {p:.2g})."
    )
    return CrossCheck("scale_bar", found, spread, "m", p, statement)


def up_direction(reliability: Reliability, up: ArrayLike, *, sigma_deg: float) -> CrossCheck:
    """Check the levelling with a direction of the source frame that is known to point up.

    Parameters
    ----------
    reliability : Reliability
        Of the fit.
    up : array_like of shape (3,)
        In the source frame, of any length: a plumb line, the normal of a levelled horizon.
    sigma_deg : float
        Standard deviation of its tilt along each of the two horizontal axes, degrees.

    Returns
    -------
    CrossCheck
        Its discrepancy is the angle to the target's vertical, in degrees.

    Raises
    ------
    ValueError
        If `up` has no length.
    """
    direction = np.asarray(up, np.float64)
    size = float(np.linalg.norm(direction))
    if not (np.isfinite(size) and size > 0):
        message = f"up {direction.tolist()} must be a direction: finite and not zero."
        raise ValueError(message)
    x, y, z = reliability.similarity.turn(direction[None, :] / size)[0]
    flat = float(np.hypot(x, y))
    angle = float(np.arctan2(flat, z))
    # The tilt as a rotation about the horizontal axes, as the covariance has it. An up that points
    # straight down tilts about any of them.
    axis = np.array([y, -x]) / flat if flat > 0 else np.array([1.0, 0.0])
    fitted = reliability.covariance[1:3, 1:3]
    given = np.radians(sigma_deg) ** 2 * np.eye(2)
    p = _p_value(angle * axis, fitted, given, reliability)
    spread = float(np.degrees(np.sqrt(np.trace(fitted + given))))
    found = float(np.degrees(angle))
    statement = (
        f"Up direction: {found:.3f}° off the vertical, where {spread:.3f}° is to be expected "
        f"(p {p:.2g})."
    )
    return CrossCheck("up_direction", found, spread, "deg", p, statement)


def camera_positions(
    reliability: Reliability, source: Points, target: Points, *, sigma: ArrayLike
) -> CrossCheck:
    """Check the whole similarity with camera positions that GNSS measured.

    Parameters
    ----------
    reliability : Reliability
        Of the fit.
    source : ndarray of shape (m, 3)
        Camera centres in the source frame.
    target : ndarray of shape (m, 3)
        GNSS positions in the target frame: of the cameras, not of their antennas.
    sigma : array_like, broadcast to shape (m, 3)
        Standard deviation of the GNSS positions along each axis, metres.

    Returns
    -------
    CrossCheck
        Its discrepancy is the root mean square distance, its sigma the one to expect.

    Raises
    ------
    ValueError
        If shapes do not match, there is no camera, or a sigma is not above zero.
    """
    cameras, gnss, _ = check_pairs(source, target, None)
    sigmas = np.broadcast_to(np.asarray(sigma, np.float64), cameras.shape)
    if not len(cameras) or not (sigmas > 0).all():
        message = (
            f"{len(cameras)} cameras, the least sigma {sigmas.min(initial=np.inf):g} m: at least "
            f"one camera and sigmas above zero are needed."
        )
        raise ValueError(message)
    carried = reliability.similarity(cameras)
    errors = gnss - carried
    design = design_matrix(carried - reliability.centroid)

    # errors' covariance is diagonal (GNSS) plus rank 7 (the similarity): Woodbury's identity, in
    # the form that also holds where the similarity's own covariance is singular.
    covariance = reliability.covariance
    weights = sigmas**-2
    normal = np.einsum("mia,mi,mib->ab", design, weights, design)
    pull = np.einsum("mia,mi,mi->a", design, weights, errors)
    inner = np.linalg.solve(np.eye(7) + covariance @ normal, covariance)
    statistic = float((weights * errors**2).sum()) - float(pull @ inner @ pull)
    share = float((inner * normal.T).sum()) / errors.size

    fitted = float(np.einsum("mia,ab,mib->", design, covariance, design))
    given = float((sigmas**2).sum())
    p = _tail(statistic, errors.size, share, reliability)
    found = float(np.sqrt((errors**2).sum(axis=1).mean()))
    spread = float(np.sqrt((fitted + given) / len(errors)))
    east, north, up = errors.mean(axis=0)
    statement = (
        f"Camera positions: {found:.3f} m RMS over {len(errors)} cameras where {spread:.3f} m is "
        f"to be expected (p {p:.2g}); mean offset {east:+.3f}, {north:+.3f}, {up:+.3f} m."
    )
    return CrossCheck("camera_positions", found, spread, "m", p, statement)


def _p_value(
    found: NDArray[np.float64],
    fitted: NDArray[np.float64],
    given: NDArray[np.float64],
    reliability: Reliability,
) -> float:
    total = fitted + given
    if not np.linalg.det(total) > 0:  # nothing is uncertain: any difference is one
        return 1.0 if not found.any() else 0.0
    statistic = float(found @ np.linalg.solve(total, found))
    share = float(np.trace(np.linalg.solve(total, fitted))) / len(found)
    return _tail(statistic, len(found), share, reliability)


def _tail(statistic: float, count: int, share: float, reliability: Reliability) -> float:
    # The fit's share of the variance was estimated, the rest is given: Welch and Satterthwaite's
    # effective degrees of freedom (JCGM 100:2008, G.4). A million are as good as a known sigma.
    known = reliability.noise == "stated" or reliability.dof > 1e6 * share**2
    if known:
        return float(chi2_sf(statistic, count))
    return float(f_sf(statistic / count, count, reliability.dof / share**2))
