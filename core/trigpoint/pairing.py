"""Two reconstructions of one building: which is more complete, and can the data tell."""

from __future__ import annotations

from collections.abc import Hashable
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from trigpoint.blocks import FEWEST_BLOCKS, blocks_of, resampled, too_few
from trigpoint.comparison import Comparison
from trigpoint.intervals import DRAWS, LEVELS, Intervals, thresholds_of
from trigpoint.preparation import ALL, SEED
from trigpoint.tallies import measures, tally

BETTER, WORSE, NEITHER, UNKNOWN = "better", "worse", "not distinguishable", "not known"
UNRESOLVED, MIXED = "not resolvable", "not told"


@dataclass(frozen=True, slots=True, eq=False)
class Paired:
    """The completeness of one reconstruction less that of another, on the same reference points.

    Attributes
    ----------
    names : tuple of str
        The one, and the other.
    differences : DataFrame
        A row per zone and threshold: zone, threshold_m, one_pct, other_pct, difference_pct (in
        percentage points); low_pct, high_pct, its 95 % interval; pose_low_pct, pose_high_pct
        from the similarities' uncertainty alone (NaN without); sampling_low_pct,
        sampling_high_pct from the block bootstrap alone; verdict (the one is "better", "worse",
        "not distinguishable"; "not known" where fewer than 10 blocks hold points; "not
        resolvable" where the threshold is not above the voxel; "not told" where what was measured
        and its interval lie on different sides of zero); sentence.
    has_pose : tuple of bool
        Whether each one's pose uncertainty is in the interval.
    block_m : float
        Edge of the blocks that were resampled.
    draws, seed : int
    statement : str
        The verdicts over all zones together, in one sentence.
    """

    names: tuple[str, str]
    differences: pd.DataFrame
    has_pose: tuple[bool, bool]
    block_m: float
    draws: int
    seed: int
    statement: str


def compare_pair(
    one: Comparison,
    other: Comparison,
    *,
    names: tuple[str, str],
    poses: tuple[Intervals | None, Intervals | None] = (None, None),
    draws: int = DRAWS,
    seed: int = SEED,
) -> Paired:
    """Compare the completeness of two reconstructions, reference point by reference point.

    Both were measured from the same reference points, so what the points have in common (a hidden
    wall, a gap in the reference) falls out of the difference. Its interval comes from resampling
    blocks of 2 m, and where the intervals of the two comparisons are given, from the uncertainty
    of their similarities too: between clouds that picks alone have placed, most of a difference
    may be picking noise. The two sets of picks are taken as independent.

    Parameters
    ----------
    one, other : Comparison
        Against the same reference, within the same thresholds.
    names : tuple of str
        What the sentences call them.
    poses : tuple of Intervals or None
        What `trigpoint.intervals.estimate` found of each, with the same number of draws.
    draws, seed : int

    Raises
    ------
    ValueError
        If references, thresholds or draws differ.
    """
    within = thresholds_of(one)
    _refuse_unlike(one, other, poses, draws)
    points, zone_names = one.reference.xyz, one.zones.names
    own = one.zones.of(points[:, 2] + one.reference.origin[2])
    blocks = blocks_of(points, points.min(axis=0))
    shape = (blocks.count, len(zone_names))
    hits, others = (
        tally(each.completeness_m, own, blocks.of, shape=shape, within=within)
        for each in (one, other)
    )
    pcts = [measures(each.sum(axis=0))[:, 1:] for each in (hits, others)]
    gaps = hits.copy()
    gaps[..., 1] = 0.0  # squares are infinite where a cloud is empty
    gaps[..., 2:] -= others[..., 2:]

    streams = [np.random.default_rng(child) for child in np.random.SeedSequence(seed).spawn(2)]
    gap = pcts[0] - pcts[1]
    again = measures(resampled(gaps, draws=draws, random=streams[0]))[:, :, 1:]
    sampled = 2 * gap - np.where(np.isnan(again), gap, again)
    # In an order of their own: drawn from one seed, both poses would have the same luck.
    truths = [None if pose is None else pose.completeness_pose_pct for pose in poses]
    ends = [
        pct if truth is None else streams[1].permutation(truth)
        for pct, truth in zip(pcts, truths, strict=True)
    ]
    posed = np.broadcast_to(ends[0] - ends[1], sampled.shape)
    has_pose = (truths[0] is not None, truths[1] is not None)
    parts = [posed + sampled - gap, posed, sampled]
    bounds = np.clip([np.quantile(part, LEVELS, axis=0) for part in parts], -100, 100)
    sparse = too_few(hits)
    bounds[0, :, sparse] = bounds[2, :, sparse] = np.nan
    if not any(has_pose):
        bounds[1] = np.nan

    table = _table([ALL, *zone_names], within, pcts, bounds, one.voxel_m)
    sentences = [_sentence(row, names) for row in table.to_dict(orient="records")]
    return Paired(
        names=names,
        differences=table.assign(sentence=sentences),
        has_pose=has_pose,
        block_m=blocks.edge_m,
        draws=draws,
        seed=seed,
        statement=_statement(table[table["zone"] == ALL], names, has_pose),
    )


def _table(
    zones: list[str],
    within: list[float],
    pcts: list[NDArray[np.float64]],
    bounds: NDArray[np.float64],
    voxel: float,
) -> pd.DataFrame:
    """Tabulate; `bounds` has axes both parts, pose, sampling; low, high; zone; threshold."""
    table = pd.DataFrame(
        {
            "zone": np.repeat(zones, len(within)),
            "threshold_m": np.tile(within, len(zones)),
            "one_pct": pcts[0].ravel(),
            "other_pct": pcts[1].ravel(),
            "difference_pct": (pcts[0] - pcts[1]).ravel(),
        }
    )
    for k, part in enumerate(("", "pose_", "sampling_")):
        for end, word in enumerate(("low", "high")):
            table[f"{part}{word}_pct"] = bounds[k, end].ravel()
    resolved = table["threshold_m"] > voxel
    rows = zip(resolved, table["difference_pct"], table["low_pct"], table["high_pct"], strict=True)
    return table.assign(verdict=[_verdict(*row) for row in rows])


def _verdict(resolved: bool, gap: float, low: float, high: float) -> str:
    if not resolved:
        return UNRESOLVED
    if np.isnan(low):
        return UNKNOWN
    if low <= 0 <= high:
        return NEITHER
    # The interval is about the difference at the true poses, the number about those picked.
    if gap * low <= 0:
        return MIXED
    return BETTER if low > 0 else WORSE


def _sentence(row: dict[Hashable, Any], names: tuple[str, str]) -> str:
    one, other = names
    where = "in all zones together" if row["zone"] == ALL else f"in zone {row['zone']}"
    place = f"within {row['threshold_m']:g} m {where}"
    numbers = f"{row['one_pct']:.1f} against {row['other_pct']:.1f} %"
    gap = f"{row['difference_pct']:+.1f} points"
    if row["verdict"] == UNKNOWN:
        return (
            f"Whether {one} or {other} is more complete {place} can't be told: fewer than "
            f"{FEWEST_BLOCKS} blocks hold reference points ({numbers})."
        )
    if row["verdict"] == UNRESOLVED:
        return (
            f"Whether {one} or {other} is more complete {place} can't be resolved: that is not "
            f"above the voxel ({numbers})."
        )
    span = f"{gap}, 95 % interval {row['low_pct']:+.1f} to {row['high_pct']:+.1f}"
    if row["verdict"] == NEITHER:
        return f"{one} and {other} are not distinguishable {place}: {numbers} ({span})."
    if row["verdict"] == MIXED:
        return (
            f"Whether {one} or {other} is more complete {place} is not told: what was measured and "
            f"its interval lie on different sides of zero: {numbers} ({span})."
        )
    word = "more" if row["verdict"] == BETTER else "less"
    return f"{one} is {word} complete than {other} {place}: {numbers} ({span})."


def _statement(table: pd.DataFrame, names: tuple[str, str], has_pose: tuple[bool, bool]) -> str:
    """Say in one sentence what holds over all zones, and what it takes for granted."""
    one, other = names
    phrases = {
        BETTER: (f"{one} is more complete than {other}", ""),
        WORSE: (f"{one} is less complete than {other}", ""),
        NEITHER: (f"{one} and {other} are not distinguishable in completeness", ""),
        UNKNOWN: (f"{one} and {other} can't be compared in completeness (too few blocks)", ""),
        MIXED: (
            "which is more complete",
            " is not told, for what was measured and its interval disagree",
        ),
        UNRESOLVED: ("nothing is said", ", not above the voxel"),
    }
    found = []
    for verdict, (what, why) in phrases.items():
        thresholds = [f"{t:g}" for t in table.loc[table["verdict"] == verdict, "threshold_m"]]
        if thresholds:
            found.append(f"{what} within {_listed(thresholds)} m{why}")
    if (table["verdict"] == UNRESOLVED).all():
        return f"Over all zones, {'; '.join(found)}."
    taken = [name for name, known in zip(names, has_pose, strict=True) if not known]
    proviso = f", the pose of {_listed(taken)} being taken as it is" if taken else ""
    return f"Over all zones, {'; '.join(found)} (95 % intervals{proviso})."


def _refuse_unlike(
    one: Comparison,
    other: Comparison,
    poses: tuple[Intervals | None, Intervals | None],
    draws: int,
) -> None:
    same = one.reference is other.reference or (
        one.reference.xyz.shape == other.reference.xyz.shape
        and (one.reference.coordinates == other.reference.coordinates).all()
    )
    if not same:
        message = (
            f"The two comparisons were measured from different references ({len(one.reference):,} "
            f"and {len(other.reference):,} points): measure both against one `prepare`d reference."
        )
        raise ValueError(message)
    thresholds = [thresholds_of(each) for each in (one, other)]
    if thresholds[0] != thresholds[1]:
        message = (
            f"The two comparisons have different thresholds: {thresholds[0]}, {thresholds[1]}."
        )
        raise ValueError(message)
    drawn = {pose.draws for pose in poses if pose is not None and pose.has_pose} | {draws}
    if len(drawn) > 1:
        message = f"Poses and blocks were drawn {sorted(drawn)} times: draw all equally often."
        raise ValueError(message)


def _listed(words: list[str]) -> str:
    return " and ".join(filter(None, [", ".join(words[:-1]), words[-1]]))
