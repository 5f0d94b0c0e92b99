"""Whether each pick fits the others, and how wrong it would have to be to show."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from trigpoint.adjustment import Adjustment
from trigpoint.cautions import Caution
from trigpoint.distributions import chi2_isf, chi2_sf, f_isf, f_sf, noncentral_sf

SUSPECT_ALPHA = 0.05  # shared by the n tests that may name a suspect
BLUNDER_ALPHA, POWER = 0.001, 0.80  # Baarda's levels, for the detectable blunder
# A direction in which less than this share of a pick's error shows in its residual has no test.
BLIND = 1e-9


@cache
def noncentrality(alpha: float, power: float, dof: int, spare: int | None = None) -> float:
    """Return the noncentrality at which a test of `dof` degrees of freedom reaches its power.

    Parameters
    ----------
    alpha, power : float
        Error level of the test; probability to reject.
    dof : int
        Of the chi-square test, or of the numerator of the F test.
    spare : int, optional
        Degrees of freedom of the F test's denominator; without it, sigma is known.

    Examples
    --------
    >>> round(noncentrality(0.001, 0.80, 1), 2), round(noncentrality(0.001, 0.80, 3), 2)
    (17.07, 21.55)
    """
    critical = float(chi2_isf(alpha, dof)) if spare is None else f_isf(alpha, dof, spare)
    low, high = 0.0, 10.0
    while noncentral_sf(critical, dof, high, spare) < power:
        low, high = high, 2 * high
    while low < (middle := (low + high) / 2) < high:
        if noncentral_sf(critical, dof, middle, spare) < power:
            low = middle
        else:
            high = middle
    return high


def pick_table(
    adjustment: Adjustment,
    shape: NDArray[np.float64],
    sigma: float,
    misfit: float,
    *,
    known: bool,
    exact: bool,
) -> pd.DataFrame:
    """Test each pick's residual against its own covariance.

    Directions in which a pick's error can't show in its residual are left out of its test.

    Parameters
    ----------
    adjustment : Adjustment
        The fit, linearised.
    shape : ndarray of shape (n,)
        Variances of the picks, as shares of `sigma` squared.
    sigma : float
        Metres.
    misfit : float
        `adjustment.misfit(shape)`.
    known : bool
        Whether `sigma` was stated: then chi-square with 3 degrees of freedom; if not, F with 3 and
        3n-10, sigma being taken from the other picks.
    exact : bool
        Whether the residuals are rounding only, and test nothing unless sigma is known.

    Returns
    -------
    DataFrame
        redundancy, standardised, p_value, suspected and detectable_blunder_m of each pick.
    """
    count = len(shape)
    # svd, here and elsewhere: the bits of eigh depend on threads in the OpenBLAS of older NumPys.
    axes, shown, _ = np.linalg.svd(adjustment.redundancy)
    blind = shown <= BLIND
    cofactor = np.einsum("nji,njk,nkl->nil", axes, adjustment.residual_covariance(shape), axes)
    cofactor[blind[:, :, None] | blind[:, None, :]] = 0.0
    cofactor += np.einsum("ni,ij->nij", blind.astype(float), np.eye(3))
    residuals = np.where(blind, 0.0, np.einsum("nji,nj->ni", axes, adjustment.residuals))
    weight = np.linalg.inv(cofactor)
    squares = np.einsum("ni,nij,nj->n", residuals, weight, residuals)

    testable = (~blind).sum(axis=1)
    spare = 3 * count - 7 - testable
    standardised = p = np.full(count, np.nan)
    if count > 3 and not (exact and not known):
        standardised = np.sqrt(squares) / sigma
        if known:
            p = chi2_sf(squares / sigma**2, testable)
        else:
            rest = np.maximum(misfit - squares, np.finfo(np.float64).tiny)
            p = f_sf(squares / testable / (rest / spare), testable, spare)

    # A blunder moves the residual by the redundancy times itself.
    response = np.einsum("ni,nij,nj->nij", shown, weight, shown)
    least = np.where(blind.any(axis=1), 0.0, np.linalg.svd(response, compute_uv=False)[:, 2])
    limit = noncentrality(BLUNDER_ALPHA, POWER, 3)
    with np.errstate(divide="ignore", invalid="ignore"):  # exact picks have no sigma
        detectable = sigma * np.sqrt(limit / least)
    if count == 3:
        detectable = np.full(count, np.inf)
    return pd.DataFrame(
        {
            "redundancy": np.trace(adjustment.redundancy, axis1=1, axis2=2),
            "standardised": standardised,
            "p_value": p,
            "suspected": p < SUSPECT_ALPHA / count,
            "detectable_blunder_m": detectable,
        }
    )


def pick_cautions(picks: pd.DataFrame, names: Sequence[str], *, known: bool) -> list[Caution]:
    """Say in words what the table of picks shows, and what it could not have shown."""
    count = len(picks)
    dof = 3 * count - 7
    cautions = []
    if count == 3:
        message = "3 picks leave 2 redundant equations: no pick can be tested."
        cautions.append(Caution("picks_few", message))
    elif count < 6 and picks["p_value"].notna().any():
        alpha = SUSPECT_ALPHA / count
        naming = noncentrality(alpha, POWER, 3, None if known else dof - 3)
        ratio = np.sqrt(naming / noncentrality(BLUNDER_ALPHA, POWER, 3))
        size = ratio * picks["detectable_blunder_m"].to_numpy()
        message = (
            f"{count} picks leave {dof} redundant equations: a wrong pick is named with "
            f"{100 * POWER:.0f} % probability only if it is off by {size.min():.3g} m or more at "
            f"the best-checked pick and {size.max():.3g} m at the worst."
        )
        cautions.append(Caution("picks_few", message))
    if picks["suspected"].any():
        worst = int(np.nanargmin(picks["p_value"]))
        others = int(picks["suspected"].sum()) - 1
        more = f" {others} more stand out, perhaps only because of it." if others else ""
        message = (
            f"Pick {names[worst]} does not fit the others: its residual is "
            f"{picks['standardised'][worst]:.1f} of its own sigmas long "
            f"(p {picks['p_value'][worst]:.2g}, level {SUSPECT_ALPHA:g} / {count}).{more}"
        )
        cautions.append(Caution("blunder_suspected", message))
    return cautions
