from functools import cache

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy import stats
from scipy.spatial.transform import Rotation

from trigpoint.crosschecks import camera_positions, scale_bar, up_direction
from trigpoint.reliability import assess
from trigpoint.similarity import Similarity, umeyama

SOURCE = np.random.default_rng(0).normal(size=(7, 3)) * [3, 4, 6]
CAMERAS = np.random.default_rng(1).normal(size=(15, 3)) * 10
SIGMA = 0.05
UTM = np.array([741_000.0, 4_279_000.0, 150.0])
TRUTH = Similarity(3.26, Rotation.from_rotvec([0.3, -1.1, 2.0]).as_matrix(), np.zeros(3))
UP = TRUTH.rotation.T @ [0, 0, 1]  # in the source frame


@cache
def worth_of(seed, *, known=True, shift=0.0, sigma=SIGMA):
    target = TRUTH(SOURCE) + shift * UTM
    target = target + np.random.default_rng(seed).normal(0, sigma, target.shape)
    stated = np.full(7, sigma) if known else None
    return assess(SOURCE, target, umeyama(SOURCE, target), sigma_target=stated)


def bar(worth, rng, error=0.0):
    length = TRUTH.scale * 2 + rng.normal(0, 0.005) + error
    return scale_bar(worth, [0, 0, 0], [0, 0, 2], length=length, sigma=0.005)


def level(worth, rng, tilt=0.0):
    turn = Rotation.from_rotvec([*np.radians(rng.normal([0, tilt], 0.1)), 0])
    up = TRUTH.rotation.T @ turn.apply([0, 0, 1])
    return up_direction(worth, 4 * up, sigma_deg=0.1)


def cameras(worth, rng, shift=0.0):
    sigma = np.array([0.02, 0.02, 0.04])
    gnss = TRUTH(CAMERAS) + rng.normal(0, 1, CAMERAS.shape) * sigma
    return camera_positions(worth, CAMERAS, gnss + shift * np.eye(3)[0], sigma=sigma)


@pytest.mark.parametrize("check", [bar, level, cameras])
def test_p_values_are_uniform_where_both_sides_are_right(check):
    p = []
    for seed in range(250):
        found = check(worth_of(seed), np.random.default_rng([seed, 1]))
        p.append(found.p_value)
    assert stats.kstest(p, "uniform").pvalue > 1e-3


@pytest.mark.parametrize("check", [bar, level, cameras])
def test_with_sigma_from_residuals_false_alarms_keep_their_level(check):
    alarms = sum(
        check(worth_of(seed, known=False), np.random.default_rng([seed, 1])).caution is not None
        for seed in range(250)
    )
    assert 0.015 * 250 < alarms < 0.095 * 250


@pytest.mark.parametrize(("check", "error"), [(bar, 0.05), (level, 1.0), (cameras, 0.3)])
def test_a_wrong_side_is_called_wrong(check, error):
    found = check(worth_of(1), np.random.default_rng(1), error)
    assert found.caution.code == "cross_check_disagrees"
    assert found.caution.message == found.statement
    assert check(worth_of(1), np.random.default_rng(1)).caution is None


@pytest.mark.parametrize("check", [bar, level, cameras])
def test_sigma_is_the_size_of_what_is_found(check):
    found = [check(worth_of(seed), np.random.default_rng([seed, 2])) for seed in range(600)]
    size = np.sqrt(np.mean([one.discrepancy**2 for one in found]))
    assert_allclose(size, found[0].sigma, rtol=0.09)


def test_a_scale_bar_is_measured_in_target_metres():
    found = scale_bar(worth_of(1), [1, 1, 1], [1, 1, 3], length=6.5, sigma=0.01, sigma_source=0.002)
    scale = worth_of(1).similarity.scale
    assert_allclose(found.discrepancy, 2 * scale - 6.5)
    expected = 0.01**2 + 2 * (scale * 0.002) ** 2 + (2 * scale) ** 2 * worth_of(1).covariance[0, 0]
    assert_allclose(found.sigma, np.sqrt(expected))
    assert found.unit == "m"


def test_an_upside_down_frame_is_180_degrees_off():
    found = up_direction(worth_of(1), -UP, sigma_deg=0.1)
    assert_allclose(found.discrepancy, 180, atol=0.2)
    assert found.p_value < 1e-9


def test_cameras_agree_with_a_dense_computation():
    worth = worth_of(2)
    rng = np.random.default_rng(3)
    sigma = rng.uniform(0.01, 0.1, CAMERAS.shape)
    gnss = TRUTH(CAMERAS) + rng.normal(0, 1, CAMERAS.shape) * sigma
    found = camera_positions(worth, CAMERAS, gnss, sigma=sigma)
    carried = worth.similarity(CAMERAS)
    arms = []
    for p in carried - worth.centroid:
        x, y, z = p
        turn = np.array([[0, z, -y], [-z, 0, x], [y, -x, 0]])  # w x p, by w
        arms.append(np.column_stack([p, turn, np.eye(3)]))
    arms = np.vstack(arms)
    total = np.diag(sigma.ravel() ** 2) + arms @ worth.covariance @ arms.T
    errors = (gnss - carried).ravel()
    statistic = errors @ np.linalg.solve(total, errors)
    assert_allclose(found.p_value, stats.chi2.sf(statistic, errors.size), rtol=1e-6)
    assert_allclose(found.sigma, np.sqrt(np.trace(total) / len(CAMERAS)), rtol=1e-9)


def test_cameras_may_be_at_utm():
    sigma = np.array([0.02, 0.02, 0.04])
    gnss = TRUTH(CAMERAS) + np.random.default_rng(1).normal(0, 1, CAMERAS.shape) * sigma
    near = camera_positions(worth_of(4), CAMERAS, gnss, sigma=sigma)
    far = camera_positions(worth_of(4, shift=1.0), CAMERAS, gnss + UTM, sigma=sigma)
    assert_allclose(far.p_value, near.p_value, rtol=1e-5)


def test_a_fit_without_any_noise_checks_by_the_given_sigma_alone():
    worth = assess(SOURCE, SOURCE, umeyama(SOURCE, SOURCE))
    found = scale_bar(worth, [0, 0, 0], [1, 0, 0], length=1.01, sigma=0.01)
    assert_allclose(found.p_value, 2 * stats.norm.sf(1), rtol=1e-6)
    found = camera_positions(worth, CAMERAS, CAMERAS, sigma=0.01)
    assert_allclose(found.p_value, 1)


def test_checks_that_check_nothing_are_refused():
    worth = worth_of(1)
    with pytest.raises(ValueError, match="checks nothing"):
        scale_bar(worth, [1, 1, 1], [1, 1, 1], length=2, sigma=0.1)
    with pytest.raises(ValueError, match="finite and not zero"):
        up_direction(worth, [0, 0, 0], sigma_deg=1)
    with pytest.raises(ValueError, match="sigmas above zero"):
        camera_positions(worth, CAMERAS, CAMERAS, sigma=0)
    with pytest.raises(ValueError, match="0 cameras"):
        camera_positions(worth, np.empty((0, 3)), np.empty((0, 3)), sigma=1)
