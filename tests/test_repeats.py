from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy import stats

from trigpoint.alignment import align
from trigpoint.errors import PicksError
from trigpoint.picks import picks_from
from trigpoint.repeats import picking_sigma, repicked

PLACES = np.random.default_rng(0).normal(size=(12, 3)) * 20
SHIFT = np.array([0.2, 0, 0])


def sessions(seed, count=2, sigma=0.05, offset=0.0):
    rng = np.random.default_rng(seed)
    return [PLACES + offset + rng.normal(0, sigma, PLACES.shape) for _ in range(count)]


@pytest.mark.parametrize("count", [2, 3, 5])
def test_the_sigma_put_in_is_found(count, offset):
    found = [picking_sigma(sessions(seed, count, offset=offset)) for seed in range(100)]
    assert found[0].dof == 36 * (count - 1)
    assert_allclose(np.sqrt(np.mean([one.sigma**2 for one in found])), 0.05, rtol=0.03)
    covered = sum(one.sigma_low <= 0.05 <= one.sigma_high for one in found)
    assert covered >= 88


def test_each_axis_has_its_own_sigma():
    rng = np.random.default_rng(1)
    noise = rng.normal(0, [0.02, 0.05, 0.2], (4, *PLACES.shape))
    assert_allclose(picking_sigma(PLACES + noise).sigma_axes, [0.02, 0.05, 0.2], rtol=0.25)


def test_places_that_one_session_left_out_still_count():
    first, second, third = sessions(2, 3)
    second[:4] = np.nan
    third[[0, 7]] = np.nan
    found = picking_sigma([first, second, third])
    assert found.picks["times"].tolist() == [1, 2, 2, 2, 3, 3, 3, 2, 3, 3, 3, 3]
    assert found.dof == 3 * (4 * 1 + 7 * 2)
    assert np.isnan(found.picks["sigma"][0])
    groups = [np.array([s[i] for s in (first, second, third)]) for i in range(12)]
    squares = sum(((g - np.nanmean(g, axis=0)) ** 2)[np.isfinite(g)].sum() for g in groups)
    assert_allclose(found.sigma, np.sqrt(squares / found.dof))


def test_two_operators_who_differ_are_found_out():
    first, second = sessions(3)
    same = picking_sigma([first, second])
    other = picking_sigma([first, second + SHIFT])
    assert same.bias_p_value > 0.01
    assert other.bias_p_value < 1e-3
    shift = other.sessions["dx"][1] - other.sessions["dx"][0]
    assert_allclose(shift, 0.2 + (second - first)[:, 0].mean())


def test_bias_p_values_are_uniform_without_bias():
    p = [picking_sigma(sessions(seed, 3)).bias_p_value for seed in range(300)]
    assert stats.kstest(p, "uniform").pvalue > 1e-3


def test_the_same_session_twice_has_no_sigma():
    first = sessions(4)[0]
    found = picking_sigma([first, first])
    assert found.sigma == 0
    assert found.bias_p_value == 1


def test_no_repeats_are_refused():
    first, second = sessions(5)
    first[:6] = np.nan
    second[6:] = np.nan
    with pytest.raises(ValueError, match="none of 12 places twice"):
        picking_sigma([first, second])
    with pytest.raises(ValueError, match="must be"):
        picking_sigma([first, second[:5]])


def test_operators_apart_by_the_same_shift_everywhere_differ_beyond_doubt():
    places = np.random.default_rng(0).uniform(0, 10, (5, 3))
    assert picking_sigma([places, places + 1]).bias_p_value < 1e-12
    assert picking_sigma([np.zeros((5, 3)), np.ones((5, 3))]).bias_p_value < 1e-12


def picked(seed, *, source=0.0, target=0.05, ids="abcdefghijkl"):
    rng = np.random.default_rng(seed)
    rows = ["abcdefghijkl".index(name) for name in ids]
    places = PLACES[rows]
    noise = rng.normal(0, 1, (2, *places.shape))
    return picks_from(list(ids), places + source * noise[0], 3 * places + target * noise[1])


def test_picking_again_gives_picks_their_sigmas_frame_by_frame():
    first, others = picked(1), [picked(2, ids="lkjihgfedcba"), picked(3, ids="bcdf")]
    fed, found = repicked(first, others)
    assert set(found) == {"target"}  # in the source nothing was picked again
    assert_allclose(fed.sigma_target, found["target"].sigma)
    assert_allclose(found["target"].sigma, 0.05, rtol=0.3)
    assert found["target"].picks["times"].tolist() == [2, 3, 3, 3, 2, 3, 2, 2, 2, 2, 2, 2]
    assert np.isnan(fed.sigma_source).all()
    assert_allclose(fed.target, first.target)


def test_the_sigma_found_feeds_the_similarity():
    first, second = picked(1, source=0.01), picked(2, source=0.01)
    fed, found = repicked(first, [second])
    worth = align(fed).reliability
    expected = np.hypot(found["target"].sigma, worth.similarity.scale * found["source"].sigma)
    assert worth.noise == "stated"
    assert_allclose(worth.sigma_m, expected)


def test_a_sigma_stated_for_a_frame_that_was_not_picked_again_is_kept():
    first = replace(picked(1), sigma_source=np.full(12, 0.01), sigma_target=np.full(12, 9.0))
    fed, _ = repicked(first, [picked(2)])
    assert (fed.sigma_source == 0.01).all()
    assert (fed.sigma_target < 0.1).all()


def test_operators_who_disagree_give_a_caution():
    other = picked(2)
    other = replace(other, target=other.target + SHIFT)
    codes = [caution.code for caution in repicked(picked(1), [other])[0].cautions]
    assert codes == ["repeats_disagree"]


def test_files_that_repeat_nothing_are_refused():
    with pytest.raises(PicksError, match="nothing was picked again"):
        repicked(picked(1), [picked(1)])
    with pytest.raises(PicksError, match="No id"):
        repicked(picked(1, ids="abc"), [picked(2, ids="def")])
