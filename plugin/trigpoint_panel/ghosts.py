"""Ghosts: where the fit of the other pairs expects the half that is still open."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from trigpoint_panel.names import isolated
from trigpoint_panel.pairs import Pair, Pairs, Place, Side, place_of
from trigpoint_panel.statistics import Fit

# A click further from its ghost than this many RMSE, and than this, deserves a word.
GHOST_RMSES, GHOST_M = 4.0, 1.0


@dataclass(frozen=True, slots=True)
class Ghost:
    """Where the fit of the other pairs expects the open half of a pair.

    Attributes
    ----------
    id : str
    side : {"source", "target"}
        The half that is open.
    xyz : tuple of three float
    pairs : int
        How many pairs put it there.
    """

    id: str
    side: Side
    xyz: Place
    pairs: int

    @property
    def label(self) -> str:
        """The pair's name with a question mark."""
        return f"{self.id}?"


def predict(pair: Pair, fit: Fit) -> Ghost | None:
    """Predict the open half of a pair; None without a fit, or unless just one half is open."""
    similarity = fit.similarity
    if similarity is None:
        return None
    fitted = int(fit.table["used"].sum())
    if pair.source is not None and pair.target is None:
        xyz = similarity(np.array([pair.source]))[0]
        return Ghost(pair.id, "target", place_of(xyz), fitted)
    if pair.target is not None and pair.source is None:
        xyz = similarity.inverse()(np.array([pair.target]))[0]
        return Ghost(pair.id, "source", place_of(xyz), fitted)
    return None


def distance_doubt(ghost: Ghost, place: Place, fit: Fit) -> str:
    """Say that a pick lies far from its ghost; empty where it does not."""
    assert fit.similarity is not None
    # Metres on either side.
    unit = fit.similarity.scale if ghost.side == "source" else 1.0
    apart = math.dist(ghost.xyz, place) * unit
    if apart <= max(GHOST_RMSES * fit.rmse_m, GHOST_M):
        return ""
    return f"{apart:.1f} m from where {ghost.pairs} pairs put it. Keep?"


def doubt(pairs: Pairs, side: Side, place: Place, ghost: Ghost | None, fit: Fit | None) -> str:
    """Say what is doubtful about a pick before it is made; empty: nothing."""
    same = next((each.id for each in pairs if each.at(side) == place), None)
    if same is not None:
        return f"That is {isolated(same)}'s point already. Keep?"
    if ghost is None or fit is None or ghost.side != side:
        return ""
    return distance_doubt(ghost, place, fit)
