"""Real pairs: two LiDAR scans with a published pose, and a church portal with six picks."""

import json

import laspy
import numpy as np
import pandas as pd
import plyfile
import pytest
from scipy.spatial.transform import Rotation

from trigpoint.refinement import icp
from trigpoint.similarity import Similarity, umeyama
from trigpoint.surface import Surface
from trigpoint.trial import judge


def ply(path):
    vertex = plyfile.PlyData.read(path)["vertex"]
    return np.column_stack([vertex[axis] for axis in "xyz"]).astype(np.float64)


def centroids(points, voxel):
    cells = np.unique(np.floor(points / voxel), axis=0, return_inverse=True)[1].ravel()
    counts = np.bincount(cells)[:, None]
    return np.column_stack([np.bincount(cells, column) for column in points.T]) / counts


def pairs(path):
    table = pd.read_csv(path)
    source, target = (
        table[[f"{frame}_{axis}" for axis in "xyz"]].to_numpy() for frame in ("source", "target")
    )
    return source, target


def rmse(similarity, source, target):
    return float(np.sqrt(((target - similarity(source)) ** 2).sum(axis=1).mean()))


@pytest.fixture(scope="module")
def scans(request):
    folder = request.getfixturevalue("real_data")("small_gicp_rigid")
    clouds = [centroids(ply(folder / name), 0.10) for name in ("source.ply", "target.ply")]
    return *clouds, np.loadtxt(folder / "T_target_source.txt")


@pytest.mark.parametrize("method", ["plane", "point"])
def test_two_scans_come_to_their_published_pose(scans, method, offset):
    source, target, published = scans
    truth = Similarity(1.0, published[:3, :3], published[:3, 3])
    refinement = icp(source + offset, target + offset, method=method)
    found = refinement.similarity(source + offset) - offset
    start = np.sqrt(((source - truth(source)) ** 2).sum(axis=1).mean())
    error = np.sqrt(((found - truth(source)) ** 2).sum(axis=1).mean())
    turn = Rotation.from_matrix(refinement.similarity.rotation @ truth.rotation.T)
    # Open3D's point to plane lands 2.2 cm and 0.18 degrees from the published pose.
    assert start > 0.4
    assert error < 0.06
    assert np.degrees(turn.magnitude()) < 0.3


@pytest.fixture(scope="module")
def portal(request):
    folder = request.getfixturevalue("real_data")("herzjesu_even_vs_odd")
    expected = json.loads((folder / "expected.json").read_text())
    picks = pairs(folder / "picks6.csv")
    fit = umeyama(*picks)
    las = laspy.read(folder / "ref_dense_metric.laz")
    reference = Surface(np.column_stack([las.x, las.y, las.z]))
    matches = pairs(folder / "structural_all_with_outliers.csv")
    refined = expected["structural_refined"]
    best = Similarity(refined["scale"], np.array(refined["R"]), np.array(refined["t"]))
    near = ((matches[1] - best(matches[0])) ** 2).sum(axis=1) <= refined["threshold_m"] ** 2
    checks = matches[0][near], matches[1][near]
    assert len(checks[0]) == refined["inliers"]
    cloud = fit(ply(folder / "src_dense_strict_local.ply"))
    return cloud, reference, fit, picks, checks, expected["icp_from_picks6_strict"]


@pytest.mark.parametrize(("method", "key"), [("point", "open3d_p2p"), ("plane", "open3d_p2plane")])
def test_the_portal_gets_worse_as_open3d_found(portal, method, key):
    cloud, reference, fit, picks, checks, expected = portal
    refinement = icp(
        cloud, reference, method=method, max_distance=expected["max_corr_dist"], trim=0
    )
    after = refinement.similarity @ fit
    assert rmse(fit, *picks) == pytest.approx(expected["before_controls6"], abs=1e-6)
    assert rmse(fit, *checks) == pytest.approx(expected["before_structural"], abs=1e-6)
    # Half of the points take part here and all of them there: that is worth a millimetre.
    assert rmse(after, *picks) == pytest.approx(expected[key]["controls6"], abs=1e-3)
    assert rmse(after, *checks) == pytest.approx(expected[key]["structural"], abs=1e-3)
    assert refinement.overlap_pct == pytest.approx(100 * expected[key]["fitness"], abs=0.1)


def test_the_portals_check_pairs_refuse_what_leave_one_out_would_take(portal):
    cloud, reference, fit, picks, checks, _ = portal
    trial = judge(cloud, reference, similarity=fit, controls=picks, checks=checks)
    assert trial.control_rmse_after_m > trial.control_rmse_before_m
    assert trial.loocv_rmse_before_m == pytest.approx(0.03178536, abs=1e-6)
    assert trial.loocv_rmse_after_m < trial.loocv_rmse_before_m
    assert trial.check_rmse_after_m > trial.check_rmse_before_m
    assert not trial.retained
