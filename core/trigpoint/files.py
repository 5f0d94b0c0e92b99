"""Open, stream and write point clouds: one door, one module per format behind it."""

from __future__ import annotations

import os
import uuid
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np
import pyproj
from numpy.typing import ArrayLike, NDArray

from trigpoint.cautions import Caution
from trigpoint.cloud import PointCloud, concatenate
from trigpoint.crs import conversion_cautions, metre_factors, parse_crs
from trigpoint.errors import CloudError, CrsError
from trigpoint.formats.registry import READERS, WRITERS, backend_of, named, opened
from trigpoint.formats.source import Box, Chunk, Plan, Source
from trigpoint.similarity import Points, Similarity

PathLike = str | os.PathLike[str]
Bounds = tuple[ArrayLike, ArrayLike]

CHUNK = 1_000_000
# Coordinates stored in steps above this, in metres, can't show centimetres.
COARSE_M = 0.01
SIGMAS = ("sigma_e", "sigma_n", "sigma_h")


@dataclass(frozen=True, slots=True, eq=False)
class CloudInfo:
    """What a cloud file is.

    Attributes
    ----------
    path : Path
    format : str
    points : int
        With finite coordinates.
    low, high : ndarray of shape (3,)
        Extent in metres; in the file's own units where its CRS counts in degrees.
    crs : pyproj.CRS or None
    attributes : tuple of str
    scans : int
    cautions : tuple of Caution
    """

    path: Path
    format: str
    points: int
    low: NDArray[np.float64]
    high: NDArray[np.float64]
    crs: pyproj.CRS | None
    attributes: tuple[str, ...]
    scans: int
    cautions: tuple[Caution, ...]


def read(
    path: PathLike,
    *,
    crs: str | pyproj.CRS | None = None,
    bounds: Bounds | None = None,
    attributes: bool = True,
) -> PointCloud:
    """Read a whole cloud; the parameters are those of `stream`."""
    return concatenate(list(stream(path, crs=crs, bounds=bounds, attributes=attributes)))


def stream(
    path: PathLike,
    *,
    crs: str | pyproj.CRS | None = None,
    bounds: Bounds | None = None,
    chunk: int = CHUNK,
    attributes: bool = True,
) -> Iterator[PointCloud]:
    """Yield a cloud piece by piece, all about one origin: the first point, floored to the metre.

    LAS, LAZ, COPC, E57, XYZ, and binary PLY and PCD are not held in memory. A mesh comes in one
    piece, with its faces. Points with NaN or infinite coordinates are left out; `describe` counts
    them.

    Parameters
    ----------
    path : path-like
        LAS, LAZ, COPC, PLY, E57, PCD, XYZ, CSV, TXT; EPT and others through PDAL.
    crs : str or pyproj.CRS, optional
        Assigned in place of what the file says; nothing is reprojected.
    bounds : pair of array_like of shape (2,) or (3,), optional
        Lowest and highest corner in the file's own units, both inclusive.
    chunk : int
        Points read at a time.
    attributes : bool
        False reads coordinates only, which is faster.

    Yields
    ------
    PointCloud
        Coordinates in metres. At least one, which is empty if `bounds` hold no point.

    Raises
    ------
    CloudError
        If the file is no point cloud, is damaged, or holds no point.
    CrsError
        If the CRS does not count in lengths.
    MissingPackageError
        If the format needs a package that is not installed.
    """
    path = Path(path)
    source, faults = opened(path)
    frame = parse_crs(crs) or source.crs
    factors, box = metre_factors(frame), _box(bounds)

    def pieces() -> Iterator[PointCloud]:
        with named(path, faults):
            yield from _clouds(source.chunks(chunk, attributes, box), frame, factors, box)

    return pieces()


def describe(path: PathLike, *, crs: str | pyproj.CRS | None = None) -> CloudInfo:
    """Say what a cloud file is, and what is doubtful about it.

    LAS is taken at its header's word; of other formats every point is looked at.

    Parameters
    ----------
    path : path-like
    crs : str or pyproj.CRS, optional
        Assigned in place of what the file says.
    """
    path = Path(path)
    source, faults = opened(path)
    assigned = parse_crs(crs)
    frame = assigned or source.crs
    doubts = [c for c in source.cautions if assigned is None or not c.code.startswith("crs_")]
    try:
        factors = metre_factors(frame)
    except CrsError as error:
        factors = np.ones(3)
        doubts.append(Caution("crs_doubtful", str(error)))
    doubts += conversion_cautions(frame)

    points, extent = source.points, source.extent
    if points is None or extent is None:
        with named(path, faults):
            points, dropped, extent = _surveyed(source.chunks(CHUNK, False, None))
        if dropped:
            message = (
                f"{dropped:,} of {points + dropped:,} points have NaN or infinite coordinates and "
                f"are left out."
            )
            doubts.append(Caution("points_dropped", message))
    step = _step(source, extent)
    coarsest = float((step * factors).max())
    if coarsest > COARSE_M:
        message = f"coordinates are stored in steps of {coarsest:.2g} m: anything finer is lost."
        doubts.append(Caution("coordinates_coarse", message))
    return CloudInfo(
        path=path,
        format=source.format,
        points=points,
        low=extent.low * factors,
        high=extent.high * factors,
        crs=frame,
        attributes=source.attributes,
        scans=source.scans,
        cautions=tuple(doubts),
    )


def write(
    path: PathLike, clouds: PointCloud | Iterable[PointCloud], *, like: PathLike | None = None
) -> tuple[Caution, ...]:
    """Write a cloud, or pieces of one, in the units of its CRS: all of it or nothing.

    The file takes its name only when it is whole, so it may replace the one that the pieces are
    being read from.

    Parameters
    ----------
    path : path-like
        Its end says the format: .las, .laz, .ply, .xyz, .csv or .txt.
    clouds : PointCloud or iterable of PointCloud
        Pieces share their CRS and their attributes.
    like : path-like, optional
        A LAS or LAZ file that the points come from: its kind of GPS time, its date, and the
        scaling of its extra dimensions are kept when writing LAS.

    Returns
    -------
    tuple of Caution
        `attribute_dropped`, `crs_missing` and `coordinates_coarse`: what the format can't hold.

    Raises
    ------
    CloudError
        If the format can't be written, there is no point, or a coordinate is not finite.
    """
    path = Path(path)
    suffix = path.suffix.lower()
    if suffix not in WRITERS or path.name.lower().endswith(".copc.laz"):
        message = f"{path.name} can't be written; these can: {', '.join(WRITERS)}."
        raise CloudError(message)
    if not path.parent.is_dir():
        message = f"{path}: there is no folder {path.parent}."
        raise CloudError(message)
    extent = _extent(clouds) if isinstance(clouds, PointCloud) else None
    pieces = _slices(clouds) if isinstance(clouds, PointCloud) else iter(clouds)
    first = next((piece for piece in pieces if len(piece)), None)
    if first is None:
        message = f"{path.name}: there are no points to write."
        raise CloudError(message)
    factors = metre_factors(first.crs)
    box = Box(extent.low / factors, extent.high / factors) if extent else None
    pattern = (
        Path(like) if like is not None and READERS.get(Path(like).suffix.lower()) == "las" else None
    )
    chunks = _checked(chain([first], pieces), first, factors)
    backend = backend_of(WRITERS[suffix], path)
    with _beside(path) as draft:
        cautions: tuple[Caution, ...] = backend.write(draft, chunks, Plan(first.crs, box, pattern))
    if first.faces is not None and suffix != ".ply":
        message = f"{suffix} can't hold the {len(first.faces):,} faces of the mesh: PLY can."
        cautions = (*cautions, Caution("attribute_dropped", message))
    return cautions


def carry(
    source: PathLike,
    target: PathLike,
    similarity: Similarity,
    *,
    crs: str | pyproj.CRS | None = None,
    sigma: Callable[[Points], Points] | None = None,
) -> tuple[int, tuple[Caution, ...]]:
    """Carry a cloud file through a similarity into another file, with everything it holds.

    Parameters
    ----------
    source, target : path-like
        May be the same file.
    similarity : Similarity
        Maps the source's coordinates, in metres where it has a CRS, to the target's.
    crs : str or pyproj.CRS, optional
        What the target's frame is.
    sigma : callable, optional
        Gives the standard deviations (n, 3) of points of the target frame, such as
        `Reliability.sigma`: they become the attributes sigma_e, sigma_n and sigma_h, in metres.

    Returns
    -------
    points : int
        Written.
    cautions : tuple of Caution
        As of `write`, and `crs_doubtful` where the source states the target's frame already.
    """
    frame = parse_crs(crs)
    count, already = 0, False

    def moved() -> Iterator[PointCloud]:
        nonlocal count, already
        for cloud in stream(source):
            count += len(cloud)
            already = frame is not None and cloud.crs == frame
            carried = cloud.transformed(similarity, crs=frame)
            yield carried if sigma is None else _with_sigmas(carried, sigma(carried.coordinates))

    cautions = write(target, moved(), like=source)
    if already and frame is not None:
        message = (
            f"{Path(source).name} states {frame.name} itself, and was carried into it all the "
            "same: a cloud that is there already needs no similarity."
        )
        cautions = (*cautions, Caution("crs_doubtful", message))
    return count, cautions


def _with_sigmas(cloud: PointCloud, sigmas: Points) -> PointCloud:
    # Single precision: a standard deviation has no seven digits.
    columns = zip(SIGMAS, sigmas.T.astype(np.float32), strict=True)
    return replace(cloud, attributes=dict(cloud.attributes) | dict(columns))


def _clouds(
    chunks: Iterator[Chunk], crs: pyproj.CRS | None, factors: NDArray[np.float64], box: Box | None
) -> Iterator[PointCloud]:
    origin: NDArray[np.float64] | None = None
    found = False
    for raw in chunks:
        finite = np.isfinite(raw.xyz)
        # Asking row by row takes nine times as long, and is nearly always for nothing.
        chunk = raw if finite.all() else _kept(raw, finite.all(axis=1))
        if origin is None and len(chunk.xyz):
            origin = np.floor(chunk.xyz[0] * factors)
        if box is not None:
            chunk = _kept(chunk, ((chunk.xyz >= box.low) & (chunk.xyz <= box.high)).all(axis=1))
        if origin is not None and len(chunk.xyz):
            found = True
            # In place: a chunk is ours to change, and most of the time is spent moving memory.
            xyz = chunk.xyz
            if (factors != 1).any():
                xyz *= factors
            xyz -= origin
            yield PointCloud(xyz, origin, chunk.attributes, crs, chunk.faces)
    if not found and box is not None:
        yield PointCloud(np.empty((0, 3)), np.zeros(3), {}, crs)
    elif not found:
        message = "it holds no point with finite coordinates."
        raise CloudError(message)


def _kept(chunk: Chunk, mask: Any) -> Chunk:
    """Keep some points, and the faces all of whose corners are kept."""
    if mask.all():
        return chunk
    faces = chunk.faces
    if faces is not None:
        faces = (np.cumsum(mask) - 1)[faces[mask[faces].all(axis=1)]]
    return Chunk(chunk.xyz[mask], {n: v[mask] for n, v in chunk.attributes.items()}, faces)


def _surveyed(chunks: Iterator[Chunk]) -> tuple[int, int, Box]:
    """Count points and those that are not finite, and find the extent of the others."""
    points = total = 0
    low, high = np.full(3, np.inf), np.full(3, -np.inf)
    for chunk in chunks:
        xyz = chunk.xyz[np.isfinite(chunk.xyz).all(axis=1)]
        total += len(chunk.xyz)
        points += len(xyz)
        low = np.minimum(low, xyz.min(axis=0, initial=np.inf))
        high = np.maximum(high, xyz.max(axis=0, initial=-np.inf))
    if not points:
        message = "it holds no point with finite coordinates."
        raise CloudError(message)
    return points, total - points, Box(low, high)


def _step(source: Source, extent: Box) -> NDArray[np.float64]:
    """Return the distance between neighbouring coordinates that the file can tell apart."""
    if source.step is not None:
        return source.step
    reach = np.maximum(np.abs(extent.low), np.abs(extent.high))
    spacing = np.spacing(reach.astype(np.float32) if source.is_single else reach)
    return np.array(spacing, np.float64)


def _box(bounds: Bounds | None) -> Box | None:
    if bounds is None:
        return None
    low, high = (np.asarray(end, np.float64).ravel() for end in bounds)
    if low.shape != high.shape or low.shape not in ((2,), (3,)) or not (low <= high).all():
        message = (
            f"bounds {low.tolist()} to {high.tolist()} must be the lowest and the highest corner, "
            f"with two or three coordinates each."
        )
        raise CloudError(message)
    # In plan, every height is inside.
    open_end = [np.inf] * (3 - len(low))
    return Box(np.append(low, np.negative(open_end)), np.append(high, open_end))


def _slices(cloud: PointCloud) -> Iterator[PointCloud]:
    if cloud.faces is not None:
        yield cloud
        return
    for start in range(0, len(cloud), CHUNK):
        part = slice(start, start + CHUNK)
        attributes = {name: values[part] for name, values in cloud.attributes.items()}
        yield PointCloud(cloud.xyz[part], cloud.origin, attributes, cloud.crs)


def _extent(cloud: PointCloud) -> Box | None:
    if not len(cloud):
        return None
    return Box(cloud.xyz.min(axis=0) + cloud.origin, cloud.xyz.max(axis=0) + cloud.origin)


def _checked(
    clouds: Iterable[PointCloud], first: PointCloud, factors: NDArray[np.float64]
) -> Iterator[Chunk]:
    """Turn clouds into chunks in the units of the file, all of a kind with the first."""
    for cloud in clouds:
        if not len(cloud):
            continue
        if set(cloud.attributes) != set(first.attributes) or cloud.crs != first.crs:
            message = (
                f"a piece holds {', '.join(cloud.attributes) or 'no attributes'} in "
                f"{cloud.crs and cloud.crs.name}, and the first one "
                f"{', '.join(first.attributes) or 'none'} in {first.crs and first.crs.name}: "
                f"pieces of one file must be alike."
            )
            raise CloudError(message)
        xyz = cloud.coordinates / factors
        if bad := len(xyz) - int(np.isfinite(xyz).all(axis=1).sum()):
            message = f"{bad:,} of {len(xyz):,} points have NaN or infinite coordinates."
            raise CloudError(message)
        yield Chunk(xyz, dict(cloud.attributes), cloud.faces)


@contextmanager
def _beside(path: Path) -> Iterator[Path]:
    """Give a name beside `path` to write to, and make it `path` if that went well."""
    draft = path.with_name(f".{path.stem}-{uuid.uuid4().hex[:8]}{path.suffix}")
    try:
        yield draft
        draft.replace(path)
    except OSError as error:
        message = f"{path} can't be written: {error.strerror or error}"
        raise CloudError(message) from error
    finally:
        draft.unlink(missing_ok=True)
