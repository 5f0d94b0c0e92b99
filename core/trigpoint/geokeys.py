"""The CRS that the GeoTIFF keys of a LAS header name."""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import cache

import pyproj
from pyproj.crs import CompoundCRS
from pyproj.database import get_units_map
from pyproj.exceptions import CRSError

from trigpoint.errors import CrsError

GEOGRAPHIC, PROJECTED, LINEAR_UNIT, VERTICAL, VERTICAL_UNIT = 2048, 3072, 3076, 4096, 4099
UNDEFINED, USER_DEFINED = 0, 32767
# GeoTIFF 1.0 numbered vertical systems by their datum; this one is common in North American LAS.
VERTICAL_BY_DATUM = {5103: 5703}
# For a height unit that comes without a datum.
UNKNOWN_HEIGHT = 'VERT_CS["unknown",VERT_DATUM["unknown",2005],UNIT["metre",1],AXIS["Up",UP]]'

Unit = tuple[str, float]


def keyed_crs(geokeys: Mapping[int, int]) -> pyproj.CRS | None:
    """Return the CRS that GeoTIFF keys name, in the units that they name; None if they do not.

    Parameters
    ----------
    geokeys : mapping of int to int
        Keys whose value stands in the directory itself (``tiff_tag_location == 0``), by key id.

    Raises
    ------
    CrsError
        If the code is not in the register, or says that the projection is user-defined.

    References
    ----------
    OGC 19-008r4, GeoTIFF Standard 1.1, sections 7.5 and 7.6.

    Examples
    --------
    >>> keyed_crs({3072: 32104, 3076: 9003}).axis_info[0].unit_name
    'US survey foot'
    """
    code = geokeys.get(PROJECTED, UNDEFINED) or geokeys.get(GEOGRAPHIC, UNDEFINED)
    unit = _linear_units().get(geokeys.get(LINEAR_UNIT, UNDEFINED))
    if code == UNDEFINED:
        return None
    if code == USER_DEFINED:
        message = (
            f"code {code} stands for a projection of its own, in "
            f"{unit[0] if unit else 'unstated units'}, which only WKT could name"
        )
        raise CrsError(message)
    try:
        horizontal = pyproj.CRS.from_epsg(code)
    except CRSError:
        message = f"EPSG:{code} is not in PROJ's register of coordinate reference systems"
        raise CrsError(message) from None
    if horizontal.is_geographic:
        return horizontal
    horizontal = _in_unit(horizontal, unit)
    height_unit = _linear_units().get(geokeys.get(VERTICAL_UNIT, UNDEFINED))
    vertical = _vertical(geokeys.get(VERTICAL, UNDEFINED))
    if vertical is None and (height_unit is None or _is_in(horizontal, height_unit)):
        return horizontal
    vertical = _in_unit(vertical or pyproj.CRS(UNKNOWN_HEIGHT), height_unit)
    return CompoundCRS(f"{horizontal.name} + {vertical.name}", [horizontal, vertical])


def _vertical(code: int) -> pyproj.CRS | None:
    try:
        vertical = pyproj.CRS.from_epsg(VERTICAL_BY_DATUM.get(code, code))
    except CRSError:
        return None
    return vertical if vertical.is_vertical else None


def _in_unit(crs: pyproj.CRS, unit: Unit | None) -> pyproj.CRS:
    if unit is None or _is_in(crs, unit):
        return crs
    described = crs.to_json_dict()
    described.pop("id", None)
    # False easting and the like state their own units: only the axes change.
    for axis in described["coordinate_system"]["axis"]:
        axis["unit"] = {"type": "LinearUnit", "name": unit[0], "conversion_factor": unit[1]}
    return pyproj.CRS.from_json_dict(described)


def _is_in(crs: pyproj.CRS, unit: Unit) -> bool:
    return math.isclose(crs.axis_info[0].unit_conversion_factor, unit[1], rel_tol=1e-9)


@cache
def _linear_units() -> dict[int, Unit]:
    units = get_units_map("EPSG", "linear").values()
    return {int(unit.code): (unit.name, unit.conv_factor) for unit in units}
