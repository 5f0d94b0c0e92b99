"""What a flawless reconstruction would score, its picks being as noisy as they are."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd

from trigpoint.adjustment import design_matrix
from trigpoint.intervals import DRAWS, LEVELS
from trigpoint.posing import parameters, samples
from trigpoint.preparation import ALL, SEED
from trigpoint.reliability import Reliability
from trigpoint.surface import Surface
from trigpoint.tallies import measures, tally_halves
from trigpoint.zones import HeightZones

SAMPLE = 2000  # points of a zone that are judged; the same at all poses
CHUNK = 100  # poses judged at once; the result does not depend on it


@dataclass(frozen=True, slots=True, eq=False)
class Flawless:
    """Completeness of a reconstruction without flaw or gap, placed by picks as noisy as these.

    Attributes
    ----------
    shares : DataFrame
        zone, threshold_m, low_pct, median_pct, high_pct: between low and high lie 95 % of what
        it would score.
    statement : str
        The same in one sentence, for all zones together.
    """

    shares: pd.DataFrame
    statement: str


def flawless(
    reliability: Reliability,
    surface: Surface,
    zones: HeightZones,
    *,
    within: Sequence[float],
    draws: int = DRAWS,
    seed: int = SEED,
) -> Flawless:
    """Find how much completeness picking noise alone costs, reconstruction and sensor aside.

    The reference's own surface is taken as a reconstruction that is perfect and densely sampled,
    and is moved by errors drawn from the similarity's covariance. The distance of a reference
    point to it is then the part of the point's motion along the normal there. (Measured to a
    moved copy of the points themselves, the gaps between them would count as errors as well.)

    Parameters
    ----------
    reliability : Reliability
        Of the similarity.
    surface : Surface
        Of the reference.
    zones : HeightZones
    within : sequence of float
        Thresholds in metres.
    draws, seed : int

    Examples
    --------
    >>> from trigpoint.reliability import assess
    >>> from trigpoint.similarity import umeyama
    >>> from trigpoint.zones import height_zones
    >>> wall = np.array([[x, 0.0, z] for x in range(8) for z in range(10)])
    >>> picks = np.array([[0.0, 0, 0], [7, 0, 1], [0, 5, 5], [3, 2, 9]])
    >>> worth = assess(picks, picks, umeyama(picks, picks), sigma_target=np.full(4, 0.05))
    >>> flawless(worth, Surface(wall), height_zones(0.0, 9.0), within=[0.1]).statement
    'From picking noise alone, ...'
    """
    own = zones.of(surface.points[:, 2] + surface.centre[2])
    random = np.random.default_rng(seed)
    _, (rows,), weights = next(samples(1, own, random=random, size=SAMPLE))
    arms = surface.points[rows] + (surface.centre - reliability.centroid)
    along = np.einsum("ni,nip->np", surface.normals(rows), design_matrix(arms))
    errors = parameters(reliability, draws=draws, random=random)
    tallies = []
    for first in range(0, draws, CHUNK):
        away = np.abs(np.einsum("mp,np->mn", errors[first : first + CHUNK], along))
        zone = np.broadcast_to(own[rows], away.shape)
        tallies.append(tally_halves(away, zone, weights, len(zones.names), within).sum(axis=1))
    pct = measures(np.concatenate(tallies))[:, :, 1:]
    low, median, high = np.quantile(pct, [LEVELS[0], 0.5, LEVELS[1]], axis=0)
    names = [ALL, *zones.names]
    shares = pd.DataFrame(
        {
            "zone": np.repeat(names, len(within)),
            "threshold_m": np.tile(np.asarray(within, np.float64), len(names)),
            "low_pct": low.ravel(),
            "median_pct": median.ravel(),
            "high_pct": high.ravel(),
        }
    )
    scores = [
        f"{_between(f'{least:.0f}', f'{most:.0f}')} % within {threshold:g} m"
        for threshold, least, most in zip(within, low[0], high[0], strict=True)
    ]
    statement = (
        "From picking noise alone, the completeness of a perfect reconstruction would be "
        f"{', '.join(scores)}."
    )
    return Flawless(shares, statement)


def _between(least: str, most: str) -> str:
    return f"about {least}" if least == most else f"between {least} and {most}"
