"""Where a click meant to land: the point, a centroid, a summit, or the corner of three planes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from trigpoint.errors import TrigpointError
from trigpoint.similarity import Points

Mode = Literal["point", "centroid", "highest", "corner"]
MODES: tuple[Mode, ...] = ("point", "centroid", "highest", "corner")


class SnapError(TrigpointError, ValueError):
    """There is nothing of that kind to snap to around the click."""

    code = "snap"


@dataclass(frozen=True, slots=True, eq=False)
class Snap:
    """Where a pick came to lie.

    Attributes
    ----------
    xyz : ndarray of shape (3,)
        In the coordinates of the points given.
    sigma : float
        One standard deviation along each axis, in the same units.
    note : str
        What was done, for the pair's note; empty for the point itself.
    """

    xyz: NDArray[np.float64]
    sigma: float
    note: str


def snap(
    points: Points,
    at: NDArray[np.float64],
    mode: Mode,
    radius: float,
    *,
    up: NDArray[np.float64] | None = None,
) -> Snap:
    """Refine a click.

    Parameters
    ----------
    points : ndarray of shape (n, 3)
        Those within twice the radius of the click, at least; the clicked one among them.
    at : ndarray of shape (3,)
        The clicked point.
    mode : str
        "point", "centroid", "highest" or "corner".
    radius : float
        How far around the click to look, in the units of the points.
    up : ndarray of shape (3,), optional
        Where up is; by default along z.

    Raises
    ------
    SnapError
        If there is nothing of that kind within the radius.
    """
    raise NotImplementedError
