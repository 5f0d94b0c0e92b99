"""Open3D reads what is written here, and what it writes is read here."""

import numpy as np
import pytest

from trigpoint.cloud import PointCloud
from trigpoint.files import read, write

o3d = pytest.importorskip("open3d", reason="Open3D is the oracle and is not installed")

CORNERS = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
UTM = np.array([741_000.0, 4_279_000.0, 150.0])


@pytest.fixture
def points():
    # Smooth enough that the compression finds something to repeat.
    steps = np.linspace(0, 6, 4000).round(2)
    return np.column_stack([np.cos(steps), np.sin(steps), steps])


def test_open3d_reads_the_same_doubles_from_ply(tmp_path, offset, points):
    write(tmp_path / "a.ply", PointCloud(points, offset))
    theirs = np.asarray(o3d.io.read_point_cloud(str(tmp_path / "a.ply")).points)
    np.testing.assert_allclose(theirs, points + offset, rtol=0, atol=1e-9)


def test_open3d_reads_the_same_mesh(tmp_path):
    faces = np.array([[0, 1, 2], [0, 3, 1]])
    write(tmp_path / "a.ply", PointCloud(CORNERS, np.zeros(3), {}, None, faces))
    theirs = o3d.io.read_triangle_mesh(str(tmp_path / "a.ply"))
    np.testing.assert_array_equal(np.asarray(theirs.triangles), faces)
    np.testing.assert_array_equal(np.asarray(theirs.vertices), CORNERS)


@pytest.mark.parametrize("text", [True, False])
def test_a_ply_of_open3d_is_read_the_same(tmp_path, text, points):
    # As text Open3D writes six digits: nothing to try in UTM.
    points = points if text else points + UTM
    cloud = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(points))
    cloud.colors = o3d.utility.Vector3dVector(np.full((len(points), 3), 0.2))
    o3d.io.write_point_cloud(str(tmp_path / "a.ply"), cloud, write_ascii=text)
    mine = read(tmp_path / "a.ply")
    np.testing.assert_allclose(mine.coordinates, points, rtol=0, atol=6e-6 if text else 1e-9)
    assert set(mine.attributes["red"].tolist()) == {51}


@pytest.mark.parametrize(("text", "compressed"), [(True, False), (False, False), (False, True)])
def test_a_pcd_of_open3d_is_read_the_same(tmp_path, text, compressed, points):
    cloud = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(points))
    cloud.colors = o3d.utility.Vector3dVector(np.full((len(points), 3), [0.2, 0.4, 0.6]))
    cloud.normals = o3d.utility.Vector3dVector(points / np.linalg.norm(points, axis=1)[:, None])
    path = str(tmp_path / "a.pcd")
    o3d.io.write_point_cloud(path, cloud, write_ascii=text, compressed=compressed)
    mine, theirs = read(path), o3d.io.read_point_cloud(path)
    np.testing.assert_allclose(mine.coordinates, np.asarray(theirs.points), rtol=0, atol=2e-7)
    colours = [mine.attributes[name][0] for name in ("red", "green", "blue")]
    assert colours == [51, 102, 153]
    normals = np.column_stack([mine.attributes[f"normal_{axis}"] for axis in "xyz"])
    np.testing.assert_allclose(normals, np.asarray(theirs.normals), atol=1e-6)
