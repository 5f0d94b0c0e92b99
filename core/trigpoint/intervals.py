"""How sure the measured shares and RMSE are: 95 % intervals, from the picks and from sampling."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy.special import ndtr, ndtri

from trigpoint.blocks import BLOCK_M, FEWEST_BLOCKS, blocks_of, resampled, too_few
from trigpoint.cautions import Caution
from trigpoint.comparison import Comparison
from trigpoint.nearest import Tree
from trigpoint.posing import changes_at, parameters, poses_with
from trigpoint.preparation import ALL, SEED
from trigpoint.reliability import Reliability
from trigpoint.tallies import Tallies, measures, tally

DRAWS = 1000
LEVELS = (0.025, 0.975)
DIRECTIONS = ("accuracy", "completeness")
LEAST = 1e-9  # the smallest share that stands for a mean square: of none it would be infinite


@dataclass(frozen=True, slots=True, eq=False)
class Intervals:
    """95 % intervals of what a comparison measured, and of what each is made.

    Attributes
    ----------
    shares : DataFrame
        A row for each of the comparison's `within`, in its order: direction, zone, threshold_m,
        pct; low_pct, high_pct; pose_low_pct, pose_high_pct from the similarity's uncertainty
        alone; sampling_low_pct, sampling_high_pct from the block bootstrap alone.
    rmse : DataFrame
        The same of RMSE: direction, zone, rmse_m, low_m, high_m, pose_low_m and so on.
    has_pose : bool
        Whether the similarity's uncertainty is part of it. Without, the pose columns are NaN.
    block_m : dict of str to float
        Edge of the blocks that were resampled, by direction.
    draws, seed : int
    completeness_pose_pct : ndarray of shape (draws, 1 + zones, thresholds) or None
        Shares of completeness at the true pose, were each drawn pose error the one that was made:
        what the pose's intervals are taken from.
    statement : str
        What an interval means, in one sentence.
    cautions : tuple of Caution
    """

    shares: pd.DataFrame
    rmse: pd.DataFrame
    has_pose: bool
    block_m: dict[str, float]
    draws: int
    seed: int
    completeness_pose_pct: NDArray[np.float64] | None
    statement: str
    cautions: tuple[Caution, ...]


def estimate(
    comparison: Comparison,
    *,
    reliability: Reliability | None = None,
    draws: int = DRAWS,
    seed: int = SEED,
) -> Intervals:
    """Work out 95 % intervals of a comparison's shares and RMSE, zone by zone.

    What is estimated is the value at the true pose. Two things keep the measured value from it,
    and each gives draws of what the value at the true pose may be:

    *Pose.* The similarity is wrong by an error drawn from its covariance. Moving the cloud by such
    errors once more shows what they do. They worsen the fit of a cloud that fits best where it
    belongs, so the moved shares themselves lie on the wrong side of the truth: they are reflected.
    What adds up is the mean square, for errors of the pose and of the surfaces are independent. A
    share stands for one too: that of normal distances of which so many are within its threshold.
    So each error, taken both ways (what only its direction does falls out), adds to the mean
    square about what the true error has added, and that much is taken off.

    *Sampling.* The building is one of its kind: its blocks of 2 m, drawn again with replacement,
    show how the value would vary among such buildings, and with it what a small or patchy zone
    is worth. Reflected as ``2 p - q``.

    The interval holds the middle 95 % of both together, clipped to what is possible. What was
    measured lies near its worse end, and may lie just outside: a pose error has worsened it. Where
    the true share is nearly 0 or 100 %, no interval can miss it on that side, and more than 95 %
    of them hold it; where a reconstruction fits better elsewhere than where it belongs (it is
    shifted or bent as a whole), fewer do. With the picks of the demo's tower picked again 60 times,
    zone shares between 2 and 98 % lay in their intervals 94.6 % of the time for a perfect
    reconstruction, 96.6 % for the neural and 96.3 % for the photogrammetric one, between 85 and
    100 % for a single zone and threshold (`make bench` prints the table).

    A blunder among the picks is not in it. The region's crop and the lattice stay where they were.

    Parameters
    ----------
    comparison : Comparison
    reliability : Reliability, optional
        Of the similarity that carried the reconstruction to where it was measured. None where
        none did (it came georeferenced), or where it was moved since (by ICP): then the pose is
        taken as it is, and only sampling is in the interval.
    draws, seed : int

    Returns
    -------
    Intervals
        NaN where nothing was measured, or fewer than 10 blocks hold any points.

    References
    ----------
    Davison and Hinkley (1997), Bootstrap Methods and their Application, section 5.2 (basic
    interval and its transformations), doi:10.1017/CBO9780511802843.
    """
    within = thresholds_of(comparison)
    zones, origin = comparison.zones, comparison.reference.origin
    source, target = comparison.reconstruction.xyz, comparison.reference.xyz
    streams = np.random.SeedSequence(seed).spawn(3)
    poses = None
    if reliability is not None:
        random = np.random.default_rng(streams[0])
        errors = parameters(reliability, draws=draws, random=random)
        poses = poses_with(reliability, np.concatenate([errors, -errors])).about(origin)

    truths = {}
    moves: Literal["source", "target"]
    for direction, moves, points, others, distances, stream in (
        ("accuracy", "source", source, target, comparison.accuracy_m, streams[1]),
        ("completeness", "target", target, source, comparison.completeness_m, streams[2]),
    ):
        if not (len(points) and len(others)):
            truths[direction] = _unknown((1 + len(zones.names), 1 + len(within)), draws)
            continue
        # Streams of their own: with and without a pose, sampling draws the same.
        sampling, posing = (np.random.default_rng(child) for child in stream.spawn(2))
        blocks = blocks_of(points, target.min(axis=0))
        tallies = tally(
            distances,
            zones.of(points[:, 2] + origin[2]),
            blocks.of,
            shape=(blocks.count, len(zones.names)),
            within=within,
        )
        changes = None
        if poses is not None:
            changes = changes_at(
                poses,
                points,
                Tree(others),
                distances=distances,
                zones=zones,
                base=float(origin[2]),
                within=within,
                moves=moves,
                random=posing,
            )
        again = resampled(tallies, draws=draws, random=sampling)
        truths[direction] = _truth(tallies, again, changes, within, blocks.edge_m)

    has_pose = poses is not None and len(source) > 0 and len(target) > 0
    posed = truths["completeness"].posed[:, :, 1:] if has_pose else None
    shares, rmse = _tables(comparison, truths)
    edges = {direction: truth.block_m for direction, truth in truths.items()}
    return Intervals(
        shares=shares,
        rmse=rmse,
        has_pose=has_pose,
        block_m=edges,
        draws=draws,
        seed=seed,
        completeness_pose_pct=posed,
        statement=_statement(reliability, max(edges.values())),
        cautions=tuple(_doubts(comparison, truths)),
    )


def thresholds_of(comparison: Comparison) -> list[float]:
    """Return the thresholds of a comparison in metres, in its order."""
    table = comparison.within
    first = (table["direction"] == DIRECTIONS[0]) & (table["zone"] == ALL)
    return [float(threshold) for threshold in table.loc[first, "threshold_m"]]


@dataclass(frozen=True, slots=True, eq=False)
class _Truth:
    """Draws of what the values at the true pose may be, and their bounds.

    Values are RMSE and shares, shape (1 + zones, 1 + thresholds); `bounds` has two more axes in
    front: both parts, the pose alone, sampling alone; low, high.
    """

    posed: NDArray[np.float64]
    bounds: NDArray[np.float64]
    sparse: NDArray[np.bool_]
    block_m: float


def _truth(
    tallies: Tallies,
    again: Tallies,
    changes: NDArray[np.float64] | None,
    within: Sequence[float],
    block_m: float,
) -> _Truth:
    means = measures(tallies.sum(axis=0))
    value, drawn = _values(means), _values(measures(again))
    # A draw of blocks that holds no point of a zone says nothing about it.
    sampled = 2 * value - np.where(np.isnan(drawn), value, drawn)
    posed = np.full_like(sampled, np.nan)
    both = sampled
    if changes is not None:
        posed = _posed(means, np.split(means + np.nan_to_num(changes), 2))
        posed[..., 1:] = _nested(posed[..., 1:], within)
        both = posed + sampled - value
    bounds = np.stack([np.quantile(part, LEVELS, axis=0) for part in (both, posed, sampled)])
    np.clip(bounds[..., 0], 0, None, out=bounds[..., 0])
    np.clip(bounds[..., 1:], 0, 100, out=bounds[..., 1:])
    sparse = too_few(tallies)
    bounds[0, :, sparse] = bounds[2, :, sparse] = np.nan
    return _Truth(posed, bounds, sparse, block_m)


def _posed(means: NDArray[np.float64], moved: Sequence[NDArray[np.float64]]) -> NDArray[np.float64]:
    """Take off what pose errors add, once ahead and once back: RMSE and shares at the true pose."""
    now, ahead, back = (_squares(each) for each in (means, *moved))
    squares = np.maximum(2 * now - (ahead + back) / 2, 0)
    posed = np.sqrt(squares)
    with np.errstate(divide="ignore"):
        posed[..., 1:] = 100 * (2 * ndtr(1 / posed[..., 1:]) - 1)
    # From a share of nothing there is nothing to reflect.
    return np.where(means > 0, posed, _values(moved[0]))


def _squares(means: NDArray[np.float64]) -> NDArray[np.float64]:
    """Mean squares, and those that shares stand for, in squares of the threshold."""
    squares = np.maximum(means, 0)
    shares = np.clip(means[..., 1:] / 100, LEAST, 1 - LEAST)
    squares[..., 1:] = ndtri((1 + shares) / 2) ** -2
    return squares


def _nested(shares: NDArray[np.float64], within: Sequence[float]) -> NDArray[np.float64]:
    """Lower each draw's shares to those within larger thresholds: at one pose, none is smaller."""
    falling = np.argsort(within)[::-1]
    nested = np.empty_like(shares)
    nested[..., falling] = np.minimum.accumulate(shares[..., falling], axis=-1)
    return nested


def _unknown(shape: tuple[int, int], draws: int) -> _Truth:
    nothing = np.full((3, 2, *shape), np.nan)
    none = np.zeros(shape[0], np.bool_)
    return _Truth(np.full((draws, *shape), np.nan), nothing, none, BLOCK_M)


def _values(means: NDArray[np.float64]) -> NDArray[np.float64]:
    """Mean squares and shares as RMSE and shares, within what is possible."""
    values = np.clip(means, 0, None)
    values[..., 0] = np.sqrt(values[..., 0])
    np.clip(values[..., 1:], 0, 100, out=values[..., 1:])
    return values


def _tables(comparison: Comparison, truths: dict[str, _Truth]) -> tuple[pd.DataFrame, pd.DataFrame]:
    # Rows run by direction, zone and threshold, as those of the comparison do.
    bounds = np.stack([truths[direction].bounds for direction in DIRECTIONS])
    shares = comparison.within[["direction", "zone", "threshold_m", "pct"]].copy()
    names = [ALL, *comparison.zones.names]
    measured = [getattr(comparison, direction)["rmse_m"] for direction in DIRECTIONS]
    rmse = pd.DataFrame(
        {
            "direction": np.repeat(DIRECTIONS, len(names)),
            "zone": names * len(DIRECTIONS),
            "rmse_m": np.concatenate([column.to_numpy() for column in measured]),
        }
    )
    for k, part in enumerate(("", "pose_", "sampling_")):
        for end, word in enumerate(("low", "high")):
            rmse[f"{part}{word}_m"] = bounds[:, k, end, :, 0].ravel()
            shares[f"{part}{word}_pct"] = bounds[:, k, end, :, 1:].ravel()
    return shares, rmse


def _statement(reliability: Reliability | None, block_m: float) -> str:
    if reliability is None:
        return (
            f"Each 95 % interval holds what sampling leaves open (blocks of {block_m:g} m, drawn "
            "again); the pose is taken as it is, for the reconstruction came georeferenced or was "
            "moved since it was fitted, and the pose's own uncertainty is not in it."
        )
    return (
        "Each 95 % interval says where the value at the true pose lies, given the noise of the "
        f"picks ({reliability.sigma_m:.2g} m per axis) and what sampling leaves open (blocks of "
        f"{block_m:g} m, drawn again), if no pick is a blunder and a reconstruction fits best "
        "where it belongs."
    )


def _doubts(comparison: Comparison, truths: dict[str, _Truth]) -> Iterator[Caution]:
    names = np.array([ALL, *comparison.zones.names])
    for direction, truth in truths.items():
        occupied = getattr(comparison, direction)["n"].to_numpy() > 0
        sparse = names[truth.sparse & occupied]
        if len(sparse):
            message = (
                f"No 95 % interval of {direction} is given for {', '.join(sparse)}: the points "
                f"occupy fewer than {FEWEST_BLOCKS} blocks of {truth.block_m:g} m, too few to "
                "show how much they vary."
            )
            yield Caution("blocks_few", message)
