import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation
from towers import TOWER

from trigpoint.adjustment import linearise
from trigpoint.similarity import Similarity, umeyama


def pairs(truth, seed, sigma=0.1):
    return truth(TOWER) + np.random.default_rng(seed).normal(0, sigma, TOWER.shape)


def moved(fit, centroid, parameters):
    """Apply the seven parameters by hand, without linearising."""
    turn = Rotation.from_rotvec(parameters[1:4]).as_matrix()
    scale = fit.scale * np.exp(parameters[0])
    shift = (
        centroid + parameters[4:] - scale * turn @ fit.rotation @ fit.inverse()(centroid[None])[0]
    )
    return Similarity(scale, turn @ fit.rotation, shift)


@pytest.mark.parametrize("weighted", [False, True])
def test_agrees_with_an_independent_least_squares_adjustment(weighted, similarity_from):
    truth = similarity_from(1)
    sigma = np.random.default_rng(2).uniform(0.02, 0.3, 6) if weighted else np.full(6, 0.1)
    target = pairs(truth, 3)
    fit = umeyama(TOWER, target, weights=sigma**-2)
    ours = linearise(TOWER, target, fit, sigma**-2)

    def residuals(parameters):
        guess = moved(fit, ours.centroid, parameters)
        return ((target - guess(TOWER)) / sigma[:, None]).ravel()

    oracle = least_squares(residuals, np.zeros(7), jac="3-point", x_scale=1e-2)
    assert_allclose(oracle.x, 0, atol=1e-6)  # the fit is the optimum
    assert_allclose(
        ours.covariance(sigma**2), np.linalg.inv(oracle.jac.T @ oracle.jac), rtol=1e-6, atol=1e-12
    )
    assert_allclose(ours.misfit(sigma**2), 2 * oracle.cost, rtol=1e-9)


def test_three_blocks_of_the_covariance_are_uncorrelated_for_equal_weights(similarity_from, offset):
    truth = similarity_from(4, offset)
    ours = linearise(TOWER, truth(TOWER), truth, np.ones(6))
    p = truth(TOWER) - truth(TOWER).mean(axis=0)
    square = (p**2).sum()
    inertia = square * np.eye(3) - p.T @ p
    expected = np.zeros((7, 7))
    expected[0, 0] = 1 / square
    expected[1:4, 1:4] = np.linalg.inv(inertia)
    expected[4:, 4:] = np.eye(3) / 6
    assert_allclose(ours.covariance(np.full(6, 0.01)), 0.01 * expected, rtol=1e-8, atol=1e-14)


@given(st.integers(0, 1000), st.integers(3, 12))
def test_redundancies_sum_to_the_degrees_of_freedom(seed, count):
    rng = np.random.default_rng(seed)
    source = rng.normal(size=(count, 3))
    weights = rng.uniform(0.1, 10, count)
    target = 3 * source + rng.normal(scale=0.1, size=source.shape)
    ours = linearise(source, target, umeyama(source, target, weights=weights), weights)
    traces = np.trace(ours.redundancy, axis1=1, axis2=2)
    assert_allclose(traces.sum(), 3 * count - 7, atol=1e-9)


@pytest.mark.parametrize("weighted", [False, True])
def test_leverage_foretells_the_residual_of_a_pick_left_out(weighted, similarity_from, offset):
    weights = np.random.default_rng(1).uniform(0.5, 2, 6) if weighted else np.ones(6)
    target = pairs(similarity_from(5, offset), 5, sigma=0.02)
    fit = umeyama(TOWER, target, weights=weights)
    ours = linearise(TOWER, target, fit, weights)
    foretold = np.linalg.solve(ours.redundancy, ours.residuals[:, :, None])[:, :, 0]
    for i in range(6):
        others = np.arange(6) != i
        refit = umeyama(TOWER[others], target[others], weights=weights[others])
        left_out = (target - refit(TOWER))[i]
        assert np.linalg.norm(foretold[i] - left_out) <= 0.02 * np.linalg.norm(left_out)

        # Exact against one linearised step without the pick.
        design, rest, w = ours.design[others], ours.residuals[others], weights[others]
        normal = np.einsum("nia,n,nib->ab", design, w, design)
        step = np.linalg.solve(normal, np.einsum("nia,n,ni->a", design, w, rest))
        assert_allclose(foretold[i], ours.residuals[i] - ours.design[i] @ step, atol=1e-9)


def test_an_unweighted_fit_of_unequal_picks_has_the_covariance_of_its_draws(similarity_from):
    # The sandwich: simulate the linear estimator itself, whose covariance must be exact.
    truth = similarity_from(6)
    sigma = np.array([0.02, 0.3, 0.1, 0.05, 0.2, 0.1])
    ours = linearise(TOWER, truth(TOWER), truth, np.ones(6))
    hat = np.einsum("ab,nib->ani", ours.cofactor, ours.design).reshape(7, 18)
    expected = hat @ np.diag(np.repeat(sigma**2, 3)) @ hat.T
    assert_allclose(ours.covariance(sigma**2), expected, rtol=1e-9, atol=1e-15)

    design = ours.design.reshape(18, 7)
    maker = np.eye(18) - design @ hat
    full = maker @ np.diag(np.repeat(sigma**2, 3)) @ maker.T
    blocks = np.array([full[3 * i : 3 * i + 3, 3 * i : 3 * i + 3] for i in range(6)])
    assert_allclose(ours.residual_covariance(sigma**2), blocks, atol=1e-12)


def test_the_misfit_does_not_depend_on_the_weights_of_the_fit(similarity_from):
    # It is what the best fit would leave, so any fit near it must give the same (to second order).
    target = pairs(similarity_from(7), 7, sigma=0.001)
    sigma = np.array([0.001, 0.002, 0.001, 0.003, 0.001, 0.002])
    values = [
        linearise(TOWER, target, umeyama(TOWER, target, weights=w), w).misfit(sigma**2)
        for w in (np.ones(6), sigma**-2, np.arange(1.0, 7))
    ]
    assert_allclose(values, values[0], rtol=1e-3)
