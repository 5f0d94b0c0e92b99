"""Clouds made ready to be compared: in one frame, cropped, on one lattice, every loss counted."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, replace
from itertools import chain
from typing import NamedTuple

import numpy as np
import pandas as pd
import pyproj
from numpy.typing import NDArray

from trigpoint.cautions import Caution
from trigpoint.cloud import PointCloud
from trigpoint.crsparts import split_crs
from trigpoint.errors import CloudError, CrsError
from trigpoint.files import CHUNK, PathLike, stream
from trigpoint.nearest import Tree, nearest
from trigpoint.similarity import Points, Similarity
from trigpoint.threads import worked
from trigpoint.voxels import Cells, Lattice, Voxels, centroids, gather, group
from trigpoint.zones import (
    FRACTIONS,
    Box,
    HeightZones,
    Outline,
    extent,
    height_zones,
    padded_box,
    read_outline,
)

# A cloud in memory, or the file that holds it.
Cloud = PointCloud | PathLike

VOXEL_M = 0.10
MARGIN_M = 1.0
SEED = 42

# Unthinned points are kept of clouds of at most so many, so that memory follows voxels, not points.
RAW_LIMIT = 4_000_000
# A region that keeps less than this share of a reconstruction deserves a caution.
MOSTLY_EMPTY = 0.5
# Polygons that leave out more than this share of a reference deserve one: completeness counts it.
LEFT_OUT = 0.01
# The floor is measured from at most so many points, spread evenly: to a part in five hundred.
FLOOR_SAMPLE = 250_000

ALL = "all"


@dataclass(frozen=True, slots=True, eq=False)
class Reference:
    """A reference cloud made ready, to measure any number of reconstructions against.

    Attributes
    ----------
    cloud : PointCloud
        Thinned; all clouds of a comparison are about its origin.
    counts : ndarray of shape (m,)
        Points that each of its points stands for.
    raw : ndarray of shape (n, 3) or None
        The points before thinning, about the same origin; None where there are too many.
    lattice : Lattice or None
        None where nothing is thinned.
    points : int
        Before thinning.
    low, high : ndarray of shape (3,)
        Extent before thinning, absolute, in metres.
    zones : HeightZones
    region : Box, Outline or None
        What reconstructions are cropped to; None keeps all of them.
    cautions : tuple of Caution
    """

    cloud: PointCloud
    counts: NDArray[np.int64]
    raw: Points | None
    lattice: Lattice | None
    points: int
    low: NDArray[np.float64]
    high: NDArray[np.float64]
    zones: HeightZones
    region: Box | Outline | None
    cautions: tuple[Caution, ...]
    # Worked out by threads while the first reconstruction is being read.
    _tree: Future[Tree]
    _floor: Future[pd.Series[float]]

    @property
    def tree(self) -> Tree:
        """Of the thinned points."""
        return self._tree.result()

    @property
    def floor_rmse_m(self) -> pd.Series[float]:
        """RMSE of one random half of the reference against the other, both thinned, by zone.

        ``all`` comes first. A perfect reconstruction that is sampled no denser would score no
        better.
        """
        return self._floor.result()


@dataclass(frozen=True, slots=True, eq=False)
class Thinned:
    """A reconstruction made ready: in the reference's frame, cropped, on the reference's lattice.

    Attributes
    ----------
    cloud : PointCloud
        Thinned, about the reference's origin.
    counts : ndarray of shape (m,)
        Points that each of its points stands for.
    raw : ndarray of shape (n, 3) or None
        The points in the region before thinning, about the same origin; None where they, or the
        reference's, are too many.
    points, points_in_region : int
        Read, and kept by the region.
    cautions : tuple of Caution
    """

    cloud: PointCloud
    counts: NDArray[np.int64]
    raw: Points | None
    points: int
    points_in_region: int
    cautions: tuple[Caution, ...]

    def moved(self, similarity: Similarity) -> Thinned:
        """Carry thinned and unthinned points through a rigid motion, such as ICP's.

        Parameters
        ----------
        similarity : Similarity
            Of scale 1, acting on absolute coordinates.
        """
        origin = self.cloud.origin
        cloud = self.cloud.transformed(similarity, crs=self.cloud.crs, origin=origin)
        raw = self.raw
        if raw is not None:
            raw = PointCloud(raw, origin).transformed(similarity, origin=origin).xyz
        return replace(self, cloud=cloud, raw=raw)


def prepare(
    reference: Cloud,
    *,
    voxel: float = VOXEL_M,
    zones: Sequence[float] = FRACTIONS,
    margin: float | None = MARGIN_M,
    region: PathLike | Outline | None = None,
    crs: str | pyproj.CRS | None = None,
    seed: int = SEED,
) -> Reference:
    """Read and thin a reference, find its zones and region, and measure its floor, all once.

    No point of a reference is left out, whatever the region.

    Parameters
    ----------
    reference : PointCloud or path-like
    voxel : float
        Edge of the lattice's cells in metres; 0 thins nothing.
    zones : sequence of float
        Fractions of the height range at which it is cut.
    margin : float or None
        Pads the extent to which reconstructions are cropped, in metres. None crops nothing.
    region : path-like or Outline, optional
        Polygons in plan to crop reconstructions to instead.
    crs : str or pyproj.CRS, optional
        Assigned to a file in place of what it says.
    seed : int
        Of the two halves that measure the floor.

    Raises
    ------
    CloudError, CrsError, RegionError
        If the cloud, its CRS, or the region can't be used.
    """
    chunks = _chunks(reference, crs=crs)
    first = next((chunk for chunk in chunks if len(chunk)), None)
    if first is None:
        message = "The reference holds no points."
        raise CloudError(message)
    origin = np.floor(first.xyz[0] + first.origin)
    lattice = Lattice(voxel, origin) if voxel else None
    random = np.random.default_rng(seed)

    def halved() -> Iterator[tuple[PointCloud, NDArray[np.bool_]]]:
        # Drawn in the order of the points by the thread that reads: no chunking changes a half.
        for chunk in chain([first], chunks):
            yield chunk, random.random(len(chunk)) < 0.5

    def work(item: tuple[PointCloud, NDArray[np.bool_]]) -> _Part:
        chunk, half = item
        return _part(chunk, len(chunk), origin, lattice, half=half)

    found = _joined(worked(work, halved()), limit=RAW_LIMIT if lattice else None)
    cuts = height_zones(float(found.low[2]), float(found.high[2]), fractions=zones)
    area = _area(region, margin, found, first.crs)
    voxels = found.voxels(origin, lattice)
    pool = ThreadPoolExecutor(2)
    tree = pool.submit(Tree, voxels.cloud.xyz)
    floor = pool.submit(_floor, found, origin, lattice, cuts)
    pool.shutdown(wait=False)
    return Reference(
        cloud=replace(voxels.cloud, crs=first.crs),
        counts=voxels.counts,
        raw=found.raw,
        lattice=lattice,
        points=found.read,
        low=found.low,
        high=found.high,
        zones=cuts,
        region=area,
        cautions=_outline_cautions(area, voxels) if isinstance(area, Outline) else (),
        _tree=tree,
        _floor=floor,
    )


def thin(
    reconstruction: Cloud,
    reference: Reference,
    *,
    similarity: Similarity | None = None,
    crs: str | pyproj.CRS | None = None,
) -> Thinned:
    """Read a reconstruction into the reference's frame, crop it to the region, and thin it.

    Parameters
    ----------
    reconstruction : PointCloud or path-like
    reference : Reference
    similarity : Similarity, optional
        Carries the reconstruction into the reference's frame; by default it is there already.
    crs : str or pyproj.CRS, optional
        Assigned to a file in place of what it says.

    Raises
    ------
    CloudError
        If the reconstruction can't be used.
    CrsError
        If there is no similarity and its CRS is not the reference's.
    """
    origin, lattice, region = reference.cloud.origin, reference.lattice, reference.region

    nameless = False

    def placed() -> Iterator[PointCloud]:
        nonlocal nameless
        for chunk in _chunks(reconstruction, crs=crs):
            if similarity is None:
                nameless = (chunk.crs is None) != (reference.cloud.crs is None)
                _refuse_other_crs(chunk.crs, reference.cloud.crs)
            yield chunk

    def work(chunk: PointCloud) -> _Part:
        moved = chunk if similarity is None else chunk.transformed(similarity, origin=origin)
        if region is not None:
            inside = region.contains(moved)
            moved = moved if inside.all() else moved.take(inside)
        return _part(moved, len(chunk), origin, lattice)

    limit = None if lattice is None else RAW_LIMIT if reference.raw is not None else 0
    found = _joined(worked(work, placed()), limit=limit)
    voxels = found.voxels(origin, lattice)
    cautions = []
    if nameless:
        message = (
            "The reconstruction or the reference, and not the other, names no CRS: both are taken "
            "to be in the same one, in metres."
        )
        cautions.append(Caution("crs_missing", message))
    if found.kept < MOSTLY_EMPTY * found.read or not found.kept:
        message = (
            f"The region keeps {found.kept:,} of the reconstruction's {found.read:,} points. If "
            "more should lie in it, check the alignment and the CRS, or widen the margin."
        )
        cautions.append(Caution("region_mostly_empty", message))
    return Thinned(
        cloud=replace(voxels.cloud, crs=reference.cloud.crs),
        counts=voxels.counts,
        raw=found.raw,
        points=found.read,
        points_in_region=found.kept,
        cautions=tuple(cautions),
    )


def _chunks(cloud: Cloud, *, crs: str | pyproj.CRS | None) -> Iterator[PointCloud]:
    if not isinstance(cloud, PointCloud):
        yield from stream(cloud, crs=crs, attributes=False)
        return
    for start in range(0, len(cloud), CHUNK):
        yield PointCloud(cloud.xyz[start : start + CHUNK], cloud.origin, crs=cloud.crs)


class _Part(NamedTuple):
    """One chunk: how many points were read, those that the region kept, and their cells."""

    read: int
    xyz: Points
    low: NDArray[np.float64]
    high: NDArray[np.float64]
    half: NDArray[np.bool_] | None
    cells: list[Cells]


@dataclass(frozen=True, slots=True, eq=False)
class _Joined:
    """All parts of a cloud; `raw` is None, and `half` with it, where it outgrew its limit."""

    read: int
    kept: int
    low: NDArray[np.float64]
    high: NDArray[np.float64]
    raw: Points | None
    half: NDArray[np.bool_] | None
    pieces: list[Cells]

    def voxels(
        self, origin: NDArray[np.float64], lattice: Lattice | None, *, half: int | None = None
    ) -> Voxels:
        if lattice is not None:
            return centroids(self.pieces, lattice, half=half)
        assert self.raw is not None
        xyz = self.raw if half is None else self.raw[self.half == half]
        return Voxels(PointCloud(xyz, origin), np.ones(len(xyz), np.int64))


def _part(
    cloud: PointCloud,
    read: int,
    origin: NDArray[np.float64],
    lattice: Lattice | None,
    *,
    half: NDArray[np.bool_] | None = None,
) -> _Part:
    xyz = cloud.xyz if (cloud.origin == origin).all() else cloud.about(origin).xyz
    low, high = extent(PointCloud(xyz, origin))
    cells = [] if lattice is None else group(cloud, lattice, half=half)
    return _Part(read, xyz, low, high, half, cells)


def _joined(parts: Iterator[_Part], *, limit: int | None) -> _Joined:
    """Put parts together, and keep their points while they are no more than the limit."""
    read = kept = 0
    low, high = np.full(3, np.inf), np.full(3, -np.inf)
    raw: list[_Part] = []

    def cells() -> Iterator[Cells]:
        nonlocal read, kept, low, high
        for part in parts:
            read, kept = read + part.read, kept + len(part.xyz)
            low, high = np.minimum(low, part.low), np.maximum(high, part.high)
            yield from part.cells
            raw.append(part._replace(cells=[]))
            if limit is not None and kept > limit:
                raw.clear()

    pieces = gather(cells())
    if limit is not None and kept > limit:
        return _Joined(read, kept, low, high, None, None, pieces)
    xyz = np.concatenate([np.empty((0, 3)), *(part.xyz for part in raw)])
    halves = [part.half for part in raw if part.half is not None]
    half = np.concatenate(halves) if halves else None
    return _Joined(read, kept, low, high, xyz, half, pieces)


def _area(
    region: PathLike | Outline | None,
    margin: float | None,
    reference: _Joined,
    crs: pyproj.CRS | None,
) -> Box | Outline | None:
    if isinstance(region, Outline):
        return region
    if region is not None:
        return read_outline(region, crs=crs)
    return None if margin is None else padded_box(reference.low, reference.high, margin=margin)


def _outline_cautions(outline: Outline, reference: Voxels) -> tuple[Caution, ...]:
    """Say what of the reference lies outside, in holes too: it is kept, and has no partner left."""
    whole = int(reference.counts.sum())
    left_out = int(reference.counts[~outline.contains(reference.cloud)].sum())
    if left_out <= LEFT_OUT * whole:
        return outline.cautions
    message = (
        f"{left_out:,} of the reference's {whole:,} points lie outside the region or in its holes, "
        "where reconstructions are cropped and the reference is not: completeness counts them as "
        "missing. Cut the reference to the region, or draw the region around it."
    )
    return (*outline.cautions, Caution("region_leaves_out_reference", message))


def _floor(
    found: _Joined, origin: NDArray[np.float64], lattice: Lattice | None, zones: HeightZones
) -> pd.Series[float]:
    one = found.voxels(origin, lattice, half=0).cloud.xyz
    points = one[:: max(1, math.ceil(len(one) / FLOOR_SAMPLE))].copy()
    del one  # before the other half takes as much memory
    other = found.voxels(origin, lattice, half=1).cloud.xyz
    found.pieces.clear()  # nobody asks for them again, and the search needs their memory
    squares = nearest(points, other) ** 2
    own = zones.of(points[:, 2] + origin[2])
    parts = {ALL: squares} | {name: squares[own == k] for k, name in enumerate(zones.names)}
    means = {name: float(part.mean()) if len(part) else math.nan for name, part in parts.items()}
    # Infinite where the other half is empty: nothing was measured.
    floors = {name: math.sqrt(m) if math.isfinite(m) else math.nan for name, m in means.items()}
    return pd.Series(floors, dtype=np.float64, name="floor_rmse_m")


def _refuse_other_crs(own: pyproj.CRS | None, other: pyproj.CRS | None) -> None:
    if own is None or other is None:
        return
    heights = [vertical.datum for crs in (own, other) if (vertical := split_crs(crs)[1])]
    # By name: the same datum in feet and in metres is one, and both were converted.
    names = [datum.name for datum in heights if datum is not None]
    if len(names) == 2 and names[0] != names[1]:
        message = (
            f"The reconstruction's heights count from {names[0]} and the reference's from "
            f"{names[1]}: bring one to the other's vertical CRS first."
        )
        raise CrsError(message)
    codes = [split_crs(crs)[0].to_epsg() for crs in (own, other)]
    if None not in codes and codes[0] != codes[1]:
        message = (
            f"The reconstruction is in {own.name} (EPSG:{codes[0]}) and the reference in "
            f"{other.name} (EPSG:{codes[1]}): bring one to the other's CRS first."
        )
        raise CrsError(message)
