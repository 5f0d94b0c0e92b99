"""Where to pick next: the places that would lower the largest uncertainty most."""

from __future__ import annotations

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from trigpoint.adjustment import MOTION, carried, design_matrix
from trigpoint.reliability import Reliability
from trigpoint.similarity import Points

CHUNK = 2_000_000  # candidates times places judged at once


def next_picks(
    reliability: Reliability,
    candidates: Points,
    region: Points,
    *,
    count: int = 5,
    apart: float = 0.0,
) -> pd.DataFrame:
    """Rank places by how much one more pick there would lower the largest sigma over a region.

    Sigma is that of a point in space, the root of its three variances' sum. The new pick is as
    good as an average one of those there are. Nothing needs to be picked to know this: what a
    pick adds depends on where it lies alone.

    Parameters
    ----------
    reliability : Reliability
        Of the picks there are.
    candidates : ndarray of shape (m, 3)
        Places that could be picked, in the target frame.
    region : ndarray of shape (k, 3)
        Points whose largest sigma counts. Corners of the region do: sigma grows outwards.
    count : int
        Rows wanted.
    apart : float
        Leave out places nearer than this to a better one, in metres.

    Returns
    -------
    DataFrame
        x, y, z, gain_m: best first. Each gain is that of one pick, not of those above it too.
    """
    places = np.unique(np.asarray(candidates, np.float64).reshape(-1, 3), axis=0)
    judged = np.unique(np.asarray(region, np.float64).reshape(-1, 3), axis=0)
    if not len(places) or not len(judged):
        message = f"{len(places)} candidates and {len(judged)} points of the region: both need one."
        raise ValueError(message)
    now = _largest(reliability.covariance[None], judged - reliability.centroid)[0]
    gains = np.zeros(len(places))
    rows = max(1, CHUNK // len(judged))
    for start in range(0, len(places), rows):
        part = slice(start, start + rows)
        after = _with_pick(reliability, places[part])
        gains[part] = now - _largest(after, judged - reliability.centroid)

    kept: list[int] = []
    for best in np.argsort(-gains, kind="stable").tolist():
        if len(kept) == count:
            break
        near = np.linalg.norm(places[kept] - places[best], axis=1) < apart
        if not near.any():
            kept.append(best)
    return pd.DataFrame(
        np.column_stack([places[kept], gains[kept]]), columns=["x", "y", "z", "gain_m"]
    )


def _with_pick(reliability: Reliability, places: Points) -> NDArray[np.float64]:
    """Return the covariance (m, 7, 7) that one more pick at each place would leave."""
    covariance = reliability.covariance
    if reliability.sigma_m == 0:
        return np.broadcast_to(covariance, (len(places), 7, 7))
    design = design_matrix(places - reliability.centroid)
    # What the new pick measures that is not known yet, and the Kalman update that follows.
    surprise = carried(design, covariance) + reliability.sigma_m**2 * np.eye(3)
    half = np.einsum("nia,ab->nib", design, covariance)
    known = np.einsum("nia,nib->nab", half, np.linalg.solve(surprise, half))
    after: NDArray[np.float64] = covariance - known
    return after


def _largest(covariances: NDArray[np.float64], offsets: Points) -> NDArray[np.float64]:
    """Return the largest sigma (m,) that each covariance (m, 7, 7) gives points at offsets."""
    terms = np.column_stack([np.ones(len(offsets)), offsets])
    quadratic = np.einsum("iap,mab,ibq->mpq", MOTION, covariances, MOTION)
    squares = np.einsum("kp,kq->kpq", terms, terms).reshape(-1, 16)
    variances = np.einsum("mp,kp->mk", quadratic.reshape(-1, 16), squares)
    largest: NDArray[np.float64] = np.sqrt(np.maximum(variances.max(axis=1), 0.0))
    return largest
