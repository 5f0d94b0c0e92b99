import time

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from scipy import stats
from scipy.spatial.transform import Rotation
from towers import DEMO, TOWER

from trigpoint.cautions import CODES
from trigpoint.reliability import assess
from trigpoint.similarity import Similarity, umeyama

UTM = np.array([741_000.0, 4_279_000.0, 150.0])
TRUTH = Similarity(3.26, Rotation.from_rotvec([0.3, -1.1, 2.0]).as_matrix(), np.zeros(3))
DRAWS = 20_000
PLACES = pytest.mark.parametrize("source", [TOWER, DEMO / TRUTH.scale], ids=["tower", "demo"])


def umeyamas(source, targets):
    """Fit many targets at once: scales (m,), rotations (m, 3, 3), target centroids (m, 3)."""
    a = source - source.mean(axis=0)
    centroids = targets.mean(axis=1)
    b = targets - centroids[:, None, :]
    u, d, vt = np.linalg.svd(np.einsum("mni,nj->mij", b, a))
    d[:, 2] *= np.sign(np.linalg.det(u) * np.linalg.det(vt))
    u[:, :, 2] *= np.sign(np.linalg.det(u) * np.linalg.det(vt))[:, None]
    return d.sum(axis=1) / (a**2).sum(), u @ vt, centroids


def draws(source, sigma, seed=1):
    """Fit noisy targets; return the true target, the noisy ones, and the fits."""
    target = TRUTH(source)
    noise = np.random.default_rng(seed).normal(size=(DRAWS, *source.shape))
    targets = target + noise * np.broadcast_to(sigma, len(source))[:, None]
    return target, targets, *umeyamas(source, targets)


def tower_at(offset, seed=2, sigma=0.1):
    target = TRUTH(TOWER) + offset
    return target + np.random.default_rng(seed).normal(0, sigma, target.shape)


def codes(worth):
    return [caution.code for caution in worth.cautions]


@PLACES
def test_predicted_covariance_is_that_of_twenty_thousand_draws(source):
    sigma = 0.1
    target, _, scales, rotations, centroids = draws(source, sigma)
    worth = assess(source, target, TRUTH, sigma_target=np.full(6, sigma))
    assert_allclose(np.var(np.log(scales)), worth.covariance[0, 0], rtol=0.03)

    turns = Rotation.from_matrix(rotations @ TRUTH.rotation.T).as_rotvec()
    size = np.sqrt(np.diag(worth.covariance)[1:4])
    unit = np.outer(size, size)
    assert_allclose(np.cov(turns.T) / unit, worth.covariance[1:4, 1:4] / unit, atol=0.03)

    # Ten points in and around the tower: each 3x3 covariance, relative to its own size.
    low, high = source.min(axis=0) - 3, source.max(axis=0) + 4
    points = np.random.default_rng(3).uniform(low, high, (10, 3))
    a = points - source.mean(axis=0)
    carried = scales[:, None, None] * (a @ rotations.transpose(0, 2, 1)) + centroids[:, None, :]
    for i, expected in enumerate(worth.covariance_at(TRUTH(points))):
        found = np.cov(carried[:, i].T)
        assert np.abs(found - expected).max() < 0.03 * np.abs(expected).max()


def test_the_covariance_of_an_unweighted_fit_of_unequal_picks_is_that_of_its_draws():
    sigma = np.array([0.02, 0.25, 0.1, 0.05, 0.2, 0.1])
    target, _, scales, rotations, centroids = draws(TOWER, sigma)
    worth = assess(TOWER, target, TRUTH, sigma_target=sigma)
    turns = Rotation.from_matrix(rotations @ TRUTH.rotation.T).as_rotvec()
    found = np.cov(np.column_stack([np.log(scales), turns, centroids]).T)
    size = np.sqrt(np.diag(worth.covariance))
    assert_allclose(
        found / np.outer(size, size), worth.covariance / np.outer(size, size), atol=0.04
    )


def test_sources_picked_with_noise_widen_the_covariance_by_the_scale():
    sigma = 0.03  # source units
    rng = np.random.default_rng(5)
    target = TRUTH(TOWER)
    fits = [
        umeyama(TOWER + rng.normal(0, sigma, TOWER.shape), target)(TOWER[4:5])[0]
        for _ in range(3000)
    ]
    worth = assess(TOWER, target, TRUTH, sigma_source=np.full(6, sigma))
    expected = worth.covariance_at(target[4:5])[0]
    assert np.abs(np.cov(np.array(fits).T) - expected).max() < 0.08 * np.abs(expected).max()


@PLACES
@pytest.mark.parametrize("known", [True, False])
def test_intervals_of_scale_and_position_cover_the_truth_95_times_in_100(known, source):
    sigma = 0.1
    target, targets, scales, rotations, centroids = draws(source, sigma)
    point = source.mean(axis=0) + np.array([0, 0, 12])
    carried = (
        scales[:, None] * ((point - source.mean(axis=0)) @ rotations.transpose(0, 2, 1)) + centroids
    )
    a = source - source.mean(axis=0)
    residuals = (
        targets - scales[:, None, None] * (a @ rotations.transpose(0, 2, 1)) - centroids[:, None, :]
    )
    sigmas = np.sqrt((residuals**2).sum(axis=(1, 2)) / 11)
    worth = assess(source, target, TRUTH, sigma_target=np.full(6, sigma))
    if known:
        quantile, sigmas = worth.quantile, np.full(DRAWS, sigma)
        assert_allclose(quantile, stats.norm.isf(0.025))
    else:
        quantile = assess(source, targets[0], umeyama(source, targets[0])).quantile
        assert_allclose(quantile, stats.t.isf(0.025, 11))
    # The covariance is quadratic in sigma, and hardly depends on where the fit came to lie.
    half = quantile * np.sqrt(worth.covariance[0, 0]) * sigmas / sigma
    assert 0.93 < (np.abs(np.log(scales / TRUTH.scale)) <= half).mean() < 0.97
    wide = quantile * worth.sigma(TRUTH(point[None]))[0] * sigmas[:, None] / sigma
    covered = (np.abs(carried - TRUTH(point[None])) <= wide).mean(axis=0)
    assert ((covered > 0.93) & (covered < 0.97)).all()


@pytest.mark.parametrize("known", [True, False])
def test_the_stated_interval_of_the_scale_covers_it_fit_by_fit(known):
    covered = 0
    for seed in range(600):
        target = tower_at(0, seed=seed)
        stated = np.full(6, 0.1) if known else None
        worth = assess(TOWER, target, umeyama(TOWER, target), sigma_target=stated)
        covered += worth.scale_low <= TRUTH.scale <= worth.scale_high
    assert 0.925 < covered / 600 < 0.975


def test_sigma0_and_its_interval(offset):
    target = tower_at(offset)
    fit = umeyama(TOWER, target)
    worth = assess(TOWER, target, fit)
    sigma0 = np.sqrt(((target - fit(TOWER)) ** 2).sum() / 11)
    assert_allclose(worth.sigma0_m, sigma0, rtol=1e-6)
    assert_allclose(worth.sigma0_low_m, sigma0 * np.sqrt(11 / stats.chi2.ppf(0.975, 11)), rtol=1e-6)
    assert_allclose(
        worth.sigma0_high_m, sigma0 * np.sqrt(11 / stats.chi2.ppf(0.025, 11)), rtol=1e-6
    )
    assert worth.noise == "residuals"
    assert worth.sigma_m == worth.sigma0_m
    assert np.isnan(worth.global_p_value)


def test_a_stated_sigma_is_used_and_tested_against_the_residuals(offset):
    target = tower_at(offset)
    fit = umeyama(TOWER, target)
    square = ((target - fit(TOWER)) ** 2).sum()
    worth = assess(TOWER, target, fit, sigma_target=np.full(6, 0.1))
    assert worth.noise == "stated"
    assert_allclose(worth.sigma_m, 0.1)
    assert_allclose(worth.global_statistic, square / 0.01, rtol=1e-6)
    assert_allclose(worth.global_p_value, stats.chi2.sf(square / 0.01, 11), rtol=1e-5)
    assert_allclose(worth.sigma0_m, np.sqrt(square / 11), rtol=1e-6)


@pytest.mark.parametrize(("stated", "word"), [(0.02, "larger"), (0.9, "smaller")])
def test_a_stated_sigma_that_the_residuals_contradict_is_doubted(stated, word):
    target = tower_at(0)
    sigma = np.full(6, stated)
    worth = assess(
        TOWER, target, umeyama(TOWER, target), sigma_source=0 * sigma, sigma_target=sigma
    )
    messages = [c.message for c in worth.cautions if c.code == "sigmas_doubtful"]
    assert len(messages) == 1
    assert f"residuals are {word} than" in messages[0]


def test_sigmas_that_only_some_picks_state_are_not_used():
    target = tower_at(0)
    fit = umeyama(TOWER, target)
    sigma = np.array([0.1, np.nan, 0.1, 0.1, np.nan, 0.1])
    worth = assess(TOWER, target, fit, sigma_target=sigma)
    assert worth.noise == "residuals"
    assert_allclose(worth.covariance, assess(TOWER, target, fit).covariance)
    assert "2 of 6 picks state no sigma" in worth.cautions[0].message
    assert assess(TOWER, target, fit, sigma_target=np.full(6, np.nan)).cautions == ()


def test_weights_only_count_by_their_ratios():
    rng = np.random.default_rng(1)
    weights = rng.uniform(0.5, 2, 6)
    target = tower_at(0)
    fit = umeyama(TOWER, target, weights=weights)
    one = assess(TOWER, target, fit, weights=weights)
    other = assess(TOWER, target, fit, weights=1000 * weights)
    assert_allclose(one.covariance, other.covariance, atol=1e-15)
    assert_allclose(one.sigma0_m, other.sigma0_m)


def test_a_weighted_fit_by_its_sigmas_beats_an_unweighted_one():
    sigma = np.array([0.02, 0.3, 0.1, 0.05, 0.2, 0.1])
    target = TRUTH(TOWER)
    plain = assess(TOWER, target, TRUTH, sigma_target=sigma)
    weighted = assess(TOWER, target, TRUTH, sigma_target=sigma, weights=sigma**-2)
    points = target + 5
    assert (
        np.linalg.eigvalsh(plain.covariance_at(points) - weighted.covariance_at(points)) > -1e-12
    ).all()


@given(st.permutations(range(6)), st.integers(0, 20))
@settings(max_examples=40, deadline=None)
def test_order_of_picks_changes_nothing_to_the_last_bit(order, seed):
    target = tower_at(UTM, seed=seed)
    sigma = np.random.default_rng(seed).uniform(0.05, 0.2, 6)
    fit = umeyama(TOWER, target)
    one = assess(TOWER, target, fit, sigma_target=sigma)
    other = assess(TOWER[order], target[order], fit, sigma_target=sigma[order])
    assert (one.covariance == other.covariance).all()
    assert one.sigma0_m == other.sigma0_m
    assert one.statement == other.statement
    back = np.argsort(order)
    columns = ["redundancy", "standardised", "p_value", "detectable_blunder_m"]
    assert (one.picks[columns].to_numpy() == other.picks[columns].to_numpy()[back]).all()


@pytest.mark.parametrize(("units", "metre"), [(1e3, 1.0), (1e-3, 1.0), (1.0, 3.28), (1e3, 1e3)])
def test_only_what_is_in_metres_depends_on_the_metre(units, metre):
    source, target = TOWER * units, tower_at(0) * metre
    one = assess(TOWER, target / metre, umeyama(TOWER, target / metre))
    other = assess(source, target, umeyama(source, target))
    for column in ("redundancy", "standardised", "p_value"):
        assert_allclose(one.picks[column], other.picks[column], rtol=1e-9)
    assert_allclose(other.picks["detectable_blunder_m"], metre * one.picks["detectable_blunder_m"])
    assert_allclose(other.rotation_sigma_deg, one.rotation_sigma_deg, rtol=1e-9)
    assert_allclose(other.sigma0_m, metre * one.sigma0_m)


def test_nothing_divides_by_zero_where_the_picks_fit_exactly(offset):
    source = np.array([[0, 0, 0], [4, 0, 0], [0, 4, 0], [0, 0, 4.0]])
    extent = np.array([[-5, -5, -5], [9, 9, 9]]) + offset
    worth = assess(source, source + offset, umeyama(source, source + offset), extent=extent)
    assert worth.geometry == "sound"
    assert worth.sigma0_m < 1e-8
    assert_allclose([worth.scale_low, worth.scale_high], 1, atol=1e-6)
    assert not worth.picks["suspected"].any()


def test_corners_tell_how_far_the_reference_reaches(offset):
    target = tower_at(offset)
    extent = np.array([target.min(axis=0) - 30, target.max(axis=0) + 10])
    worth = assess(TOWER, target, umeyama(TOWER, target), extent=extent)
    assert len(worth.corners) == 8
    points = worth.corners[["x", "y", "z"]].to_numpy()
    assert (np.unique(points, axis=0) == points).all()
    assert_allclose(worth.corners.to_numpy()[:, 3:], worth.sigma(points))
    reach = np.linalg.norm(target - target.mean(axis=0), axis=1).max()
    far = np.linalg.norm(points - target.mean(axis=0), axis=1).max()
    assert_allclose(worth.extrapolation, far / reach, rtol=1e-9)


def test_every_caution_has_a_code():
    for count in (3, 4, 6):
        source, target = TOWER[:count], tower_at(0, sigma=1)[:count]
        worth = assess(source, target, umeyama(source, target), sigma_target=np.full(count, 0.01))
        assert set(codes(worth)) <= CODES


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        ({"sigma_target": np.full(5, 0.1)}, "must be 6 finite numbers"),
        ({"sigma_source": np.full(6, -0.1)}, "not below zero"),
        ({"sigma_target": np.array([0.1, 0, 0.1, 0.1, 0, 0.1])}, r"Picks \[1, 4\] state a sigma"),
        ({"weights": np.zeros(6)}, "above zero"),
        ({"extent": np.zeros((3, 2))}, "lowest and highest"),
    ],
)
def test_bad_settings_are_refused(settings, words):
    with pytest.raises(ValueError, match=words):
        assess(TOWER, TRUTH(TOWER), TRUTH, **settings)


def test_thousands_of_pairs_take_no_time():
    rng = np.random.default_rng(1)
    source = rng.normal(size=(5000, 3)) * 10
    target = TRUTH(source) + UTM + rng.normal(0, 0.05, source.shape)
    fit = umeyama(source, target)
    start = time.perf_counter()
    worth = assess(source, target, fit)
    assert time.perf_counter() - start < 2
    assert_allclose(worth.sigma0_m, 0.05, rtol=0.02)
    assert_allclose(worth.picks["redundancy"].sum(), 15_000 - 7, atol=1e-6)
