"""LAS, LAZ and COPC: nothing that a point carries is lost, and laspy reads the same."""

import datetime as dt

import laspy
import numpy as np
import pytest

from trigpoint.cloud import PointCloud
from trigpoint.crs import parse_crs
from trigpoint.errors import CloudError
from trigpoint.files import carry, describe, read, stream, write
from trigpoint.similarity import Similarity

UTM = np.array([741_000.0, 4_279_000.0, 150.0])
STAY = Similarity(1.0, np.eye(3), np.zeros(3))


def las_file(path, *, version="1.4", point_format=6, n=200, extra=(), scale=0.001):
    header = laspy.LasHeader(version=version, point_format=point_format)
    header.scales, header.offsets = np.full(3, scale), UTM
    for params in extra:
        header.add_extra_dim(params)
    las = laspy.LasData(header)
    rng = np.random.default_rng(3)
    las.x, las.y, las.z = (rng.uniform(-50, 50, (n, 3)) + UTM).T
    for dimension in las.point_format.dimensions:
        if dimension.name not in ("X", "Y", "Z") and dimension.is_standard:
            top = min(int(dimension.max), 60_000) if dimension.name != "gps_time" else 60_000
            low = 1 if "return" in dimension.name else 0
            las[dimension.name] = rng.integers(low, top + 1, n)
    for params in extra:
        shape = (n, *params.type.shape)
        las[params.name] = (
            rng.integers(0, 100, shape) * 0.5
            if params.scales is not None
            else rng.integers(0, 100, shape)
        )
    las.write(path)
    return laspy.read(path)


def test_laspy_reads_the_same_points(tmp_path):
    las = las_file(tmp_path / "cloud.laz", point_format=7)
    cloud = read(tmp_path / "cloud.laz")
    np.testing.assert_allclose(cloud.coordinates, las.xyz, rtol=0, atol=2e-9)
    assert set(cloud.attributes) == set(las.point_format.dimension_names) - {"X", "Y", "Z"}
    for name, values in cloud.attributes.items():
        np.testing.assert_array_equal(values, np.array(las[name]))


@pytest.mark.parametrize(
    ("version", "point_format"),
    [("1.2", 0), ("1.2", 1), ("1.2", 2), ("1.2", 3), ("1.4", 6), ("1.4", 7), ("1.4", 8)],
)
@pytest.mark.parametrize("suffix", [".las", ".laz"])
def test_every_attribute_survives(tmp_path, version, point_format, suffix):
    source, target = tmp_path / f"source{suffix}", tmp_path / f"target{suffix}"
    las = las_file(source, version=version, point_format=point_format)
    _, cautions = carry(source, target, STAY)
    back = laspy.read(target)
    assert cautions == ()
    assert str(back.header.version) == "1.4"
    assert np.abs(back.xyz - las.xyz).max() < 1e-5
    for name in set(las.point_format.dimension_names) - {"X", "Y", "Z", "scan_angle_rank"}:
        np.testing.assert_array_equal(np.array(back[name]), np.array(las[name]), err_msg=name)
    if "scan_angle_rank" in las.point_format.dimension_names:
        angle = np.array(back["scan_angle"]) * 0.006
        np.testing.assert_allclose(angle, np.array(las["scan_angle_rank"]), atol=0.0031)


def test_extra_dimensions_keep_type_width_scaling_and_description(tmp_path):
    extra = [
        laspy.ExtraBytesParams("height", "i4", "above ground", offsets=[10.0], scales=[0.5]),
        laspy.ExtraBytesParams("flow", "3i2", "", offsets=[0.0, 1, 2], scales=[0.5, 0.5, 0.5]),
        laspy.ExtraBytesParams("colours", "3u2"),
        laspy.ExtraBytesParams("time", "u8"),
        laspy.ExtraBytesParams("raw", "7u1"),
        laspy.ExtraBytesParams("ratio", "f4"),
    ]
    las = las_file(tmp_path / "source.laz", extra=extra)
    carry(tmp_path / "source.laz", tmp_path / "target.laz", STAY)
    back = laspy.read(tmp_path / "target.laz")
    for params in extra:
        old, new = (f.point_format.dimension_by_name(params.name) for f in (las, back))
        assert new == old
        np.testing.assert_array_equal(np.array(back[params.name]), np.array(las[params.name]))


def test_gps_time_keeps_its_meaning(tmp_path):
    for kind in (laspy.header.GpsTimeType.WEEK_TIME, laspy.header.GpsTimeType.STANDARD):
        las = las_file(tmp_path / "source.laz")
        las.header.global_encoding.value = int(kind) | 16
        las.write(tmp_path / "source.laz")
        carry(tmp_path / "source.laz", tmp_path / "target.laz", STAY)
        with laspy.open(tmp_path / "target.laz") as reader:
            assert reader.header.global_encoding.gps_time_type == kind


def test_gps_time_beyond_a_week_is_no_week_time(tmp_path):
    cloud = PointCloud(np.zeros((1, 3)), UTM, {"gps_time": np.array([2.5e8])})
    write(tmp_path / "cloud.las", cloud)
    with laspy.open(tmp_path / "cloud.las") as reader:
        assert reader.header.global_encoding.gps_time_type == laspy.header.GpsTimeType.STANDARD


def test_the_header_says_who_wrote_it_and_never_when(tmp_path):
    write(tmp_path / "cloud.laz", PointCloud(np.zeros((1, 3)), UTM))
    with laspy.open(tmp_path / "cloud.laz") as reader:
        header = reader.header
        assert (header.generating_software, header.system_identifier) == ("trigpoint", "trigpoint")
        assert header.creation_date == dt.date.min
        assert header.point_format.id == 6


def test_trap_8_the_step_is_a_tenth_of_a_millimetre_or_finer(tmp_path):
    crs = parse_crs("EPSG:32615+5703")
    rng = np.random.default_rng(0)
    # Ten kilometres across, and the first point in a corner.
    xyz = np.concatenate([[[0, 0, 0]], rng.uniform(0, 10_000, (1000, 3)), [[1e4, 1e4, 1e4]]])
    for frame in (None, crs):
        cloud = PointCloud(xyz, UTM, {}, frame)
        write(tmp_path / "cloud.laz", [cloud])
        las = laspy.read(tmp_path / "cloud.laz")
        assert las.header.scales.max() <= 1e-4
        assert np.abs(las.xyz - cloud.coordinates).max() < 1e-4
    assert las.header.parse_crs() == crs
    wkt = las.header.vlrs.get("WktCoordinateSystemVlr")[0].string
    assert wkt.startswith("COMPD_CS[")  # the WKT 1 that LAS 1.4 asks for
    assert las.header.global_encoding.wkt


def test_points_too_far_apart_are_coarser_or_refused_never_wrapped(tmp_path):
    cloud = PointCloud(np.array([[0.0, 0, 0], [3e6, 0, 0]]), UTM, {}, parse_crs("EPSG:32615"))
    cautions = write(tmp_path / "cloud.laz", cloud)
    assert [c.code for c in cautions] == ["coordinates_coarse"]
    np.testing.assert_allclose(
        read(tmp_path / "cloud.laz").coordinates, cloud.coordinates, atol=0.01
    )
    with pytest.raises(CloudError, match="the points reach 3,000,"):
        write(tmp_path / "pieces.laz", [cloud])
    assert not (tmp_path / "pieces.laz").exists()


def test_eight_bit_colours_fill_sixteen_bits(tmp_path):
    shade = np.array([0, 1, 128, 255], np.uint8)
    cloud = PointCloud(np.zeros((4, 3)), UTM, dict.fromkeys(("red", "green", "blue"), shade))
    write(tmp_path / "cloud.laz", cloud)
    back = read(tmp_path / "cloud.laz")
    assert back.attributes["red"].tolist() == [0, 257, 128 * 257, 65_535]


def test_fractions_under_a_standard_name_keep_their_values(tmp_path):
    shares = np.array([0.0, 0.25, 1.0], np.float32)
    write(tmp_path / "cloud.laz", PointCloud(np.zeros((3, 3)), UTM, {"intensity": shares}))
    np.testing.assert_array_equal(
        read(tmp_path / "cloud.laz").attributes["intensity_value"], shares
    )


def test_whole_numbers_of_a_table_become_standard_dimensions(tmp_path):
    (tmp_path / "a.csv").write_text(
        "x,y,z,intensity,return_number,number_of_returns,classification,withheld,red,green,blue\n"
        "1,2,3,500,2,3,6,1,65535,0,7\n4,5,6,501,1,1,2,0,1,2,3\n"
    )
    carry(tmp_path / "a.csv", tmp_path / "a.laz", STAY)
    back = laspy.read(tmp_path / "a.laz")
    assert back.point_format.id == 7
    assert list(back.point_format.extra_dimension_names) == []
    assert np.array(back.return_number).tolist() == [2, 1]
    assert np.array(back.withheld).tolist() == [1, 0]
    assert np.array(back.red).tolist() == [65_535, 1]


def test_one_colour_alone_and_wide_rows_are_extra_dimensions(tmp_path):
    rng = np.random.default_rng(6)
    attributes = {
        "red": np.array([3, 4], np.uint8),
        "histogram": rng.normal(size=(2, 5)).astype(np.float32),
        "pair": rng.normal(size=(2, 2)),
        "half": np.array([0.5, 1], np.float16),
        "yes": np.array([True, False]),
    }
    assert write(tmp_path / "a.laz", PointCloud(np.zeros((2, 3)), UTM, attributes)) == ()
    back = read(tmp_path / "a.laz").attributes
    for name in ("red", "pair", "half", "yes"):
        np.testing.assert_array_equal(back[name], attributes[name])
    np.testing.assert_array_equal(back["histogram_4"], attributes["histogram"][:, 4])


def test_a_value_that_does_not_fit_is_refused(tmp_path):
    cloud = PointCloud(np.zeros((2, 3)), UTM, {"classification": np.array([2, 300])})
    with pytest.raises(CloudError, match="'classification' holds 2 to 300, and LAS allows"):
        write(tmp_path / "cloud.laz", cloud)


def test_a_value_beyond_the_scaling_of_its_dimension_is_refused(tmp_path):
    extra = [laspy.ExtraBytesParams("height", "i2", offsets=[0.0], scales=[0.5])]
    las_file(tmp_path / "a.laz", extra=extra)
    cloud = PointCloud(np.zeros((1, 3)), UTM, {"height": np.array([1e6])})
    with pytest.raises(CloudError, match="'height' does not fit the scaling"):
        write(tmp_path / "b.laz", cloud, like=tmp_path / "a.laz")


def test_what_las_can_not_hold_is_named(tmp_path):
    attributes = {"label": np.array(["roof", "wall"]), "n" * 33: np.zeros(2), "kept": np.ones(2)}
    cautions = write(tmp_path / "cloud.laz", PointCloud(np.zeros((2, 3)), UTM, attributes))
    assert [c.code for c in cautions] == ["attribute_dropped"] * 2
    assert "'label'" in cautions[0].message
    assert "kept" in read(tmp_path / "cloud.laz").attributes


def test_a_coarse_file_is_doubted(tmp_path):
    las_file(tmp_path / "fine.las", scale=0.001)
    las_file(tmp_path / "coarse.las", scale=0.05)
    assert "coordinates_coarse" not in [c.code for c in describe(tmp_path / "fine.las").cautions]
    assert "coordinates_coarse" in [c.code for c in describe(tmp_path / "coarse.las").cautions]


def test_coordinates_alone_do_not_change_with_what_is_decompressed(tmp_path):
    for version, point_format in (("1.2", 3), ("1.4", 7)):
        las = las_file(tmp_path / "cloud.laz", version=version, point_format=point_format, n=3000)
        pieces = list(stream(tmp_path / "cloud.laz", chunk=700, attributes=False))
        found = np.concatenate([piece.coordinates for piece in pieces])
        np.testing.assert_allclose(found, las.xyz, rtol=0, atol=2e-9)


@pytest.mark.parametrize("suffix", [".las", ".laz"])
@pytest.mark.parametrize("at", [100, 243])
def test_a_header_that_counts_more_records_than_there_is_room_for_is_refused_at_once(
    tmp_path, suffix, at
):
    path = tmp_path / f"cloud{suffix}"
    las_file(path)
    content = bytearray(path.read_bytes())
    content[at : at + 4] = b"\xff\xff\xff\xf0"
    path.write_bytes(content)
    with pytest.raises(CloudError, match=r"its header counts 4,043,309,055 records, which need"):
        describe(path)


def test_noise_behind_a_signature_is_refused_at_once(tmp_path):
    for length in (0, 50, 99, 100, 300, 100_000):
        (tmp_path / "noise.las").write_bytes(b"LASF" + np.random.default_rng(1).bytes(length))
        with pytest.raises(CloudError, match=r"^noise\.las "):
            read(tmp_path / "noise.las")
