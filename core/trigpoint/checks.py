"""Check picks: how far the similarity carries picks that had no part in it from where they lie."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from trigpoint.similarity import Points, Similarity, check_pairs


@dataclass(frozen=True, slots=True, eq=False)
class Checks:
    """What the check picks show. Without any, numbers are NaN.

    Attributes
    ----------
    n : int
    mean_m : ndarray of shape (3,)
        Mean error, target minus carried source: what does not average out.
    rmse_axes_m : ndarray of shape (3,)
        Root mean square error along each axis.
    rmse_m : float
        In space.
    total_axes_m, total_m : ndarray of shape (3,), float
        The same with the reference's own accuracy added in quadrature, as ASPRS (2023) asks: what
        the error is against the ground, not against the reference. NaN where it is not known.
    residuals : DataFrame
        position, dx_m, dy_m, dz_m, d_m of each pick.
    """

    n: int
    mean_m: NDArray[np.float64]
    rmse_axes_m: NDArray[np.float64]
    rmse_m: float
    total_axes_m: NDArray[np.float64]
    total_m: float
    residuals: pd.DataFrame


def measure_checks(
    source: Points, target: Points, similarity: Similarity, *, accuracy: float | None = None
) -> Checks:
    """Measure a similarity on picks that it was not fitted to.

    Parameters
    ----------
    source, target : ndarray of shape (n, 3)
        Check picks; `target` in metres. n may be 0.
    similarity : Similarity
        The fit.
    accuracy : float, optional
        Standard deviation of the reference along each axis, metres.

    Returns
    -------
    Checks

    References
    ----------
    ASPRS (2023), Positional Accuracy Standards for Digital Geospatial Data, edition 2, section 7.

    Examples
    --------
    >>> same = Similarity(1.0, np.eye(3), np.zeros(3))
    >>> found = measure_checks(np.zeros((2, 3)), [[0, 0, 0.03], [0, 0, 0.05]], same, accuracy=0.02)
    >>> found.mean_m.round(3).tolist(), round(found.rmse_m, 4), found.total_axes_m.round(4).tolist()
    ([0.0, 0.0, 0.04], 0.0412, [0.02, 0.02, 0.0458])
    """
    source, target, _ = check_pairs(source, target, None)
    errors = target - similarity(source)
    count = len(errors)
    mean = errors.mean(axis=0) if count else np.full(3, np.nan)
    squares = (errors**2).mean(axis=0) if count else np.full(3, np.nan)
    total = squares + (np.nan if accuracy is None else accuracy) ** 2
    residuals = pd.DataFrame(errors, columns=["dx_m", "dy_m", "dz_m"])
    residuals.insert(0, "position", np.arange(count))
    residuals["d_m"] = np.sqrt((errors**2).sum(axis=1))
    return Checks(
        count,
        mean,
        np.sqrt(squares),
        float(np.sqrt(squares.sum())),
        np.sqrt(total),
        float(np.sqrt(total.sum())),
        residuals,
    )
