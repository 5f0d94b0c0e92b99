"""Whether the picks' layout pins the similarity down: sound, weak or refused, in words."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from trigpoint.adjustment import Adjustment
from trigpoint.similarity import Points, are_mirrored, principal_spreads

Verdict = Literal["sound", "weak", "refused"]

# One standard deviation of rotation. Five degrees move the far end of a 10 m building by 0.9 m,
# and past them the covariance itself, which is linear, no longer holds.
REFUSED_DEG = 5.0
# One degree moves the top of a 60 m tower by a metre.
WEAK_DEG = 1.0
# Second spread of the picks over the first. Below a twentieth they are a line with a lever across
# it twenty times too short, whatever their noise is said to be.
NARROW = 0.05
# Where less than a tenth of a pick's error shows in its own residual, that pick decides alone.
UNCHECKED = 0.10
# Copies of picks among all. A few copies among thousands of matched points change nothing.
COPIES = 0.05
# A corner of the reference that is known three times worse than one pick measures is carried by
# the picks' lever, not by the picks.
FAR = 3.0


@dataclass(frozen=True, slots=True, eq=False)
class Geometry:
    """A verdict on the layout of the picks.

    Attributes
    ----------
    verdict : str
        "sound", "weak" or "refused".
    reasons : tuple of str
        Clauses that led to the verdict; empty where sound.
    """

    verdict: Verdict
    reasons: tuple[str, ...]


def judge(
    source: Points,
    target: Points,
    adjustment: Adjustment,
    rotation_covariance: NDArray[np.float64],
    *,
    doubt: float,
    corner_ratio: float,
    names: Sequence[str],
) -> Geometry:
    """Judge the layout of the picks.

    Nothing in it depends on the units or the order of the picks.

    Parameters
    ----------
    source, target : ndarray of shape (n, 3)
        The picks that the similarity was fitted to.
    adjustment : Adjustment
        The fit, linearised.
    rotation_covariance : ndarray of shape (3, 3)
        rad², about the target's axes.
    doubt : float
        How many times larger sigma may be than it was taken to be (1 where it is known).
    corner_ratio : float
        Largest sigma at the reference's corners over that of one pick; 0 where there is none.
    names : sequence of str
        Of the picks.

    Returns
    -------
    Geometry
    """
    sigmas, axes = rotation_axes(rotation_covariance)
    sigma = float(np.degrees(sigmas[0]))
    about = axis_words(axes[0])
    # Where noise alone spreads the picks across the axis, the lever that the source shows is not
    # there in the target, and the rotation is known that much worse than the covariance says.
    sigma /= _confirmed(adjustment, target, axes[0])
    spreads = principal_spreads(target)

    refused, weak = [], []
    if are_mirrored(source, target):
        refused.append(
            "a mirror image of the source fits at least ten times better: an axis points the wrong "
            "way in one of the frames"
        )
    elif not sigma <= REFUSED_DEG:
        rmse = np.sqrt((adjustment.residuals**2).sum(axis=1).mean())
        known = f"known to {sigma:.1f}° (one sigma)" if sigma < 90 else "not known at all"
        refused.append(
            f"the rotation about {about} is {known}, and {REFUSED_DEG:g}° is the most that "
            f"can be used; the picks' second spread is {spreads[1]:.3g} m against {spreads[0]:.3g} "
            f"m along, and the RMSE of {rmse:.3g} m does not show it: add a pick well off that axis"
        )
    elif sigma > WEAK_DEG:
        weak.append(f"the rotation about {about} is known to {sigma:.1f}° only (one sigma)")
    elif sigma * doubt > REFUSED_DEG:
        weak.append(
            f"with so few equations the rotation about {about} may be known to "
            f"{min(sigma * doubt, 180):.0f}° only, though the residuals suggest {sigma:.2f}°"
        )
    if spreads[1] < NARROW * spreads[0]:
        weak.append(
            f"the picks lie along {axis_words(_line(target))}: they spread {spreads[1]:.3g} m "
            f"across it against {spreads[0]:.3g} m along it, and only that fixes the rotation "
            f"about it"
        )
    weak += _equal(source, target, names)
    weak += _alone(adjustment, names)
    if corner_ratio > FAR:
        weak.append(
            f"at the reference's farthest corner the similarity is {corner_ratio:.1f} times less "
            f"certain than one pick: the picks do not reach it"
        )
    verdict: Verdict = "refused" if refused else "weak" if weak else "sound"
    return Geometry(verdict, tuple(refused or weak))


def rotation_axes(
    rotation_covariance: NDArray[np.float64],
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return sigmas (3,) in rad about the principal axes (3, 3; one a row), worst first."""
    axes, variances, _ = np.linalg.svd(rotation_covariance)
    axes = axes.T
    # An axis has no sign of its own: let it point up, or else to the larger of its components.
    lead = np.where(np.abs(axes[:, 2]) > 1e-6, 2, np.argmax(np.abs(axes), axis=1))
    signs = np.sign(axes[np.arange(3), lead])
    return np.sqrt(variances), axes * signs[:, None]


def axis_words(axis: NDArray[np.float64]) -> str:
    """Name a direction of the target frame: the vertical, or a bearing from grid north."""
    east, north, up = axis if axis[2] >= 0 else -axis
    slope = np.degrees(np.arctan2(up, np.hypot(east, north)))
    bearing = round(float(np.degrees(np.arctan2(east, north)))) % 360
    if slope > 80:
        return "the vertical"
    if slope < 10:
        return f"a horizontal axis bearing {bearing % 180}° from grid north"
    return f"an axis {slope:.0f}° above the horizon, bearing {bearing}° from grid north"


def _confirmed(adjustment: Adjustment, target: Points, axis: NDArray[np.float64]) -> float:
    # The curvature of the misfit about the axis, over what the source's lever alone makes of it.
    lever = np.cross(axis, adjustment.design[:, :, 0])  # column 0 of the design is the offset
    weights = adjustment.weights
    expected = np.einsum("n,ni,ni->", weights, lever, lever)
    found = np.einsum("n,ni,ni->", weights, lever, np.cross(axis, target - adjustment.centroid))
    return float(min(1.0, max(found / expected, 1e-12)))


def _line(points: Points) -> NDArray[np.float64]:
    centred = points - points.mean(axis=0)
    axis: NDArray[np.float64] = np.linalg.svd(centred, full_matrices=False)[2][0]
    return axis


def _equal(source: Points, target: Points, names: Sequence[str]) -> list[str]:
    pairs = np.column_stack([source, target])
    _, place, counts = np.unique(pairs, axis=0, return_inverse=True, return_counts=True)
    if 1 - len(counts) / len(pairs) <= COPIES:
        return []
    copies = np.flatnonzero(counts[place.reshape(-1)] > 1).tolist()
    listed = ", ".join(sorted(names[i] for i in copies)) if len(copies) < 10 else str(len(copies))
    return [f"picks {listed} hold copies of one another: a copy is no second measurement"]


def _alone(adjustment: Adjustment, names: Sequence[str]) -> list[str]:
    if len(names) == 3:  # no pick can be checked, and the statement says so
        return []
    shown = np.linalg.svd(adjustment.redundancy, compute_uv=False)[:, 2]
    worst = int(np.argmin(shown))
    if shown[worst] >= UNCHECKED:
        return []
    share = 100 * shown[worst]
    return [
        f"pick {names[worst]} decides alone: {share:.0f} % of an error in its worst direction "
        f"would show in its residual"
    ]
