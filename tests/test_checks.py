import numpy as np
import pytest
from numpy.testing import assert_allclose

from trigpoint.checks import measure_checks


def test_errors_put_in_are_read_back(similarity_from, offset):
    truth = similarity_from(1, offset)
    source = np.random.default_rng(1).normal(size=(40, 3)) * 10
    errors = np.random.default_rng(2).normal([0.1, 0, -0.2], 0.05, (40, 3))
    found = measure_checks(source, truth(source) + errors, truth)
    assert found.n == 40
    assert_allclose(found.mean_m, errors.mean(axis=0), atol=1e-8)
    assert_allclose(found.rmse_axes_m, np.sqrt((errors**2).mean(axis=0)), atol=1e-8)
    assert_allclose(found.rmse_m, np.sqrt((errors**2).sum(axis=1).mean()), atol=1e-8)
    assert_allclose(found.residuals[["dx_m", "dy_m", "dz_m"]], errors, atol=1e-8)
    assert_allclose(found.residuals["d_m"], np.linalg.norm(errors, axis=1), atol=1e-8)


def test_the_reference_s_accuracy_is_added_in_quadrature(similarity_from):
    truth = similarity_from(1)
    source = np.random.default_rng(1).normal(size=(5, 3))
    found = measure_checks(source, truth(source) + np.array([0.03, 0, 0.04]), truth, accuracy=0.03)
    assert_allclose(found.rmse_m, 0.05)
    assert_allclose(found.total_axes_m, [0.03 * np.sqrt(2), 0.03, 0.05])
    assert_allclose(found.total_m, np.sqrt(0.05**2 + 3 * 0.03**2))


def test_an_unknown_accuracy_adds_nothing_and_says_nothing(similarity_from):
    truth = similarity_from(1)
    source = np.ones((2, 3))
    assert np.isnan(measure_checks(source, truth(source), truth).total_m)


def test_no_checks_are_no_numbers(similarity_from):
    found = measure_checks(np.empty((0, 3)), np.empty((0, 3)), similarity_from(1))
    assert found.n == len(found.residuals) == 0
    assert np.isnan([found.rmse_m, *found.mean_m, *found.rmse_axes_m]).all()


def test_a_broken_check_is_refused(similarity_from):
    with pytest.raises(ValueError, match="NaN"):
        measure_checks(np.full((2, 3), np.nan), np.zeros((2, 3)), similarity_from(1))
