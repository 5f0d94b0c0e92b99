"""A comparison seen from above: one value for each cell of a plan grid, north up."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

# A grid of more cells than this shows no more on a screen, and fills the memory.
MOST_CELLS = 50_000_000
# The error's colours end at this share of the cells, so that a few outliers do not hide the rest.
CLIP_PCT = 98


@dataclass(frozen=True, eq=False)
class PlanGrid:
    """Square cells over easting and northing.

    Attributes
    ----------
    west, north : float
        Of the upper left corner, metres.
    size : float
        Edge of a cell, metres.
    shape : tuple of int
        Rows from the north and columns from the west.
    """

    west: float
    north: float
    size: float
    shape: tuple[int, int]

    def cell_of(self, points: NDArray[np.float64]) -> NDArray[np.intp]:
        """Return the position of each point's cell in the flattened grid."""
        rows, columns = self.shape
        column = np.floor((points[:, 0] - self.west) / self.size).astype(np.intp)
        row = np.floor((self.north - points[:, 1]) / self.size).astype(np.intp)
        return np.clip(row, 0, rows - 1) * columns + np.clip(column, 0, columns - 1)

    def mean(self, points: NDArray[np.float64], values: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the mean of the values in each cell, NaN where there is none."""
        cells, count = self.cell_of(points), self.shape[0] * self.shape[1]
        number = np.bincount(cells, minlength=count)
        total = np.bincount(cells, weights=values, minlength=count)
        means = np.full(count, np.nan)
        np.divide(total, number, out=means, where=number > 0)
        return means.reshape(self.shape)


def grid_over(points: NDArray[np.float64], size: float) -> PlanGrid:
    """Lay a grid over points; its lines are multiples of the cell's size.

    Raises
    ------
    ValueError
        If the size is not above zero, or the grid would be too large.
    """
    if not size > 0:
        message = f"The cells of the map are {size:g} m; they must be larger than zero."
        raise ValueError(message)
    low, high = points[:, :2].min(axis=0), points[:, :2].max(axis=0)
    west, south = (np.floor(low / size) * size).tolist()
    columns, rows = (np.floor((high - [west, south]) / size).astype(int) + 1).tolist()
    if rows * columns > MOST_CELLS:
        message = f"Cells of {size:g} m make a map of {rows:,} x {columns:,}: take larger ones."
        raise ValueError(message)
    return PlanGrid(west, south + rows * size, size, (rows, columns))


def completeness_pct(
    points: NDArray[np.float64], distances: NDArray[np.float64], grid: PlanGrid, within: float
) -> NDArray[np.float64]:
    """Share of the reference's voxels in each cell that the reconstruction comes near, percent.

    Parameters
    ----------
    points : ndarray of shape (n, 3)
        Of the reference, metres.
    distances : ndarray of shape (n,)
        From each to the reconstruction; not finite where there is none.
    grid : PlanGrid
    within : float
        Metres.
    """
    return grid.mean(points, np.where(np.nan_to_num(distances, nan=np.inf) <= within, 100.0, 0.0))


def rmse_m(
    points: NDArray[np.float64], distances: NDArray[np.float64], grid: PlanGrid
) -> NDArray[np.float64]:
    """RMSE in each cell of distances from the reconstruction's points to the reference, metres."""
    return np.sqrt(grid.mean(points, np.where(np.isfinite(distances), distances, np.nan) ** 2))


def most(values: NDArray[np.float64]) -> float:
    """Return where the colours of an error end: two digits, which a legend can show."""
    seen = values[np.isfinite(values)]
    clipped = float(np.percentile(seen, CLIP_PCT)) if len(seen) else 0.0
    return float(f"{clipped:.2g}") or 1.0
