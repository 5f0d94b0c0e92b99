"""E57 with several scans, poses, colours and holes, written by pye57 and by hand."""

import numpy as np
import pye57
import pytest
from pye57 import libe57
from scipy.spatial.transform import Rotation

from trigpoint.files import describe, read, stream

TURN = Rotation.from_euler("xyz", [5, -10, 120], degrees=True)
SHIFT = np.array([741_000.0, 4_279_000.0, 150.0])


def quaternion(rotation):
    x, y, z, w = rotation.as_quat()
    return np.array([w, x, y, z])


def scan_of(points, **fields):
    axes = ("cartesianX", "cartesianY", "cartesianZ")
    return {**dict(zip(axes, points.T.copy(), strict=True)), **fields}


@pytest.fixture
def points():
    return np.random.default_rng(4).uniform(-8, 8, (60, 3)).astype(np.float32).astype(float)


def test_scans_are_joined_where_their_poses_put_them(tmp_path, points):
    colours = {f"color{c}": np.arange(60, dtype=np.uint8) for c in ("Red", "Green", "Blue")}
    with pye57.E57(str(tmp_path / "a.e57"), mode="w") as file:
        file.write_scan_raw(
            scan_of(points, intensity=np.linspace(0, 1, 60).astype("f4"), **colours)
        )
        file.write_scan_raw(scan_of(points), rotation=quaternion(TURN), translation=SHIFT)
    cloud = read(tmp_path / "a.e57")
    expected = np.concatenate([points, TURN.apply(points) + SHIFT])
    np.testing.assert_allclose(cloud.coordinates, expected, rtol=0, atol=2e-9)
    # The second scan has no colours: zero, and NaN where there can be one.
    assert cloud.attributes["red"].tolist() == [*range(60), *[0] * 60]
    assert cloud.attributes["red"].dtype == np.uint8
    assert np.isnan(cloud.attributes["intensity"][60:]).all()
    assert [len(piece) for piece in stream(tmp_path / "a.e57", chunk=40)] == [40, 20, 40, 20]
    found = describe(tmp_path / "a.e57")
    assert (found.scans, found.points) == (2, 120)
    assert found.format == "E57 1.0"


def test_pye57_puts_the_points_at_the_same_place(tmp_path, points):
    with pye57.E57(str(tmp_path / "a.e57"), mode="w") as file:
        file.write_scan_raw(scan_of(points), rotation=quaternion(TURN), translation=SHIFT)
    with pye57.E57(str(tmp_path / "a.e57")) as file:
        scan = file.read_scan(0, ignore_missing_fields=True)
    expected = np.column_stack([scan[f"cartesian{axis}"] for axis in "XYZ"])
    np.testing.assert_allclose(read(tmp_path / "a.e57").coordinates, expected, rtol=0, atol=2e-9)


def test_points_marked_invalid_are_left_out_and_counted(tmp_path, points):
    state = np.zeros(60, np.int8)
    state[[3, 30]] = 2, 1
    with pye57.E57(str(tmp_path / "a.e57"), mode="w") as file:
        file.write_scan_raw(scan_of(points, cartesianInvalidState=state))
    cloud = read(tmp_path / "a.e57")
    np.testing.assert_array_equal(cloud.coordinates, np.delete(points, [3, 30], axis=0))
    assert "points_dropped" in [c.code for c in describe(tmp_path / "a.e57").cautions]


def test_trap_1_single_precision_in_utm_is_doubted(tmp_path, points):
    with pye57.E57(str(tmp_path / "a.e57"), mode="w") as file:
        file.write_scan_raw(scan_of(points + SHIFT))
    with pye57.E57(str(tmp_path / "b.e57"), mode="w") as file:
        file.write_scan_raw(scan_of(points), translation=SHIFT)
    assert "coordinates_coarse" in [c.code for c in describe(tmp_path / "a.e57").cautions]
    assert "coordinates_coarse" not in [c.code for c in describe(tmp_path / "b.e57").cautions]


def hand_made(path, columns, pose=()):
    """Write one scan whose fields are doubles or wide integers, with a pose in a strange order."""
    with pye57.E57(str(path), mode="w") as file:
        image = file.image_file
        scan = libe57.StructureNode(image)
        for name, parts in pose:
            node = scan["pose"] if scan.isDefined("pose") else libe57.StructureNode(image)
            if not scan.isDefined("pose"):
                scan.set("pose", node)
            child = libe57.StructureNode(image)
            node.set(name, child)
            for key, value in parts:
                child.set(key, libe57.FloatNode(image, value))
        prototype = libe57.StructureNode(image)
        for name, values in columns.items():
            whole = values.dtype.kind in "iu"
            node = (
                libe57.IntegerNode(image, 0, 0, 65_535) if whole else libe57.FloatNode(image, 0.0)
            )
            prototype.set(name, node)
        scan.set(
            "points", libe57.CompressedVectorNode(image, prototype, libe57.VectorNode(image, True))
        )
        buffers = libe57.VectorSourceDestBuffer()
        for name, values in columns.items():
            buffers.append(libe57.SourceDestBuffer(image, name, values, len(values), True, True))
        file.data3d.append(scan)
        writer = scan["points"].writer(buffers)
        writer.write(len(values))
        writer.close()


def test_trap_1_doubles_in_utm_lose_nothing_and_wide_colours_stay_wide(tmp_path, points):
    red = np.arange(60, dtype=np.uint16) * 1000
    hand_made(tmp_path / "a.e57", scan_of(points + SHIFT, colorRed=red))
    cloud = read(tmp_path / "a.e57")
    np.testing.assert_allclose(cloud.coordinates, points + SHIFT, rtol=0, atol=2e-9)
    np.testing.assert_array_equal(cloud.attributes["red"], red)


def test_a_pose_is_read_by_name_in_whatever_order(tmp_path, points):
    x, y, z, w = TURN.as_quat()
    pose = [
        ("translation", [("z", 150.0), ("y", 4_279_000.0), ("x", 741_000.0)]),
        ("rotation", [("z", z), ("w", w), ("y", y), ("x", x)]),
    ]
    hand_made(tmp_path / "a.e57", scan_of(points), pose)
    expected = TURN.apply(points) + SHIFT
    np.testing.assert_allclose(read(tmp_path / "a.e57").coordinates, expected, rtol=0, atol=2e-9)


def test_spherical_scans_are_read(tmp_path, points):
    level = np.hypot(points[:, 0], points[:, 1])
    spherical = {
        "sphericalRange": np.hypot(level, points[:, 2]),
        "sphericalAzimuth": np.arctan2(points[:, 1], points[:, 0]),
        "sphericalElevation": np.arctan2(points[:, 2], level),
    }
    hand_made(tmp_path / "a.e57", spherical)
    np.testing.assert_allclose(read(tmp_path / "a.e57").coordinates, points, rtol=0, atol=1e-12)
