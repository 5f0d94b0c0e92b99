"""One door for every format: what goes in comes out, and what is no cloud is refused by name."""

import re

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from trigpoint.cloud import PointCloud
from trigpoint.crs import parse_crs
from trigpoint.errors import CloudError, CrsError, MissingPackageError
from trigpoint.files import READERS, WRITERS, carry, describe, read, stream, write
from trigpoint.similarity import Similarity

WRITABLE = [".las", ".laz", ".ply", ".xyz", ".csv", ".txt"]
UTM = np.array([741_000.0, 4_279_000.0, 150.0])


def cloud_at(offset, *, n=500, crs=None, seed=0, **attributes):
    rng = np.random.default_rng(seed)
    return PointCloud(rng.uniform(-20, 20, (n, 3)), offset, attributes, crs)


def rich(offset, *, n=500, crs=None):
    rng = np.random.default_rng(1)
    return cloud_at(
        offset,
        n=n,
        crs=crs,
        intensity=rng.integers(0, 65_536, n).astype(np.uint16),
        classification=rng.integers(0, 20, n).astype(np.uint8),
        red=rng.integers(0, 65_536, n).astype(np.uint16),
        green=rng.integers(0, 65_536, n).astype(np.uint16),
        blue=rng.integers(0, 65_536, n).astype(np.uint16),
        gps_time=rng.uniform(2e8, 3e8, n),
        nx=rng.normal(size=n).astype(np.float32),
        ny=rng.normal(size=n).astype(np.float32),
        nz=rng.normal(size=n).astype(np.float32),
        quality=rng.normal(size=n),
        track=rng.integers(-5, 5, n).astype(np.int32),
    )


def errors_of(back, cloud):
    return np.abs(back.coordinates - cloud.coordinates).max()


def codes(cautions):
    return [caution.code for caution in cautions]


@pytest.mark.parametrize("suffix", WRITABLE)
def test_what_is_written_is_read_back(tmp_path, suffix, offset):
    cloud = rich(offset)
    assert codes(write(tmp_path / f"cloud{suffix}", cloud)) == []
    back = read(tmp_path / f"cloud{suffix}")
    # Half a step of LAS; a rounding or two elsewhere.
    assert errors_of(back, cloud) <= (5.1e-6 if "la" in suffix else 2e-9)
    for name, values in cloud.attributes.items():
        if suffix in (".las", ".laz", ".ply"):
            assert back.attributes[name].dtype == values.dtype
        # A table holds the shortest digits that name the value in its type.
        np.testing.assert_array_equal(back.attributes[name].astype(values.dtype), values)


@pytest.mark.parametrize("suffix", WRITABLE)
def test_trap_1_no_format_loses_a_millimetre_in_utm(tmp_path, suffix):
    cloud = cloud_at(UTM, crs=parse_crs("EPSG:32615"))
    write(tmp_path / f"cloud{suffix}", cloud)
    back = read(tmp_path / f"cloud{suffix}")
    assert back.coordinates.dtype == np.float64
    assert errors_of(back, cloud) < (1e-4 if "la" in suffix else 1e-8)


@pytest.mark.parametrize("suffix", [".las", ".laz", ".ply", ".csv"])
def test_a_stream_has_one_origin_and_the_same_points_whatever_its_chunks(tmp_path, suffix):
    path = tmp_path / f"cloud{suffix}"
    write(path, rich(UTM))
    whole = read(path)
    for chunk in (1, 37, 499, 500, 10_000):
        pieces = list(stream(path, chunk=chunk))
        assert all((piece.origin == whole.origin).all() for piece in pieces)
        np.testing.assert_array_equal(np.concatenate([p.xyz for p in pieces]), whole.xyz)
        for name, values in whole.attributes.items():
            joined = np.concatenate([p.attributes[name] for p in pieces])
            np.testing.assert_array_equal(joined, values)
            assert joined.dtype == values.dtype


@pytest.mark.parametrize("suffix", WRITABLE)
def test_the_bytes_do_not_depend_on_the_chunks_they_came_in(tmp_path, suffix):
    cloud = rich(UTM, n=1000, crs=parse_crs("EPSG:32615"))
    whole, pieces = tmp_path / f"whole{suffix}", tmp_path / f"pieces{suffix}"
    write(whole, cloud)
    write(pieces, (cloud.take(np.arange(k, min(k + 77, 1000))) for k in range(0, 1000, 77)))
    assert whole.read_bytes() == pieces.read_bytes()


@pytest.mark.parametrize("suffix", WRITABLE)
def test_bounds_keep_what_is_inside_both_ends_included(tmp_path, suffix):
    cloud = PointCloud(np.arange(30.0).reshape(10, 3), UTM)
    path = tmp_path / f"cloud{suffix}"
    write(path, cloud)
    low, high = UTM + np.array([3, 4, 5]), UTM + np.array([12, 13, 14])
    np.testing.assert_allclose(
        read(path, bounds=(low, high)).coordinates, cloud.coordinates[1:5], atol=1e-6
    )
    assert len(read(path, bounds=(low[:2], high[:2]))) == 4
    empty = read(path, bounds=(low + 1e6, high + 1e6))
    assert len(empty) == 0


def test_bounds_are_in_the_units_of_the_file(tmp_path):
    crs = parse_crs("EPSG:2994")  # Oregon Lambert, international feet
    cloud = PointCloud(
        np.array([[0.0, 0, 0], [30.48, 30.48, 0]]), np.array([3048.0, 3048, 0]), {}, crs
    )
    write(tmp_path / "feet.laz", cloud)
    found = read(tmp_path / "feet.laz", bounds=((10_050, 10_050), (10_150, 10_150)))
    np.testing.assert_allclose(found.coordinates, [[3078.48, 3078.48, 0]], atol=2e-5)


@pytest.mark.parametrize("bounds", [((1, 1), (0, 0)), ((0, 0), (1, 1, 1)), ((0,), (1,))])
def test_impossible_bounds_are_refused(tmp_path, bounds):
    write(tmp_path / "cloud.ply", cloud_at(np.zeros(3)))
    with pytest.raises(CloudError, match="lowest and the highest corner"):
        read(tmp_path / "cloud.ply", bounds=bounds)


@pytest.mark.parametrize("suffix", WRITABLE)
def test_coordinates_alone_are_the_same_coordinates(tmp_path, suffix):
    path = tmp_path / f"cloud{suffix}"
    write(path, rich(UTM))
    bare = read(path, attributes=False)
    assert bare.attributes == {}
    np.testing.assert_array_equal(bare.coordinates, read(path).coordinates)


def test_feet_are_read_as_metres_and_written_as_feet(tmp_path):
    crs = parse_crs("EPSG:2994+6360")  # international feet in plan, US survey feet in height
    cloud = cloud_at(np.array([193_853.0, 258_755.0, 130.0]), crs=crs)
    write(tmp_path / "feet.laz", cloud)
    assert errors_of(read(tmp_path / "feet.laz"), cloud) < 2e-5
    write(tmp_path / "feet.csv", cloud)
    stored = read(tmp_path / "feet.csv")
    np.testing.assert_allclose(
        stored.coordinates, cloud.coordinates / [0.3048, 0.3048, 1200 / 3937], rtol=1e-12
    )
    assert errors_of(read(tmp_path / "feet.csv", crs=crs), cloud) < 1e-8
    assert "units_converted" in codes(describe(tmp_path / "feet.laz").cautions)


def test_a_crs_is_assigned_and_nothing_reprojected(tmp_path):
    cloud = cloud_at(UTM, crs=parse_crs("EPSG:32615"))
    write(tmp_path / "cloud.laz", cloud)
    assert read(tmp_path / "cloud.laz").crs.to_epsg() == 32615
    other = read(tmp_path / "cloud.laz", crs="EPSG:32616")
    assert other.crs.to_epsg() == 32616
    assert errors_of(other, cloud) < 1e-4


def test_degrees_are_refused_for_reading_and_only_described(tmp_path):
    path = tmp_path / "cloud.csv"
    path.write_text("x,y,z\n-94.6,31.03,40\n-94.5,31.04,41\n")
    with pytest.raises(CrsError, match="degrees"):
        stream(path, crs="EPSG:4326")
    found = describe(path, crs="EPSG:4326")
    assert found.high.tolist() == [-94.5, 31.04, 41]
    assert "crs_doubtful" in codes(found.cautions)


def test_a_format_that_holds_no_crs_says_so(tmp_path):
    cloud = cloud_at(UTM, crs=parse_crs("EPSG:32615"))
    for suffix in (".ply", ".csv"):
        assert codes(write(tmp_path / f"cloud{suffix}", cloud)) == ["crs_missing"]


@pytest.mark.parametrize("suffix", [".ply", ".csv"])
def test_points_that_are_nowhere_are_left_out_and_counted(tmp_path, suffix):
    path = tmp_path / f"cloud{suffix}"
    write(path, rich(UTM, n=100))
    holes = read(path)
    text = path.read_bytes()
    if suffix == ".csv":
        lines = text.decode().splitlines()
        lines[3], lines[7] = (
            "nan" + lines[3][lines[3].index(",") :],
            "inf" + lines[7][lines[7].index(",") :],
        )
        path.write_text("\n".join(lines))
        gone = [2, 6]
    else:
        body = text.index(b"end_header\n") + 11
        width = (len(text) - body) // 100
        nan = np.array([np.nan]).tobytes()
        path.write_bytes(text[: body + 2 * width] + nan + text[body + 2 * width + 8 :])
        gone = [2]
    kept = np.delete(np.arange(100), gone)
    back = read(path)
    np.testing.assert_allclose(back.coordinates, holes.coordinates[kept], rtol=1e-15)
    np.testing.assert_array_equal(back.attributes["track"], holes.attributes["track"][kept])
    found = describe(path)
    assert found.points == len(kept)
    assert codes(found.cautions) == ["points_dropped"]
    assert f"{len(gone)} of 100 points" in found.cautions[0].message


def test_describe_says_what_a_file_is(tmp_path):
    cloud = rich(UTM, crs=parse_crs("EPSG:32615"))
    for suffix in (".laz", ".ply", ".csv"):
        write(tmp_path / f"cloud{suffix}", cloud)
        found = describe(tmp_path / f"cloud{suffix}")
        assert found.points == 500
        assert found.scans == 1
        assert {"intensity", "quality"} <= set(found.attributes)
        np.testing.assert_allclose(found.low, cloud.coordinates.min(axis=0), atol=1e-4)
        np.testing.assert_allclose(found.high, cloud.coordinates.max(axis=0), atol=1e-4)
    assert describe(tmp_path / "cloud.laz").crs.to_epsg() == 32615


def test_a_file_may_be_carried_onto_itself(tmp_path):
    path = tmp_path / "cloud.laz"
    cloud = rich(np.zeros(3))
    write(path, cloud)
    fit = Similarity(3.26, Rotation.from_euler("z", 40, degrees=True).as_matrix(), UTM)
    points, cautions = carry(path, path, fit, crs="EPSG:32615")
    back = read(path)
    assert (points, codes(cautions)) == (500, [])
    assert np.abs(back.coordinates - fit(cloud.coordinates)).max() < 1e-4
    assert back.crs.to_epsg() == 32615
    turned = np.column_stack([back.attributes[n] for n in ("nx", "ny", "nz")])
    normals = np.column_stack([cloud.attributes[n] for n in ("nx", "ny", "nz")])
    np.testing.assert_allclose(turned, fit.turn(normals.astype(float)), atol=1e-6)
    np.testing.assert_array_equal(back.attributes["gps_time"], cloud.attributes["gps_time"])


def test_carrying_there_and_back_changes_nothing(tmp_path):
    write(tmp_path / "local.ply", rich(np.zeros(3)))
    fit = Similarity(3.26, Rotation.from_euler("xyz", [10, 20, 30], degrees=True).as_matrix(), UTM)
    carry(tmp_path / "local.ply", tmp_path / "there.laz", fit, crs="EPSG:32615")
    carry(tmp_path / "there.laz", tmp_path / "back.ply", fit.inverse())
    assert errors_of(read(tmp_path / "back.ply"), read(tmp_path / "local.ply")) < 5.1e-5 / 3.26 * 2


def test_a_failed_write_leaves_the_folder_as_it_was(tmp_path):
    path = tmp_path / "cloud.laz"
    write(path, rich(UTM))
    before = path.read_bytes()

    def pieces():
        yield rich(UTM)
        message = "the source broke"
        raise RuntimeError(message)

    with pytest.raises(RuntimeError, match="the source broke"):
        write(path, pieces())
    assert path.read_bytes() == before
    assert [p.name for p in tmp_path.iterdir()] == ["cloud.laz"]


def test_faces_that_a_format_can_not_hold_are_named(tmp_path):
    mesh = PointCloud(np.eye(3), UTM, {}, None, np.array([[0, 1, 2]]))
    assert write(tmp_path / "mesh.ply", mesh) == ()
    for suffix in (".laz", ".csv"):
        cautions = write(tmp_path / f"mesh{suffix}", mesh)
        assert codes(cautions) == ["attribute_dropped"]
        assert "1 faces" in cautions[0].message


@pytest.mark.parametrize("suffix", WRITABLE)
def test_points_that_are_nowhere_are_not_written(tmp_path, suffix):
    cloud = cloud_at(UTM, n=10)
    cloud.xyz[4, 1] = np.nan
    with pytest.raises(CloudError, match="1 of 10 points"):
        write(tmp_path / f"cloud{suffix}", cloud)
    assert list(tmp_path.iterdir()) == []


def test_pieces_that_differ_are_refused(tmp_path):
    plain = cloud_at(UTM)
    for other in (rich(UTM), cloud_at(UTM, crs=parse_crs("EPSG:32615"))):
        with pytest.raises(CloudError, match="must be alike"):
            write(tmp_path / "cloud.laz", [plain, other])


def test_nothing_to_write_is_refused(tmp_path):
    for clouds in ([], cloud_at(UTM, n=0), iter([cloud_at(UTM, n=0)])):
        with pytest.raises(CloudError, match="no points to write"):
            write(tmp_path / "cloud.laz", clouds)


def test_what_can_not_be_written_is_refused_by_name(tmp_path):
    with pytest.raises(CloudError, match=r"cloud\.e57 can't be written; these can: \.las, \.laz"):
        write(tmp_path / "cloud.e57", cloud_at(UTM))
    with pytest.raises(CloudError, match=r"cloud\.copc\.laz can't be written"):
        write(tmp_path / "cloud.copc.laz", cloud_at(UTM))
    (tmp_path / "folder.laz").mkdir()
    with pytest.raises(CloudError, match=r"folder\.laz can't be written: "):
        write(tmp_path / "folder.laz", cloud_at(UTM))
    with pytest.raises(CloudError, match="there is no folder"):
        write(tmp_path / "nowhere" / "cloud.laz", cloud_at(UTM))


@pytest.mark.parametrize("suffix", [".laz", ".las", ".ply", ".xyz"])
@pytest.mark.parametrize("room", [100, 100_000])
def test_a_disk_that_fills_up_is_said_with_the_path(tmp_path, suffix, room):
    resource = pytest.importorskip("resource", reason="a limit on the size of files")
    cloud, limit = cloud_at(UTM, n=50_000), resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (room, limit[1]))
    try:
        with pytest.raises(CloudError, match=rf"cloud\{suffix} can't be written: File too large"):
            write(tmp_path / f"cloud{suffix}", cloud)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limit)
    assert not list(tmp_path.iterdir())


def test_what_can_not_be_read_is_refused_by_name(tmp_path):
    with pytest.raises(CloudError, match="there is no such file"):
        read(tmp_path / "cloud.laz")
    strange = tmp_path / "cloud.docx"
    strange.write_text("hello")
    with pytest.raises(CloudError, match=r"cloud\.docx: \.docx is not a format known here"):
        read(strange)


@pytest.mark.parametrize("suffix", sorted(READERS))
def test_rubbish_and_nothing_are_refused_in_one_line(tmp_path, suffix):
    path = tmp_path / f"cloud{suffix}"
    for content in (b"", b"rubbish", bytes(range(256)) * 40, b"1 2\n3 4\n"):
        path.write_bytes(content)
        with pytest.raises(CloudError, match=rf"cloud\{suffix}") as caught:
            read(path)
        assert "\n" not in str(caught.value)
        if not content:
            assert str(caught.value).startswith(f"cloud{suffix} is empty, 0 bytes: ")


@pytest.mark.parametrize("suffix", [".las", ".laz", ".ply"])
@pytest.mark.parametrize("left", [0.1, 0.9, 0.999])
def test_a_file_cut_short_is_refused_with_what_would_do(tmp_path, suffix, left):
    path = tmp_path / f"cloud{suffix}"
    write(path, rich(UTM, n=5000))
    whole = path.read_bytes()
    path.write_bytes(whole[: int(left * len(whole))])
    said = (
        rf"^cloud\{suffix} is cut short: it .* 5,000 points that its header promises\. Copy or exp"
    )
    with pytest.raises(CloudError, match=said) as caught:
        read(path)
    if suffix != ".laz":
        held = int(re.search(r"holds ([\d,]+) of", str(caught.value))[1].replace(",", ""))
        assert left - 0.11 < held / 5000 < left


def test_a_ply_that_ends_in_its_header_is_refused(tmp_path):
    (tmp_path / "a.ply").write_bytes(b"ply\nformat binary_little_endian 1.0\nelement vertex 8\n")
    with pytest.raises(CloudError, match=r"^a\.ply ends within its header: it is no PLY, or cut"):
        read(tmp_path / "a.ply")


def test_a_missing_package_is_named(tmp_path, monkeypatch):
    import sys

    monkeypatch.setitem(sys.modules, "pye57", None)
    monkeypatch.delitem(sys.modules, "trigpoint.formats.e57", raising=False)
    (tmp_path / "cloud.e57").write_bytes(b"")
    with pytest.raises(MissingPackageError, match="pip install pye57"):
        read(tmp_path / "cloud.e57")


def test_arguments_are_left_alone(tmp_path):
    cloud = rich(UTM, crs=parse_crs("EPSG:32615"))
    xyz, kept = cloud.xyz.copy(), {n: v.copy() for n, v in cloud.attributes.items()}
    for suffix in WRITERS:
        write(tmp_path / f"cloud{suffix}", cloud)
    np.testing.assert_array_equal(cloud.xyz, xyz)
    for name, values in kept.items():
        np.testing.assert_array_equal(cloud.attributes[name], values)


@settings(
    max_examples=30, suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None
)
@given(
    points=st.lists(
        st.tuples(*[st.floats(-5000, 5000, allow_subnormal=False)] * 3), min_size=1, max_size=20
    ),
    suffix=st.sampled_from(WRITABLE),
)
def test_any_points_survive_any_format(tmp_path, points, suffix):
    cloud = PointCloud(np.array(points), UTM)
    write(tmp_path / f"cloud{suffix}", cloud)
    back = read(tmp_path / f"cloud{suffix}")
    assert errors_of(back, cloud) < (1e-4 if "la" in suffix else 2e-8)
