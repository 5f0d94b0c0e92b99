"""Exact nearest neighbours between two clouds."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from trigpoint.similarity import Points

try:
    from pykdtree.kdtree import KDTree
except ImportError:  # QGIS's own Python may not have it: SciPy gives the same answer, later
    KDTree = None  # type: ignore[assignment, misc]

# The coarse lattice that puts points in order has 2**BITS steps an axis: 3 * BITS must fit uint16,
# whose stable argsort is a radix sort.
BITS = 5
# Neighbours in a file are neighbours in space if at most this share of steps leaves a coarse cell.
JUMPS = 0.5
# Looked at to judge a cloud before ordering it.
SAMPLE = 10_000


class Tree:
    """A search tree over a target cloud, built once and asked often.

    Parameters
    ----------
    target : ndarray of shape (m, 3)
        Any order; metres. Not modified, and not to be modified while the tree lives.

    Raises
    ------
    ValueError
        If the shape is wrong or a coordinate is not finite.
    """

    __slots__ = ("_order", "_tree", "target")

    def __init__(self, target: Points) -> None:
        self.target = _checked(target, "target")
        self._order = lattice_order(self.target)
        if _is_repetitive(self.target):
            self._order = _first_of_equals(self.target)
        points = self.target if self._order is None else np.take(self.target, self._order, axis=0)
        self._tree = _build(points) if len(points) else None

    def query(self, source: Points) -> tuple[NDArray[np.float64], NDArray[np.intp]]:
        """Find the nearest target point of every source point, on all cores.

        Parameters
        ----------
        source : ndarray of shape (n, 3)
            In the target's frame, about the same origin.

        Returns
        -------
        distances : ndarray of shape (n,)
            Exact and Euclidean; infinite where the target is empty.
        indices : ndarray of shape (n,)
            Positions in `target`; -1 where it is empty. Of equally near points, any one.
        """
        source = _checked(source, "source")
        if self._tree is None or not len(source):
            return np.full(len(source), np.inf), np.full(len(source), -1, np.intp)
        order = lattice_order(source)
        if order is None:
            distances, found = _query(self._tree, source)
        else:
            distances, found = np.empty(len(source)), np.empty(len(source), np.intp)
            distances[order], found[order] = _query(self._tree, np.take(source, order, axis=0))
        return distances, found if self._order is None else self._order[found]


def nearest(source: Points, target: Points) -> NDArray[np.float64]:
    """Measure from every source point to the nearest target point.

    Parameters
    ----------
    source : ndarray of shape (n, 3)
    target : ndarray of shape (m, 3)
        Metres, both about the same origin, in any order. Points that come sorted along a lattice,
        as `trigpoint.voxels` leaves them, are answered fastest.

    Returns
    -------
    ndarray of shape (n,)
        Exact Euclidean distances, never capped; infinite where the target is empty.

    Raises
    ------
    ValueError
        If a shape is wrong or a coordinate is not finite.

    Examples
    --------
    >>> nearest(np.array([[0.0, 0, 0], [0, 0, 5]]), np.array([[3.0, 4, 0], [0, 0, 1]])).tolist()
    [1.0, 4.0]
    """
    return Tree(target).query(source)[0]


def lattice_order(points: Points) -> NDArray[np.intp] | None:
    """Return an order in which neighbours in the array are neighbours in space, or None if it is.

    A tree asked about points that jump about the cloud misses the processor's cache at every
    step, which costs up to nine times as long as an orderly walk.

    Parameters
    ----------
    points : ndarray of shape (n, 3)
    """
    if len(points) < 2:
        return None
    # Between percentiles of a sample: one stray point must not put all others in one cell.
    sample = _sample(points)
    low, high = np.quantile(sample, [0.01, 0.99], axis=0)
    steps = 2**BITS
    cell = np.zeros(len(points), np.uint16)
    for axis in range(3):
        step = points[:, axis] - low[axis]
        step *= steps / max(high[axis] - low[axis], 1e-9)  # a nanometre: a plane has no thickness
        cell <<= BITS
        cell |= np.clip(step, 0, steps - 1, out=step).astype(np.uint16)
    if np.count_nonzero(cell[1:] != cell[:-1]) <= JUMPS * len(cell):
        return None
    return np.argsort(cell, kind="stable")


def _is_repetitive(points: Points) -> bool:
    # No tree can part equal points: thousands in one place, as scanners write for pulses that never
    # came back, would be searched one by one. A sample shows any pile large enough to matter.
    sample = _sample(points)
    return len(np.unique(sample, axis=0)) < len(sample)


def _first_of_equals(points: Points) -> NDArray[np.intp]:
    order = np.lexsort(points.T)
    differs = (points[order[1:]] != points[order[:-1]]).any(axis=1)
    first: NDArray[np.intp] = order[np.concatenate([[True], differs])]
    return first


def _sample(points: Points) -> Points:
    return points[:: max(1, len(points) // SAMPLE)]


def _build(points: Points) -> Any:
    return cKDTree(points) if KDTree is None else KDTree(points)


def _query(tree: Any, source: Points) -> tuple[NDArray[np.float64], NDArray[np.intp]]:
    # pykdtree takes every core unasked and has no word for it.
    every_core = {"workers": -1} if isinstance(tree, cKDTree) else {}
    distances, found = tree.query(source, **every_core)
    indices: NDArray[np.intp] = found.astype(np.intp, copy=False)
    return distances, indices


def _checked(points: Points, name: str) -> Points:
    points = np.ascontiguousarray(points, np.float64)
    if points.ndim != 2 or points.shape[1] != 3:
        message = f"{name} has shape {points.shape}; it must be (n, 3)."
        raise ValueError(message)
    bad = len(points) - int(np.count_nonzero(np.isfinite(points).all(axis=1)))
    if bad:
        message = f"{bad} of {len(points)} {name} points are NaN or infinite; leave them out."
        raise ValueError(message)
    return points
