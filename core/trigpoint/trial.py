"""ICP on trial: what it does to picks that had no say in it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from trigpoint.cautions import Caution
from trigpoint.errors import DegeneratePicksError, RefinementError, SettingError
from trigpoint.refinement import Method, Refinement, icp
from trigpoint.similarity import Points, Similarity, canonical_order, check_pairs, umeyama
from trigpoint.surface import Surface, in_order, thinned

Pairs = tuple[Points, Points]

MOST_FOLDS = 50  # each is a whole ICP


@dataclass(frozen=True, slots=True)
class _Errors:
    """RMSE at some picks without ICP and with it; None where there is nothing to measure."""

    before: float | None = None
    after: float | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Trial:
    """A refinement, and the errors at picks without it and with it.

    An error is None where there are no picks to show it.

    Attributes
    ----------
    refinement : Refinement
        Of the whole cloud.
    control_rmse_before_m, control_rmse_after_m : float or None
        At the picks that the similarity was fitted to. The fit minimises this number over every
        similarity, so ICP can only raise it or leave it: it decides nothing.
    loocv_rmse_before_m, loocv_rmse_after_m : float or None
        Each control pick predicted by a fit to the others, and by that fit followed by ICP.
    check_rmse_before_m, check_rmse_after_m : float or None
        At the check picks.
    retained : bool
        Whether the held-out error fell.
    rule : str
        What decided, in a sentence to print before the numbers.
    cautions : tuple of Caution
        The refinement's own, and ``icp_not_retained``.
    """

    refinement: Refinement
    control_rmse_before_m: float | None
    control_rmse_after_m: float | None
    loocv_rmse_before_m: float | None
    loocv_rmse_after_m: float | None
    check_rmse_before_m: float | None
    check_rmse_after_m: float | None
    retained: bool
    rule: str
    cautions: tuple[Caution, ...]


def judge(
    source: Points,
    target: Points | Surface,
    *,
    similarity: Similarity | None = None,
    controls: Pairs | None = None,
    checks: Pairs | None = None,
    weights: NDArray[np.float64] | None = None,
    method: Method = "plane",
    max_distance: float = 0.5,
    trim: float = 0.1,
    iterations: int = 200,
) -> Trial:
    """Refine a cloud by ICP, and ask the picks whether that made it better.

    The fitted picks cannot be asked: the fit has already made their error as small as any
    similarity can. So the check picks decide, and where there are none, leave-one-out does: every
    control pick is withheld in turn, the similarity refitted to the others, the cloud moved to
    where that fit puts it, refined from there, and the withheld pick predicted. The folds use the
    at most 50,000 source points that take part in the refinement itself. Above 50 control picks,
    50 of them, spread evenly over their sorted order, are withheld.

    Parameters
    ----------
    source : ndarray of shape (n, 3)
        The reconstruction under `similarity`: absolute target coordinates, metres.
    target : ndarray of shape (m, 3) or Surface
        The reference.
    similarity : Similarity, optional
        What carried the reconstruction here, fitted to `controls`. Needed where there are picks.
    controls : pair of ndarray of shape (k, 3), optional
        The picks that `similarity` was fitted to: source units, and metres in the target frame.
    checks : pair of ndarray of shape (c, 3), optional
        Picks that took no part.
    weights : ndarray of shape (k,), optional
        Of the controls, where the fit was weighted.
    method, max_distance, trim, iterations
        See `trigpoint.refinement.icp`.

    Returns
    -------
    Trial
        A reconstruction without picks is refined and not judged: its errors are None and it is
        not retained.

    Raises
    ------
    RefinementError
        If the whole cloud cannot be refined.
    SettingError
        If a setting is out of its range, or picks come without their similarity.
    """
    if similarity is None and (controls is not None or checks is not None):
        message = "Picks were given without the similarity that carries their source to the target."
        raise SettingError(message)
    surface = target if isinstance(target, Surface) else Surface(target)

    def refine(cloud: Points) -> Refinement:
        return icp(
            cloud,
            surface,
            method=method,
            max_distance=max_distance,
            trim=trim,
            iterations=iterations,
        )

    ordered = in_order(source)
    refinement = refine(ordered)
    control = loocv = check = _Errors()
    if similarity is not None:
        refined = refinement.similarity @ similarity
        if controls is not None and len(controls[0]):
            control = _Errors(_rmse(similarity, *controls), _rmse(refined, *controls))
            loocv = _leave_one_out(thinned(ordered), similarity, controls, weights, refine)
        if checks is not None and len(checks[0]):
            check = _Errors(_rmse(similarity, *checks), _rmse(refined, *checks))

    held_out = loocv if check.before is None else check
    retained = _fell(held_out)
    cautions = refinement.cautions
    picked = control.before is not None or check.before is not None
    if picked and not retained:
        cautions += (_not_retained(refinement, held_out),)
    return Trial(
        refinement=refinement,
        control_rmse_before_m=control.before,
        control_rmse_after_m=control.after,
        loocv_rmse_before_m=loocv.before,
        loocv_rmse_after_m=loocv.after,
        check_rmse_before_m=check.before,
        check_rmse_after_m=check.after,
        retained=retained,
        rule=_rule(control, check),
        cautions=cautions,
    )


def _leave_one_out(
    sample: Points,
    similarity: Similarity,
    controls: Pairs,
    weights: NDArray[np.float64] | None,
    refine: Callable[[Points], Refinement],
) -> _Errors:
    """Predict every withheld pick by a fit to the others, and by that fit and its own ICP."""
    source, target, weights = check_pairs(*controls, weights)
    order = canonical_order(source, target)
    withheld = np.linspace(0, len(order) - 1, min(len(order), MOST_FOLDS)).round().astype(int)
    back = similarity.inverse()
    before, after = [], []
    for fold in withheld:
        out, others = order[[fold]], np.delete(order, fold)
        try:
            fit = umeyama(source[others], target[others], weights=weights[others])
        except DegeneratePicksError:
            return _Errors()  # without this pick there is no similarity: nothing can be held out
        before.append(target[out] - fit(source[out]))
        try:
            refined = refine((fit @ back)(sample)).similarity @ fit
        except RefinementError:
            refined = None  # the fold's cloud lies too far off
        if refined is not None:
            after.append(target[out] - refined(source[out]))
    return _Errors(_rms(before), _rms(after) if len(after) == len(before) else None)


def _rule(control: _Errors, check: _Errors) -> str:
    if check.before is not None:
        return (
            "ICP is retained only if it lowers the error at the check picks, which take part in "
            "nothing else."
        )
    if control.before is not None:
        return (
            "ICP is retained only if it lowers the leave-one-out error: each control pick is "
            "predicted by a fit to the others, without ICP and followed by it."
        )
    return "No pick is held out here, so ICP is not judged and not retained; its shift is reported."


def _fell(errors: _Errors) -> bool:
    return errors.before is not None and errors.after is not None and errors.after < errors.before


def _not_retained(refinement: Refinement, held_out: _Errors) -> Caution:
    if held_out.before is None:
        found = "too few control picks are left when one is withheld, so nothing speaks for it"
    elif held_out.after is None:
        found = "with a pick withheld the clouds no longer overlap enough for ICP"
    else:
        found = (
            f"it takes the held-out error from {held_out.before:.3f} m to {held_out.after:.3f} m"
        )
    message = (
        f"ICP would move the reference's centroid by {refinement.shift_m:.3f} m and is not "
        f"retained: {found}."
    )
    return Caution("icp_not_retained", message)


def _rmse(similarity: Similarity, source: Points, target: Points) -> float:
    source, target, _ = check_pairs(source, target, None)
    order = canonical_order(source, target)
    return _rms([target[order] - similarity(source[order])])


def _rms(errors: Sequence[Points]) -> float:
    return float(np.sqrt((np.concatenate(errors) ** 2).sum(axis=1).mean()))
