"""What a coordinate reference system says, and fails to say, at a site.

Coordinates are taken as easting, northing, height, whatever order the CRS lists its axes in.
Nothing here shifts a datum: a site is only unprojected to the longitude and latitude of its own
datum. That needs no grid file, so PROJ never has a reason to ask the network.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
import pyproj
from numpy.typing import ArrayLike, NDArray
from pyproj.crs import CompoundCRS
from pyproj.exceptions import CRSError

from trigpoint.cautions import Caution
from trigpoint.crsparts import (
    axis_units,
    crs_code,
    datum_ensemble,
    grid_factors,
    has_height,
    lonlat,
    mean_radius,
    split_crs,
    stray_deg,
    vertical_datum,
)
from trigpoint.errors import CrsError
from trigpoint.geokeys import keyed_crs

# A map grid that is off by more than this over 100 m, in millimetres, deserves a caution.
GRID_MM = 10.0
# A site this far outside a CRS's area of use, in degrees, is probably not in that CRS.
STRAY_DEG = 1.0
# Two records of one header that place the site further apart than this, in metres, disagree.
APART_M = 1.0


@dataclass(frozen=True, slots=True, eq=False)
class CrsReport:
    """What a CRS says at a site; numbers that it can't give are NaN, names None.

    Attributes
    ----------
    name : str
    code : str or None
        Such as ``EPSG:32615+5703``.
    units : tuple of str
        Of easting, northing and height, as the CRS names them.
    to_metre : ndarray of shape (3,)
        Metres per unit of easting, northing and height.
    datum : str or None
        Horizontal datum.
    is_ensemble : bool
        The datum stands for several realisations that differ by up to `ensemble_accuracy_m`.
    ensemble_accuracy_m : float
    vertical_datum : str or None
        None: the CRS does not say what heights count from.
    longitude_deg, latitude_deg : float
        Of the site, in the CRS's own datum.
    in_area_of_use : bool or None
        None: no area of use is known.
    grid_scale : float
        Point scale factor: map length over length on the ellipsoid.
    convergence_deg : float
        From true north to grid north, clockwise.
    height_effect_ppm : float
        What the height above the ellipsoid does to lengths: ``-1e6 h / R``.
    combined_factor : float
        Map length over length on the ground at the site.
    mm_over_100_m : float
        What the map adds to 100 m on the ground.
    cautions : tuple of Caution
    """

    name: str
    code: str | None
    units: tuple[str, str, str]
    to_metre: NDArray[np.float64]
    datum: str | None = None
    is_ensemble: bool = False
    ensemble_accuracy_m: float = math.nan
    vertical_datum: str | None = None
    longitude_deg: float = math.nan
    latitude_deg: float = math.nan
    in_area_of_use: bool | None = None
    grid_scale: float = math.nan
    convergence_deg: float = math.nan
    height_effect_ppm: float = math.nan
    combined_factor: float = math.nan
    mm_over_100_m: float = math.nan
    cautions: tuple[Caution, ...] = ()


def parse_crs(
    text: str | pyproj.CRS | None, *, vertical: str | pyproj.CRS | None = None
) -> pyproj.CRS | None:
    """Turn a code, WKT or PROJ string into a CRS; empty text and None say that there is none.

    Parameters
    ----------
    text : str, pyproj.CRS or None
        ``EPSG:32615``, ``EPSG:32615+5703``, WKT, a PROJ string or a CRS's exact name.
    vertical : str, pyproj.CRS or None
        Vertical CRS to add to one that has none, such as ``EPSG:5703``.

    Raises
    ------
    CrsError
        If PROJ does not know it, or `vertical` can't be added.

    Examples
    --------
    >>> parse_crs("EPSG:32615", vertical="EPSG:5703").name
    'WGS 84 / UTM zone 15N + NAVD88 height'
    """
    crs = _parse(text)
    height = _parse(vertical)
    if height is None:
        return crs
    if crs is None or not height.is_vertical or len(crs.axis_info) != 2:
        message = (
            f"the vertical CRS {height.name!r} can't be added to "
            f"{'no CRS' if crs is None else repr(crs.name)}: give a horizontal CRS that has no "
            f"heights of its own, such as EPSG:32615, and a vertical CRS, such as EPSG:5703."
        )
        raise CrsError(message)
    return CompoundCRS(f"{crs.name} + {height.name}", [crs, height])


def header_crs(
    wkt: str | None, geokeys: Mapping[int, int] | None, low: ArrayLike, high: ArrayLike
) -> tuple[pyproj.CRS | None, tuple[Caution, ...]]:
    """Say which CRS a file's header names, judged against its extent; never raises for content.

    WKT goes before GeoTIFF keys unless only the keys fit the extent. Degrees over coordinates
    that can't be degrees are not believed: the answer is None, and the coordinates are taken as
    metres.

    Parameters
    ----------
    wkt : str or None
        As stored, trailing NULs included.
    geokeys : mapping of int to int, or None
        GeoTIFF keys whose value stands in the directory (``tiff_tag_location == 0``), by key id.
    low, high : array_like of shape (3,)
        Extent of the coordinates as stored, in the file's own units.

    Returns
    -------
    crs : pyproj.CRS or None
    cautions : tuple of Caution
        `crs_missing`, `crs_doubtful` or `crs_conflict`.

    Examples
    --------
    >>> low, high = [515_368, 4_918_340, 2323], [515_401, 4_918_381, 2338]
    >>> crs, cautions = header_crs(None, {2048: 4326}, low, high)
    >>> crs is None, cautions[0].code
    (True, 'crs_doubtful')
    """
    extent = np.array([low, high], np.float64)
    found: list[pyproj.CRS] = []
    cautions: list[Caution] = []
    records = {"WKT": partial(_parse, wkt), "GeoTIFF keys": partial(keyed_crs, geokeys or {})}
    for record, parse in records.items():
        try:
            crs = parse()
        except CrsError as error:
            # Keys that can't be used take nothing away from WKT that can.
            if not found:
                message = f"the header's {record} can't be used: {error}"
                cautions.append(Caution("crs_doubtful", message))
        else:
            found += [] if crs is None else [crs]
    if not found:
        missing = Caution("crs_missing", "the header names no CRS: name it with --crs.")
        return None, tuple(cautions or [missing])

    if len(found) == 2 and (apart := _apart(found[0], found[1], extent)) > APART_M:
        distance = f"{apart:,.0f} m apart" if math.isfinite(apart) else "on no common ground"
        message = (
            f"WKT ({found[0].name}) and GeoTIFF keys ({found[1].name}) of the header place the "
            f"coordinates {distance}: name the right one with --crs."
        )
        cautions.append(Caution("crs_conflict", message))
    crs = next((each for each in found if not _misfit(each, extent)), found[0])
    if doubt := _misfit(crs, extent):
        cautions.append(Caution("crs_doubtful", doubt))
    believed = not (doubt and split_crs(crs)[0].is_geographic)
    return (crs if believed else None), tuple(cautions)


def metre_factors(crs: pyproj.CRS | None) -> NDArray[np.float64]:
    """Return the metres per unit of easting, northing and height, shape (3,).

    Without a CRS coordinates are taken as metres. A CRS with no height axis is taken to have
    heights in its horizontal unit.

    Raises
    ------
    CrsError
        If an axis is not a length (degrees), or no axis is a height above ground (geocentric).

    Examples
    --------
    >>> metre_factors(parse_crs("EPSG:2991+6360")).round(7).tolist()
    [1.0, 1.0, 0.3048006]
    """
    if crs is None:
        return np.ones(3)
    if refusal := _refusal(crs):
        raise CrsError(refusal)
    return np.array([factor for _, factor in axis_units(crs)])


def conversion_cautions(crs: pyproj.CRS | None) -> tuple[Caution, ...]:
    """Say which axes of a CRS are not in metres, as `units_converted`; empty if all are."""
    if crs is None or _refusal(crs) or (metre_factors(crs) == 1).all():
        return ()
    (plan, plan_factor), _, (height, height_factor) = axis_units(crs)
    assumed = "" if has_height(crs) else ", assumed: the CRS names no unit for them"
    message = (
        f"{crs.name}: easting and northing were converted to metres from {plan} "
        f"({plan_factor:.10g} m), heights from {height} ({height_factor:.10g} m{assumed})."
    )
    return (Caution("units_converted", message),)


def describe_crs(crs: pyproj.CRS | None, *, at: ArrayLike) -> CrsReport:
    """Say what a CRS means at a site.

    Parameters
    ----------
    crs : pyproj.CRS or None
    at : array_like of shape (3,)
        Easting, northing and height of the site, metres. The height serves the height effect as
        if it were above the ellipsoid; the geoid's part in that is below 17 ppm.

    Returns
    -------
    CrsReport

    Notes
    -----
    The combined factor is ``k (1 - h / R)`` with the point scale k (the root of PROJ's areal
    scale) and the Gaussian mean radius of curvature R.

    Examples
    --------
    >>> report = describe_crs(parse_crs("EPSG:32615"), at=[740_711, 4_280_069, 150])
    >>> round(report.grid_scale, 6), round(report.convergence_deg, 3), report.vertical_datum
    (1.000314, 1.728, None)
    """
    if crs is None:
        caution = Caution("crs_missing", "there is no CRS: coordinates are taken as metres.")
        return CrsReport("none", None, ("metre",) * 3, np.ones(3), cautions=(caution,))
    horizontal, _ = split_crs(crs)
    easting, northing, height = np.asarray(at, np.float64)
    refusal = _refusal(crs)
    units = axis_units(crs)
    to_metre = np.full(3, np.nan) if refusal else np.array([factor for _, factor in units])
    longitude, latitude = lonlat(horizontal, easting / to_metre[0], northing / to_metre[1])
    scale, convergence = grid_factors(horizontal, longitude, latitude)
    effect = -height / mean_radius(horizontal, latitude)
    combined = scale * (1 + effect)
    stray = stray_deg(horizontal, longitude, latitude) if np.isfinite(at).all() else math.nan
    is_ensemble, accuracy = datum_ensemble(horizontal)
    report = CrsReport(
        name=crs.name,
        code=crs_code(crs),
        units=(units[0][0], units[1][0], units[2][0]),
        to_metre=to_metre,
        datum=horizontal.datum.name if horizontal.datum else None,
        is_ensemble=is_ensemble,
        ensemble_accuracy_m=accuracy,
        vertical_datum=vertical_datum(crs),
        longitude_deg=longitude,
        latitude_deg=latitude,
        in_area_of_use=None if math.isnan(stray) else stray == 0,
        grid_scale=scale,
        convergence_deg=convergence,
        height_effect_ppm=1e6 * effect,
        combined_factor=combined,
        mm_over_100_m=1e5 * (combined - 1),
    )
    doubts = [Caution("crs_doubtful", refusal)] if refusal else _doubts(report, horizontal)
    return replace(report, cautions=(*conversion_cautions(crs), *doubts))


def _doubts(report: CrsReport, horizontal: pyproj.CRS) -> list[Caution]:
    doubts = []
    if report.in_area_of_use is False:
        place = f"longitude {report.longitude_deg:.3f}, latitude {report.latitude_deg:.3f}"
        place = "no longitude and latitude" if math.isnan(report.longitude_deg) else place
        message = f"{report.name}: the site, at {place}, lies outside its area of use."
        doubts.append(Caution("crs_doubtful", message))
    turned = [a.direction for a in horizontal.axis_info if a.direction in ("west", "south")]
    if len(set(turned)) == 2:
        message = f"{report.name} counts {' and '.join(turned)}, not east and north."
        doubts.append(Caution("crs_doubtful", message))
    if report.vertical_datum is None:
        message = f"{report.name} does not say what heights count from: name a vertical CRS."
        doubts.append(Caution("vertical_datum_unknown", message))
    if report.is_ensemble:
        message = (
            f"{report.datum} stands for several realisations: positions in {report.name} are "
            f"known to {report.ensemble_accuracy_m:g} m unless the realisation is stated."
        )
        doubts.append(Caution("datum_ensemble", message))
    if abs(report.mm_over_100_m) > GRID_MM:
        message = (
            f"the map adds {report.mm_over_100_m:+.1f} mm to 100 m on the ground (point scale "
            f"{report.grid_scale:.6f}, height effect {report.height_effect_ppm:+.1f} ppm) and "
            f"nothing to heights: one scale can't serve both."
        )
        doubts.append(Caution("grid_scale", message))
    return doubts


def _parse(text: str | pyproj.CRS | None) -> pyproj.CRS | None:
    if isinstance(text, str):
        # Some writers leave NULs, or a pair of quotes, where WKT should stand.
        text = text.strip(" \t\r\n\0'\"")
    if text is None or text == "":
        return None
    try:
        with warnings.catch_warnings():
            # "+init=" is old, not wrong.
            warnings.simplefilter("ignore", FutureWarning)
            return pyproj.CRS.from_user_input(text)
    except CRSError as error:
        shown = " ".join(str(text).split())
        shown = shown if len(shown) <= 60 else f"{shown[:60]}..."
        reason = " ".join(str(error).split()).rpartition("Internal Proj Error: ")[2].rstrip(")")
        message = (
            f"{shown!r} names no coordinate reference system ({reason[:200]}): give an EPSG code "
            f"such as EPSG:32615, or WKT."
        )
        raise CrsError(message) from None


def _refusal(crs: pyproj.CRS) -> str:
    """Say why lengths and heights can't be had in a CRS; empty if they can."""
    horizontal, _ = split_crs(crs)
    unit = axis_units(crs)[0][0]
    if horizontal.is_geographic or unit in ("degree", "grad", "radian"):
        reason = f"counts in {unit}s, not in lengths: it is refused for metric work"
    elif horizontal.is_geocentric:
        reason = "is geocentric: none of its axes is a height, so it is refused"
    elif horizontal.is_vertical:
        reason = "is a vertical CRS alone: it says nothing about easting and northing"
    else:
        return ""
    return f"{crs.name} {reason}. Use a projected CRS, such as the UTM zone of the site."


def _misfit(crs: pyproj.CRS, extent: NDArray[np.float64]) -> str:
    """Say how a CRS does not fit coordinates in its units, of shape (2, 3); empty if it does."""
    horizontal, _ = split_crs(crs)
    reach = np.abs(extent).max(axis=0)
    if not np.isfinite(extent).all():
        return ""
    if horizontal.is_geographic:
        # Longitudes may run to 360, and may stand in either column.
        beyond = reach[:2].max() > 360
        return (
            f"the header says {crs.name} ({horizontal.axis_info[0].unit_name}s), but its "
            f"coordinates reach {reach[0]:,.0f}, {reach[1]:,.0f}: it is not believed, and they "
            f"are taken as metres. Name the right CRS with --crs."
            if beyond
            else ""
        )
    centre = extent.mean(axis=0)
    stray = stray_deg(horizontal, *lonlat(horizontal, centre[0], centre[1]))
    where = f"{stray:.1f} degrees outside its area of use" if math.isfinite(stray) else "nowhere"
    return (
        f"the header says {crs.name}, but coordinates about {centre[0]:,.0f}, {centre[1]:,.0f} "
        f"lie {where}: name the right CRS with --crs."
        if stray > STRAY_DEG
        else ""
    )


def _apart(one: pyproj.CRS, other: pyproj.CRS, extent: NDArray[np.float64]) -> float:
    """Metres between the places where two CRSs put the middle of the extent."""
    if not np.isfinite(extent).all():
        return 0.0
    centre = extent.mean(axis=0)
    places = [lonlat(split_crs(crs)[0], centre[0], centre[1]) for crs in (one, other)]
    metres = float(pyproj.Geod(ellps="GRS80").inv(*places[0], *places[1])[2])
    return math.inf if math.isnan(metres) else metres
