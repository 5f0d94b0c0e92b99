"""Where a reconstruction is judged: the evaluation region and the height zones of the reference."""

from __future__ import annotations

import math
import os
import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pyproj
import shapely
from numpy.typing import NDArray
from pyproj.exceptions import ProjError

from trigpoint.cautions import Caution
from trigpoint.cloud import PointCloud
from trigpoint.crs import metre_factors, parse_crs
from trigpoint.crsparts import split_crs
from trigpoint.errors import MissingPackageError, RegionError
from trigpoint.similarity import Points

FRACTIONS = (0.33, 0.66)


@dataclass(frozen=True, slots=True, eq=False)
class HeightZones:
    """A height range cut into zones.

    Attributes
    ----------
    names : tuple of str
        From the lowest up: lower, middle and upper where there are three, zone_1, zone_2 and so
        on otherwise.
    edges_m : ndarray of shape (len(names) + 1,)
        Ascending heights, from the bottom of the range to its top.
    """

    names: tuple[str, ...]
    edges_m: NDArray[np.float64]

    def of(self, heights: NDArray[np.float64]) -> NDArray[np.intp]:
        """Return the position in `names` of each height's zone.

        A height on an edge between zones belongs to the one above; what lies below or above the
        range belongs to the lowest or highest zone, and so does the top edge.
        """
        return np.searchsorted(self.edges_m[1:-1], heights, side="right")


def height_zones(low: float, high: float, *, fractions: Sequence[float] = FRACTIONS) -> HeightZones:
    """Cut a height range at fractions of it.

    Parameters
    ----------
    low, high : float
        Metres: of the reference, before thinning.
    fractions : sequence of float
        Ascending, between 0 and 1.

    Raises
    ------
    RegionError
        If the fractions are not ascending numbers between 0 and 1.

    Examples
    --------
    >>> zones = height_zones(150.0, 210.0)
    >>> zones.names, zones.edges_m.round(3).tolist()
    (('lower', 'middle', 'upper'), [150.0, 169.8, 189.6, 210.0])
    >>> zones.of(np.array([149.0, 169.8, 210.0])).tolist()
    [0, 1, 2]
    """
    cuts = np.array([0, *fractions, 1], np.float64)
    if not (np.diff(cuts) > 0).all():
        listed = ", ".join(f"{fraction:g}" for fraction in fractions)
        message = f"The zone fractions are {listed}; they must ascend between 0 and 1."
        raise RegionError(message)
    names = (
        ("lower", "middle", "upper")
        if len(cuts) == 4
        else tuple(f"zone_{k}" for k in range(1, len(cuts)))
    )
    edges = low + cuts * (high - low)
    edges[-1] = high
    return HeightZones(names, edges)


@dataclass(frozen=True, slots=True, eq=False)
class Box:
    """An upright box; its faces belong to it.

    Attributes
    ----------
    low, high : ndarray of shape (3,)
        Metres.
    """

    low: NDArray[np.float64]
    high: NDArray[np.float64]

    def contains(self, cloud: PointCloud) -> NDArray[np.bool_]:
        """Tell which points lie inside, shape (n,)."""
        inside = np.ones(len(cloud), np.bool_)
        low, high = extent(cloud)
        for axis in range(3):
            if low[axis] < self.low[axis] or high[axis] > self.high[axis]:
                values = cloud.xyz[:, axis] + cloud.origin[axis]
                inside &= (values >= self.low[axis]) & (values <= self.high[axis])
        return inside


@dataclass(frozen=True, slots=True, eq=False)
class Outline:
    """Polygons in plan, of any height; their borders belong to them.

    Attributes
    ----------
    shape : shapely.Polygon or shapely.MultiPolygon
        Easting and northing in metres. Holes are outside.
    cautions : tuple of Caution
        What was doubtful about the file.
    """

    shape: shapely.Geometry
    cautions: tuple[Caution, ...] = ()

    def contains(self, cloud: PointCloud) -> NDArray[np.bool_]:
        """Tell which points lie inside, shape (n,)."""
        easting, northing = (cloud.xyz[:, axis] + cloud.origin[axis] for axis in (0, 1))
        shapely.prepare(self.shape)
        inside: NDArray[np.bool_] = shapely.intersects_xy(self.shape, easting, northing)
        return inside


def extent(cloud: PointCloud) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the lowest and the highest coordinates, absolute; infinite where there is no point."""
    # Rows of many points at once: five times as fast as along an axis of three.
    width = 64
    whole = len(cloud) // width * width
    rows, rest = cloud.xyz[:whole].reshape(-1, 3 * width), cloud.xyz[whole:]
    lows = rows.min(axis=0, initial=np.inf).reshape(width, 3)
    highs = rows.max(axis=0, initial=-np.inf).reshape(width, 3)
    low = np.minimum(lows.min(axis=0), rest.min(axis=0, initial=np.inf))
    high = np.maximum(highs.max(axis=0), rest.max(axis=0, initial=-np.inf))
    return low + cloud.origin, high + cloud.origin


def padded_box(low: NDArray[np.float64], high: NDArray[np.float64], *, margin: float) -> Box:
    """Pad an extent by a margin on every side.

    Parameters
    ----------
    low, high : ndarray of shape (3,)
        Metres.
    margin : float
        Metres, zero or more.

    Raises
    ------
    RegionError
        If the margin is below zero or not finite.
    """
    if not (math.isfinite(margin) and margin >= 0):
        message = f"The margin is {margin} m; it must be zero or more, or none for no crop."
        raise RegionError(message)
    return Box(low - margin, high + margin)


def read_outline(path: str | os.PathLike[str], *, crs: pyproj.CRS | None = None) -> Outline:
    """Read the polygons of a GeoJSON, GeoPackage, shapefile or anything else that GDAL reads.

    They are carried from the file's CRS to the cloud's. Where either has none they are taken as
    they are.

    Parameters
    ----------
    path : path-like
        Every polygon in the first layer counts; lines and points do not.
    crs : pyproj.CRS, optional
        The cloud's.

    Raises
    ------
    RegionError
        If the file can't be read, holds no polygon, or its CRS can't be brought to the cloud's.
    """
    path = Path(path)
    if not path.exists():
        message = f"{path}: there is no such region file."
        raise RegionError(message)
    with warnings.catch_warnings():
        # GDAL and numpy warn of what is refused below.
        warnings.simplefilter("ignore", RuntimeWarning)
        meta, wkb = _first_layer(path)
        shape = _united(path, wkb)

    own = parse_crs(meta["crs"])
    cautions: tuple[Caution, ...] = ()
    if own is not None and own.is_geographic and _is_beyond_degrees(shape):
        # GeoJSON has no way to name another CRS than longitude and latitude, so GDAL assumes it.
        message = (
            f"{path.name} says {own.name}, but its coordinates reach {shape.bounds[3]:.0f}: they "
            "are taken to be in the cloud's CRS."
        )
        own, cautions = None, (Caution("crs_doubtful", message),)
    if own is None or crs is None:
        if own is not None and own.is_geographic:
            message = (
                f"{path.name} is in degrees ({own.name}) and the reference cloud has no CRS to "
                "bring it to: assign one with --crs."
            )
            raise RegionError(message)
        return Outline(_in_metres(shape, crs or own), cautions)
    horizontal = split_crs(crs)[0]
    try:
        to_cloud = pyproj.Transformer.from_crs(own, horizontal, always_xy=True)
        moved = shapely.transform(
            shape, lambda xy: np.column_stack(to_cloud.transform(xy[:, 0], xy[:, 1], errcheck=True))
        )
    except ProjError as error:
        message = f"{path.name} ({own.name}) can't be brought to {crs.name}: {error}"
        raise RegionError(message) from error
    return Outline(_in_metres(moved, crs), cautions)


def outline_format(path: str | os.PathLike[str]) -> str:
    """Return what GDAL calls the format of a file that `read_outline` has read."""
    import pyogrio

    return str(pyogrio.read_info(path)["driver"])


def _first_layer(path: Path) -> tuple[dict[str, Any], NDArray[np.object_] | None]:
    try:
        import pyogrio
    except ImportError as error:  # not in QGIS's own Python
        message = f"{path.name}: reading a region needs pyogrio: pip install pyogrio"
        raise MissingPackageError(message) from error
    try:
        meta, _, wkb, _ = pyogrio.raw.read(path, columns=[], force_2d=True)
    except (pyogrio.errors.DataSourceError, pyogrio.errors.DataLayerError) as error:
        message = (
            f"{path.name} can't be read as polygons: it is broken, or in a format that GDAL does "
            "not know. GeoJSON and GeoPackage would do."
        )
        raise RegionError(message) from error
    return meta, wkb


def _united(path: Path, wkb: NDArray[np.object_] | None) -> shapely.Geometry:
    try:
        parts = shapely.get_parts([] if wkb is None else shapely.from_wkb(wkb))
        areas = parts[np.isin(shapely.get_type_id(parts), [3, 6])]  # Polygon, MultiPolygon
        shape = shapely.union_all(shapely.make_valid(areas))
    except shapely.errors.GEOSException as error:
        message = (
            f"{path.name} holds a ring that is no outline: it must end where it starts, with three "
            "places or more and finite coordinates."
        )
        raise RegionError(message) from error
    if shape.is_empty or not 0 < shape.area < math.inf:
        message = f"{path.name} holds {len(parts)} shapes and none encloses an area."
        raise RegionError(message)
    return shape


def _is_beyond_degrees(shape: shapely.Geometry) -> bool:
    west, south, east, north = shape.bounds
    return bool(west < -360 or east > 360 or south < -90 or north > 90)


def _in_metres(shape: shapely.Geometry, crs: pyproj.CRS | None) -> shapely.Geometry:
    # Clouds in feet became metres on reading, so their regions must.
    factors: NDArray[np.float64] = metre_factors(crs)[:2]

    def scaled(xy: Points) -> Points:
        return xy * factors

    return shapely.transform(shape, scaled)
