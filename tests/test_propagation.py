import numpy as np
import pytest
from numpy.testing import assert_allclose

from trigpoint.adjustment import design_matrix, linearise
from trigpoint.propagation import CHUNK, covariance_at, matrix_covariance, sigma_at
from trigpoint.reliability import assess
from trigpoint.similarity import umeyama


@pytest.fixture
def worth(similarity_from, offset):
    rng = np.random.default_rng(1)
    source = rng.normal(size=(6, 3)) * [3, 4, 6]
    target = similarity_from(1, offset)(source) + rng.normal(0, 0.1, source.shape)
    sigma = rng.uniform(0.05, 0.3, 6)
    return assess(source, target, umeyama(source, target), sigma_target=sigma)


def test_points_carry_the_covariance_of_the_linear_model(worth):
    points = worth.centroid + np.random.default_rng(2).normal(0, 30, (50, 3))
    design = design_matrix(points - worth.centroid)
    expected = design @ worth.covariance @ design.transpose(0, 2, 1)
    found = worth.covariance_at(points)
    assert_allclose(found, expected, rtol=1e-9, atol=1e-12)
    assert_allclose(found, found.transpose(0, 2, 1), rtol=0, atol=0)
    assert_allclose(worth.sigma(points) ** 2, np.diagonal(found, axis1=1, axis2=2), rtol=1e-9)


def test_equal_picks_give_the_closed_form(similarity_from, offset):
    # sigma² (I / n + [p] J^-1 [p]' + p p' / S)
    truth = similarity_from(3, offset)
    source = np.random.default_rng(3).normal(size=(7, 3)) * 5
    ours = linearise(source, truth(source), truth, np.ones(7))
    p = truth(source) - ours.centroid
    square = (p**2).sum()
    inertia = np.linalg.inv(square * np.eye(3) - p.T @ p)
    x, y, z = q = np.array([20.0, -5, 8])
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    expected = 0.04 * (np.eye(3) / 7 + cross @ inertia @ cross.T + np.outer(q, q) / square)
    found = covariance_at(
        (ours.centroid + q)[None, :], ours.centroid, ours.covariance(np.full(7, 0.04))
    )
    assert_allclose(found[0], expected, rtol=1e-6, atol=1e-12)


def test_a_point_s_sigma_does_not_depend_on_its_chunk(worth):
    rng = np.random.default_rng(4)
    points = worth.centroid + rng.normal(0, 30, (CHUNK + 100, 3))
    whole = worth.sigma(points)
    assert (whole[-200:] == worth.sigma(points[-200:])).all()


def test_no_points_have_no_sigma(worth):
    assert worth.sigma(np.empty((0, 3))).shape == (0, 3)
    assert worth.covariance_at(np.empty((0, 3))).shape == (0, 3, 3)


def test_no_noise_is_no_sigma():
    points = np.random.default_rng(5).normal(size=(10, 3))
    assert (sigma_at(points, np.zeros(3), np.zeros((7, 7))) == 0).all()


def arms_about(reference, points):
    """How the twelve numbers move each point: (n, 3, 12)."""
    arms = np.zeros((len(points), 3, 12))
    for axis in range(3):
        arms[:, axis, 3 * axis : 3 * axis + 3] = points - reference
        arms[:, axis, 9 + axis] = 1
    return arms


@pytest.mark.parametrize("reference", [np.zeros(3), np.array([4.0, -2, 9])])
def test_the_matrix_carries_the_same_covariance_to_points(worth, reference):
    full = matrix_covariance(
        worth.similarity, worth.centroid, worth.covariance, reference=reference
    )
    source = np.random.default_rng(6).normal(0, 5, (20, 3))
    arms = arms_about(reference, source)
    expected = worth.covariance_at(worth.similarity(source))
    assert_allclose(arms @ full @ arms.transpose(0, 2, 1), expected, rtol=1e-6, atol=1e-9)
    assert_allclose(full, full.T, rtol=0, atol=0)


def test_the_covariance_for_m3c2_is_about_the_georeferenced_cloud(worth):
    points = worth.centroid + np.random.default_rng(8).normal(0, 20, (20, 3))
    reference = worth.centroid + np.array([3, 4, 5])
    arms = arms_about(reference, points)
    carried = arms @ worth.m3c2_covariance(reference) @ arms.transpose(0, 2, 1)
    assert_allclose(carried, worth.covariance_at(points), rtol=1e-6, atol=1e-9)


def test_the_matrix_covariance_is_that_of_drawn_matrices(similarity_from):
    truth = similarity_from(7)
    rng = np.random.default_rng(7)
    source = rng.normal(size=(6, 3)) * [3, 4, 6]
    sigma, reference = 0.02, np.array([1.0, 2, 3])
    ours = linearise(source, truth(source), truth, np.ones(6))
    expected = matrix_covariance(
        truth, ours.centroid, ours.covariance(np.full(6, sigma**2)), reference=reference
    )
    draws = []
    for _ in range(2000):
        fit = umeyama(source, truth(source) + rng.normal(0, sigma, source.shape))
        draws.append([*(fit.scale * fit.rotation).ravel(), *fit(reference[None, :])[0]])
    found = np.cov(np.array(draws).T)
    size = np.sqrt(np.diag(expected))
    assert_allclose(found / np.outer(size, size), expected / np.outer(size, size), atol=0.1)
