"""Points seen from afar along an axis: a true-scale orthographic z-buffer, without OpenGL."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from trigpoint.similarity import Points

Side = Literal["north", "east", "south", "west", "above"]

# For each side: what runs to the right, what runs up, and what runs towards the viewer, as axis
# and sign. From the north, east lies to the left.
_FRAMES: dict[Side, tuple[tuple[int, int], tuple[int, int], tuple[int, int]]] = {
    "north": ((0, -1), (2, 1), (1, 1)),
    "east": ((1, 1), (2, 1), (0, 1)),
    "south": ((0, 1), (2, 1), (1, -1)),
    "west": ((1, -1), (2, 1), (0, -1)),
    "above": ((0, 1), (1, 1), (2, 1)),
}


@dataclass(frozen=True, slots=True, eq=False)
class Splat:
    """Which point is seen at each pixel.

    Attributes
    ----------
    index : ndarray of shape (height, width)
        Position of the point seen, the top row first; -1 where there is none.
    depth : ndarray of shape (height, width)
        How near it is to the viewer, in metres along the line of sight; -inf where there is none.
    """

    index: NDArray[np.int64]
    depth: NDArray[np.float64]


def extent(points: Points, side: Side) -> NDArray[np.float64]:
    """Return where points lie in a view: (left, bottom, right, top) in metres.

    Examples
    --------
    >>> extent(np.array([[0.0, 5.0, 1.0], [2.0, 7.0, 9.0]]), "north").tolist()
    [-2.0, 1.0, 0.0, 9.0]
    """
    right, up, _ = _seen(points, side)
    return np.array([right.min(), up.min(), right.max(), up.max()]) + 0.0  # no negative zero


def pixels_of(window: NDArray[np.float64], pixel: float) -> tuple[int, int]:
    """Return how many pixels a window is wide and high."""
    width, height = np.ceil((window[2:] - window[:2]) / pixel - 1e-9).astype(int)
    return max(1, int(width)), max(1, int(height))


def splat(
    points: Points,
    side: Side,
    *,
    window: NDArray[np.float64],
    pixel: float,
    size: float,
) -> Splat:
    """Find the point nearest to the viewer at every pixel.

    Parameters
    ----------
    points : ndarray of shape (n, 3)
        Easting, northing, height in metres, about any origin.
    side : str
        Where the viewer stands.
    window : ndarray of shape (4,)
        left, bottom, right, top, as `extent` gives them. A point on its lower or left edge is in.
    pixel : float
        Edge of a pixel in metres.
    size : float
        Edge in metres of the square that a point covers; never under a pixel.

    Returns
    -------
    Splat
        Where two points are equally near the first one is seen, whatever the number of threads.
    """
    right, up, towards = _seen(points, side)
    width, height = pixels_of(window, pixel)
    column = np.floor((right - window[0]) / pixel + 1e-9).astype(np.int64)
    # Rows count from the top, and a point on the lower edge belongs to the last one.
    row = height - 1 - np.floor((up - window[1]) / pixel + 1e-9).astype(np.int64)
    inside = np.flatnonzero((column >= 0) & (column < width) & (row >= 0) & (row < height))
    flat = row[inside] * width + column[inside]
    depth = np.full(height * width, -np.inf)
    np.maximum.at(depth, flat, towards[inside])
    # Of those equally near the first is seen: no order of writing decides.
    front = towards[inside] == depth[flat]
    index = np.full(height * width, len(points), np.int64)
    np.minimum.at(index, flat[front], inside[front])
    index[index == len(points)] = -1
    seen = Splat(index.reshape(height, width), depth.reshape(height, width))
    return grown(seen, max(1, int(np.ceil(size / pixel - 1e-9))))


def grown(seen: Splat, edge: int) -> Splat:
    """Let every point cover a square of `edge` pixels, behind those that are nearer."""
    index, depth = seen.index, seen.depth
    for _ in range(2):  # along the columns, then along the rows
        index, depth = _stretched(index.T, depth.T, edge)
    return Splat(index, depth)


def _seen(points: Points, side: Side) -> tuple[NDArray[np.float64], ...]:
    return tuple(sign * points[:, axis] for axis, sign in _FRAMES[side])


def _stretched(
    index: NDArray[np.int64], depth: NDArray[np.float64], edge: int
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Find the nearest of `edge` rows at every row: pairs of rows, pairs of those, and so on."""
    length = len(index)
    index = np.pad(index, ((edge, edge), (0, 0)), constant_values=-1)
    depth = np.pad(depth, ((edge, edge), (0, 0)), constant_values=-np.inf)
    width = 1
    while width < edge:
        shift = min(width, edge - width)
        nearer = depth[shift:] > depth[:-shift]
        index = np.where(nearer, index[shift:], index[:-shift])
        depth = np.where(nearer, depth[shift:], depth[:-shift])
        width += shift
    first = 1 + (edge - 1) // 2
    return index[first : first + length], depth[first : first + length]
