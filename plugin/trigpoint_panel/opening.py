"""Opens a cloud for the screen: header first, then as many of its points as can be shown."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from trigpoint.cloud import PointCloud, concatenate
from trigpoint.errors import CloudError, CrsError
from trigpoint.files import CloudInfo, describe, stream
from trigpoint.picks import FARTHEST
from trigpoint_panel.fingerprints import Fingerprint, fingerprint_of, stamp_of

# What colours are made of; whatever else a file holds stays in the file.
KEPT = frozenset({"red", "green", "blue", "intensity", "classification", "distance_m"})
MOST = 5_000_000
# Points read at a time: small enough to be cancelled soon.
CHUNK = 500_000

Progress = Callable[[float, str], None]


@dataclass(frozen=True, slots=True, eq=False)
class Opened:
    """A cloud as it is shown.

    Attributes
    ----------
    info : CloudInfo
        What the file is; `info.points` counts all of its points.
    cloud : PointCloud
        The points shown: an even random share of the file's, each at full precision.
    fingerprint : Fingerprint or None
        Of the file as it was read.
    """

    info: CloudInfo
    cloud: PointCloud
    fingerprint: Fingerprint | None = None

    @property
    def has_changed(self) -> bool:
        """Whether the file is there and holds something else than what was read."""
        return self.fingerprint is not None and self.fingerprint.is_outdated

    @property
    def path(self) -> Path:
        """The file."""
        return self.info.path

    @property
    def total(self) -> int:
        """Points in the file."""
        return self.info.points

    @property
    def is_thinned(self) -> bool:
        """Whether only a share of the points is shown."""
        return len(self.cloud) < self.total

    @property
    def unit(self) -> str:
        """Unit of the coordinates: a cloud that no CRS describes is in its own."""
        return "units" if self.info.crs is None else "m"


def open_cloud(
    path: str | Path,
    *,
    crs: str | None = None,
    needs_crs: bool = False,
    most: int = MOST,
    progress: Progress | None = None,
) -> Opened:
    """Read a cloud for display, in memory that follows the points shown and not the file.

    Which points are shown depends on their place in the file alone, so that a session opened
    again shows the same ones.

    Parameters
    ----------
    path : path-like
    crs : str, optional
        Assigned in place of what the file says; nothing is reprojected.
    needs_crs : bool
        Refuse a cloud of which no CRS is known.
    most : int
        Points shown, about.
    progress : callable, optional
        ``progress(fraction, message)`` as the file is read; what it raises stops the reading.

    Raises
    ------
    CloudError
        If the file is no point cloud, is damaged or cut short, holds no point or one farther away
        than a pick may be, or changes while it is read.
    CrsError
        If the CRS is missing where it is needed, or counts in degrees.
    """
    tell = progress or (lambda _fraction, _message: None)
    path = Path(path)
    tell(0.0, f"Opening {path.name}")
    try:
        pieces = stream(path, crs=crs, chunk=CHUNK)  # refuses degrees before anything is read
        info = describe(path, crs=crs)
    except CrsError as error:
        if path.name in str(error):
            raise
        message = f"{path.name}: {error}"
        raise CrsError(message) from error
    if needs_crs and info.crs is None:
        message = f"{path.name} has no CRS: choose one, because the reference needs it."
        raise CrsError(message)
    share = most / max(info.points, 1)
    before = stamp_of(path)
    kept: list[PointCloud] = []
    read = 0
    for piece in pieces:
        rows = _chosen(read, len(piece), share)
        _refuse_far(path, piece)
        attributes = {n: v for n, v in piece.attributes.items() if n in KEPT}
        slim = PointCloud(piece.xyz, piece.origin, attributes, piece.crs)
        kept.append(slim if share >= 1 else slim.take(rows))
        read += len(piece)
        tell(min(read / max(info.points, 1), 1.0), f"Reading {path.name}")
    fingerprint = fingerprint_of(path)
    if fingerprint.stamp != before:
        message = f"{path.name} has changed while it was read: open it again once it is complete."
        raise CloudError(message)
    return Opened(info, concatenate(kept), fingerprint)


def _refuse_far(path: Path, piece: PointCloud) -> None:
    """Refuse coordinates that no pick may have; nothing could be shown of them either."""
    if len(piece) == 0:
        return
    ends = np.array([piece.xyz.min(axis=0), piece.xyz.max(axis=0)]) + piece.origin
    if not (np.abs(ends) <= FARTHEST).all():  # NaN is not below anything either
        message = (
            f"{path.name} has coordinates of up to {np.abs(ends).max():.3g}, and they may reach "
            f"{FARTHEST:.0e} at most: it is damaged, or in another unit."
        )
        raise CloudError(message)


def _chosen(start: int, count: int, share: float) -> NDArray[np.intp]:
    """Choose about `share` of the rows from `start` on, by a hash of their number.

    Every k-th row would alias with scan lines, and a generator's state with the chunks.
    """
    if share >= 1:
        return np.arange(count)
    # SplitMix64 (Steele, Lea and Flood 2014, doi:10.1145/2660193.2660195).
    mixed = np.arange(start + 1, start + count + 1, dtype=np.uint64) * np.uint64(0x9E3779B97F4A7C15)
    mixed = (mixed ^ (mixed >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    mixed = (mixed ^ (mixed >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    mixed ^= mixed >> np.uint64(31)
    return np.flatnonzero(mixed < np.uint64(share * 2**64))
