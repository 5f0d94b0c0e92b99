from functools import partial
from time import perf_counter

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal
from scipy.spatial.transform import Rotation
from towers import TOWER

from trigpoint import crossvalidation as module
from trigpoint.consensus import exhaustive, no_consensus, ransac
from trigpoint.crossvalidation import leave_one_out
from trigpoint.errors import ConsensusError
from trigpoint.similarity import umeyama

UTM = np.array([741_000.0, 4_279_000.0, 150.0])
RESIDUAL = ["dx_m", "dy_m", "dz_m"]


def noisy_picks(seed, count=8, noise=0.1, offset=UTM):
    """Make picks of a tower 10 by 10 by 50 m in the target."""
    rng = np.random.default_rng(seed)
    source = rng.uniform(-1, 1, size=(count, 3)) * [1.5, 1.5, 8]
    turn = Rotation.random(random_state=seed).as_matrix()
    target = 3.26 * source @ turn.T + rng.normal(scale=noise, size=(count, 3)) + offset
    return source, target


def spoilt(seed, count=8):
    """Make the same, with a gross error of 2 m at the last pick."""
    source, target = noisy_picks(seed, count)
    target[-1] += [2.0, 0, 0]
    return source, target


@pytest.mark.parametrize("weighted", [False, True])
def test_every_fold_is_a_fit_that_has_not_seen_its_pick(weighted, offset):
    source, target = noisy_picks(1, offset=offset)
    weights = np.random.default_rng(1).uniform(0.2, 5, 8) if weighted else np.ones(8)
    result = leave_one_out(source, target, weights=weights)
    full = umeyama(source, target, weights=weights)
    centre = np.average(source, axis=0, weights=weights)[None]
    for row in result.folds.itertuples():
        others = np.arange(8) != row.position
        fold = umeyama(source[others], target[others], weights=weights[others])
        left = (target - fold(source))[row.position]
        assert_allclose([row.dx_m, row.dy_m, row.dz_m], left, atol=1e-8)
        assert row.d_m == pytest.approx(np.linalg.norm(left), abs=1e-8)
        assert row.scale == fold.scale
        assert row.scale_change_pct == pytest.approx(100 * (fold.scale / full.scale - 1))
        turn = Rotation.from_matrix(fold.rotation @ full.rotation.T).magnitude()
        assert row.rotation_change_deg == pytest.approx(np.degrees(turn), abs=1e-9)
        assert row.shift_m == pytest.approx(np.linalg.norm(fold(centre) - full(centre)), abs=1e-8)
    assert result.rmse_m == pytest.approx(np.sqrt((result.folds["d_m"] ** 2).mean()))
    assert result.max_scale_change_pct == result.folds["scale_change_pct"].abs().max()
    assert not result.closed_form
    assert not result.cautions


@pytest.mark.parametrize("seed", range(20))
def test_a_perfect_set_is_predicted_perfectly(seed, offset, similarity_from):
    source = np.random.default_rng(seed).normal(size=(6, 3))
    result = leave_one_out(source, similarity_from(seed, offset)(source))
    assert result.rmse_m == pytest.approx(0, abs=1e-7)
    assert result.max_scale_change_pct == pytest.approx(0, abs=1e-6)


def test_residuals_are_target_minus_prediction():
    source, target = noisy_picks(2, noise=0)
    target[3] += [0, 0, 0.4]
    row = leave_one_out(source, target).folds.loc[3]
    assert_allclose(row[RESIDUAL].astype(float), [0, 0, 0.4], atol=1e-7)


def test_only_inliers_are_withheld_and_others_are_never_seen():
    source, target = spoilt(3)
    used = np.arange(8) < 7
    result = leave_one_out(source, target, used)
    alone = leave_one_out(source[:7], target[:7])
    assert result.folds["position"].tolist() == list(range(7))
    assert result.rmse_m == alone.rmse_m
    assert result.folds.drop(columns="inliers_changed").equals(
        alone.folds.drop(columns="inliers_changed")
    )


def test_trap_10_a_gross_outlier_sits_in_no_fold():
    source, target = spoilt(4)
    results = []
    for blunder in (2.0, 500.0):
        target[-1] += [blunder, 0, 0]
        found = exhaustive(source, target)
        assert found.inliers.tolist() == [True] * 7 + [False]
        results.append(leave_one_out(source, target, found.inliers, procedure=exhaustive))
    assert results[0].rmse_m == results[1].rmse_m
    assert results[0].rmse_procedure_m == results[1].rmse_procedure_m
    assert not results[0].folds["inliers_changed"].any()


def both_ways(monkeypatch, source, target, weights=None):
    """Give every fold's refit, then the closed form of the same picks."""
    monkeypatch.setattr(module, "REFITS", len(source))
    exact = leave_one_out(source, target, weights=weights)
    monkeypatch.setattr(module, "REFITS", 0)
    closed = leave_one_out(source, target, weights=weights)
    assert (exact.closed_form, closed.closed_form) == (False, True)
    return exact, closed


def largest_gap(exact, closed):
    gap = closed.folds[RESIDUAL].to_numpy() - exact.folds[RESIDUAL].to_numpy()
    return float((np.linalg.norm(gap, axis=1) / exact.folds["d_m"]).max())


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("weighted", [False, True])
def test_trap_10_the_closed_form_is_within_two_percent_of_refits(
    seed, weighted, monkeypatch, offset
):
    source, target = noisy_picks(seed, 60, offset=offset)
    weights = np.random.default_rng(seed).uniform(0.3, 3, 60) if weighted else None
    exact, closed = both_ways(monkeypatch, source, target, weights)
    assert largest_gap(exact, closed) < 0.02
    assert closed.rmse_m == pytest.approx(exact.rmse_m, rel=0.002)
    for column in ("scale_change_pct", "rotation_change_deg", "shift_m"):
        size = exact.folds[column].abs().max()
        assert_allclose(closed.folds[column], exact.folds[column], atol=0.02 * size)


def test_trap_10_six_picks_of_the_tower_are_predicted_within_two_percent(monkeypatch):
    for seed in range(40):
        noise = np.random.default_rng(seed).normal(0, 0.1, TOWER.shape)
        exact, closed = both_ways(monkeypatch, TOWER, 3.26 * TOWER + noise + UTM)
        assert largest_gap(exact, closed) < 0.02


@pytest.mark.parametrize("weighted", [False, True])
@pytest.mark.parametrize("count", [5, 6, 12, 60])
def test_the_closed_form_becomes_exact_as_errors_become_small(count, weighted, monkeypatch):
    weights = np.random.default_rng(count).uniform(0.3, 3, count) if weighted else None
    for noise in (1e-2, 1e-4):
        source, target = noisy_picks(6, count, noise=noise, offset=0)
        exact, closed = both_ways(monkeypatch, source, target, weights)
        assert largest_gap(exact, closed) < noise
        for column in ("scale_change_pct", "rotation_change_deg", "shift_m"):
            size = exact.folds[column].abs().max()
            assert_allclose(closed.folds[column], exact.folds[column], atol=noise * size)


def test_the_closed_form_serves_above_fifty_inliers_and_repeats_no_procedure():
    def never(*_, **__):
        raise AssertionError

    fifty, more = noisy_picks(5, 50), noisy_picks(5, 51)
    assert not leave_one_out(*fifty).closed_form
    result = leave_one_out(*more, procedure=never)
    assert result.closed_form
    assert result.rmse_procedure_m is None
    assert result.folds["inliers_changed"].isna().all()


def test_the_procedure_sees_all_remaining_picks():
    source, target = spoilt(7)
    used = np.arange(8) < 7
    calls = []

    def procedure(source, target, *, weights):
        calls.append((len(source), weights))
        return exhaustive(source, target, weights=weights)

    leave_one_out(source, target, used, procedure=procedure)
    assert calls == [(7, None)] * 7
    calls.clear()
    weights = np.linspace(1, 2, 8)
    leave_one_out(source, target, used, weights=weights, procedure=procedure)
    assert [len(given) for _, given in calls] == [7] * 7


def test_a_pick_that_chose_its_own_company_is_told_on():
    # Three picks of the one camp and four of the other: take one of the four away, and the camps
    # are even; the tighter three are kept.
    rng = np.random.default_rng(9)
    source = rng.uniform(-5, 5, size=(7, 3))
    target = 2 * source + UTM
    target[3:] += rng.normal(scale=0.02, size=(4, 3)) + np.array([3.0, 0, 0])
    procedure = partial(exhaustive, threshold=0.1)
    found = procedure(source, target)
    assert found.inliers.tolist() == [False] * 3 + [True] * 4
    result = leave_one_out(source, target, found.inliers, procedure=procedure)
    assert result.folds["inliers_changed"].all()
    assert result.rmse_m < 0.3
    assert result.rmse_procedure_m == pytest.approx(3, abs=0.2)


@pytest.mark.parametrize("method", [ransac, exhaustive, no_consensus])
def test_sound_picks_have_one_answer_either_way(method):
    source, target = noisy_picks(8, 7, noise=0.05)
    result = leave_one_out(source, target, procedure=method)
    assert result.rmse_procedure_m == result.rmse_m
    assert result.folds["inliers_changed"].tolist() == [False] * 7


def test_three_inliers_can_not_be_assessed():
    source, target = noisy_picks(10, 3)
    result = leave_one_out(source, target, procedure=exhaustive)
    assert (result.rmse_m, result.rmse_procedure_m, result.max_scale_change_pct) == (None,) * 3
    assert result.folds["d_m"].isna().all()
    assert [caution.code for caution in result.cautions] == ["picks_few"]


def test_four_inliers_can():
    source, target = noisy_picks(10, 4)
    assert leave_one_out(source, target).rmse_m > 0


@pytest.mark.parametrize("count", [6, 60])
def test_a_pick_that_alone_stands_off_a_line_can_not_be_withheld(count, offset):
    source = np.linspace(-8, 8, count)[:, None] * [0.1, 0.2, 1.0]
    source[4] += [1.5, 0, 0]
    result = leave_one_out(source, 3.26 * source + offset)
    assert np.flatnonzero(result.folds["d_m"].isna()).tolist() == [4]
    assert result.rmse_m is None
    assert result.max_scale_change_pct is None
    assert [caution.code for caution in result.cautions] == ["fold_failed"]
    assert "position 4" in result.cautions[0].message


def test_a_fold_without_consensus_leaves_the_procedure_unassessed():
    source, target = noisy_picks(11, 5)

    def procedure(source, target, *, weights):
        if len(source) == 4 and source[0, 0] != noisy_picks(11, 5)[0][0, 0]:
            raise ConsensusError
        return no_consensus(source, target, weights=weights)

    result = leave_one_out(source, target, procedure=procedure)
    assert result.rmse_m > 0
    assert result.rmse_procedure_m is None
    assert [caution.code for caution in result.cautions] == ["fold_failed"]
    assert "position 0 " in result.cautions[0].message
    assert result.folds["inliers_changed"].isna().tolist() == [True, False, False, False, False]


@settings(max_examples=15, deadline=None)
@given(st.permutations(range(9)), st.booleans())
def test_order_of_picks_changes_nothing_to_the_last_bit(order, weighted):
    source, target = spoilt(12, 9)
    weights = np.random.default_rng(12).uniform(0.5, 2, 9) if weighted else None
    used = np.arange(9) < 8
    one = leave_one_out(source, target, used, weights=weights, procedure=exhaustive)
    assert one.rmse_procedure_m is not None
    other = leave_one_out(
        source[order],
        target[order],
        used[order],
        weights=None if weights is None else weights[order],
        procedure=exhaustive,
    )
    assert one.rmse_m == other.rmse_m
    assert one.rmse_procedure_m == other.rmse_procedure_m
    assert one.max_scale_change_pct == other.max_scale_change_pct
    moved = other.folds.assign(position=np.array(order)[other.folds["position"]])
    assert moved.sort_values("position", ignore_index=True).equals(one.folds)


def test_order_of_many_picks_changes_nothing_to_the_last_bit():
    source, target = noisy_picks(13, 200)
    order = np.random.default_rng(13).permutation(200)
    one, other = leave_one_out(source, target), leave_one_out(source[order], target[order])
    assert (one.rmse_m, one.max_scale_change_pct) == (other.rmse_m, other.max_scale_change_pct)
    moved = other.folds.assign(position=order[other.folds["position"]])
    assert moved.sort_values("position", ignore_index=True).equals(one.folds)


@pytest.mark.parametrize("factor", [1e-4, 1e4])
def test_units_of_the_source_change_no_error(factor):
    source, target = noisy_picks(14)
    one, other = leave_one_out(source, target), leave_one_out(factor * source, target)
    assert other.rmse_m == pytest.approx(one.rmse_m, rel=1e-7)
    assert other.max_scale_change_pct == pytest.approx(one.max_scale_change_pct, rel=1e-7)


def test_columns_are_those_promised():
    folds = leave_one_out(*noisy_picks(15)).folds
    assert folds.columns.tolist() == module.COLUMNS
    assert folds["inliers_changed"].dtype == "boolean"


def test_arguments_are_left_alone():
    source, target = spoilt(16)
    weights, used = np.linspace(1, 2, 8), np.arange(8) < 7
    before = [array.tobytes() for array in (source, target, weights, used)]
    leave_one_out(source, target, used, weights=weights, procedure=exhaustive)
    assert [array.tobytes() for array in (source, target, weights, used)] == before


def test_inliers_of_another_length_are_refused():
    source, target = noisy_picks(17)
    with pytest.raises(ValueError, match=r"inliers \(5,\) must be 8 truth values"):
        leave_one_out(source, target, np.ones(5, bool))


def test_eight_thousand_pairs_take_no_longer_than_the_fit():
    source, target = noisy_picks(18, 8_000)
    start = perf_counter()
    found = ransac(source, target)
    fitted = perf_counter()
    result = leave_one_out(source, target, found.inliers, procedure=ransac)
    assert perf_counter() - fitted <= fitted - start
    assert_array_equal(result.folds["position"], np.arange(8_000))
