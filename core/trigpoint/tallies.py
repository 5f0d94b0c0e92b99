"""Tallies of distances by group and zone: points, squares, and hits within each threshold."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

Tallies = NDArray[np.float64]


def tally(
    distances: NDArray[np.float64],
    zones: NDArray[np.intp],
    groups: NDArray[np.intp],
    *,
    shape: tuple[int, int],
    within: Sequence[float],
    weights: NDArray[np.float64] | None = None,
) -> Tallies:
    """Count points and hits, and sum squares, in every group and zone.

    Parameters
    ----------
    distances : ndarray of shape (n,)
        Metres.
    zones, groups : ndarray of shape (n,)
        Each point's zone and group, from 0.
    shape : tuple of int
        How many groups and zones there are.
    within : sequence of float
        Thresholds in metres; a hit is ``<=``.
    weights : ndarray of shape (n,), optional
        How many points each stands for; 1 if omitted.

    Returns
    -------
    ndarray of shape (groups, 1 + zones, 2 + thresholds)
        All zones together first. Points, sum of squared distances, hits within each threshold.

    Examples
    --------
    >>> zones, groups = np.array([0, 1, 1]), np.array([0, 0, 0])
    >>> found = tally(np.array([0.1, 0.2, 2.0]), zones, groups, shape=(1, 2), within=[0.5])
    >>> found[0, :, [0, 2]].T.tolist()
    [[3.0, 2.0], [1.0, 1.0], [2.0, 1.0]]
    """
    cells = groups * shape[1] + zones
    columns = [None, distances**2, *(distances <= threshold for threshold in within)]
    found = np.empty((*shape, len(columns)))
    for k, column in enumerate(columns):
        amount = weights
        if column is not None:
            amount = column.astype(np.float64) if weights is None else column * weights
        total = np.bincount(cells, amount, minlength=shape[0] * shape[1])
        found[:, :, k] = total.reshape(shape)
    return np.concatenate([found.sum(axis=1, keepdims=True), found], axis=1)


def tally_halves(
    distances: NDArray[np.float64],
    zones: NDArray[np.intp],
    weights: NDArray[np.float64],
    count: int,
    within: Sequence[float],
) -> Tallies:
    """Tally the even and the odd columns of each row of distances (m, n).

    `zones` is of shape (m, n) and `count` is how many there are; points in a column share a weight
    (n,).

    Returns
    -------
    ndarray of shape (m, 2, 1 + zones, 2 + thresholds)
    """
    rows, points = distances.shape
    groups = 2 * np.arange(rows)[:, None] + np.arange(points) % 2
    found = tally(
        distances.ravel(),
        zones.ravel(),
        groups.ravel(),
        shape=(2 * rows, count),
        within=within,
        weights=np.tile(weights, rows),
    )
    return found.reshape(rows, 2, *found.shape[1:])


def measures(tallies: Tallies) -> NDArray[np.float64]:
    """Return mean squares in m² and shares in percent from tallies (..., 2 + t): (..., 1 + t).

    NaN where there are no points.
    """
    with np.errstate(invalid="ignore"):
        means: NDArray[np.float64] = tallies[..., 1:] / tallies[..., :1]
    means[..., 1:] *= 100
    return means
