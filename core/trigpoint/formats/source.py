"""What passes between the door and a format: `Source`, `Chunk`, `Plan`."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pyproj
from numpy.typing import NDArray

from trigpoint.cautions import Caution
from trigpoint.errors import CloudError
from trigpoint.similarity import Points

Attributes = dict[str, NDArray[np.generic]]


class Box(NamedTuple):
    """An axis-parallel box, both ends inclusive, in the file's own units; shapes (3,)."""

    low: NDArray[np.float64]
    high: NDArray[np.float64]


class Chunk(NamedTuple):
    """Some points as a file has them: absolute, in the file's own units.

    The arrays are the receiver's to change. Points that the file marks as invalid are NaN.
    `faces` index the points of the same chunk, so a mesh comes in one chunk.
    """

    xyz: Points
    attributes: Attributes
    faces: NDArray[np.int64] | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Source:
    """An opened file: what its header says, and the way to its points.

    Attributes
    ----------
    format : str
        For people.
    chunks : callable
        ``chunks(size, attributes, box)`` reads the points. Without `attributes` only coordinates
        come; `box` lets a format with an index skip what is outside, and promises nothing.
    attributes : tuple of str
    extent : Box or None
        What the header says; None if it says nothing.
    points : int or None
    step : ndarray of shape (3,) or None
        Between neighbouring coordinates that the file can tell apart; None for floating point.
    is_single : bool
        Coordinates are float32.
    crs : pyproj.CRS or None
    scans : int
    cautions : tuple of Caution
    """

    format: str
    chunks: Callable[[int, bool, Box | None], Iterator[Chunk]]
    attributes: tuple[str, ...]
    extent: Box | None = None
    points: int | None = None
    step: NDArray[np.float64] | None = None
    is_single: bool = False
    crs: pyproj.CRS | None = None
    scans: int = 1
    cautions: tuple[Caution, ...] = ()


@dataclass(frozen=True, slots=True, eq=False)
class Plan:
    """What a format must know before it writes the first point.

    Attributes
    ----------
    crs : pyproj.CRS or None
    extent : Box or None
        Of all points, where they are known beforehand.
    like : Path or None
        The file that the points came from: how it stored them is a pattern to follow.
    """

    crs: pyproj.CRS | None = None
    extent: Box | None = None
    like: Path | None = None


def axes_of(names: tuple[str, ...], path: Path) -> tuple[str, str, str]:
    """Find the coordinates among the columns of a table: x, y, z or X, Y, Z."""
    for axes in (("x", "y", "z"), ("X", "Y", "Z")):
        if set(axes) <= set(names):
            return axes
    message = f"{path.name} has {', '.join(names) or 'no columns'}: a point cloud needs x, y and z."
    raise CloudError(message)


def cut_short(path: Path, held: int, promised: int, what: str = "points") -> str:
    """Say that a file ends before all that its header promises, and what would do."""
    return (
        f"{path.name} is cut short: it holds {held:,} of the {promised:,} {what} that its header "
        f"promises. Copy or export it again."
    )


def chunk_of_records(
    records: NDArray[np.void], axes: tuple[str, str, str], *, attributes: bool
) -> Chunk:
    """Copy structured records, of any byte order, into a chunk."""
    xyz = np.empty((len(records), 3))
    for column, axis in enumerate(axes):
        xyz[:, column] = records[axis]
    names = [name for name in records.dtype.names or () if name not in axes]
    return Chunk(xyz, {name: native(records[name]) for name in names} if attributes else {})


def native(values: NDArray[np.generic]) -> NDArray[np.generic]:
    """Copy values into an array of this machine's byte order."""
    return np.array(values, dtype=values.dtype.newbyteorder("="))


def columns_of(attributes: Attributes) -> Attributes:
    """Spread attributes of shape (n, k) over k columns, for formats that hold plain tables."""
    columns: Attributes = {}
    for name, values in attributes.items():
        if values.ndim == 1:
            columns[name] = values
        else:
            columns |= {f"{name}_{k}": values[:, k] for k in range(values.shape[1])}
    return columns
