"""One lattice for all clouds, and the centroids of its cells, streamed."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from fractions import Fraction
from itertools import chain

import numpy as np
from numpy.typing import NDArray

from trigpoint.cloud import PointCloud
from trigpoint.errors import CloudError, RegionError
from trigpoint.similarity import Points
from trigpoint.threads import worked

# Offsets in a cell are summed as whole multiples of 2**-STEPS of the cell (0.02 nm at 0.10 m):
# sums of integers are exact, so no order of points or chunks can change a bit of a centroid.
STEPS = 32
# Coordinates within a millionth of a cell below its edge belong to it: in those multiples.
EDGE = round(1e-6 * 2**STEPS)
# Bits of a cell's key: easting, northing, height, and one that tells two halves of a cloud apart.
BITS = (21, 21, 20)
# Cells part into slabs of eight across the easting: keys that differ only in their low bits.
SLAB = BITS[1] + BITS[2] + 1 + 3
# Points that wait before they are summed into the cells already found.
PENDING = 12_000_000
# Points handled at a time: arrays this small stay in the processor's cache.
BLOCK = 2**17
# Points or cells summed at a time, about, and the step of the sample that finds where to cut.
PIECE, STRIDE = 2**18, 2**9

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
    """Occupied cells of a lattice with exact sums over their points, or points yet to be summed.

    Attributes
    ----------
    keys : ndarray of shape (m,)
        int64, ordered by easting, northing, height and half. Ascending once summed; until then
        only slab by slab.
    sums : list of three ndarray of shape (m,)
        Unsigned or signed integers: offsets from a millionth of a cell below the cell's low
        corner, in ``2**-32`` of a cell.
    counts : ndarray of shape (m,) or None
        int64, points in each cell; None where each is one point.
    """

    keys: NDArray[np.int64]
    sums: list[NDArray[np.integer]]
    counts: Counts | None = None

    def __len__(self) -> int:
        """Count the cells."""
        return len(self.keys)

    def __getitem__(self, index: slice | NDArray[np.bool_]) -> Cells:
        """Keep some cells."""
        counts = None if self.counts is None else self.counts[index]
        return Cells(self.keys[index], [total[index] for total in self.sums], counts)


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
    parts = chain.from_iterable(group(chunk, lattice) for chunk in chunks)
    return centroids(gather(parts), lattice)


def group(
    cloud: PointCloud, lattice: Lattice, *, half: NDArray[np.bool_] | None = None
) -> list[Cells]:
    """Find the cell of every point of one chunk, and put the points in order slab by slab.

    Parameters
    ----------
    cloud : PointCloud
    lattice : Lattice
    half : ndarray of shape (n,), optional
        Tells two halves of the cloud apart: each cell is then summed for either half on its own.

    Returns
    -------
    list of Cells
        Yet to be summed, one for each block of points.

    Raises
    ------
    CloudError
        As `thin`.
    """
    origin_cell, _ = lattice.split(lattice.origin)
    chunk_cell, rest = lattice.split(cloud.origin)
    lifts = [chunk_cell[axis] - origin_cell[axis] + 2 ** (BITS[axis] - 1) for axis in range(3)]
    blocks = []
    for start in range(0, len(cloud), BLOCK):
        rows = slice(start, start + BLOCK)
        key = np.zeros(len(cloud.xyz[rows]), np.int64)
        offsets = []
        for axis, bits in enumerate(BITS):
            # Whole steps of 2**-STEPS cells: the cell above, the offset in it below.
            position = cloud.xyz[rows, axis] + rest[axis]
            _refuse_far(position, lifts[axis], bits, lattice)
            position *= 2**STEPS / lattice.voxel
            steps = np.rint(position, out=position).astype(np.int64)
            steps += (lifts[axis] << STEPS) + EDGE
            key <<= bits
            key |= steps >> STEPS
            offsets.append(steps.astype(np.uint32))
        key <<= 1
        if half is not None:
            key |= half[rows]
        # Slabs are few, and small integers are sorted in one pass.
        slab = key >> SLAB
        slab -= slab.min()
        order = np.argsort(slab.astype(np.min_scalar_type(slab.max())), kind="stable")
        blocks.append(Cells(key[order], [offset[order] for offset in offsets]))
    return blocks


def gather(parts: Iterable[Cells]) -> list[Cells]:
    """Sum the points of many chunks cell by cell; memory follows the cells, not the points.

    Parameters
    ----------
    parts : iterable of Cells
        Blocks of points, as `group` returns them.

    Returns
    -------
    list of Cells
        Each ascending, and one after the other.
    """
    merged: list[Cells] = []
    waiting: list[Cells] = []
    # Waiting points lie in a few arrays that are used again: of many small ones, made by many
    # threads among others that do not last, the allocator gives little memory back.
    keys, offsets = np.empty(PENDING, np.int64), [np.empty(PENDING, np.uint32) for _ in range(3)]
    points = 0
    for part in parts:
        if points + len(part) > PENDING:
            merged, waiting, points = _merge(merged + waiting), [], 0
        rows = slice(points, points := points + len(part))
        keys[rows] = part.keys
        for offset, own in zip(offsets, part.sums, strict=True):
            offset[rows] = own
        waiting.append(Cells(keys[rows], [offset[rows] for offset in offsets]))
    return _merge(merged + waiting)


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
    _, rest = lattice.split(lattice.origin)

    def work(piece: Cells) -> tuple[Points, Counts]:
        cells = _whole(piece) if half is None else piece[(piece.keys & 1) == half]
        counts = _points(cells)
        weight = counts * 2.0**STEPS
        xyz = np.empty((len(cells), 3))
        shift = 1  # past the bit of the halves
        for axis in (2, 1, 0):
            bits = BITS[axis]
            cell = ((cells.keys >> shift) & (2**bits - 1)) - 2 ** (bits - 1)
            shift += bits
            share = cells.sums[axis] / weight
            share += cell
            xyz[:, axis] = share * lattice.voxel - (rest[axis] + EDGE / 2**STEPS * lattice.voxel)
        return xyz, counts

    size = sum(map(len, pieces))
    xyz, counts, used = np.empty((size, 3)), np.empty(size, np.int64), 0
    for part, points in worked(work, pieces):
        rows = slice(used, used := used + len(part))
        xyz[rows], counts[rows] = part, points
    return Voxels(PointCloud(xyz[:used], lattice.origin), counts[:used])


def _merge(runs: list[Cells]) -> list[Cells]:
    # Range by range: what is being sorted stays in the processor's cache, and ranges can be sorted
    # at the same time. The cells, which last, go to a few large arrays, as waiting points do.
    cuts = _cuts(runs)
    size, used, pieces = sum(map(len, runs)), 0, []
    keys, counts, *sums = (np.empty(size, np.int64) for _ in range(5))

    def work(k: int) -> Cells:
        rows = [slice(cut[k], cut[k + 1]) for cut in cuts]
        return _summed(
            [(run, own) for run, own in zip(runs, rows, strict=True) if own.start < own.stop]
        )

    for piece in worked(work, range(len(cuts[0]) - 1) if cuts else ()):
        rows = slice(used, used := used + len(piece))
        keys[rows], counts[rows] = piece.keys, _points(piece)
        for total, part in zip(sums, piece.sums, strict=True):
            total[rows] = part
        pieces.append(Cells(keys[rows], [total[rows] for total in sums], counts[rows]))
    return pieces


def _cuts(runs: list[Cells]) -> list[list[int]]:
    """Find where to cut each run, so that all are cut at the same keys and between slabs."""
    if not runs:
        return []
    sample = np.sort(np.concatenate([run.keys[::STRIDE] for run in runs]))
    step = PIECE // STRIDE
    bounds = np.unique(sample[step::step] >> SLAB) << SLAB
    return [[0, *np.searchsorted(run.keys, bounds).tolist(), len(run)] for run in runs]


def _summed(parts: list[tuple[Cells, slice]]) -> Cells:
    none = np.empty(0, np.int64)
    keys = np.concatenate([none, *(cells.keys[rows] for cells, rows in parts)])
    order = np.argsort(keys)
    keys = keys[order]
    starts = _starts(keys)
    sums = []
    for axis in range(3):
        values = np.concatenate([none, *(cells.sums[axis][rows] for cells, rows in parts)])
        sums.append(np.add.reduceat(values[order], starts))
    if all(cells.counts is None for cells, _ in parts):
        return Cells(keys[starts], sums, np.diff(starts, append=len(keys)))
    counts = np.concatenate([_points(cells[rows]) for cells, rows in parts])
    return Cells(keys[starts], sums, np.add.reduceat(counts[order], starts))


def _points(cells: Cells) -> Counts:
    return np.ones(len(cells), np.int64) if cells.counts is None else cells.counts


def _whole(cells: Cells) -> Cells:
    # Without its last bit a key forgets the half.
    keys = cells.keys & ~1
    starts = _starts(keys)
    if len(starts) == len(keys):
        return cells
    sums: list[NDArray[np.integer]] = [np.add.reduceat(total, starts) for total in cells.sums]
    return Cells(keys[starts], sums, np.add.reduceat(_points(cells), starts))


def _starts(keys: NDArray[np.int64]) -> NDArray[np.intp]:
    return np.flatnonzero(np.concatenate([[True], keys[1:] != keys[:-1]])[: len(keys)])


def _refuse_far(values: NDArray[np.float64], lift: int, bits: int, lattice: Lattice) -> None:
    """Refuse coordinates that are no numbers, or whose cell would be numbered past its bits."""
    low, high = float(values.min()) / lattice.voxel, float(values.max()) / lattice.voxel
    if not (math.isfinite(low) and math.isfinite(high)):
        message = "A coordinate is NaN or infinite; leave such points out."
        raise CloudError(message)
    if low + lift < 1 or high + lift > 2**bits - 2:
        middle = 2 ** (bits - 1)
        reach = max(abs(low + lift - middle), abs(high + lift - middle)) * lattice.voxel
        message = (
            f"A point lies {reach:.6g} m from the lattice's origin along one axis; with voxels of "
            f"{lattice.voxel:g} m the lattice reaches {middle * lattice.voxel:.6g} m. "
            "Crop the cloud to the reference (a margin or a region), or take a larger voxel."
        )
        raise CloudError(message)
