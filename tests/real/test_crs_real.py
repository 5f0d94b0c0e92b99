import laspy
import numpy as np
import pytest
from numpy.testing import assert_allclose

from trigpoint.crs import describe_crs, header_crs, metre_factors

US_FOOT = 1200 / 3937

# Name of the file; the CRS believed; the cautions; metres per unit of easting and height.
HEADERS = {
    "ign_extra_dims_pf8.laz": ("RGF93 v1 / Lambert-93", [], 1, 1),
    "ign_lareunion_epsg2975.laz": ("RGR92 / UTM zone 40S", [], 1, 1),
    # Keys name the metric grid with axes in feet, WKT the grid in feet: the same place.
    "laspy_both_wkt_and_geotiff.las": ("NAD83_2011_Nebraska_ft", [], US_FOOT, US_FOOT),
    "laspy_extra_bytes.laz": (None, ["crs_missing"], 1, 1),
    # Feet under a CRS in metres: 3 degrees outside Oregon.
    "laspy_simple_with_page.copc.laz": (
        "NAD83 / Oregon LCC (m) + NAVD88 height (ftUS)",
        ["crs_doubtful"],
        1,
        US_FOOT,
    ),
    "pdal_1.2-with-color.copc.laz": (
        "NAD83 / Oregon LCC (m) + NAVD88 height (ftUS)",
        ["crs_doubtful"],
        1,
        US_FOOT,
    ),
    "pdal_autzen_bmx_2010.las": (
        "NAD83 / Oregon LCC (m) + NAVD88 height (ftUS)",
        [],
        1,
        US_FOOT,
    ),
    "pdal_autzen_bmx_2023.las": (
        "NAD83 / Oregon LCC (m) + NAVD88 height (ftUS)",
        [],
        1,
        US_FOOT,
    ),
    "pdal_autzen_trim_feet.laz": ("NAD_1983_HARN_Lambert_Conformal_Conic", [], 0.3048, 0.3048),
    "pdal_bad-geotiff-keys.las": ("WGS 84 / UTM zone 17N", [], 1, 1),
    # EPSG:4326 over UTM coordinates.
    "pdal_lone_star_riegl_tls_518k.laz": (None, ["crs_doubtful"], 1, 1),
    "pdal_sample_c_building_nocrs.las": (None, ["crs_missing"], 1, 1),
    "pdal_warsaw_small_empty_wkt.las": (None, ["crs_missing"], 1, 1),
    "pdal_epsg_4326_degrees.las": ("WGS 84", [], None, None),
}


def header(path):
    with laspy.open(path) as reader:
        wkt, keys = None, {}
        for vlr in [*reader.header.vlrs, *(reader.header.evlrs or [])]:
            if isinstance(vlr, laspy.vlrs.known.WktCoordinateSystemVlr):
                wkt = vlr.string
            if isinstance(vlr, laspy.vlrs.known.GeoKeyDirectoryVlr):
                keys = {k.id: k.value_offset for k in vlr.geo_keys if k.tiff_tag_location == 0}
        return wkt, keys, np.array(reader.header.mins), np.array(reader.header.maxs)


@pytest.mark.parametrize("name", HEADERS)
def test_every_odd_header_gives_a_crs_none_or_a_doubt(name, real_data):
    expected, codes, plan, height = HEADERS[name]
    wkt, keys, low, high = header(real_data(f"format_zoo/{name}"))
    crs, cautions = header_crs(wkt, keys, low, high)
    assert (crs.name if crs else None) == expected
    assert [caution.code for caution in cautions] == codes
    report = describe_crs(crs, at=(low + high) / 2 * (metre_factors(crs) if plan else 1))
    if plan:
        assert_allclose(report.to_metre, [plan, plan, height], rtol=1e-9)
    if crs and plan:
        assert report.in_area_of_use is not False or codes == ["crs_doubtful"]
        assert np.isfinite(report.combined_factor)


def test_the_table_names_every_las_file_of_the_zoo(real_data):
    folder = real_data("format_zoo")
    assert {path.name for path in folder.glob("*.la[sz]")} == set(HEADERS)
