"""Every odd file of the zoo is read right, or refused with a sentence that says what it is."""

import laspy
import numpy as np
import pytest

from trigpoint.errors import CloudError, CrsError
from trigpoint.files import carry, describe, read
from trigpoint.similarity import Similarity

FOOT, FOOT_US = 0.3048, 1200 / 3937

# Points, first point as stored, metres per unit, EPSG code or part of the CRS's name, cautions.
READ = {
    "ign_extra_dims_pf8.laz": (72_770, [770561.32, 6277506.59, 20.92], 1, 2154, []),
    "ign_lareunion_epsg2975.laz": (59_712, [377016.62, 7655950.54, 150.74], 1, 2975, []),
    "laspy_both_wkt_and_geotiff.las": (
        25_408,
        [2445180.75, 604324.04, 1354.22],
        FOOT_US,
        "NAD83_2011_Nebraska_ft",
        ["units_converted"],
    ),
    "laspy_extra_bytes.laz": (1065, [637012.24, 849028.31, 431.66], 1, None, ["crs_missing"]),
    "laspy_simple_with_page.copc.laz": (
        1065,
        [636145.60, 849170.47, 428.15],
        [1, 1, FOOT_US],
        "NAVD88 height (ftUS)",
        # The coordinates are feet of another CRS: they lie outside the one that the header names.
        ["crs_doubtful", "units_converted"],
    ),
    "pdal_1.2-with-color.copc.laz": (
        1065,
        [636145.60, 849170.47, 428.15],
        [1, 1, FOOT_US],
        "NAVD88 height (ftUS)",
        ["crs_doubtful", "units_converted"],
    ),
    "pdal_A_B.e57": (6, [-42.63949966, 1.87259996, 0.66670001], 1, None, ["crs_missing"]),
    "pdal_autzen-utm.pcd": (1065, [494428.61, 4877455.58, 131.57], 1, None, []),
    "pdal_autzen_bmx_2010.las": (
        829,
        [194506.86, 259235.01, 426.54],
        [1, 1, FOOT_US],
        "NAVD88 height (ftUS)",
        ["units_converted"],
    ),
    "pdal_autzen_bmx_2023.las": (
        687,
        [194474.56, 259231.61, 425.07],
        [1, 1, FOOT_US],
        "NAVD88 height (ftUS)",
        ["units_converted"],
    ),
    "pdal_autzen_trim_feet.laz": (
        110_000,
        [637177.98, 849393.95, 411.19],
        FOOT,
        "NAD_1983_HARN_Lambert_Conformal_Conic",
        ["units_converted"],
    ),
    "pdal_bad-geotiff-keys.las": (10, [289814.15, 4320978.61, 170.76], 1, 32617, []),
    "pdal_lone_star_riegl_tls_518k.laz": (
        518_862,
        [515396.148, 4918348.30, 2323.8455],
        1,
        None,
        ["crs_doubtful"],
    ),
    "pdal_sample_c_building_nocrs.las": (
        14_408,
        [674522.00, 1206771.75, 627.590029],
        1,
        None,
        ["crs_missing"],
    ),
    "pdal_warsaw_small_empty_wkt.las": (
        3000,
        [639944.97, 485154.44, 84.82],
        1,
        None,
        ["crs_missing"],
    ),
    "pix4d_test_offset.xyz": (1, [368109.0, 3956043.0, 96.0], 1, None, []),
}

REFUSED = {
    "cloudcompare_icp_adjustscale_MATRIX.txt": "a 4x4 transformation matrix",
    "cloudcompare_icp_rigid_MATRIX.txt": "a 4x4 transformation matrix",
    "colmap_fountain_bin": "a COLMAP model folder: export its points as PLY",
    "colmap_fountain_bin/points3D.bin": "part of a COLMAP model: export its points as PLY",
    "evo_georeferenced.tum": "a trajectory (TUM: time, position, quaternion)",
    "helmert3d_param.txt": "the parameters of a similarity",
    "instantngp_fox_transforms.json": "a nerfstudio or instant-ngp camera file",
    "matrix4x4_small_gicp.txt": "a 4x4 transformation matrix",
    "nerfstudio_lego_test_transforms_train.json": "a nerfstudio or instant-ngp camera file",
    "odm_bellus_gcp_list.txt": "a list of ground control points",
    "odm_copr_gcp_list.txt": "a list of ground control points",
    "opensfm_berlin_ground_control_points.json": "OpenSfM's ground control points",
    "opensfm_berlin_reconstruction.json": "an OpenSfM reconstruction",
    "pdal_epsg_4326_degrees.las": "counts in degrees",
    "qgis_sheet.points": "QGIS georeferencer points, which are two-dimensional",
    "tanksandtemples_mapping.txt": "a table of image numbers",
    "tanksandtemples_test.log": "a camera trajectory",
}


def test_every_file_of_the_zoo_is_in_one_of_the_tables(real_data):
    files = {path.name for path in real_data("format_zoo").iterdir()} - {"SOURCE.md"}
    assert files == {name for name in {**READ, **REFUSED} if "/" not in name}


@pytest.mark.parametrize("name", READ)
def test_a_file_is_read_right(real_data, name):
    points, first, to_metre, crs, codes = READ[name]
    path = real_data(f"format_zoo/{name}")
    cloud, found = read(path), describe(path)
    assert len(cloud) == found.points == points
    np.testing.assert_allclose(
        cloud.coordinates[0], np.multiply(first, to_metre), rtol=0, atol=6e-3
    )
    for extent, end in ((found.low, "min"), (found.high, "max")):
        actual = getattr(cloud.coordinates, end)(axis=0)
        np.testing.assert_allclose(extent, actual, rtol=0, atol=3e-3)
    assert [caution.code for caution in found.cautions] == codes
    assert set(found.attributes) == set(cloud.attributes)
    if isinstance(crs, int):
        assert cloud.crs.to_epsg() == crs
    else:
        assert cloud.crs is None if crs is None else crs in cloud.crs.name


@pytest.mark.parametrize("name", [n for n in READ if n.endswith((".las", ".laz"))])
def test_laspy_reads_the_same(real_data, name):
    path = real_data(f"format_zoo/{name}")
    las, cloud = laspy.read(path), read(path)
    stored = cloud.coordinates / READ[name][2]
    np.testing.assert_allclose(stored, las.xyz, rtol=0, atol=2e-9)
    for dimension, values in cloud.attributes.items():
        np.testing.assert_array_equal(values, np.array(las[dimension]))
    np.testing.assert_array_equal(read(path, attributes=False).xyz, cloud.xyz)


@pytest.mark.parametrize("name", [n for n in READ if n.endswith((".las", ".laz"))])
def test_everything_in_a_file_survives_being_carried(real_data, tmp_path, name):
    path = real_data(f"format_zoo/{name}")
    cloud = read(path)
    stay = Similarity(1.0, np.eye(3), np.zeros(3))
    points, _ = carry(path, tmp_path / "out.laz", stay, crs=cloud.crs)
    back = read(tmp_path / "out.laz")
    assert points == len(back)
    assert np.abs(back.coordinates - cloud.coordinates).max() < 1e-4
    for dimension in set(cloud.attributes) - {"scan_angle_rank"}:
        np.testing.assert_array_equal(back.attributes[dimension], cloud.attributes[dimension])
        assert back.attributes[dimension].dtype == cloud.attributes[dimension].dtype


@pytest.mark.parametrize("name", REFUSED)
def test_a_file_is_refused_with_what_it_is(real_data, name):
    with pytest.raises((CloudError, CrsError)) as caught:
        read(real_data(f"format_zoo/{name}"))
    assert REFUSED[name] in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_cloud_in_degrees_can_still_be_described(real_data):
    found = describe(real_data("format_zoo/pdal_epsg_4326_degrees.las"))
    assert found.points == 5380
    assert found.low.round(3).tolist() == [-94.683, 31.037, 39.081]
    assert "crs_doubtful" in [caution.code for caution in found.cautions]


@pytest.mark.parametrize(
    "name", ["pdal_1.2-with-color.copc.laz", "laspy_simple_with_page.copc.laz"]
)
def test_a_bounds_query_of_copc_gives_what_filtering_gives(real_data, name):
    path = real_data(f"format_zoo/{name}")
    las = laspy.read(path)
    low, high = np.percentile(las.xyz, 30, axis=0), np.percentile(las.xyz, 70, axis=0)
    for ends in (3, 2):
        inside = ((las.xyz >= low) & (las.xyz <= high))[:, :ends].all(axis=1)
        assert 0 < inside.sum() < len(las.xyz)
        found = read(path, bounds=(low[:ends], high[:ends]))
        expected = las.xyz[inside] * [1, 1, FOOT_US]
        order = np.lexsort(expected.round(3).T)
        mine = np.lexsort(found.coordinates.round(3).T)
        np.testing.assert_allclose(found.coordinates[mine], expected[order], rtol=0, atol=2e-9)
        np.testing.assert_array_equal(
            np.sort(found.attributes["gps_time"]), np.sort(np.array(las.gps_time)[inside])
        )
    assert len(read(path, bounds=(high + 1e5, high + 2e5))) == 0
    whole = (np.full(3, -np.inf), np.full(3, np.inf))
    assert len(read(path, bounds=whole)) == len(las.xyz)
