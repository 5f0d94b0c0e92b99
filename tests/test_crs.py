import json
import os
import socket
import subprocess
import sys

import numpy as np
import pyproj
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from trigpoint.crs import (
    conversion_cautions,
    describe_crs,
    header_crs,
    metre_factors,
    parse_crs,
)
from trigpoint.errors import CrsError
from trigpoint.geokeys import keyed_crs

US_FOOT = 1200 / 3937
ST_LOUIS = np.array([740_711.0, 4_280_069.0, 150.0])
LOW, HIGH = ST_LOUIS - 20, ST_LOUIS + 20


def codes(cautions):
    return [caution.code for caution in cautions]


def wkt1(code):
    return pyproj.CRS(code).to_wkt("WKT1_GDAL")


# What a text names


@pytest.mark.parametrize(
    "text",
    [
        "EPSG:32615",
        " epsg:32615 ",
        "'EPSG:32615'",
        "urn:ogc:def:crs:EPSG::32615",
        "WGS 84 / UTM zone 15N",
        "+proj=utm +zone=15 +datum=WGS84",
        "+init=epsg:32615",
        wkt1(32615),
        wkt1(32615) + "\0\0",
        pyproj.CRS(32615).to_wkt("WKT2_2019"),
        pyproj.CRS(32615).to_wkt("WKT1_ESRI"),
        pyproj.CRS(32615),
    ],
    ids=lambda text: str(text)[:24],
)
def test_a_crs_is_known_by_code_name_wkt_and_proj_string(text):
    assert parse_crs(text).to_epsg() == 32615


@pytest.mark.parametrize("text", ["", "  ", None, "\0\0", "''", '""'])
def test_empty_text_says_that_there_is_no_crs(text):
    assert parse_crs(text) is None


@pytest.mark.parametrize(
    "text", ["EPSG:999999", "tower", "UTM", 'PROJCS["cut off', "NAD83 Missouri", "{}", "+proj=nope"]
)
def test_what_is_no_crs_is_refused_in_one_line_that_says_what_would_do(text):
    with pytest.raises(CrsError, match="EPSG:32615") as caught:
        parse_crs(text)
    assert "\n" not in str(caught.value)
    assert len(str(caught.value)) < 450


def test_a_vertical_crs_can_be_added():
    crs = parse_crs("EPSG:32615", vertical="EPSG:6360")
    assert_allclose(metre_factors(crs), [1, 1, US_FOOT], rtol=1e-12)
    assert describe_crs(crs, at=ST_LOUIS).code == "EPSG:32615+6360"
    assert parse_crs("EPSG:32615", vertical="").to_epsg() == 32615


@pytest.mark.parametrize(
    ("text", "vertical"),
    [("", "EPSG:5703"), ("EPSG:32615+5703", "EPSG:5703"), ("EPSG:32615", "EPSG:32615")],
    ids=["to nothing", "to heights", "not vertical"],
)
def test_a_vertical_crs_that_does_not_fit_is_refused(text, vertical):
    with pytest.raises(CrsError, match="can't be added"):
        parse_crs(text, vertical=vertical)


def test_parts_from_two_registers_have_no_common_code():
    crs = parse_crs("ESRI:102696", vertical="EPSG:5703")
    assert describe_crs(crs, at=[250_000, 310_000, 150]).code is None


# Units


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("EPSG:32615", [1, 1, 1]),
        ("ESRI:102696", [US_FOOT] * 3),
        ("EPSG:2992", [0.3048] * 3),
        ("EPSG:2991+6360", [1, 1, US_FOOT]),
        ("EPSG:2992+5703", [0.3048, 0.3048, 1]),
        ("EPSG:2180", [1, 1, 1]),
        ('LOCAL_CS["site",UNIT["Foot_US",0.304800609601219]]', [US_FOOT] * 3),
        ("+proj=utm +zone=33 +ellps=bessel +towgs84=1,2,3,0,0,0,0 +units=us-ft", [US_FOOT] * 3),
    ],
)
def test_metres_per_unit_are_found_axis_by_axis(text, expected):
    assert_allclose(metre_factors(parse_crs(text)), expected, rtol=1e-12)


def test_without_a_crs_coordinates_are_metres():
    assert metre_factors(None).tolist() == [1, 1, 1]
    report = describe_crs(None, at=[0, 0, 0])
    assert codes(report.cautions) == ["crs_missing"]
    assert np.isnan(report.grid_scale)


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("EPSG:4326", "degrees.*refused for metric work"),
        ("EPSG:4979", "degrees.*refused for metric work"),
        ("EPSG:4326+5703", "degrees.*refused for metric work"),
        ("EPSG:4978", "geocentric"),
        ("EPSG:5703", "vertical CRS alone"),
    ],
)
def test_what_has_no_lengths_or_heights_is_refused_but_can_be_described(text, reason):
    crs = parse_crs(text)
    with pytest.raises(CrsError, match=reason):
        metre_factors(crs)
    report = describe_crs(crs, at=[-90, 38, 100])
    assert codes(report.cautions) == ["crs_doubtful"]
    assert np.isnan(report.to_metre).all()
    assert conversion_cautions(crs) == ()


def test_the_caution_about_feet_names_units_and_what_was_assumed():
    (stated,) = conversion_cautions(parse_crs("EPSG:2991+6360"))
    assert stated.code == "units_converted"
    assert "heights from US survey foot (0.3048006096 m)" in stated.message
    (assumed,) = conversion_cautions(parse_crs("EPSG:2992"))
    assert "assumed" in assumed.message
    assert conversion_cautions(parse_crs("EPSG:32615")) == conversion_cautions(None) == ()


# What it means at a site


def test_utm_at_st_louis_is_313_ppm_long_and_turned_by_1_727_degrees():
    report = describe_crs(parse_crs("EPSG:32615"), at=ST_LOUIS)
    assert report.grid_scale == pytest.approx(1.000313, abs=2e-6)
    assert report.convergence_deg == pytest.approx(1.727, abs=1e-3)
    assert (report.is_ensemble, report.ensemble_accuracy_m) == (True, 2.0)
    assert report.in_area_of_use
    assert report.vertical_datum is None
    assert codes(report.cautions) == ["vertical_datum_unknown", "datum_ensemble", "grid_scale"]


def test_scale_and_convergence_agree_with_lengths_and_bearings_on_the_ellipsoid():
    crs = parse_crs("EPSG:32615")
    report = describe_crs(crs, at=ST_LOUIS)
    to_degrees = pyproj.Transformer.from_crs(crs, crs.geodetic_crs, always_xy=True)
    east, north = ST_LOUIS[0] + np.array([0, 0.0]), ST_LOUIS[1] + np.array([-50, 50.0])
    longitude, latitude = to_degrees.transform(east, north)
    bearing, _, length = pyproj.Geod(ellps="WGS84").inv(
        longitude[0], latitude[0], longitude[1], latitude[1]
    )
    assert report.grid_scale == pytest.approx(100 / length, rel=1e-8)
    assert report.convergence_deg == pytest.approx(bearing, abs=1e-4)


def test_height_and_grid_combine_as_millimetres_over_100_m():
    report = describe_crs(parse_crs("EPSG:32615"), at=[*ST_LOUIS[:2], 1500])
    assert report.height_effect_ppm == pytest.approx(-1e6 * 1500 / 6_375_000, rel=2e-3)
    assert report.combined_factor == pytest.approx(
        report.grid_scale * (1 + 1e-6 * report.height_effect_ppm), rel=1e-15
    )
    assert report.mm_over_100_m == pytest.approx((report.combined_factor - 1) * 1e5)


def test_the_site_is_in_metres_whatever_the_units():
    metres = describe_crs(parse_crs("EPSG:2991"), at=[194_490, 259_240, 130])
    feet = describe_crs(parse_crs("EPSG:2992"), at=[194_490, 259_240, 130])
    assert feet.longitude_deg == pytest.approx(metres.longitude_deg, abs=1e-9)
    # PROJ differentiates numerically: its factors are good to some 1e-11.
    assert feet.grid_scale == pytest.approx(metres.grid_scale, abs=1e-10)


@pytest.mark.parametrize("code", ["EPSG:2180", "EPSG:31467"], ids=["PL-1992", "Gauss-Krueger"])
def test_coordinates_are_easting_northing_even_where_the_crs_lists_northing_first(code):
    crs = parse_crs(code)
    assert crs.axis_info[0].direction == "north"
    area = crs.area_of_use
    longitude, latitude = area.west + 1, (area.south + area.north) / 2
    to_map = pyproj.Transformer.from_crs(crs.geodetic_crs, crs, always_xy=True)
    report = describe_crs(crs, at=[*to_map.transform(longitude, latitude), 0])
    assert report.longitude_deg == pytest.approx(longitude, abs=1e-9)
    assert report.latitude_deg == pytest.approx(latitude, abs=1e-9)
    assert report.in_area_of_use


def test_a_prime_meridian_elsewhere_turns_nothing():
    report = describe_crs(parse_crs("EPSG:27572"), at=[600_000, 2_200_000, 0])
    assert report.longitude_deg == pytest.approx(2.33722917)
    assert report.convergence_deg == pytest.approx(0, abs=1e-6)


@pytest.mark.parametrize("form", ["WKT1_GDAL", "WKT1_ESRI", "WKT2_2019"])
def test_an_ensemble_is_known_even_from_wkt_that_can_not_say_so(form):
    crs = parse_crs(pyproj.CRS(32615).to_wkt(form))
    report = describe_crs(crs, at=ST_LOUIS)
    assert (report.is_ensemble, report.ensemble_accuracy_m) == (True, 2.0)
    assert report.in_area_of_use


def test_a_datum_with_one_realisation_is_no_ensemble():
    report = describe_crs(parse_crs("EPSG:2154+5720"), at=[770_500, 6_277_500, 37])
    assert not report.is_ensemble
    assert np.isnan(report.ensemble_accuracy_m)
    assert report.vertical_datum == "Nivellement General de la France - IGN69"
    assert codes(report.cautions) == ["grid_scale"]


@pytest.mark.parametrize(
    ("text", "datum"),
    [
        ("EPSG:32615", None),
        ("EPSG:32615+5703", "North American Vertical Datum 1988"),
        (pyproj.CRS(32615).to_3d(), "ellipsoid"),
        (keyed_crs({3072: 32615, 4099: 9003}), None),
    ],
    ids=["none", "compound", "3D", "unit without a datum"],
)
def test_the_vertical_datum_is_known_or_said_to_be_unknown(text, datum):
    report = describe_crs(parse_crs(text), at=ST_LOUIS)
    assert report.vertical_datum == datum
    assert ("vertical_datum_unknown" in codes(report.cautions)) == (datum is None)


@pytest.mark.parametrize("at", [[4e6, 4_280_069, 0], [1e20, 1e20, 0]], ids=["far", "nowhere"])
def test_a_site_outside_the_area_of_use_is_doubtful(at):
    report = describe_crs(parse_crs("EPSG:32615"), at=at)
    assert report.in_area_of_use is False
    assert "crs_doubtful" in codes(report.cautions)


def test_an_unknown_site_leaves_numbers_out_and_raises_nothing():
    report = describe_crs(parse_crs("EPSG:32615"), at=[np.nan] * 3)
    assert report.in_area_of_use is None
    assert np.isnan([report.grid_scale, report.convergence_deg, report.mm_over_100_m]).all()


def test_an_area_of_use_may_cross_the_antimeridian():
    report = describe_crs(parse_crs("EPSG:3832"), at=[3e6, 0, 0])
    assert report.longitude_deg < -180 or report.longitude_deg > 170
    assert report.in_area_of_use


def test_axes_that_point_west_and_south_are_doubtful():
    report = describe_crs(parse_crs("EPSG:5513"), at=[1_144_058, 544_115, 0])
    (doubt,) = [c.message for c in report.cautions if c.code == "crs_doubtful"]
    assert "south and west" in doubt


def test_nothing_asks_the_network_or_changes_its_switch():
    # In a child, so that PROJ reads the environment afresh: network on, and we are the server.
    script = (
        "import json, pyproj; from trigpoint.crs import *;"
        "before = pyproj.network.is_network_enabled();"
        "report = describe_crs(parse_crs('EPSG:26715+5703'), at=[740711, 4280069, 150]);"
        "print(json.dumps([before, pyproj.network.is_network_enabled(), report.grid_scale]))"
    )
    with socket.create_server(("127.0.0.1", 0)) as server:
        server.setblocking(False)
        switched_on = {
            "PROJ_NETWORK": "ON",
            "PROJ_NETWORK_ENDPOINT": f"http://127.0.0.1:{server.getsockname()[1]}",
        }
        done = subprocess.run(
            [sys.executable, "-c", script],
            env=os.environ | switched_on,
            capture_output=True,
            check=True,
            timeout=30,  # PROJ waits for an answer as long as it takes
        )
        with pytest.raises(BlockingIOError):
            server.accept()
    before, after, scale = json.loads(done.stdout)
    assert before is after is True
    assert scale == pytest.approx(1.000313, abs=2e-6)


# What a header says


def test_a_sound_header_is_believed_without_a_word():
    crs, cautions = header_crs(wkt1(32615), None, LOW, HIGH)
    assert (crs.to_epsg(), cautions) == (32615, ())
    crs, cautions = header_crs(None, {1024: 1, 3072: 32615, 3076: 9001, 0: 0}, LOW, HIGH)
    assert (crs.to_epsg(), cautions) == (32615, ())


@pytest.mark.parametrize("wkt", [None, "", "\0\0\0", "''"])
@pytest.mark.parametrize("keys", [None, {}, {1024: 1, 3076: 9001}, {2048: 0}])
def test_an_empty_header_is_said_to_name_no_crs(wkt, keys):
    crs, cautions = header_crs(wkt, keys, LOW, HIGH)
    assert crs is None
    assert codes(cautions) == ["crs_missing"]


@pytest.mark.parametrize("record", ["wkt", "keys"])
def test_degrees_over_metre_sized_coordinates_are_not_believed(record):
    wkt, keys = (wkt1(4326), None) if record == "wkt" else (None, {2048: 4326})
    crs, cautions = header_crs(wkt, keys, LOW, HIGH)
    assert crs is None
    assert codes(cautions) == ["crs_doubtful"]
    assert "degrees" in cautions[0].message
    assert "4,280,089" in cautions[0].message


def test_degrees_over_degrees_are_believed_so_that_they_are_refused_later():
    crs, cautions = header_crs(None, {2048: 4326}, [-94.7, 31.0, 39], [-94.6, 31.1, 78])
    assert (crs.to_epsg(), cautions) == (4326, ())


def test_coordinates_outside_the_area_of_use_are_doubtful_but_keep_their_units():
    # Feet under a CRS in metres, as in a well-known sample file.
    crs, cautions = header_crs(
        wkt1("EPSG:2991+6360"), None, [635_619, 848_899, 406], [638_982, 853_535, 586]
    )
    assert codes(cautions) == ["crs_doubtful"]
    assert "degrees outside its area of use" in cautions[0].message
    assert_allclose(metre_factors(crs), [1, 1, US_FOOT])


@pytest.mark.parametrize(
    ("wkt", "keys"),
    [("garbage[", None), (None, {3072: 99999}), (None, {3072: 32767, 3076: 9003})],
    ids=["WKT", "unknown code", "user-defined"],
)
def test_a_record_that_can_not_be_used_is_doubtful(wkt, keys):
    crs, cautions = header_crs(wkt, keys, LOW, HIGH)
    assert crs is None
    assert codes(cautions) == ["crs_doubtful"]
    assert "\n" not in cautions[0].message


def test_one_good_record_serves_where_the_other_is_bad():
    crs, cautions = header_crs("garbage[", {3072: 32615}, LOW, HIGH)
    assert (crs.to_epsg(), codes(cautions)) == (32615, ["crs_doubtful"])
    crs, cautions = header_crs(wkt1(32615), {3072: 32767}, LOW, HIGH)
    assert (crs.to_epsg(), cautions) == (32615, ())


def test_two_records_that_disagree_are_a_conflict_and_wkt_goes_first():
    crs, cautions = header_crs(wkt1(32615), {3072: 32616}, LOW, HIGH)
    assert crs.to_epsg() == 32615
    assert codes(cautions) == ["crs_conflict"]
    assert "m apart" in cautions[0].message


def test_the_record_that_fits_the_extent_goes_before_the_one_that_does_not():
    crs, cautions = header_crs(wkt1(4326), {3072: 32615}, LOW, HIGH)
    assert crs.to_epsg() == 32615
    assert codes(cautions) == ["crs_conflict"]


def test_two_records_that_agree_are_no_conflict():
    for keys in ({3072: 32615}, {3072: 26915}):
        assert header_crs(wkt1(32615), keys, LOW, HIGH)[1] == ()


@pytest.mark.parametrize("edge", [np.nan, np.inf])
def test_without_an_extent_nothing_is_judged(edge):
    for wkt, keys in ((wkt1(32615), {3072: 32616}), (wkt1(4326), None)):
        crs, cautions = header_crs(wkt, keys, [edge] * 3, [-edge] * 3)
        assert crs is not None
        assert cautions == ()


KEYS = st.dictionaries(
    st.sampled_from([0, 1024, 2048, 3072, 3076, 4096, 4099]), st.integers(0, 65535), max_size=5
)


# PROJ looks unknown text up among its names, which takes a while.
@settings(deadline=None, max_examples=6)
@given(st.text(max_size=40))
def test_no_text_in_a_header_makes_it_crash(wkt):
    crs, cautions = header_crs(wkt, None, LOW, HIGH)
    assert crs is not None or cautions


@settings(deadline=None, max_examples=50)
@given(st.sampled_from([None, wkt1(4326), wkt1(32615)]), KEYS)
def test_no_keys_in_a_header_make_it_crash(wkt, keys):
    crs, cautions = header_crs(wkt, keys, LOW, HIGH)
    assert crs is not None or cautions


# GeoTIFF keys


def test_keys_that_change_the_unit_keep_the_place():
    metres = keyed_crs({3072: 32104, 3076: 9001})
    feet = keyed_crs({3072: 32104, 3076: 9003})
    assert_allclose(metre_factors(feet), [US_FOOT] * 3, rtol=1e-12)
    at = [745_300, 184_200, 400]
    one, other = describe_crs(metres, at=at), describe_crs(feet, at=at)
    assert other.longitude_deg == pytest.approx(one.longitude_deg, abs=1e-9)
    assert other.latitude_deg == pytest.approx(one.latitude_deg, abs=1e-9)


@pytest.mark.parametrize(
    ("keys", "factors", "datum"),
    [
        ({4096: 5703}, [1, 1, 1], "North American Vertical Datum 1988"),
        ({4096: 5103}, [1, 1, 1], "North American Vertical Datum 1988"),
        ({4096: 5103, 4099: 9003}, [1, 1, US_FOOT], "North American Vertical Datum 1988"),
        ({4096: 6360}, [1, 1, US_FOOT], "North American Vertical Datum 1988"),
        ({4099: 9002}, [1, 1, 0.3048], None),
        ({4099: 9001}, [1, 1, 1], None),
        ({4096: 32767}, [1, 1, 1], None),
        ({4096: 4326}, [1, 1, 1], None),
    ],
)
def test_vertical_keys_are_read_with_their_unit(keys, factors, datum):
    crs = keyed_crs({3072: 32615, **keys})
    assert_allclose(metre_factors(crs), factors, rtol=1e-12)
    assert describe_crs(crs, at=ST_LOUIS).vertical_datum == datum
