"""The covariance of a similarity, carried to points and to its matrix."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from trigpoint.adjustment import MOTION, design_matrix
from trigpoint.similarity import Points, Similarity

CHUNK = 65_536  # rows that stay in the processor's cache; the result does not depend on it


def sigma_at(
    points: Points, centroid: NDArray[np.float64], covariance: NDArray[np.float64]
) -> Points:
    """Return the standard deviation of georeferenced points along the target's axes.

    Parameters
    ----------
    points : ndarray of shape (n, 3)
        In the target frame, metres.
    centroid : ndarray of shape (3,)
        Of the picks, in the target frame.
    covariance : ndarray of shape (7, 7)
        Of the similarity, in the order that `trigpoint.adjustment` states.

    Returns
    -------
    ndarray of shape (n, 3)
        Metres: easting, northing, height.
    """
    variances = _variances(points, centroid, covariance, [(0, 0), (1, 1), (2, 2)])
    # Rounding may leave a zero variance a hair below zero.
    return np.sqrt(np.maximum(variances, 0.0, out=variances), out=variances)


def covariance_at(
    points: Points, centroid: NDArray[np.float64], covariance: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the covariance (n, 3, 3) in m² of georeferenced points; arguments as in `sigma_at`."""
    corner = [(i, j) for i in range(3) for j in range(i, 3)]
    entries = _variances(points, centroid, covariance, corner)
    full = np.empty((len(points), 3, 3))
    for column, (i, j) in enumerate(corner):
        full[:, i, j] = full[:, j, i] = entries[:, column]
    return full


def matrix_covariance(
    similarity: Similarity,
    centroid: NDArray[np.float64],
    covariance: NDArray[np.float64],
    *,
    reference: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Return the covariance of the twelve numbers of ``target = m @ (source - reference) + shift``.

    In the order m11, m12, ... m33, shift: that of py4dgeo's M3C2-EP, which adds the reference to
    the shift afterwards, and so has the same covariance.

    Parameters
    ----------
    similarity : Similarity
        The fit; m is its scale times its rotation.
    centroid, covariance
        As in `sigma_at`.
    reference : ndarray of shape (3,)
        In the source frame.

    Returns
    -------
    ndarray of shape (12, 12)
        Its rank is 7.
    """
    matrix = similarity.scale * similarity.rotation
    # Each column of m is carried like a point, except that it does not move with the centroid.
    columns = design_matrix(matrix.T)
    columns[:, :, 4:] = 0.0
    shift = design_matrix(similarity(reference[None, :]) - centroid)[0]
    motion = np.concatenate([columns.transpose(1, 0, 2).reshape(9, 7), shift])
    full: NDArray[np.float64] = motion @ covariance @ motion.T
    return (full + full.T) / 2


def _variances(
    points: Points,
    centroid: NDArray[np.float64],
    covariance: NDArray[np.float64],
    pairs: list[tuple[int, int]],
) -> Points:
    # Each entry of a point's covariance is a quadratic in its offset: ten coefficients, found
    # once, then a few products per point.
    quadratics = np.einsum("iam,ab,jbn->ijmn", MOTION, covariance, MOTION)
    out = np.empty((len(points), len(pairs)))
    for start in range(0, len(points), CHUNK):
        rows = slice(start, start + CHUNK)
        x, y, z = (np.ascontiguousarray(column) for column in (points[rows] - centroid).T)
        for column, (i, j) in enumerate(pairs):
            q = quadratics[i, j] + quadratics[i, j].T
            out[rows, column] = (
                (q[1, 1] / 2 * x + q[1, 2] * y + q[1, 3] * z + q[0, 1]) * x
                + (q[2, 2] / 2 * y + q[2, 3] * z + q[0, 2]) * y
                + (q[3, 3] / 2 * z + q[0, 3]) * z
                + q[0, 0] / 2
            )
    return out
