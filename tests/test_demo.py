"""What `trigpoint demo` shows, without its clouds: the truth within what was claimed of it."""

import numpy as np
import pytest
from scipy import stats
from scipy.spatial.transform import Rotation

from trigpoint.alignment import align
from trigpoint.picks import read_picks
from trigpoint.synthetic import clock_tower, write_project


@pytest.fixture(scope="module")
def demo(tmp_path_factory):
    scene = clock_tower()
    project = write_project(tmp_path_factory.mktemp("demo"), scene)
    return scene, align(read_picks(project.parent / "picks.csv"))


def test_the_demo_recovers_its_truth_within_the_covariance(demo):
    scene, alignment = demo
    fit, worth = alignment.similarity, alignment.reliability
    centroid = worth.centroid[None, :]
    back = scene.truth.inverse()(centroid)
    turned = Rotation.from_matrix(scene.truth.rotation @ fit.rotation.T).as_rotvec()
    error = np.concatenate(
        [[np.log(scene.truth.scale / fit.scale)], turned, centroid[0] - fit(back)[0]]
    )
    distance = error @ np.linalg.solve(worth.covariance, error)
    assert distance < stats.chi2.isf(0.01, 7)


def test_the_demo_is_like_the_paper(demo):
    scene, alignment = demo
    assert scene.truth.scale == pytest.approx(3.260)
    assert len(alignment.inliers) == 6
    assert alignment.loocv.rmse_m < 0.3
    assert alignment.loocv.max_scale_change_pct < 0.5
    assert alignment.exhaustive_agrees is True
