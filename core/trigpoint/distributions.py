"""Tails of the laws that tests and intervals rest on; scipy.stats has them, and is slow to load."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import special

Numbers = float | list[float] | NDArray[np.float64] | NDArray[np.intp]


def chi2_sf(x: Numbers, dof: Numbers) -> NDArray[np.float64]:
    """Return the chance that chi-square with `dof` degrees of freedom exceeds x."""
    return np.asarray(special.chdtrc(dof, x), np.float64)


def chi2_isf(tail: Numbers, dof: Numbers) -> NDArray[np.float64]:
    """Return what chi-square with `dof` degrees of freedom exceeds with this chance."""
    return np.asarray(special.chdtri(dof, tail), np.float64)


def f_sf(x: Numbers, dof: Numbers, spare: Numbers) -> NDArray[np.float64]:
    """Return the chance that F with `dof` over `spare` degrees of freedom exceeds x."""
    return np.asarray(special.fdtrc(dof, spare, x), np.float64)


def f_isf(tail: float, dof: float, spare: float) -> float:
    """Return what F with `dof` over `spare` degrees of freedom exceeds with this chance."""
    # By the beta law of the denominator's share: special.fdtri takes one less the tail.
    share = float(special.betaincinv(spare / 2, dof / 2, tail))
    return spare * (1 - share) / (dof * share)


def t_isf(tail: float, dof: float) -> float:
    """Return what Student's t with `dof` degrees of freedom exceeds with this chance."""
    return -float(special.stdtrit(dof, tail))


def normal_isf(tail: float) -> float:
    """Return what a standard normal number exceeds with this chance."""
    return -float(special.ndtri(tail))


def noncentral_sf(x: float, dof: float, size: float, spare: float | None = None) -> float:
    """Return the chance that noncentral chi-square exceeds x, or noncentral F where spare is given.

    A law with noncentrality `size` is a mixture of central ones, with 2k more degrees of freedom
    as often as a Poisson law of mean ``size / 2`` gives k.

    Examples
    --------
    >>> round(noncentral_sf(16.266, 3, 21.55), 3)
    0.8
    """
    mean = size / 2
    more = np.arange(np.ceil(mean + 12 * np.sqrt(mean) + 40))
    often = np.exp(special.xlogy(more, mean) - mean - special.gammaln(more + 1))
    if spare is None:
        tails = chi2_sf(x, dof + 2 * more)
    else:
        tails = np.asarray(special.betainc(spare / 2, dof / 2 + more, spare / (spare + dof * x)))
    return float((often * tails).sum())
