"""The same numbers as scipy.stats, which takes half a second to load."""

import subprocess
import sys

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy import stats

from trigpoint import distributions as laws

TAILS = [1e-9, 0.001, 0.01, 0.025, 0.05, 0.5, 0.975]
DOFS = [1, 2, 3, 5, 11, 44, 3000]


@pytest.mark.parametrize("tail", TAILS)
@pytest.mark.parametrize("dof", DOFS)
def test_quantiles_are_those_of_scipy_stats(tail, dof):
    assert_allclose(laws.chi2_isf(tail, dof), stats.chi2.isf(tail, dof), rtol=1e-12)
    assert_allclose(laws.t_isf(tail, dof), stats.t.isf(tail, dof), rtol=1e-11, atol=1e-12)
    assert_allclose(laws.normal_isf(tail), stats.norm.isf(tail), rtol=1e-12, atol=1e-15)
    for spare in (2, 5, 8, 41.5):
        # Farther out, scipy.stats is right to eight digits only.
        if tail > 1e-6:
            assert_allclose(laws.f_isf(tail, dof, spare), stats.f.isf(tail, dof, spare), rtol=1e-10)
        assert_allclose(laws.f_sf(laws.f_isf(tail, dof, spare), dof, spare), tail, rtol=1e-11)


@pytest.mark.parametrize("dof", DOFS)
def test_tails_are_those_of_scipy_stats(dof):
    x = np.array([0.0, 0.1, 1, 3, 16.3, 60, 800])
    assert_allclose(laws.chi2_sf(x, dof), stats.chi2.sf(x, dof), rtol=1e-12, atol=1e-300)
    assert_allclose(laws.f_sf(x, dof, 8), stats.f.sf(x, dof, 8), rtol=1e-12, atol=1e-300)


@pytest.mark.parametrize("dof", [1, 3])
@pytest.mark.parametrize("size", [0.0, 0.5, 21.55, 300.0, 1_000.0])
def test_noncentral_tails_are_those_of_scipy_stats(dof, size):
    for x in (0.5, 16.3, 400.0):
        expected = stats.ncx2.sf(x, dof, size) if size else stats.chi2.sf(x, dof)
        assert_allclose(laws.noncentral_sf(x, dof, size), expected, rtol=1e-9, atol=1e-12)
        for spare in (2, 5, 8):
            expected = stats.ncf.sf(x, dof, spare, size) if size else stats.f.sf(x, dof, spare)
            found = laws.noncentral_sf(x, dof, size, spare)
            assert_allclose(found, expected, rtol=1e-9, atol=1e-12)


def test_nothing_loads_scipy_stats():
    check = "import sys, trigpoint; sys.exit('scipy.stats' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", check], check=False).returncode == 0
