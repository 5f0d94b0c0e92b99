"""The evaluation region and the height zones."""

import json

import numpy as np
import pyproj
import pytest
import shapely

from trigpoint.cloud import PointCloud, cloud_from
from trigpoint.errors import RegionError
from trigpoint.zones import (
    Outline,
    extent,
    height_zones,
    outline_format,
    padded_box,
    read_outline,
)

UTM15 = pyproj.CRS("EPSG:32615")
SITE = np.array([741_000.0, 4_279_000.0, 150.0])


def square(low, high):
    return [[low, low], [high, low], [high, high], [low, high], [low, low]]


def geojson(path, *rings, crs=None, shift=SITE[:2]):
    """Write one polygon; the first ring is its border, the others are holes."""
    polygon = [[[x + shift[0], y + shift[1]] for x, y in ring] for ring in rings]
    document = {
        "type": "FeatureCollection",
        "features": [
            {
                "type": "Feature",
                "properties": {},
                "geometry": {"type": "Polygon", "coordinates": polygon},
            }
        ],
    }
    if crs:
        document["crs"] = {"type": "name", "properties": {"name": crs}}
    path.write_text(json.dumps(document))
    return path


def at(*places):
    return cloud_from(np.array(places) + SITE)


def test_zones_are_cut_from_the_height_range():
    zones = height_zones(150, 250)
    assert zones.names == ("lower", "middle", "upper")
    np.testing.assert_allclose(zones.edges_m, [150, 183, 216, 250])


def test_an_edge_belongs_to_the_zone_above_and_the_top_to_the_highest():
    zones = height_zones(0, 100)
    assert zones.of(np.array([0, 32.999, 33, 65.999, 66, 100.0])).tolist() == [0, 0, 1, 1, 2, 2]


def test_points_beyond_the_range_belong_to_the_outer_zones():
    assert height_zones(0, 100).of(np.array([-1e6, 1e6])).tolist() == [0, 2]


def test_other_numbers_of_zones_are_numbered():
    assert height_zones(0, 1, fractions=(0.5,)).names == ("zone_1", "zone_2")
    assert height_zones(0, 1, fractions=()).names == ("zone_1",)
    assert len(height_zones(0, 1, fractions=(0.2, 0.4, 0.6, 0.8)).edges_m) == 6


@pytest.mark.parametrize("fractions", [(0.66, 0.33), (0.5, 0.5), (0, 0.5), (0.5, 1), (np.nan,)])
def test_fractions_that_do_not_ascend_between_0_and_1_are_refused(fractions):
    with pytest.raises(RegionError, match="must ascend between 0 and 1"):
        height_zones(0, 1, fractions=fractions)


def test_a_box_keeps_what_lies_in_its_margin_on_every_side():
    box = padded_box(SITE, SITE + 10, margin=1)
    inside = box.contains(
        at([-1, 5, 5], [-1.001, 5, 5], [5, 11, 5], [5, 11.001, 5], [5, 5, -1], [5, 5, 11.001])
    )
    assert inside.tolist() == [True, False, True, False, True, False]
    assert padded_box(SITE, SITE + 10, margin=0).contains(at([0, 0, 0], [10, 10, 10])).all()


@pytest.mark.parametrize("margin", [-1, np.nan, np.inf])
def test_a_margin_below_zero_is_refused(margin):
    with pytest.raises(RegionError, match="must be zero or more"):
        padded_box(SITE, SITE, margin=margin)


@pytest.mark.parametrize("crs", ["urn:ogc:def:crs:EPSG::32615", None])
def test_an_outline_crops_in_plan_at_any_height_and_holes_are_outside(tmp_path, crs):
    # Many a GeoJSON holds map coordinates and no word of it: GDAL then says longitude, latitude.
    path = geojson(tmp_path / "region.geojson", square(0, 10), square(4, 6), crs=crs)
    outline = read_outline(path, crs=UTM15)
    inside = outline.contains(at([1, 1, 0], [1, 1, 1e4], [5, 5, 0], [11, 5, 0], [0, 5, 0]))
    assert inside.tolist() == [True, True, False, False, True]
    assert [caution.code for caution in outline.cautions] == ([] if crs else ["crs_doubtful"])


def test_longitude_and_latitude_are_carried_to_the_clouds_crs(tmp_path):
    back = pyproj.Transformer.from_crs(UTM15, "EPSG:4326", always_xy=True)
    ring = np.array(square(0, 10)) + SITE[:2]
    path = geojson(
        tmp_path / "region.geojson", np.column_stack(back.transform(*ring.T)), shift=(0, 0)
    )
    found = read_outline(path, crs=UTM15)
    wanted = shapely.Polygon(ring)
    assert found.shape.symmetric_difference(wanted).area < 1e-3
    assert not found.cautions


def test_several_polygons_of_any_format_count(tmp_path):
    pyogrio = pytest.importorskip("pyogrio", reason="reading regions needs pyogrio")
    shapes = [
        shapely.box(*SITE[:2], *(SITE[:2] + 2)),
        shapely.MultiPolygon([shapely.box(*(SITE[:2] + 5), *(SITE[:2] + 6))]),
        shapely.box(*(SITE[:2] + 1), *(SITE[:2] + 3)),
        shapely.Point(SITE[:2] + 20),
    ]
    path = tmp_path / "region.gpkg"
    pyogrio.raw.write(
        path,
        geometry=shapely.to_wkb(shapes),
        field_data=[],
        fields=[],
        geometry_type="Unknown",
        crs="EPSG:32615",
        layer="region",
    )
    assert outline_format(path) == "GPKG"
    outline = read_outline(path, crs=UTM15)
    inside = outline.contains(at([1, 1, 0], [2.5, 2.5, 0], [5.5, 5.5, 0], [4, 4, 0], [20, 20, 0]))
    assert inside.tolist() == [True, True, True, False, False]
    assert outline.shape.area == pytest.approx(4 + 4 - 1 + 1)


def test_a_region_in_feet_becomes_metres_as_its_cloud_did(tmp_path):
    feet = pyproj.CRS("EPSG:2264")
    path = geojson(
        tmp_path / "region.geojson",
        square(0, 100),
        crs="urn:ogc:def:crs:EPSG::2264",
        shift=(1_500_000, 600_000),
    )
    foot = 1200 / 3937
    corner = np.array([1_500_000, 600_000, 0]) * foot
    inside = read_outline(path, crs=feet).contains(
        cloud_from(corner + np.array([[99 * foot, 1, 0], [101 * foot, 1, 0]]))
    )
    assert inside.tolist() == [True, False]


def test_degrees_are_refused_where_the_cloud_has_no_crs(tmp_path):
    path = geojson(tmp_path / "region.geojson", square(0, 1), shift=(-90, 38))
    with pytest.raises(RegionError, match="the reference cloud has no CRS"):
        read_outline(path)


def test_map_coordinates_are_taken_as_they_are_where_the_cloud_has_no_crs(tmp_path):
    path = geojson(tmp_path / "region.geojson", square(0, 10))
    assert read_outline(path).contains(at([1, 1, 0], [11, 1, 0])).tolist() == [True, False]


def test_what_is_no_region_is_refused(tmp_path):
    with pytest.raises(RegionError, match="there is no such region file"):
        read_outline(tmp_path / "nothing.geojson")
    broken = tmp_path / "broken.geojson"
    broken.write_text("{")
    with pytest.raises(RegionError, match="can't be read as polygons"):
        read_outline(broken)
    line = tmp_path / "line.geojson"
    line.write_text(json.dumps({"type": "LineString", "coordinates": [[0, 0], [1, 1]]}))
    with pytest.raises(RegionError, match="1 shapes and none encloses an area"):
        read_outline(line)


@pytest.mark.parametrize(
    "ring",
    [
        "[[0, 0], [9, 0], [9, 9], [0, 9]]",
        "[[0, 0]]",
        "[[0, 0], [9, 0], [1e999, 9], [0, 0]]",
        "[[0, 0], [9, 0], [NaN, 9], [0, 9], [0, 0]]",
        "[[0, 0], [1e300, 0], [1e300, 1e300], [0, 0]]",
    ],
)
def test_a_ring_that_is_open_or_leads_nowhere_is_refused(tmp_path, ring):
    path = tmp_path / "region.geojson"
    path.write_text(f'{{"type": "Polygon", "coordinates": [{ring}]}}')
    with pytest.raises(RegionError, match=r"^region.geojson holds (a ring that is no|1 shapes)"):
        read_outline(path)


def test_an_outline_looks_at_absolute_coordinates():
    outline = Outline(shapely.box(*SITE[:2], *(SITE[:2] + 1)))
    points = np.array([[0.5, 0.5, 0], [1.5, 0.5, 0]])
    for origin in (SITE, SITE - 1_000):
        cloud = PointCloud(points + (SITE - origin), origin)
        assert outline.contains(cloud).tolist() == [True, False]


@pytest.mark.parametrize("n", [1, 63, 64, 65, 1000])
def test_the_extent_is_that_of_every_point(n, offset):
    points = np.random.default_rng(n).normal(0, 9, (n, 3))
    low, high = extent(PointCloud(points, offset))
    np.testing.assert_array_equal(low, points.min(axis=0) + offset)
    np.testing.assert_array_equal(high, points.max(axis=0) + offset)


def test_the_extent_of_nothing_is_infinite():
    low, high = extent(PointCloud(np.empty((0, 3)), SITE))
    assert np.isposinf(low).all()
    assert np.isneginf(high).all()
