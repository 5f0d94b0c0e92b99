"""Consensus: which picks agree on one similarity, found from minimal sets of three picks."""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from math import comb
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from trigpoint.errors import ConsensusError, DegeneratePicksError, SettingError
from trigpoint.minimal import COLLAPSED, all_triples, draw_triples, fit_triples, score
from trigpoint.similarity import (
    Points,
    Similarity,
    canonical_order,
    check_pairs,
    principal_spreads,
    refuse_lines,
    umeyama,
)

Method = Literal["ransac", "exhaustive", "all"]

# `exhaustive` tries every set of three up to this many: 40 picks have 9,880.
MOST_SETS = 10_000
# Beyond these the draws fill the memory, and what reads the results no longer holds the seed.
MOST_TRIALS, LAST_SEED = 10_000_000, 2**63 - 1

# So many of the best distinct sets are refitted. The winner is then decided by the picks that agree
# with a fit to many, not by which three happened to be drawn.
REFITTED = 32


@dataclass(frozen=True, slots=True, eq=False)
class Consensus:
    """The picks that agree, and the similarity fitted to them.

    Attributes
    ----------
    similarity : Similarity
        Least-squares fit to the inliers.
    inliers : ndarray of shape (n,)
        True where the 3D residual under `similarity` is at most `threshold`. (Weights can send
        the reclassifying in circles; then a pick within it may be left out.) Under `no_consensus`
        all are True.
    method : str
        "ransac", "exhaustive", or "all" for no consensus.
    threshold : float or None
        Metres; None for method "all".
    seed : int or None
        Of method "ransac".
    trials : int
        Minimal sets drawn, or all there are.
    degenerate_trials : int
        How many of them were skipped: on a line or in one place, in either frame, or two
        triangles so unlike that no scale fits.
    rivals : int
        Other, different sets of as many picks that are just as stable. At most 31 are looked for.
    """

    similarity: Similarity
    inliers: NDArray[np.bool_]
    method: Method
    threshold: float | None = None
    seed: int | None = None
    trials: int = 0
    degenerate_trials: int = 0
    rivals: int = 0

    def residuals(self, source: Points, target: Points) -> Points:
        """Return target minus transformed source, shape (n, 3), in metres."""
        return target - self.similarity(source)


def ransac(
    source: Points,
    target: Points,
    *,
    threshold: float = 0.50,
    trials: int = 10_000,
    seed: int = 42,
    weights: NDArray[np.float64] | None = None,
) -> Consensus:
    """Find the largest set of picks that agree, from randomly drawn sets of three.

    Each trial draws three distinct picks, fits them, and counts the picks whose 3D residual is at
    most `threshold`; ties go to the smaller sum of squared residuals. The best sets are refitted
    by `umeyama` to all their inliers and reclassified until stable, and the largest is kept. The
    order of the picks changes nothing, to the last bit.

    Parameters
    ----------
    source, target : ndarray of shape (n, 3)
        Matching picks, n >= 3. `target` is in metres.
    threshold : float
        Metres in the target frame.
    trials : int
        Sets drawn. Ten sound picks among a hundred escape all of 10,000 trials in one run of
        1,700; among two hundred, in two of five. Raise it where so few are sound.
    seed : int
        Of the draws; the same seed gives the same result.
    weights : ndarray of shape (n,), optional
        Above zero; used in the refit only. Draws and threshold are unweighted.

    Returns
    -------
    Consensus

    Raises
    ------
    DegeneratePicksError
        If the picks are fewer than three, coincide, or lie on a line, in either frame.
    ConsensusError
        If no three picks agree within the threshold.
    ValueError
        If shapes, coordinates, weights or settings are unusable.

    Notes
    -----
    A set that survives is not thereby free of blunders: with six picks good to 0.10 m, a blunder
    of 0.7 m passes a threshold of 0.50 m more often than not. `reliability` tests for that.

    References
    ----------
    Fischler and Bolles (1981), Random sample consensus, Communications of the ACM 24(6),
    doi:10.1145/358669.358692. Refitting more than the best set: Chum, Matas and Kittler (2003),
    Locally optimized RANSAC, doi:10.1007/978-3-540-45243-0_31.

    Examples
    --------
    >>> corners = np.array([[0.0, 0, 0], [9, 0, 0], [0, 8, 0], [0, 0, 7], [9, 8, 7]])
    >>> blunder = np.array([[0.0, 0, 0], [0, 0, 0], [0, 0, 0], [0, 0, 0], [0, 3, 0]])
    >>> ransac(corners, 2 * corners + blunder).inliers.tolist()
    [True, True, True, True, False]
    """
    source, target, weights = check_pairs(source, target, weights)
    _refuse_few(source, target)
    if not 1 <= trials <= MOST_TRIALS:
        message = f"trials is {trials}; it must be at least 1 and at most {MOST_TRIALS:,}."
        raise SettingError(message)
    if not 0 <= seed <= LAST_SEED:
        message = f"seed is {seed}; it must be at least 0 and at most {LAST_SEED:,}."
        raise SettingError(message)
    drawn = draw_triples(len(source), trials, np.random.Generator(np.random.PCG64(seed)))
    # Each triple as one number, which sorts as its row does and much faster.
    base = np.array([len(source) ** 2, len(source), 1])
    numbers, times = np.unique((drawn * base).sum(axis=1), return_counts=True)
    triples = numbers[:, None] // base % len(source)
    return _search(source, target, weights, threshold, triples, times, method="ransac", seed=seed)


def exhaustive(
    source: Points,
    target: Points,
    *,
    threshold: float = 0.50,
    weights: NDArray[np.float64] | None = None,
) -> Consensus:
    """Find the largest set of picks that agree, from every set of three: no seed, nothing missed.

    Parameters
    ----------
    source, target : ndarray of shape (n, 3)
        Matching picks, 3 <= n <= 40. `target` is in metres.
    threshold : float
        Metres in the target frame.
    weights : ndarray of shape (n,), optional
        Above zero; used in the refit only.

    Returns
    -------
    Consensus

    Raises
    ------
    DegeneratePicksError
        If the picks are fewer than three, coincide, or lie on a line, in either frame.
    ConsensusError
        If no three picks agree within the threshold.
    ValueError
        If the picks are more than 40, or shapes, coordinates, weights or settings are unusable.

    See Also
    --------
    ransac : The same, from random sets.
    """
    source, target, weights = check_pairs(source, target, weights)
    _refuse_few(source, target)
    sets = comb(len(source), 3)
    if sets > MOST_SETS:
        message = (
            f"{len(source)} picks have {sets:,} sets of three; at most {MOST_SETS:,} are tried one "
            f"and all (40 picks). Use ransac."
        )
        raise SettingError(message)
    triples = all_triples(len(source))
    times = np.ones(len(triples), np.int64)
    return _search(source, target, weights, threshold, triples, times, method="exhaustive")


def no_consensus(
    source: Points, target: Points, *, weights: NDArray[np.float64] | None = None
) -> Consensus:
    """Take every pick as an inlier: the plain least-squares fit, as a Consensus.

    Parameters
    ----------
    source, target : ndarray of shape (n, 3)
        Matching picks, n >= 3. `target` is in metres.
    weights : ndarray of shape (n,), optional
        Above zero; equal if omitted.

    Raises
    ------
    DegeneratePicksError
        If the picks are fewer than three, coincide, or lie on a line, in either frame.
    ValueError
        If shapes, coordinates or weights are unusable.
    """
    fit = umeyama(source, target, weights=weights)
    return Consensus(fit, np.ones(len(source), np.bool_), "all")


def _refuse_few(source: Points, target: Points) -> None:
    # Whether all lie on a line is asked of the sets of three: one gross blunder stretches the whole
    # set so far that the others would look like one place.
    if len(source) < 3:
        refuse_lines(source, target)


def _search(
    source: Points,
    target: Points,
    weights: NDArray[np.float64],
    threshold: float,
    triples: NDArray[np.int64],
    times: NDArray[np.int64],
    *,
    method: Literal["ransac", "exhaustive"],
    seed: int | None = None,
) -> Consensus:
    """Score distinct triples, each tried so many times, and keep the best stable set."""
    if not (np.isfinite(threshold) and threshold > 0):
        message = f"threshold is {threshold} m; it must be a finite number above zero."
        raise SettingError(message)
    # A triple names positions in this order: what is drawn does not depend on how picks came in.
    order = canonical_order(source, target)
    source, target, weights = source[order], target[order], weights[order]

    fits = fit_triples(source, target, triples)
    trials, degenerate = int(times.sum()), int(times[~fits.sound].sum())
    if degenerate == trials:
        refuse_lines(source, target)
        listed = ", ".join(f"{spread:.3g}" for spread in principal_spreads(target))
        message = (
            f"All {trials} sets of three picks tried are degenerate, although the {len(source)} "
            f"picks spread {listed} m along the principal axes of the target frame: no three of "
            f"them span the same triangle in both frames. Check that source and target are paired."
        )
        raise DegeneratePicksError(message)
    sets, counts, squares = score(source, target, fits, threshold=threshold)
    ranking = np.lexsort([squares, -counts])  # stable: then in canonical order

    tried: set[bytes] = set()
    stable: dict[bytes, _Stable] = {}
    for best in ranking:
        if counts[best] < 3 or len(tried) == REFITTED:
            break
        packed = sets[best].tobytes()
        if packed in tried:
            continue
        tried.add(packed)
        inliers = np.unpackbits(sets[best], count=len(source)).astype(np.bool_)
        settled = _settle(source, target, weights, threshold, inliers)
        if settled is not None:
            stable[settled.inliers.tobytes()] = settled
    if not stable:
        best = ranking[0]
        raise ConsensusError(_no_agreement(threshold, trials, counts[best], fits.misfit[best]))

    winner, *others = sorted(stable.values(), key=_Stable.rank)
    kept = np.empty(len(order), np.bool_)
    kept[order] = winner.inliers
    size = winner.inliers.sum()
    rivals = sum(bool(other.inliers.sum() == size) for other in others)
    return Consensus(winner.similarity, kept, method, threshold, seed, trials, degenerate, rivals)


@dataclass(frozen=True, slots=True, eq=False)
class _Stable:
    """A fit whose inliers, classified under it, are those it was fitted to."""

    similarity: Similarity
    inliers: NDArray[np.bool_]
    squares: float

    def rank(self) -> tuple[int, float, bytes]:
        # Most inliers, then the smallest residuals, then the first in canonical order.
        return -int(self.inliers.sum()), self.squares, (~self.inliers).tobytes()


def _settle(
    source: Points,
    target: Points,
    weights: NDArray[np.float64],
    threshold: float,
    inliers: NDArray[np.bool_],
) -> _Stable | None:
    """Refit to the inliers and reclassify until nothing changes; None if that comes to nothing."""
    for turn in itertools.count():
        try:
            fit = umeyama(source[inliers], target[inliers], weights=weights[inliers])
        except DegeneratePicksError:  # fewer than three left, or a line
            return None
        square = ((target - fit(source)) ** 2).sum(axis=1)
        inside = np.sqrt(square) <= threshold
        # Unweighted, both steps lower sum(min(e**2, threshold**2)), so no set comes back. Weights
        # void that: after enough turns picks may only leave, which must end.
        if turn >= 20:
            inside &= inliers
        if (inside == inliers).all():
            break
        inliers = inside
    if _has_collapsed(fit, source[inliers], target[inliers]):
        return None
    return _Stable(fit, inliers, float(square[inliers].sum()))


def _has_collapsed(fit: Similarity, source: Points, target: Points) -> bool:
    reached = fit.scale * np.linalg.norm(principal_spreads(source))
    return bool(reached < COLLAPSED * np.linalg.norm(principal_spreads(target)))


def _no_agreement(threshold: float, trials: int, count: int, misfit: NDArray[np.float64]) -> str:
    if count >= 3:
        return (
            f"The best of {trials} sets of three keeps {count} picks within {threshold:g} m, but "
            f"no such set holds when refitted: it loses its picks, or shrinks them towards a "
            f"point because the threshold is as wide as the picks lie apart. Check that source "
            f"and target are paired, and that the threshold is well below the picks' spacing."
        )
    listed = ", ".join(f"{distance:.3g}" for distance in misfit)
    return (
        f"No three picks agree within {threshold:g} m: the best of {trials} sets of three keeps "
        f"{count} picks and leaves {listed} m at its own three. Check that source and target are "
        f"paired, or raise the threshold."
    )
