from itertools import combinations
from time import perf_counter

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_array_equal
from scipy.spatial.transform import Rotation
from towers import APEX, TOWER

from trigpoint import consensus as module
from trigpoint.consensus import exhaustive, no_consensus, ransac
from trigpoint.errors import ConsensusError, DegeneratePicksError
from trigpoint.similarity import Similarity, umeyama

UTM = np.array([741_000.0, 4_279_000.0, 150.0])
TURN = Rotation.from_rotvec([0.3, -1.1, 2.0]).as_matrix()
METHODS = pytest.mark.parametrize("method", [ransac, exhaustive])


def scene(seed, count=12, outliers=4, noise=0.05, offset=UTM):
    """Picks of a tower with gross errors, their targets, and which are sound."""
    rng = np.random.default_rng(seed)
    source = rng.uniform(-1, 1, size=(count, 3)) * [2, 2, 8]
    truth = Similarity(3.26, Rotation.random(random_state=seed).as_matrix(), offset)
    target = truth(source) + rng.normal(scale=noise, size=(count, 3))
    wrong = rng.choice(count, outliers, replace=False)
    target[wrong] += rng.choice([-1, 1], size=(outliers, 3)) * rng.uniform(2, 9, (outliers, 3))
    return source, target, np.isin(np.arange(count), wrong, invert=True)


def distances(found, source, target):
    return np.sqrt((found.residuals(source, target) ** 2).sum(axis=1))


@pytest.mark.parametrize("seed", range(20))
@METHODS
def test_recovers_the_sound_picks_and_fits_to_them_alone(method, seed, offset):
    source, target, sound = scene(seed, offset=offset)
    found = method(source, target)
    assert_array_equal(found.inliers, sound)
    alone = umeyama(source[sound], target[sound])
    assert found.similarity.matrix.tobytes() == alone.matrix.tobytes()


@pytest.mark.parametrize("wrong", [None, 3])
@METHODS
def test_trap_2_six_picks_of_the_tower_keep_their_scale(method, wrong, offset):
    noise = np.random.default_rng(0).normal(0, 0.1, TOWER.shape)
    carried = 3.26 * TOWER @ TURN.T
    target = carried - carried.mean(axis=0) + noise + offset
    if wrong is not None:
        target[wrong] += [2.0, 0, 0]
    found = method(TOWER, target)
    assert np.flatnonzero(~found.inliers).tolist() == ([] if wrong is None else [wrong])
    if wrong is None:
        assert found.similarity.scale == pytest.approx(3.2587, abs=1e-3)
        left = distances(found, TOWER, target)
        assert np.sqrt((left**2).mean()) == pytest.approx(0.0854, abs=5e-5)


@pytest.mark.parametrize("seed", range(200))
def test_trap_2_random_and_exhaustive_sets_keep_the_same_picks(seed):
    count = 6 + seed % 7
    source, target, _ = scene(seed, count, outliers=seed % (count // 2), noise=0.1)
    sampled, complete = ransac(source, target), exhaustive(source, target)
    assert_array_equal(sampled.inliers, complete.inliers)
    assert sampled.similarity.matrix.tobytes() == complete.similarity.matrix.tobytes()
    assert sampled.rivals == complete.rivals


@pytest.mark.parametrize("count", [20, 30, 40])
def test_random_and_exhaustive_sets_agree_up_to_forty_picks(count):
    for seed in range(3):
        source, target, sound = scene(seed, count, outliers=count // 3, noise=0.1)
        assert_array_equal(ransac(source, target).inliers, sound)
        assert_array_equal(exhaustive(source, target).inliers, sound)


@settings(max_examples=40, deadline=None)
@given(st.permutations(range(9)), st.integers(0, 30))
def test_trap_2_order_of_picks_changes_nothing_to_the_last_bit(order, seed):
    source, target, _ = scene(seed, 9, outliers=3, noise=0.15)
    weights = np.random.default_rng(seed).uniform(0.5, 2, 9)
    for method in (ransac, exhaustive):
        one = method(source, target, weights=weights)
        other = method(source[order], target[order], weights=weights[order])
        assert one.similarity.matrix.tobytes() == other.similarity.matrix.tobytes()
        assert_array_equal(one.inliers[order], other.inliers)
        assert one.rivals == other.rivals
        assert one.degenerate_trials == other.degenerate_trials


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 10_000), st.floats(0.05, 0.6), st.booleans())
def test_inliers_are_exactly_the_picks_within_the_threshold(seed, threshold, weighted):
    source, target, _ = scene(seed, 10, outliers=2, noise=0.15)
    weights = np.random.default_rng(seed).uniform(0.5, 2, 10) if weighted else None
    try:
        found = ransac(source, target, threshold=threshold, trials=200, weights=weights)
    except ConsensusError:
        return
    assert_array_equal(found.inliers, distances(found, source, target) <= threshold)
    kept = None if weights is None else weights[found.inliers]
    again = umeyama(source[found.inliers], target[found.inliers], weights=kept)
    assert again.matrix.tobytes() == found.similarity.matrix.tobytes()


def test_the_same_seed_draws_the_same_and_any_seed_finds_the_same(offset):
    source, target, sound = scene(3, 60, outliers=20, offset=offset)
    results = [ransac(source, target, seed=seed) for seed in (42, 42, 0, 7)]
    assert {found.similarity.matrix.tobytes() for found in results} == {
        umeyama(source[sound], target[sound]).matrix.tobytes()
    }
    assert [found.seed for found in results] == [42, 42, 0, 7]


def test_a_result_says_how_it_was_found():
    source, target, _ = scene(1, 8, outliers=2)
    drawn, tried, plain = (
        ransac(source, target, threshold=0.4, trials=500, seed=3),
        exhaustive(source, target, threshold=0.4),
        no_consensus(source, target),
    )
    assert (drawn.method, drawn.threshold, drawn.trials, drawn.seed) == ("ransac", 0.4, 500, 3)
    assert (tried.method, tried.threshold, tried.trials, tried.seed) == (
        "exhaustive",
        0.4,
        56,
        None,
    )
    assert (plain.method, plain.threshold, plain.trials, plain.seed) == ("all", None, 0, None)
    assert plain.inliers.all()
    assert plain.similarity.matrix.tobytes() == umeyama(source, target).matrix.tobytes()


def test_residuals_are_target_minus_transformed_source():
    source, target, _ = scene(1, 8, outliers=2)
    found = ransac(source, target)
    assert_array_equal(found.residuals(source, target), target - found.similarity(source))


def test_degenerate_sets_are_skipped_and_counted():
    line = np.arange(5)[:, None] * np.array([1.0, 2, 2])
    source = np.vstack([line, [[5.0, 0, 0], [0, 5, 1]]])
    target = 3.26 * source + UTM
    found = exhaustive(source, target)
    assert (found.trials, found.degenerate_trials) == (35, 10)  # C(7, 3), C(5, 3) on the line
    assert found.inliers.all()
    drawn = ransac(source, target)
    assert drawn.degenerate_trials / drawn.trials == pytest.approx(10 / 35, abs=0.02)


@METHODS
def test_two_equal_rows_are_one_place_not_a_minimal_set(method):
    source, target, _ = scene(2, 5, outliers=0)
    found = method(np.vstack([source, source[:1]]), np.vstack([target, target[:1]]))
    assert found.inliers.all()
    assert found.degenerate_trials > 0


@METHODS
def test_picks_on_a_line_are_refused_with_their_spread(method, offset):
    line = np.linspace(0, 30, 6)[:, None] * [0.4, 0.9, 0.2]
    with pytest.raises(DegeneratePicksError, match=r"picks spread .* well off the line"):
        method(line, 3.26 * line + offset)
    with pytest.raises(DegeneratePicksError, match="at least three"):
        method(TOWER[:2], TOWER[:2])


@METHODS
def test_picks_that_share_no_triangle_are_refused(method):
    source = np.array([[0.0, 0, 0], [0, 0, 0], [4, 0, 0], [0, 3, 0]])
    target = np.array([[0.0, 0, 0], [4, 0, 0], [0, 3, 0], [0, 3, 0]])
    # 01 together in the source, 23 in the target: each of the four sets holds one of the pairs.
    with pytest.raises(DegeneratePicksError, match="no three of them span the same triangle"):
        method(source, target)


@METHODS
def test_no_agreement_is_an_error_with_the_numbers(method):
    source = np.random.default_rng(0).uniform(-5, 5, size=(6, 3))
    target = np.random.default_rng(1).uniform(-50, 50, size=(6, 3)) + UTM
    with pytest.raises(ConsensusError, match=r"No three picks agree within 0.01 m: .* keeps \d"):
        method(source, target, threshold=0.01)


@METHODS
def test_three_picks_are_kept_if_their_exact_fit_is_within_the_threshold(method, offset):
    source, target = TOWER[:3], 3.26 * TOWER[:3] + offset
    assert method(source, target).inliers.all()
    bent = target + np.array([[0, 0, 0], [0, 0, 0], [0, 0, 9.0]])
    with pytest.raises(ConsensusError, match=r"keeps \d picks and leaves .*, .*, .* m at its own"):
        method(source, bent)


@METHODS
def test_trap_2_a_fit_that_shrinks_everything_to_a_point_is_never_kept(method):
    # All targets lie within the threshold of each other: any source shrunk to a point "fits".
    source = np.random.default_rng(5).uniform(-5, 5, size=(30, 3))
    target = np.random.default_rng(6).uniform(-0.2, 0.2, size=(30, 3)) + UTM
    with pytest.raises(ConsensusError, match=r"keeps 30 picks .* towards a point"):
        method(source, target)


@pytest.mark.parametrize("unit", [1e-4, 1e-3, 1, 1e4])
def test_units_of_the_source_change_the_scale_alone(unit):
    source, target, sound = scene(8)
    found = ransac(source / unit, target)
    assert_array_equal(found.inliers, sound)
    assert found.similarity.scale == pytest.approx(unit * ransac(source, target).similarity.scale)


def test_weights_serve_the_refit_only():
    source, target, sound = scene(4, noise=0.1)
    weights = np.where(sound, np.random.default_rng(4).uniform(0.1, 10, 12), 1e6)
    found = ransac(source, target, weights=weights)
    assert_array_equal(found.inliers, sound)
    fit = umeyama(source[sound], target[sound], weights=weights[sound])
    assert found.similarity.matrix.tobytes() == fit.matrix.tobytes()


def test_extreme_weights_cannot_keep_the_search_from_ending():
    for seed in range(30):
        source, target, _ = scene(seed, 8, outliers=2, noise=0.3)
        weights = 10.0 ** np.random.default_rng(seed).uniform(-4, 4, 8)
        try:
            found = exhaustive(source, target, weights=weights)
        except ConsensusError:
            continue
        assert (distances(found, source, target)[found.inliers] <= 0.5).all()


def test_two_camps_of_picks_are_rivals():
    rng = np.random.default_rng(9)
    source = rng.uniform(-5, 5, size=(8, 3))
    target = 2 * source
    target[4:] += [3.0, 0, 0]  # half the picks agree on one position, half on another
    assert exhaustive(source, target, threshold=0.1).rivals == 1
    assert ransac(source, target, threshold=0.1).rivals == 1
    assert exhaustive(source[:7], target[:7], threshold=0.1).rivals == 0


def test_ties_go_to_the_smaller_residuals():
    rng = np.random.default_rng(9)
    source = rng.uniform(-5, 5, size=(8, 3))
    target = 2 * source
    target[:4] += rng.normal(scale=0.01, size=(4, 3))
    target[4:] += [3.0, 0, 0]
    assert np.flatnonzero(ransac(source, target, threshold=0.1).inliers).tolist() == [4, 5, 6, 7]


def test_the_best_set_is_the_largest_stable_one():
    # Brute force: every subset of nine picks, fitted, is one that the search might have kept.
    for seed in range(5):
        source, target, _ = scene(seed, 9, outliers=3, noise=0.12)
        largest = 0
        for size in range(3, 10):
            for subset in map(list, combinations(range(9), size)):
                fit = umeyama(source[subset], target[subset])
                inside = np.flatnonzero(np.linalg.norm(target - fit(source), axis=1) <= 0.5)
                if inside.tolist() == subset:
                    largest = max(largest, size)
        assert exhaustive(source, target).inliers.sum() == largest


def test_trap_5_a_blunder_of_0_7_m_often_passes_a_threshold_of_0_5_m():
    # Not a fault of the search: a pick that steers the fit hides its own error. The scene is the
    # one in which 69 % of runs kept all six; reliability has to name what consensus can't.
    rng = np.random.default_rng(4)
    kept = 0
    for _ in range(300):
        target = 3.26 * TOWER @ TURN.T + rng.normal(0, 0.101, TOWER.shape)
        way = rng.normal(size=3)
        target[APEX] += 0.7 * way / np.linalg.norm(way)
        kept += exhaustive(TOWER, target).inliers.all()
    assert 0.60 < kept / 300 < 0.80


def test_more_than_forty_picks_are_not_tried_exhaustively():
    source, target, _ = scene(0, 41, outliers=5)
    with pytest.raises(ValueError, match=r"41 picks have 10,660 sets of three"):
        exhaustive(source, target)
    assert exhaustive(source[:40], target[:40]).trials == 9_880


@pytest.mark.parametrize("threshold", [0.0, -1.0, np.nan, np.inf])
def test_a_useless_threshold_is_refused(threshold):
    for method in (ransac, exhaustive):
        with pytest.raises(ValueError, match="finite number above zero"):
            method(TOWER, TOWER, threshold=threshold)


def test_no_trials_at_all_are_refused():
    with pytest.raises(ValueError, match="trials is 0"):
        ransac(TOWER, TOWER, trials=0)


def test_more_trials_than_memory_and_seeds_beyond_63_bits_are_refused():
    with pytest.raises(ValueError, match=r"trials is 10000001; .* at most 10,000,000"):
        ransac(TOWER, TOWER, trials=10_000_001)
    for seed in (-1, 2**63):
        with pytest.raises(ValueError, match=rf"seed is {seed}; .* at most 9,223"):
            ransac(TOWER, TOWER, seed=seed)
    assert ransac(TOWER, TOWER, seed=2**63 - 1, trials=9).inliers.all()


def test_bad_arrays_are_named():
    for method in (ransac, exhaustive, no_consensus):
        with pytest.raises(ValueError, match=r"\(6, 3\) and target \(5, 3\)"):
            method(TOWER, TOWER[:5])
        with pytest.raises(ValueError, match="NaN"):
            method(TOWER * np.nan, TOWER)


def test_arguments_are_left_alone():
    source, target, _ = scene(6)
    weights = np.linspace(1, 2, len(source))
    before = [array.tobytes() for array in (source, target, weights)]
    for method in (ransac, exhaustive, no_consensus):
        method(source, target, weights=weights)
    assert [array.tobytes() for array in (source, target, weights)] == before


def test_ten_thousand_trials_on_six_picks_take_well_under_a_fifth_of_a_second():
    target = 3.26 * TOWER + UTM
    times = []
    for _ in range(3):
        start = perf_counter()
        ransac(TOWER, target)
        times.append(perf_counter() - start)
    assert min(times) < 0.1


def test_thousands_of_pairs_with_a_fifth_of_outliers_take_seconds():
    source, target, sound = scene(0, 8_000, outliers=1_600, noise=0.05)
    start = perf_counter()
    found = ransac(source, target)
    assert perf_counter() - start < 20
    assert_array_equal(found.inliers, sound)


def test_refitting_one_set_alone_is_the_textbook_search(monkeypatch):
    monkeypatch.setattr(module, "REFITTED", 1)
    source, target, sound = scene(5)
    assert_array_equal(ransac(source, target).inliers, sound)


def test_a_blunder_of_a_lost_decimal_point_is_rejected_and_not_called_a_line(similarity_from):
    source = np.random.default_rng(3).normal(scale=20, size=(8, 3))
    target = similarity_from(3, np.array([741_000.0, 4_279_000.0, 150.0]))(source)
    target[2, 0] *= 100
    for found in (ransac(source, target), exhaustive(source, target)):
        assert np.flatnonzero(~found.inliers).tolist() == [2]
