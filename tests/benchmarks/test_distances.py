"""Nearest distances and thinning, beside Open3D, SciPy and CloudCompare."""

import os
import shutil
import subprocess

import numpy as np
import pytest
from scipy.spatial import cKDTree

from trigpoint.cloud import PointCloud
from trigpoint.files import read, write
from trigpoint.nearest import nearest
from trigpoint.voxels import Lattice, thin

pytestmark = pytest.mark.benchmark

# Sixteen million points on this width thin to about four million voxels.
MILLIONS, EDGE, VOXEL = 16, 106, 0.10


@pytest.fixture(scope="module")
def open3d():
    return pytest.importorskip("open3d", reason="Open3D has no wheel for this machine")


@pytest.fixture(scope="module")
def surveys(gathered):
    return [gathered(MILLIONS * 1_000_000, seed, edge=EDGE) for seed in (1, 2)]


def ours(points):
    lattice = Lattice(VOXEL, np.zeros(3))
    return thin([PointCloud(points, np.zeros(3))], lattice).cloud.xyz


@pytest.fixture(scope="module")
def thinned(surveys):
    return [ours(points) for points in surveys]


def in_open3d(open3d, points):
    return open3d.geometry.PointCloud(open3d.utility.Vector3dVector(points))


def test_thinning_is_not_slower_than_open3d(open3d, surveys, seconds, faster):
    theirs = in_open3d(open3d, surveys[0])
    took, other = seconds(lambda: ours(surveys[0]), lambda: theirs.voxel_down_sample(VOXEL), runs=1)
    faster(
        f"thin {MILLIONS} M points",
        took,
        "Open3D voxel_down_sample",
        other,
        times=1,
    )


def test_distances_between_voxels(open3d, surveys, thinned, seconds, faster, line):
    source, target = thinned
    name = f"distances, {len(source) / 1e6:.1f} M to {len(target) / 1e6:.1f} M voxels"
    took, in_order = seconds(
        lambda: nearest(source, target), lambda: cKDTree(target).query(source, workers=-1)
    )
    line(f"{name:<46} {took:7.2f} s   SciPy, given our sorted voxels     {in_order:7.2f} s")
    # As they come: the voxels that Open3D makes of the same points, in the order of its hashing.
    clouds = [in_open3d(open3d, points).voxel_down_sample(VOXEL) for points in surveys]
    arrays = [np.asarray(cloud.points) for cloud in clouds]
    for rival, work in (
        (
            "Open3D compute_point_cloud_distance",
            lambda: clouds[0].compute_point_cloud_distance(clouds[1]),
        ),
        ("SciPy cKDTree, workers=-1", lambda: cKDTree(arrays[1]).query(arrays[0], workers=-1)),
    ):
        faster(name, took, rival, *seconds(work, runs=1), times=4)


def test_distances_between_shuffled_points(open3d, surveys, seconds, faster):
    rng = np.random.default_rng(3)
    source, target = (rng.permutation(points)[:4_000_000] for points in surveys)
    (took,) = seconds(lambda: nearest(source, target))
    clouds = [in_open3d(open3d, points) for points in (source, target)]
    for rival, work in (
        (
            "Open3D compute_point_cloud_distance",
            lambda: clouds[0].compute_point_cloud_distance(clouds[1]),
        ),
        ("SciPy cKDTree, workers=-1", lambda: cKDTree(target).query(source, workers=-1)),
    ):
        faster(
            "distances, 4 M to 4 M shuffled, ordering included",
            took,
            rival,
            *seconds(work, runs=1),
            times=2,
        )


def test_distances_beside_cloudcompare(thinned, seconds, faster, tmp_path):
    program = shutil.which("CloudCompare") or shutil.which("cloudcompare.CloudCompare")
    if program is None:
        pytest.skip("CloudCompare is not installed")
    paths = []
    for name, points in zip(("source.ply", "target.ply"), thinned, strict=True):
        write(tmp_path / name, PointCloud(points, np.zeros(3)))
        paths.append(tmp_path / name)
    command = [program, "-SILENT", "-AUTO_SAVE", "OFF"]
    for path in paths:
        command += ["-O", str(path)]

    def theirs():
        subprocess.run(
            [*command, "-C2C_DIST"],
            env=os.environ | {"QT_QPA_PLATFORM": "offscreen"},
            check=True,
            capture_output=True,
        )

    took, other = seconds(
        lambda: nearest(*(read(path).coordinates for path in paths)), theirs, runs=1
    )
    faster(
        "read two PLY files, distances",
        took,
        "CloudCompare -C2C_DIST",
        other,
        times=1,
    )
