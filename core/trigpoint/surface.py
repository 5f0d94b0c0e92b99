"""A target surface for ICP: centred points, the tree over them, their normals."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from trigpoint.errors import RefinementError
from trigpoint.nearest import Tree
from trigpoint.similarity import Points

SAMPLE = 50_000  # source points that take part in ICP: more cost time and change little
NEIGHBOURS = 20  # target points that make a normal
BLOCK = 65_536  # normals made at once: bounds their memory


class Surface:
    """A target about its centroid: its tree grown once, its normals made where they are needed.

    Parameters
    ----------
    points : ndarray of shape (n, 3)
        Absolute target coordinates, metres; at least 20 points.

    Attributes
    ----------
    centre : ndarray of shape (3,)
        Centroid, absolute.
    points : ndarray of shape (n, 3)
        About the centroid, in an order that does not depend on the one they came in.

    Raises
    ------
    RefinementError
        If the points are fewer than 20 or hold NaN.
    """

    def __init__(self, points: Points) -> None:
        points = in_order(points)
        if len(points) < NEIGHBOURS:
            message = f"The target has {len(points)} points; ICP needs {NEIGHBOURS} or more."
            raise RefinementError(message)
        # About the first point before averaging: a mean taken at UTM coordinates loses digits.
        self.centre = points[0] + (points - points[0]).mean(axis=0)
        self.points = points - self.centre
        self._tree = Tree(self.points)
        self._neighbourhoods = cKDTree(self.points)
        self._normals = np.full(points.shape, np.nan)

    def nearest(self, points: Points) -> tuple[NDArray[np.float64], NDArray[np.intp]]:
        """Return the distance to, and the row of, the nearest target point of each point."""
        return self._tree.query(points)

    def normals(self, rows: NDArray[np.intp]) -> Points:
        """Return the unit normals at some rows of `points`, by PCA of 20 neighbours."""
        missing = np.unique(rows[np.isnan(self._normals[rows, 0])])
        for start in range(0, len(missing), BLOCK):
            block = missing[start : start + BLOCK]
            _, neighbours = self._neighbourhoods.query(self.points[block], k=NEIGHBOURS, workers=-1)
            patches = self.points[neighbours]
            patches -= patches.mean(axis=1, keepdims=True)
            scatter = np.einsum("nki,nkj->nij", patches, patches)
            # svd, here and in `refinement`: in the OpenBLAS of older NumPys the bits of eigh depend
            # on the number of threads. Of such matrices it gives the same, largest first.
            self._normals[block] = np.linalg.svd(scatter)[0][:, :, 2]
        return self._normals[rows]


def in_order(points: Points) -> Points:
    """Return points of shape (n, 3) in an order that does not depend on the one they came in.

    Neighbours in space become neighbours in memory, which makes tree queries several times faster.

    Raises
    ------
    RefinementError
        If a coordinate is NaN or infinite.
    ValueError
        If the shape is not (n, 3).
    """
    points = np.asarray(points, np.float64)
    if points.ndim != 2 or points.shape[1] != 3:
        message = f"points {points.shape} must have shape (n, 3)."
        raise ValueError(message)
    bad = int((~np.isfinite(points).all(axis=1)).sum())
    if bad:
        message = f"{bad} of {len(points)} points hold NaN or infinite coordinates; drop them."
        raise RefinementError(message)
    if not len(points):
        return points
    low, extent = points.min(axis=0), np.ptp(points, axis=0).max()
    cells = np.floor((points - low) / max(extent, 1e-9) * 31.999 + 1e-6).astype(np.uint16)
    cell = (cells[:, 0] << 10) | (cells[:, 1] << 5) | cells[:, 2]
    return points[np.lexsort((points[:, 2], points[:, 1], points[:, 0], cell))]


def thinned(ordered: Points) -> Points:
    """Keep every k-th of some points in order, so that at most 50,000 are left."""
    return ordered[:: max(1, -(-len(ordered) // SAMPLE))]
