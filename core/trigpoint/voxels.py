"""One lattice for all clouds, and the centroids of its cells, streamed."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

from trigpoint.cloud import PointCloud
from trigpoint.errors import CloudError, RegionError

# Coordinates on a cell's edge, to within this share of a cell, belong to the cell above it.
EDGE = 1e-6
# Offsets in a cell are summed as whole multiples of 2**-STEPS of the cell (0.02 nm at 0.10 m):
# sums of integers are exact, so no order of points or chunks can change a bit of a centroid.
STEPS = 32
# Bits of a cell's key: easting, northing, height, and one that tells two halves of a cloud apart.
BITS = (21, 21, 20)
# Cells that wait before they are merged into those already found.
PENDING = 4_000_000
# Cells merged at a time, about, and the step of the sample that finds where to part them.
PIECE, STRIDE = 2**17, 2**9

Counts = NDArray[np.int64]


@dataclass(frozen=True, slots=True, eq=False)
class Lattice:
    """Cells ``floor(coordinate / voxel + 1e-6)`` in absolute coordinates, numbered about an origin.

    The origin only says about where the numbering starts; it moves no cell's edge.

    Attributes
    ----------
    voxel : float
        Edge of a cell in metres, above zero.
    origin : ndarray of shape (3,)
        Metres. Centroids are expressed about it.
    """

    voxel: float
    origin: NDArray[np.float64]

    def __post_init__(self) -> None:
        """Refuse a cell that has no size."""
        if not (math.isfinite(self.voxel) and self.voxel > 0):
            message = f"The voxel is {self.voxel} m; it must be above zero."
            raise RegionError(message)

    def split(self, origin: NDArray[np.float64]) -> tuple[list[int], NDArray[np.float64]]:
        """Return the cell that holds a position, and how far into it the position lies, in metres.

        Exact whatever the size of the coordinates: the voxel is the decimal that the user wrote,
        not the binary number near it.
        """
        voxel = Fraction(repr(float(self.voxel)))
        exact = [Fraction(float(value)) for value in origin]
        cells = [math.floor(value / voxel) for value in exact]
        rest = [float(value - cell * voxel) for value, cell in zip(exact, cells, strict=True)]
        return cells, np.array(rest)


@dataclass(frozen=True, slots=True, eq=False)
class Cells:
    """Occupied cells of a lattice, with exact sums over their points.

    Attributes
    ----------
    keys : ndarray of shape (m,)
        int64, ascending: easting, then northing, then height, then half.
    counts : ndarray of shape (m,)
        int64, points in each cell.
    sums : list of three ndarray of shape (m,)
        int64, sums of the points' offsets in the cell, in ``2**-32`` of a cell.
    """

    keys: NDArray[np.int64]
    counts: Counts
    sums: list[Counts]

    def __len__(self) -> int:
        """Count the cells."""
        return len(self.keys)

    def __getitem__(self, index: slice | NDArray[np.bool_]) -> Cells:
        """Keep some cells."""
        return Cells(self.keys[index], self.counts[index], [total[index] for total in self.sums])


@dataclass(frozen=True, slots=True, eq=False)
class Voxels:
    """A thinned cloud: the centroid of each occupied cell, sorted along the lattice.

    Attributes
    ----------
    cloud : PointCloud
        About the lattice's origin.
    counts : ndarray of shape (m,)
        int64, how many points each stands for.
    """

    cloud: PointCloud
    counts: Counts

    def __len__(self) -> int:
        """Count the voxels."""
        return len(self.cloud)


def thin(chunks: Iterable[PointCloud], lattice: Lattice) -> Voxels:
    """Replace the points of each cell by their centroid.

    Parameters
    ----------
    chunks : iterable of PointCloud
        About any origins, in any order; neither chunks nor order change a bit of the result.
    lattice : Lattice

    Returns
    -------
    Voxels

    Raises
    ------
    CloudError
        If a coordinate is not finite, or a point lies more cells from the lattice's origin than
        can be numbered: 2**20 in plan, 2**19 in height.

    Examples
    --------
    >>> from trigpoint.cloud import cloud_from
    >>> cloud = cloud_from([[0.02, 0.02, 0], [0.04, 0.06, 0], [0.31, 0, 0]])
    >>> voxels = thin([cloud], Lattice(0.1, np.zeros(3)))
    >>> voxels.cloud.xyz.round(9).tolist(), voxels.counts.tolist()
    ([[0.03, 0.04, 0.0], [0.31, 0.0, 0.0]], [2, 1])
    """
    return centroids(gather(group(chunk, lattice) for chunk in chunks), lattice)


def group(cloud: PointCloud, lattice: Lattice, *, half: NDArray[np.bool_] | None = None) -> Cells:
    """Sum the points of one chunk cell by cell.

    Parameters
    ----------
    cloud : PointCloud
    lattice : Lattice
    half : ndarray of shape (n,), optional
        Tells two halves of the cloud apart: each cell is then summed for either half on its own.
    """
    origin_cell, _ = lattice.split(lattice.origin)
    chunk_cell, rest = lattice.split(cloud.origin)
    key = np.zeros(len(cloud), np.int64)
    offsets = []
    for axis, bits in enumerate(BITS):
        position = cloud.xyz[:, axis] + rest[axis]
        position /= lattice.voxel
        cell = np.floor(position + EDGE)
        shift = chunk_cell[axis] - origin_cell[axis] + 2 ** (bits - 1)
        _refuse_far(cell, shift, bits, lattice)
        position -= cell
        position *= 2.0**STEPS
        offsets.append(np.rint(position, out=position).astype(np.int64))
        key <<= bits
        key += cell.astype(np.int64) + shift
    key <<= 1
    if half is not None:
        key += half
    return _sorted_sums(key, None, offsets)


def gather(parts: Iterable[Cells]) -> list[Cells]:
    """Merge the cells of many chunks; memory follows the cells, not the points.

    Returns
    -------
    list of Cells
        Each ascending, and one after the other.
    """
    merged: list[Cells] = []
    waiting: list[Cells] = []
    for part in parts:
        waiting.append(part)
        if _size(waiting) > max(PENDING, _size(merged) // 2):
            runs, merged, waiting = merged + waiting, [], []
            merged = list(_merge(runs))
    return list(_merge(merged + waiting))


def centroids(pieces: list[Cells], lattice: Lattice, *, half: int | None = None) -> Voxels:
    """Return the centroid of every cell, in the order of the lattice.

    Parameters
    ----------
    pieces : list of Cells
        As `gather` returns them.
    lattice : Lattice
    half : int, optional
        0 or 1: of that half's points only. By default of all points.
    """
    size = sum(_count(piece, half) for piece in pieces)
    xyz, counts = np.empty((size, 3)), np.empty(size, np.int64)
    _, rest = lattice.split(lattice.origin)
    start = 0
    for piece in pieces:
        cells = _whole(piece) if half is None else piece[(piece.keys & 1) == half]
        rows = slice(start, start := start + len(cells))
        counts[rows] = cells.counts
        shift = 1  # past the bit of the halves
        for axis in (2, 1, 0):
            bits = BITS[axis]
            cell = (cells.keys >> shift) & (2**bits - 1)
            shift += bits
            share = cells.sums[axis] / (cells.counts * 2.0**STEPS)
            xyz[rows, axis] = (share + (cell - 2 ** (bits - 1))) * lattice.voxel - rest[axis]
    return Voxels(PointCloud(xyz, lattice.origin), counts)


def _merge(runs: list[Cells]) -> Iterator[Cells]:
    # Range by range: what is being sorted stays in the processor's cache, and what has been is
    # freed.
    if not runs:
        return
    sample = np.sort(np.concatenate([run.keys[::STRIDE] for run in runs]))
    step = PIECE // STRIDE
    for bound in [*(sample[step::step] & ~1), np.iinfo(np.int64).max]:
        cuts = [int(np.searchsorted(run.keys, bound)) for run in runs]
        parts = [run[:cut] for run, cut in zip(runs, cuts, strict=True)]
        runs = [run[cut:] for run, cut in zip(runs, cuts, strict=True) if cut < len(run)]
        yield _sorted_sums(
            np.concatenate([part.keys for part in parts]),
            np.concatenate([part.counts for part in parts]),
            [np.concatenate([part.sums[axis] for part in parts]) for axis in range(3)],
        )


def _size(runs: list[Cells]) -> int:
    return sum(map(len, runs))


def _whole(cells: Cells) -> Cells:
    # Without its last bit a key forgets the half.
    keys = cells.keys & ~1
    starts = _starts(keys)
    sums = [np.add.reduceat(total, starts) for total in cells.sums]
    return Cells(keys[starts], np.add.reduceat(cells.counts, starts), sums)


def _count(cells: Cells, half: int | None) -> int:
    if half is None:
        return len(_starts(cells.keys & ~1))
    return int(np.count_nonzero((cells.keys & 1) == half))


def _starts(keys: NDArray[np.int64]) -> NDArray[np.intp]:
    return np.flatnonzero(np.concatenate([[True], keys[1:] != keys[:-1]])[: len(keys)])


def _sorted_sums(key: NDArray[np.int64], counts: Counts | None, values: list[Counts]) -> Cells:
    order = np.argsort(key)
    key = key[order]
    starts = _starts(key)
    # A chunk's points count one each.
    points = (
        np.diff(starts, append=len(key))
        if counts is None
        else np.add.reduceat(counts[order], starts)
    )
    sums = [np.add.reduceat(value[order], starts) for value in values]
    return Cells(key[starts], points, sums)


def _refuse_far(cell: NDArray[np.float64], shift: int, bits: int, lattice: Lattice) -> None:
    if not len(cell):
        return
    low, high = float(cell.min()) + shift, float(cell.max()) + shift
    if not (math.isfinite(low) and math.isfinite(high)):
        message = "A coordinate is NaN or infinite; leave such points out."
        raise CloudError(message)
    if low < 0 or high >= 2**bits:
        reach = max(abs(low - 2 ** (bits - 1)), abs(high - 2 ** (bits - 1))) * lattice.voxel
        message = (
            f"A point lies {reach:.6g} m from the lattice's origin along one axis; with voxels of "
            f"{lattice.voxel:g} m the lattice reaches {2 ** (bits - 1) * lattice.voxel:.6g} m. "
            "Crop the cloud to the reference (a margin or a region), or take a larger voxel."
        )
        raise CloudError(message)
