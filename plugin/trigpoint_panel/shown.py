"""Shown: the points of a cloud that a scene shows, about an origin near them."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from trigpoint.cloud import PointCloud
from trigpoint.similarity import Points
from trigpoint_panel.layer import localised


class Shown:
    """A cloud, or the part of it that is not hidden; rows always count in the whole cloud.

    Parameters
    ----------
    cloud : PointCloud

    Attributes
    ----------
    origin : ndarray of shape (3,)
    local : ndarray of shape (m, 3)
        float32: the shown points about the origin.
    columns : ndarray of shape (3, m)
        The same by axes: picking asks each for itself, and finds its numbers side by side.
    """

    def __init__(self, cloud: PointCloud) -> None:
        self._cloud = cloud
        self._all, self.origin = localised(cloud)
        self.isolate(None)

    def isolate(self, mask: NDArray[np.bool_] | None) -> None:
        """Show only some of the points; None shows all."""
        self._rows = None if mask is None else np.flatnonzero(mask)
        self.local = self.of(self._all)
        self.columns = np.ascontiguousarray(self.local.T)

    def of(self, values: NDArray[Any]) -> NDArray[Any]:
        """Return those of a cloud's values that belong to shown points."""
        return values if self._rows is None else values[self._rows]

    def row(self, which: int) -> int:
        """Return the row in the cloud of one of the shown points."""
        return which if self._rows is None else int(self._rows[which])

    def coordinates(self, row: int) -> NDArray[np.float64]:
        """Return the absolute coordinates of a point, as precise as they were read."""
        return np.asarray(self._cloud.xyz[row] + self._cloud.origin, np.float64)

    def around(self, row: int, radius: float) -> Points:
        """Return the absolute coordinates of the shown points in a box about a point."""
        (x, y, z), centre = self.columns, self._all[row]
        rows: NDArray[np.intp] = np.flatnonzero(np.abs(x - centre[0]) <= radius)
        rows = rows[np.abs(y[rows] - centre[1]) <= radius]
        rows = rows[np.abs(z[rows] - centre[2]) <= radius]
        rows = rows if self._rows is None else self._rows[rows]
        return np.asarray(self._cloud.xyz[rows] + self._cloud.origin, np.float64)
