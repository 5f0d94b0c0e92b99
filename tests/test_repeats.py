import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy import stats

from trigpoint.repeats import picking_sigma

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
