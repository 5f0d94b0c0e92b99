import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from trigpoint.refinement import icp

open3d = pytest.importorskip("open3d", reason="Open3D is not installed here")


def tower(seed, count=8_000):
    """Walls of 8 x 8 x 30 m, a roof, ground."""
    rng = np.random.default_rng(seed)
    points = rng.uniform(size=(count, 3)) * [8, 8, 30]
    face = rng.choice(6, count, p=[0.19, 0.19, 0.19, 0.19, 0.07, 0.17])
    for number, (axis, value) in enumerate([(0, 0), (0, 8), (1, 0), (1, 8), (2, 30), (2, 0)]):
        points[face == number, axis] = value
    points[face == 5, :2] = rng.uniform(-3, 11, size=((face == 5).sum(), 2))
    return points + rng.normal(scale=0.02, size=points.shape)


def as_open3d(points):
    return open3d.geometry.PointCloud(open3d.utility.Vector3dVector(points))


def open3d_icp(source, target, method, max_distance):
    """Open3D's answer about the same origin: its own loses metres at UTM coordinates."""
    registration = open3d.pipelines.registration
    source, target = as_open3d(source), as_open3d(target)
    target.estimate_normals(open3d.geometry.KDTreeSearchParamKNN(20))
    estimation = {
        "point": registration.TransformationEstimationPointToPoint(),
        "plane": registration.TransformationEstimationPointToPlane(),
    }[method]
    limits = registration.ICPConvergenceCriteria(1e-12, 1e-12, 300)
    return registration.registration_icp(
        source, target, max_distance, np.eye(4), estimation, limits
    )


@pytest.mark.parametrize("method", ["plane", "point"])
@pytest.mark.parametrize("max_distance", [0.5, 1.0])
@pytest.mark.parametrize("seed", [1, 2])
def test_agrees_with_open3d(method, max_distance, seed, offset):
    turn = Rotation.from_euler("xyz", [0.2, -0.2, 0.4], degrees=True).as_matrix()
    source = tower(seed) @ turn.T + np.array([0.15, -0.1, 0.08])
    target = tower(seed + 50)
    ours = icp(source + offset, target + offset, method=method, max_distance=max_distance, trim=0)
    theirs = open3d_icp(source, target, method, max_distance)
    matrix = theirs.transformation
    carried = source @ matrix[:3, :3].T + matrix[:3, 3]
    assert_allclose(ours.similarity(source + offset) - offset, carried, atol=1e-7)
    assert ours.overlap_pct == pytest.approx(100 * theirs.fitness, abs=1e-9)
    # Theirs leaves out the points that came within reach and left it again.
    assert ours.surface_rmse_after_m == pytest.approx(theirs.inlier_rmse, rel=0.02)
