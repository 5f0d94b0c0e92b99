"""What else a comparison might have found, had the picks' noise put the cloud elsewhere."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from trigpoint.nearest import Tree
from trigpoint.reliability import Reliability
from trigpoint.similarity import Points
from trigpoint.tallies import Tallies, measures, tally_halves
from trigpoint.zones import HeightZones

# Points of a zone that are measured at every pose; other ones at each, so that no pose shares the
# error of another. On a tower of 100,000 voxels and with 2,000 poses, another seed then moves a
# bound by 0.2 % on average, and ten times as many points move it no further.
SAMPLE = 200
CHUNK = 500_000  # distances found at once; the result does not depend on it


@dataclass(frozen=True, slots=True, eq=False)
class Poses:
    """Similarities as near to the fitted one as the true one is: small motions of the target frame.

    Attributes
    ----------
    centre : ndarray of shape (3,)
        About which they turn and scale: the picks' centroid, in the target frame.
    scales : ndarray of shape (m,)
    rotations : ndarray of shape (m, 3, 3)
    shifts : ndarray of shape (m, 3)
        Metres.
    """

    centre: NDArray[np.float64]
    scales: NDArray[np.float64]
    rotations: NDArray[np.float64]
    shifts: NDArray[np.float64]

    def __len__(self) -> int:
        """Count the poses."""
        return len(self.scales)

    def about(self, origin: NDArray[np.float64]) -> Poses:
        """Express the same motions for coordinates about an origin."""
        return Poses(self.centre - origin, self.scales, self.rotations, self.shifts)

    def __getitem__(self, rows: slice) -> Poses:
        """Keep some poses."""
        return Poses(self.centre, self.scales[rows], self.rotations[rows], self.shifts[rows])

    def forward(self, points: Points) -> Points:
        """Move points of shape (m, n, 3), each set by its own pose."""
        turned: Points = np.einsum("mij,mnj->mni", self.rotations, points - self.centre)
        turned *= self.scales[:, None, None]
        turned += (self.centre + self.shifts)[:, None, :]
        return turned

    def back(self, points: Points) -> Points:
        """Undo `forward`."""
        arms = (points - (self.centre + self.shifts)[:, None, :]) / self.scales[:, None, None]
        turned: Points = np.einsum("mji,mnj->mni", self.rotations, arms)
        turned += self.centre
        return turned


def parameters(
    reliability: Reliability, *, draws: int, random: np.random.Generator
) -> NDArray[np.float64]:
    """Draw the seven parameters' errors, (draws, 7), in the order of the covariance.

    Normal where the picks' sigma is stated; where it is found from the residuals, multivariate t
    with their 3n-7 degrees of freedom.
    """
    # svd: the bits of eigh depend on the number of threads in the OpenBLAS of older NumPys.
    axes, variances, _ = np.linalg.svd(reliability.covariance)
    # The symmetric root: the sign of an axis, which rounding may turn, falls out of it.
    root = (axes * np.sqrt(variances)) @ axes.T
    errors: NDArray[np.float64] = np.einsum("ij,mj->mi", root, random.normal(size=(draws, 7)))
    if reliability.noise == "residuals":
        errors *= np.sqrt(reliability.dof / random.chisquare(reliability.dof, draws))[:, None]
    return errors


def draw_poses(reliability: Reliability, *, draws: int, random: np.random.Generator) -> Poses:
    """Draw poses from the covariance of a similarity; arguments as in `parameters`."""
    return poses_with(reliability, parameters(reliability, draws=draws, random=random))


def poses_with(reliability: Reliability, errors: NDArray[np.float64]) -> Poses:
    """Return the poses that are wrong by these errors of the seven parameters, (m, 7)."""
    return Poses(
        reliability.centroid,
        np.exp(errors[:, 0]),
        Rotation.from_rotvec(errors[:, 1:4]).as_matrix(),
        errors[:, 4:],
    )


def changes_at(
    poses: Poses,
    source: Points,
    target: Tree,
    *,
    distances: NDArray[np.float64],
    zones: HeightZones,
    base: float,
    within: Sequence[float],
    moves: Literal["source", "target"],
    random: np.random.Generator,
) -> NDArray[np.float64]:
    """Return by how much mean squares and shares change when one of two clouds takes each pose.

    Each pose is judged by a sample of its own, zone by zone, and against what the same points
    measured before: all that differs is the pose.

    Parameters
    ----------
    poses : Poses
    source : ndarray of shape (n, 3)
        Points that are measured, in the same frame as `poses`.
    target : Tree
        Points that they are measured to.
    distances : ndarray of shape (n,)
        From `source` to `target` before any motion.
    zones : HeightZones
        Of `source`, where it comes to lie.
    base : float
        Height of the frame's zero: heights of points and zones differ by it.
    within : sequence of float
        Thresholds in metres.
    moves : {"source", "target"}
        Which cloud the similarity had brought. Where it is the target, the points that are
        measured go back instead: a similarity scales all distances alike, and one tree will do.
    random : Generator

    Returns
    -------
    ndarray of shape (m, 1 + zones, 1 + thresholds)
        As `trigpoint.tallies.measures` has them.
    """
    own = zones.of(source[:, 2] + base)
    names, halves = len(zones.names), []
    for chosen, rows, weights in samples(len(poses), own, random=random):
        part = poses[chosen]
        if moves == "source":
            moved = part.forward(source[rows])
            away = target.query(moved.reshape(-1, 3))[0].reshape(rows.shape)
            zone = zones.of(moved[..., 2] + base)
        else:
            moved = part.back(source[rows])
            away = target.query(moved.reshape(-1, 3))[0].reshape(rows.shape)
            away *= part.scales[:, None]
            zone = own[rows]
        after = tally_halves(away, zone, weights, names, within)
        halves.append((after, tally_halves(distances[rows], own[rows], weights, names, within)))
    after, before = (np.concatenate(each) for each in zip(*halves, strict=True))
    sizes = np.bincount(own, minlength=names)
    taken = np.minimum(sizes, SAMPLE)
    sizes, taken = (np.concatenate([[each.sum()], each]) for each in (sizes, taken))
    return _steadied(after, before, 1 - taken / np.maximum(sizes, 1))


def _steadied(after: Tallies, before: Tallies, unseen: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return changes, their spread freed from what the choice of points adds to it.

    Halves of a sample differ by that choice alone, so their differences show its variance.
    """
    changes = measures(after.sum(axis=1)) - measures(before.sum(axis=1))
    by_half = measures(after) - measures(before)
    # A zone of so few points that a half has none is seen whole, and its choice adds nothing.
    gaps = np.nan_to_num(by_half[:, 0] - by_half[:, 1])
    noise = (gaps**2).mean(axis=0) / 4 * unseen[:, None]
    spread = changes.var(axis=0)
    share = np.clip(noise / np.where(spread > 0, spread, 1.0), 0, 1)
    middle = changes.mean(axis=0)
    steadied: NDArray[np.float64] = middle + np.sqrt(1 - share) * (changes - middle)
    return steadied


def samples(
    poses: int, own: NDArray[np.intp], *, random: np.random.Generator, size: int | None = None
) -> Iterator[tuple[slice, NDArray[np.intp], NDArray[np.float64]]]:
    """Choose points to judge each pose by: spread evenly along each zone, others for each pose.

    Parameters
    ----------
    poses : int
    own : ndarray of shape (n,)
        Each point's zone. Points in lattice order are spread evenly in space.
    random : Generator
    size : int, optional
        Points of a zone; all of a zone that has no more.

    Yields
    ------
    slice, ndarray of shape (m, k), ndarray of shape (k,)
        Some of the poses; the rows for each; and how many points each of these stands for.
    """
    members = np.argsort(own, kind="stable")
    sizes = np.bincount(own)
    taken = np.minimum(sizes, SAMPLE if size is None else size)
    start, each, sample = (np.repeat(value, taken) for value in (_starts(sizes), sizes, taken))
    step = np.arange(len(sample)) - np.repeat(_starts(taken), taken)
    ratio = each / sample
    at_once = max(1, CHUNK // len(sample))
    for first in range(0, poses, at_once):
        chosen = slice(first, min(first + at_once, poses))
        place = (step + random.random((chosen.stop - first, len(sample)))) * ratio
        # Rounding may carry the last place past the end.
        yield chosen, members[start + np.minimum(place.astype(np.intp), each - 1)], ratio


def _starts(sizes: NDArray[np.intp]) -> NDArray[np.intp]:
    starts: NDArray[np.intp] = np.cumsum(sizes) - sizes
    return starts
