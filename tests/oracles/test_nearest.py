"""Nearest distances against Open3D and SciPy, and thinning against Open3D's."""

import numpy as np
import pytest
from scipy.spatial import cKDTree

from trigpoint.cloud import PointCloud
from trigpoint.nearest import nearest
from trigpoint.voxels import Lattice, thin

open3d = pytest.importorskip("open3d", reason="Open3D has no wheel for this machine")


def roofs(n, seed):
    rng = np.random.default_rng(seed)
    points = rng.uniform(0, 30, (n, 3))
    points[:, 2] = 5 * np.sin(points[:, 0] / 4) + rng.normal(0, 0.05, n)
    return points


def as_open3d(points):
    return open3d.geometry.PointCloud(open3d.utility.Vector3dVector(points))


def test_distances_equal_open3d_and_scipy(offset):
    source, target = roofs(40_000, 1) + offset, roofs(30_000, 2) + offset + [0.03, 0, 0.02]
    found = nearest(source, target)
    theirs = np.asarray(as_open3d(source).compute_point_cloud_distance(as_open3d(target)))
    np.testing.assert_allclose(found, theirs, rtol=0, atol=1e-9)
    np.testing.assert_allclose(found, cKDTree(target).query(source)[0], rtol=0, atol=1e-9)


def test_centroids_equal_open3d_on_its_lattice():
    # Open3D starts its lattice half a cell below the lowest point. Moved there, both are one.
    points = roofs(50_000, 3)
    voxel = 0.25
    shift = points.min(axis=0) - voxel / 2
    theirs = np.asarray(as_open3d(points).voxel_down_sample(voxel).points) - shift
    ours = thin([PointCloud(points - shift, np.zeros(3))], Lattice(voxel, np.zeros(3))).cloud.xyz
    assert len(ours) == len(theirs)
    assert nearest(ours, theirs).max() < 1e-9
