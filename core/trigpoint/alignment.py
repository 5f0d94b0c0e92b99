"""From picks to one similarity, with everything the picks alone say about it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial
from math import comb

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from trigpoint.cautions import Caution
from trigpoint.consensus import MOST_SETS, Consensus, Method, exhaustive, no_consensus, ransac
from trigpoint.crossvalidation import LeaveOneOut, Procedure, leave_one_out
from trigpoint.errors import ConsensusError, DegeneratePicksError, PicksError
from trigpoint.picks import Picks, examine, require_control
from trigpoint.reliability import Reliability, assess
from trigpoint.similarity import Similarity, are_mirrored


@dataclass(frozen=True, slots=True, eq=False)
class Alignment:
    """One similarity and what the picks say about it.

    Attributes
    ----------
    picks : Picks
        As read, every role; target in metres.
    consensus : Consensus
        Over the control picks, in their order in `picks`.
    weights : ndarray of shape (n,) or None
        Of the inliers, where the fit is weighted by the picks' sigmas.
    exhaustive_agrees : bool or None
        Whether drawn and exhaustive consensus kept the same picks; None where one was not run.
    loocv : LeaveOneOut
        Over the inliers.
    reliability : Reliability
        Over the inliers.
    cautions : tuple of Caution
    """

    picks: Picks
    consensus: Consensus
    weights: NDArray[np.float64] | None
    exhaustive_agrees: bool | None
    loocv: LeaveOneOut
    reliability: Reliability
    cautions: tuple[Caution, ...]

    @property
    def similarity(self) -> Similarity:
        """Maps the reconstruction's frame to the reference's, in metres."""
        return self.consensus.similarity

    @property
    def inliers(self) -> Picks:
        """The control picks that the fit was made from."""
        return self.picks.control.take(self.consensus.inliers)

    def residuals(self, picks: Picks) -> pd.DataFrame:
        """Tabulate target minus transformed source: id, role, dx_m, dy_m, dz_m, d_m."""
        errors = picks.target - self.similarity(picks.source)
        return pd.DataFrame(
            {
                "id": picks.ids,
                "role": picks.roles,
                "dx_m": errors[:, 0],
                "dy_m": errors[:, 1],
                "dz_m": errors[:, 2],
                "d_m": np.sqrt((errors**2).sum(axis=1)),
            }
        )


def align(
    picks: Picks,
    *,
    method: Method = "ransac",
    threshold: float = 0.50,
    trials: int = 10_000,
    seed: int = 42,
    weighted: bool = False,
    extent: NDArray[np.float64] | None = None,
    thorough: bool = True,
) -> Alignment:
    """Fit one similarity to the control picks and say what it is worth.

    Parameters
    ----------
    picks : Picks
        Check picks enter nothing; picks that are off are ignored.
    method : {"ransac", "exhaustive", "all"}
        How the picks that agree are found; "all" uses every control pick.
    threshold : float
        A pick is an inlier where its 3D residual is at most this many metres.
    trials, seed : int
        Of "ransac".
    weighted : bool
        Weight each pick by its sigmas in both frames; every control pick must then have one.
    extent : ndarray of shape (2, 3), optional
        Lowest and highest coordinates of the reference, metres.
    thorough : bool
        Whether the consensus is redone without each pick, and by the other method as well. Neither
        changes the fit, and both take most of the time: who waits for each pick leaves them out.

    Returns
    -------
    Alignment

    Raises
    ------
    PicksError
        If there are fewer than three control picks, or sigmas are wanted and missing.
    DegeneratePicksError
        If the picks do not pin down a similarity: on a line, within their noise of one, mirrored.
    ConsensusError
        If no three picks agree.
    """
    require_control(picks)
    control = picks.control
    if are_mirrored(control.source, control.target):
        message = (
            f"The source looks mirrored: a mirror image of it fits the {len(control)} control "
            "picks over ten times better, and no similarity can mirror. Change the sign of one "
            "axis of the source (left-handed axes, a depth for a height), or look for swapped "
            "picks."
        )
        raise DegeneratePicksError(message)
    fits: dict[Method, Procedure] = {
        "ransac": partial(ransac, threshold=threshold, trials=trials, seed=seed),
        "exhaustive": partial(exhaustive, threshold=threshold),
        "all": no_consensus,
    }
    fit = fits[method]
    weights = (
        _weights(control, fit(control.source, control.target, weights=None)) if weighted else None
    )
    consensus = fit(control.source, control.target, weights=weights)
    inliers = control.take(consensus.inliers)
    kept = None if weights is None else weights[consensus.inliers]
    reliability = assess(
        inliers.source,
        inliers.target,
        consensus.similarity,
        sigma_source=inliers.sigma_source,
        sigma_target=inliers.sigma_target,
        weights=kept,
        extent=extent,
        names=inliers.ids,
    )
    if reliability.geometry == "refused":
        disagreeing = (
            _disagreement(control, fits["ransac"], reliability) if method == "all" else None
        )
        if disagreeing is None:
            raise DegeneratePicksError(reliability.statement)
        # Wrong picks spoil it, not their layout: who asks for every pick gets what they come to.
        reliability = replace(
            reliability,
            geometry="weak",
            statement=disagreeing.message,
            cautions=(
                *(other for other in reliability.cautions if other.code != disagreeing.code),
                disagreeing,
            ),
        )
    loocv = leave_one_out(
        control.source,
        control.target,
        consensus.inliers,
        weights=weights,
        procedure=fit if thorough and method != "all" else None,
    )
    agrees = None
    if thorough and method != "all" and comb(len(control), 3) <= MOST_SETS:
        other = exhaustive if method == "ransac" else partial(ransac, trials=trials, seed=seed)
        twin = other(control.source, control.target, threshold=threshold, weights=weights)
        agrees = bool((twin.inliers == consensus.inliers).all())
    return Alignment(
        picks,
        consensus,
        kept,
        agrees,
        loocv,
        reliability,
        (
            *picks.cautions,
            *examine(picks),
            *_doubts(control, consensus, agrees),
            *reliability.cautions,
            *loocv.cautions,
        ),
    )


def _weights(control: Picks, first: Consensus) -> NDArray[np.float64]:
    """Inverse variances of the picks in the target frame; a first fit supplies the scale."""
    known = np.isfinite(control.sigma_target) | np.isfinite(control.sigma_source)
    if not known.all():
        lacking = [name for name, has in zip(control.ids, known, strict=True) if not has]
        message = (
            f"A weighted fit needs a sigma_source or sigma_target for every control pick; "
            f"{len(lacking)} of {len(control)} have neither: {', '.join(lacking[:5])}."
        )
        raise PicksError(message)
    in_target = np.nan_to_num(control.sigma_target) ** 2
    in_source = first.similarity.scale**2 * np.nan_to_num(control.sigma_source) ** 2
    return 1 / (in_target + in_source)


def _disagreement(control: Picks, consensus: Procedure, reliability: Reliability) -> Caution | None:
    """Name the picks without which the others' layout is good enough, if there are such."""
    try:
        agreeing = consensus(control.source, control.target, weights=None)
    except ConsensusError:
        return None
    if agreeing.inliers.all():
        return None
    kept = control.take(agreeing.inliers)
    without = assess(kept.source, kept.target, agreeing.similarity, names=kept.ids)
    if without.geometry == "refused":
        return None
    count, others = _left_out(control, agreeing)
    message = (
        f"Weak: every pick was used, as asked, and {count} of {len(control)} disagree with "
        f"the others by more than {agreeing.threshold:g} m: {others}. One pick comes out good to "
        f"{reliability.sigma_m:.3g} m per axis and the rotation to "
        f"{reliability.rotation_sigma_deg.max():.1f}° (one sigma); a consensus would leave them "
        "out."
    )
    return Caution("weak_geometry", message)


def _left_out(control: Picks, consensus: Consensus) -> tuple[int, str]:
    """Count the picks that a consensus left out, and name up to ten."""
    names = [name for name, kept in zip(control.ids, consensus.inliers, strict=True) if not kept]
    return len(names), ", ".join(names[:10]) + (" and others" if len(names) > 10 else "")


def _doubts(control: Picks, consensus: Consensus, agrees: bool | None) -> list[Caution]:
    doubts = []
    count, rejected = _left_out(control, consensus)
    if count:
        message = (
            f"The consensus rejected {count} of {len(control)} control picks at "
            f"{consensus.threshold:g} m: {rejected}."
        )
        doubts.append(Caution("picks_rejected", message))
    if agrees is False:
        message = (
            "Drawing sets of three and trying every set of three kept different picks; trust the "
            "exhaustive search, or ask why two sets of picks explain themselves equally well."
        )
        doubts.append(Caution("consensus_disagrees", message))
    if consensus.rivals:
        message = (
            f"{consensus.rivals} other set(s) of {int(consensus.inliers.sum())} picks agree just "
            "as well: the one with the smaller residuals was kept. Add picks to settle it."
        )
        doubts.append(Caution("consensus_ambiguous", message))
    return doubts
