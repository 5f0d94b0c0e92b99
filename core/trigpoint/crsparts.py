"""A CRS taken apart: its components, their units and datums, and its map at a place."""

from __future__ import annotations

import math

import pyproj
from pyproj.exceptions import CRSError, ProjError

_NAMELESS = frozenset({"unknown", "unnamed", "not specified", "not_specified", "undefined"})


def split_crs(crs: pyproj.CRS) -> tuple[pyproj.CRS, pyproj.CRS | None]:
    """Split into horizontal and vertical, without the datum shifts that old WKT drags along."""
    parts = [_unbound(part) for part in _unbound(crs).sub_crs_list] or [_unbound(crs)]
    return parts[0], parts[1] if len(parts) > 1 else None


def axis_units(crs: pyproj.CRS) -> tuple[tuple[str, float], ...]:
    """Name and metres per unit of easting, northing and height.

    A CRS without a height axis lends heights its horizontal unit.
    """
    horizontal, vertical = split_crs(crs)
    axes = sorted(horizontal.axis_info[:2], key=lambda axis: axis.direction in ("north", "south"))
    axes = [*axes, axes[0]][:2] if len(axes) < 2 else axes
    heights = [*horizontal.axis_info[2:], *(vertical.axis_info if vertical else []), axes[0]]
    return tuple(
        (axis.unit_name, axis.unit_conversion_factor) for axis in (axes[0], axes[1], heights[0])
    )


def has_height(crs: pyproj.CRS) -> bool:
    """Tell whether a CRS has an axis for heights."""
    horizontal, vertical = split_crs(crs)
    return vertical is not None or len(horizontal.axis_info) > 2


def vertical_datum(crs: pyproj.CRS) -> str | None:
    """Name what heights count from; None if the CRS does not say."""
    horizontal, vertical = split_crs(crs)
    if vertical is None:
        return "ellipsoid" if has_height(crs) and horizontal.ellipsoid else None
    known = vertical.datum is not None and vertical.datum.name.lower() not in _NAMELESS
    return vertical.datum.name if vertical.datum and known else None


def crs_code(crs: pyproj.CRS) -> str | None:
    """Return the register's code, such as ``EPSG:32615+5703``; None if a part has none."""
    if crs.to_authority() is not None:
        return ":".join(crs.to_authority())
    found = [part.to_authority() for part in split_crs(crs) if part]
    # PROJ reads the parts of a compound code from one register.
    if None in found or len({authority for authority, _ in found}) != 1:
        return None
    return f"{found[0][0]}:" + "+".join(code for _, code in found)


def datum_ensemble(horizontal: pyproj.CRS) -> tuple[bool, float]:
    """Tell whether the datum is an ensemble, and its accuracy in metres (NaN if it is none)."""
    base = horizontal.geodetic_crs
    if base is None:
        return False, math.nan
    # WKT 1 can't say ensemble: ask the register about what it names.
    authority = base.to_authority()
    base = pyproj.CRS.from_authority(*authority) if authority else base
    ensemble = base.to_json_dict().get("datum_ensemble")
    return ensemble is not None, float(ensemble["accuracy"]) if ensemble else math.nan


def lonlat(horizontal: pyproj.CRS, easting: float, northing: float) -> tuple[float, float]:
    """Longitude and latitude of coordinates in the CRS's own units; NaN where there is none."""
    if horizontal.is_geographic:
        return easting, northing
    if not horizontal.is_projected:
        return math.nan, math.nan
    try:
        longitude, latitude = _map(horizontal)(easting, northing, inverse=True)
    except (CRSError, ProjError):
        return math.nan, math.nan
    found = math.isfinite(longitude) and math.isfinite(latitude)
    return (longitude, latitude) if found else (math.nan, math.nan)


def grid_factors(horizontal: pyproj.CRS, longitude: float, latitude: float) -> tuple[float, float]:
    """Point scale factor and convergence in degrees."""
    if not horizontal.is_projected or math.isnan(longitude):
        return math.nan, math.nan
    # PROJ takes this longitude from the CRS's own prime meridian, which may be Paris.
    prime = horizontal.prime_meridian
    start = math.degrees(prime.longitude * float(prime.unit_conversion_factor)) if prime else 0.0
    factors = _map(horizontal).get_factors(longitude - start, latitude)
    return math.sqrt(factors.areal_scale), factors.meridian_convergence


def mean_radius(horizontal: pyproj.CRS, latitude: float) -> float:
    """Gaussian mean radius of curvature, the root of the two principal ones' product."""
    if horizontal.ellipsoid is None:
        return math.nan
    a, b = horizontal.ellipsoid.semi_major_metre, horizontal.ellipsoid.semi_minor_metre
    e2 = 1 - (b / a) ** 2
    return a * math.sqrt(1 - e2) / (1 - e2 * math.sin(math.radians(latitude)) ** 2)


def stray_deg(horizontal: pyproj.CRS, longitude: float, latitude: float) -> float:
    """Degrees that a site lies outside the area of use.

    Infinite for a place that a map can't show, NaN if there is no map or no area is known.
    """
    if math.isnan(longitude):
        return math.inf if horizontal.is_projected else math.nan
    authority = horizontal.to_authority()
    named = pyproj.CRS.from_authority(*authority) if authority else horizontal
    area = horizontal.area_of_use or named.area_of_use
    if area is None:
        return math.nan
    # East of the western edge, counted eastward, so that areas may cross the antimeridian.
    width = (area.east - area.west) % 360 or 360.0
    eastward = (longitude - area.west) % 360
    beside = max(0.0, min(eastward - width, 360 - eastward))
    return max(beside, area.south - latitude, latitude - area.north, 0.0)


def _unbound(crs: pyproj.CRS) -> pyproj.CRS:
    return crs.source_crs if crs.is_bound and crs.source_crs else crs


def _map(horizontal: pyproj.CRS) -> pyproj.Proj:
    """Return the projection alone, on a datum without a name.

    For some names, NAD27 among them, PROJ opens the grids of a datum shift that nobody asked for,
    and fetches them where the network is on.
    """
    described = horizontal.to_json_dict()
    base = described
    while "base_crs" in base:
        base.pop("id", None)
        base = base["base_crs"]
    base.pop("id", None)
    named = base.pop("datum", None) or base.pop("datum_ensemble", {})
    kept = {key: named[key] for key in ("ellipsoid", "prime_meridian") if key in named}
    base["datum"] = {"type": "GeodeticReferenceFrame", "name": "unknown", **kept}
    return pyproj.Proj(pyproj.CRS.from_json_dict(described))
