"""The picking sigma, found from the same places picked more than once."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from trigpoint.cautions import Caution
from trigpoint.distributions import chi2_isf, f_sf
from trigpoint.errors import PicksError
from trigpoint.picks import Picks
from trigpoint.similarity import Points

BIASED = 0.01  # below this p-value sessions are said to disagree
Frame = Literal["source", "target"]


@dataclass(frozen=True, slots=True, eq=False)
class Repeats:
    """What repeated picking shows, in the units of the frame that was picked in.

    Attributes
    ----------
    points : ndarray of shape (sessions, n, 3)
        What was picked; NaN where a session left a place out.
    sigma, sigma_low, sigma_high : float
        Standard deviation of one pick along each axis, with its 95 % interval.
    sigma_axes : ndarray of shape (3,)
        The same for each axis apart.
    dof : int
        Degrees of freedom of `sigma`.
    picks : DataFrame
        position, times (how often it was picked), sigma (NaN for once).
    sessions : DataFrame
        session, n, dx, dy, dz: mean offset of a session from the means of the picks it shares with
        others.
    bias_p_value : float
        Of offsets between sessions this large, were there none; from the picks that all sessions
        hold, NaN with fewer than two such picks. Small: the sessions disagree systematically, as
        two operators may, and `sigma` holds that too.
    """

    points: NDArray[np.float64]
    sigma: float
    sigma_low: float
    sigma_high: float
    sigma_axes: NDArray[np.float64]
    dof: int
    picks: pd.DataFrame
    sessions: pd.DataFrame
    bias_p_value: float


def picking_sigma(sessions: Sequence[Points]) -> Repeats:
    """Find the picking sigma from sessions that picked the same places in one frame.

    No fit and no reference is involved: only how far picks of one place lie apart. Its `sigma` is
    the `sigma_source` or `sigma_target` of a single pick.

    Parameters
    ----------
    sessions : sequence of ndarray of shape (n, 3)
        The same n places in the same order, one array a session; NaN where one was not picked.

    Returns
    -------
    Repeats

    Raises
    ------
    ValueError
        If the shapes differ, or no place was picked twice.

    Examples
    --------
    >>> first = np.array([[0.0, 0, 0], [5, 0, 0]])
    >>> repeats = picking_sigma([first, first + [[0.02, 0, 0], [0, 0.02, 0]]])
    >>> round(repeats.sigma, 4), repeats.dof
    (0.0082, 6)
    """
    arrays = [np.asarray(session, np.float64) for session in sessions]
    if (
        len({array.shape for array in arrays}) != 1
        or arrays[0].ndim != 2
        or arrays[0].shape[1] != 3
    ):
        shapes = ", ".join(str(array.shape) for array in arrays)
        message = f"sessions of shapes {shapes}: all must be (n, 3), with the same places."
        raise ValueError(message)
    points = np.stack(arrays)
    # About each place's first pick: a mean taken at UTM coordinates loses digits.
    seen = ~np.isnan(points.sum(axis=2))
    times = seen.sum(axis=0)
    twice: NDArray[np.bool_] = times > 1
    if not twice.any():
        message = (
            f"{len(arrays)} sessions pick none of {len(times)} places twice: repeats are needed."
        )
        raise ValueError(message)
    first = points[np.argmax(seen, axis=0), np.arange(len(times))]
    moved = np.where(seen[:, :, None], points - first, 0.0)
    mean = moved.sum(axis=0) / np.maximum(times, 1)[:, None]
    offsets = np.where((seen & twice)[:, :, None], moved - mean, 0.0)

    squares = (offsets**2).sum(axis=0)
    spare = int((times[twice] - 1).sum())
    dof = 3 * spare
    sigma = float(np.sqrt(squares.sum() / dof))
    low, high = np.sqrt(dof / chi2_isf([0.025, 0.975], dof))
    own = np.full(len(times), np.nan)
    own[twice] = np.sqrt(squares[twice].sum(axis=1) / (3 * (times[twice] - 1)))

    shared = (seen & twice).sum(axis=1)
    means = offsets.sum(axis=1) / np.where(shared, shared, np.nan)[:, None]
    table = pd.DataFrame(means, columns=["dx", "dy", "dz"])
    table.insert(0, "session", np.arange(len(arrays)))
    table.insert(1, "n", shared)
    return Repeats(
        points,
        sigma,
        float(sigma * low),
        float(sigma * high),
        np.sqrt(squares.sum(axis=0) / spare),
        dof,
        pd.DataFrame({"position": np.arange(len(times)), "times": times, "sigma": own}),
        table,
        _bias(offsets[:, times == len(arrays)]),
    )


def repicked(picks: Picks, others: Sequence[Picks]) -> tuple[Picks, dict[Frame, Repeats]]:
    """Give picks the sigmas that picking the same places again shows, frame by frame.

    Places are told by their ids; their coordinates stay those of `picks`. In a frame that was
    picked again the sigma found replaces what the picks state; a frame whose coordinates are the
    same in every file was not, and keeps it.

    Parameters
    ----------
    picks : Picks
    others : sequence of Picks
        Picked by another operator, or once more; each may hold some of the places only.

    Returns
    -------
    picks : Picks
    found : dict of str to Repeats
        By the frame, "source" or "target".

    Raises
    ------
    PicksError
        If no place was picked twice, or all files hold the same coordinates.
    """
    used = np.flatnonzero(picks.roles != "off")
    rows = [{name: row for row, name in enumerate(each.ids)} for each in others]
    found: dict[Frame, Repeats] = {}
    frames: tuple[Frame, Frame] = ("source", "target")
    for frame in frames:
        own: Points = getattr(picks, frame)
        sessions = [own[used]]
        for each, row_of in zip(others, rows, strict=True):
            again = np.full((len(used), 3), np.nan)
            for place, pick in enumerate(used):
                if picks.ids[pick] in row_of:
                    again[place] = getattr(each, frame)[row_of[picks.ids[pick]]]
            sessions.append(again)
        try:
            repeats = picking_sigma(sessions)
        except ValueError as error:
            message = f"No id of the {len(used)} picks is in the files of repeated picks."
            raise PicksError(message) from error
        if repeats.sigma > 0:
            found[frame] = repeats
    if not found:
        message = (
            f"Repeated picks in {len(others)} more file(s) have the very coordinates of the first: "
            "nothing was picked again."
        )
        raise PicksError(message)
    doubts = tuple(
        _disagreement(frame, repeats)
        for frame, repeats in found.items()
        if repeats.bias_p_value < BIASED
    )

    def sigma(frame: Frame, stated: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.full(len(picks), found[frame].sigma) if frame in found else stated

    fed = replace(
        picks,
        sigma_source=sigma("source", picks.sigma_source),
        sigma_target=sigma("target", picks.sigma_target),
        cautions=(*picks.cautions, *doubts),
    )
    return fed, found


def _disagreement(frame: Frame, repeats: Repeats) -> Caution:
    unit = "m" if frame == "target" else "source units"
    offsets = repeats.sessions[["dx", "dy", "dz"]].to_numpy()
    farthest = float(np.sqrt(np.nanmax((offsets**2).sum(axis=1))))
    message = (
        f"Repeated picks in the {frame} frame disagree systematically (p "
        f"{repeats.bias_p_value:.2g}): one file lies {farthest:.3g} {unit} off the mean. The sigma "
        f"of {repeats.sigma:.3g} {unit} holds that as if it were chance."
    )
    return Caution("repeats_disagree", message)


def _bias(offsets: NDArray[np.float64]) -> float:
    # Analysis of variance of places by sessions, the three axes together.
    sessions, places, _ = offsets.shape
    if sessions < 2 or places < 2:
        return float("nan")
    between = places * float((offsets.mean(axis=1) ** 2).sum())
    within = float((offsets**2).sum()) - between
    dof = 3 * (sessions - 1)
    spare = dof * (places - 1)
    if between <= 0:
        return 1.0
    # Sessions that lie apart by the same shift everywhere leave nothing within them but rounding.
    within = max(within, np.finfo(np.float64).eps * between)
    ratio = (between / dof) / (within / spare)
    return float(f_sf(ratio, dof, spare))
