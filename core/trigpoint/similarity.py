"""The similarity Sim(3) and its closed-form least-squares fit."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from trigpoint.errors import DegeneratePicksError

Points = NDArray[np.float64]

# The second principal spread of the picks must exceed this share of the first. It refuses what is
# a line to within rounding; a line to within picking noise is refused by `reliability`, which
# knows the noise.
LINE = 1e-6
# Largest element of R R^T - I for a rotation that was stored in decimal digits.
SKEW = 1e-6


@dataclass(frozen=True, slots=True, eq=False)
class Similarity:
    """The map ``target = scale * rotation @ source + translation``.

    Attributes
    ----------
    scale : float
        Target metres per source unit, above zero.
    rotation : ndarray of shape (3, 3)
        Proper rotation.
    translation : ndarray of shape (3,)
        Metres in the target frame.
    """

    scale: float
    rotation: NDArray[np.float64]
    translation: NDArray[np.float64]

    def __call__(self, source: Points) -> Points:
        """Carry source points of shape (n, 3) into the target frame."""
        return self.scale * self.turn(source) + self.translation

    def turn(self, vectors: Points) -> Points:
        """Rotate vectors of shape (n, 3), such as normals, without scaling or moving them."""
        # Element by element, not a matrix product: BLAS may round a row differently by where it
        # stands, and a point must not move with the chunk it is read in.
        x, y, z = vectors[:, 0], vectors[:, 1], vectors[:, 2]
        r = self.rotation
        return np.column_stack([x * r[i, 0] + y * r[i, 1] + z * r[i, 2] for i in range(3)])

    def __matmul__(self, first: Similarity) -> Similarity:
        """Compose: ``(second @ first)(x)`` is ``second(first(x))``."""
        return Similarity(
            self.scale * first.scale,
            self.rotation @ first.rotation,
            self(first.translation[None, :])[0],
        )

    def inverse(self) -> Similarity:
        """Map target back to source."""
        scale, rotation = 1 / self.scale, self.rotation.T.copy()
        back = Similarity(scale, rotation, np.zeros(3))
        return Similarity(scale, rotation, -back(self.translation[None, :])[0])

    @property
    def skew(self) -> float:
        """How far the rotation is from orthogonal: the largest element of ``R R^T - I``."""
        return float(np.abs(self.rotation @ self.rotation.T - np.eye(3)).max())

    @property
    def is_proper(self) -> bool:
        """Whether all is finite, the scale above zero, and the rotation one: no skew, no mirror."""
        turns = self.skew < SKEW and np.linalg.det(self.rotation) > 0
        return bool(np.isfinite(self.matrix).all() and turns and self.scale > 0)

    @property
    def matrix(self) -> NDArray[np.float64]:
        """The 4x4 matrix ``target_from_source``, acting on columns."""
        target_from_source = np.eye(4)
        target_from_source[:3, :3] = self.scale * self.rotation
        target_from_source[:3, 3] = self.translation
        return target_from_source


def umeyama(
    source: Points, target: Points, *, weights: NDArray[np.float64] | None = None
) -> Similarity:
    """Fit the least-squares similarity that carries `source` onto `target`.

    The order of the points changes nothing, to the last bit.

    Parameters
    ----------
    source, target : ndarray of shape (n, 3)
        Matching points, n >= 3. `target` is in metres.
    weights : ndarray of shape (n,), optional
        Above zero; equal if omitted.

    Returns
    -------
    Similarity
        Maps source to target.

    Raises
    ------
    DegeneratePicksError
        If the points are fewer than three, coincide, or lie on a line, in either frame.
    ValueError
        If the shapes do not match, a coordinate is not finite, or a weight is not above zero.

    References
    ----------
    Umeyama (1991), Least-squares estimation of transformation parameters between two point
    patterns, IEEE PAMI 13(4), doi:10.1109/34.88573. Equation numbers below are his.

    Examples
    --------
    >>> corners = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
    >>> fit = umeyama(corners, 2 * corners + [500_000, 5_400_000, 200])
    >>> round(fit.scale, 9), fit.translation.round(6).tolist()
    (2.0, [500000.0, 5400000.0, 200.0])
    """
    source, target, weights = check_pairs(source, target, weights)
    refuse_lines(source, target)
    order = canonical_order(source, target)
    source, target, weights = source[order], target[order], weights[order]

    share = (weights / weights.sum())[:, None]
    # About the first point before averaging: a mean taken at UTM coordinates loses digits.
    source_mean = source[0] + (share * (source - source[0])).sum(axis=0)  # (34)
    target_mean = target[0] + (share * (target - target[0])).sum(axis=0)  # (35)
    a, b = source - source_mean, target - target_mean

    u, d, vt = np.linalg.svd((share * b).T @ a)  # (38)
    # The sign from U and V, not from the covariance: coplanar points make that one singular.
    s = np.array([1.0, 1.0, np.sign(np.linalg.det(u) * np.linalg.det(vt))])  # (43)
    rotation = (u * s) @ vt  # (40)
    scale = float((d * s).sum() / (share * a**2).sum())  # (42)
    fit = Similarity(scale, rotation, np.zeros(3))
    translation = target_mean - fit(source_mean[None, :])[0]  # (41)
    return Similarity(scale, rotation, translation)


def canonical_order(source: Points, target: Points) -> NDArray[np.intp]:
    """Return the order that sorts pairs by their coordinates, whatever order they came in."""
    return np.lexsort(np.column_stack([target, source]).T)


def principal_spreads(points: Points) -> NDArray[np.float64]:
    """Return the RMS extent of points of shape (n, 3) along their principal axes, largest first."""
    # Eigenvalues of the 3x3 scatter would square the ratio and lose a thin axis: use the SVD.
    spreads = np.zeros(3)
    if not len(points):
        return spreads
    centred = points - points.mean(axis=0)
    values = np.linalg.svd(centred, compute_uv=False) / np.sqrt(len(points))
    spreads[: len(values)] = values
    return spreads


def are_coplanar(points: Points) -> bool:
    """Tell whether points of shape (n, 3) lie in a plane to within rounding."""
    spreads = principal_spreads(points)
    return bool(spreads[2] <= _floor(points, spreads))


def are_mirrored(source: Points, target: Points) -> bool:
    """Tell whether a mirror image of `source` fits `target` far better than `source` does.

    A mirrored frame (left-handed axes, a flipped height) has no proper rotation that fits. Needs
    four points that are not coplanar: a plane fits its own mirror image.
    """
    if len(source) < 4 or are_coplanar(source) or are_coplanar(target):
        return False
    mirror = source * [-1.0, 1.0, 1.0]
    return _misfit(mirror, target) < 0.1 * _misfit(source, target)


def refuse_lines(source: Points, target: Points) -> None:
    """Raise DegeneratePicksError unless both point sets spread in two directions.

    Parameters
    ----------
    source, target : ndarray of shape (n, 3)
        Source units and metres.
    """
    for frame, points, unit in (("source", source, "source units"), ("target", target, "m")):
        spreads = principal_spreads(points)
        floor = _floor(points, spreads)
        if len(points) < 3 or spreads[1] <= floor:
            listed = ", ".join(f"{spread:.3g}" for spread in spreads)
            message = (
                f"{len(points)} picks spread {listed} {unit} along the principal axes of the "
                f"{frame} frame: they lie on a line or in one place, so the rotation about it is "
                f"not known. The second must exceed {max(floor, 1e-12):.2g} {unit}, and at least "
                f"three picks are needed. Add a pick well off the line."
            )
            raise DegeneratePicksError(message)


def check_pairs(
    source: Points, target: Points, weights: NDArray[np.float64] | None
) -> tuple[Points, Points, NDArray[np.float64]]:
    """Return the pairs as float64 with weights filled in, or raise ValueError.

    Parameters
    ----------
    source, target : array_like of shape (n, 3)
    weights : array_like of shape (n,) or None
        Equal weights if None.
    """
    source, target = np.asarray(source, np.float64), np.asarray(target, np.float64)
    if source.shape != target.shape or source.ndim != 2 or source.shape[1] != 3:
        message = f"source {source.shape} and target {target.shape} must both have shape (n, 3)."
        raise ValueError(message)
    weights = np.ones(len(source)) if weights is None else np.asarray(weights, np.float64)
    if weights.shape != (len(source),) or not (np.isfinite(weights) & (weights > 0)).all():
        message = f"weights {weights.shape} must be {len(source)} finite numbers above zero."
        raise ValueError(message)
    bad = np.flatnonzero(~np.isfinite(np.column_stack([source, target])).all(axis=1))
    if len(bad):
        message = f"pairs {bad.tolist()} hold NaN or infinite coordinates; leave them out."
        raise ValueError(message)
    return source, target, weights


def _floor(points: Points, spreads: NDArray[np.float64]) -> float:
    # The spacing of float64 at the coordinates' size is noise that nobody picked.
    rounding = 64 * float(np.spacing(np.abs(points).max(initial=0.0)))
    return max(LINE * float(spreads[0]), rounding)


def _misfit(source: Points, target: Points) -> float:
    fit = umeyama(source, target)
    return float(np.sqrt(((target - fit(source)) ** 2).sum(axis=1).mean()))
