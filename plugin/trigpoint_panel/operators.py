"""The second operator: the same places picked again, and how far apart the picks lie."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from trigpoint.errors import PicksError
from trigpoint.repeats import Repeats, picking_sigma
from trigpoint_panel.model import Model
from trigpoint_panel.pairs import Pair, Pairs, Side, annotated


@dataclass(frozen=True, slots=True, eq=False)
class Repeatability:
    """What picking the same places twice shows.

    Attributes
    ----------
    source, target : Repeats or None
        In source units and in metres; None where no place was picked twice on that side.
    statement : str
        The same in a sentence or two.
    """

    source: Repeats | None
    target: Repeats | None
    statement: str


def begin_second_operator(model: Model) -> None:
    """Hide the pairs, and have a second operator pick the same places again."""
    model.refuse_second_operator()
    blank = second_round(model.state.pairs)
    model.step("Begin second operator", first=model.state.pairs, pairs=blank, selected=blank[0].id)


def end_second_operator(model: Model, *, adopt: bool) -> Repeatability:
    """Bring the first operator's pairs back, and say how far two picks of a place lie apart.

    Parameters
    ----------
    adopt : bool
        Whether the pairs that state no sigma take the picking sigma found.

    Raises
    ------
    PicksError
        If no second operator is picking.
    """
    first = _first_operator(model)
    found = repeatability(first, model.state.pairs)
    pairs = with_sigmas(first, found) if adopt else first
    model.step("End second operator", pairs=pairs, first=None)
    return found


def cancel_second_operator(model: Model) -> None:
    """Bring the first operator's pairs back, and forget the second's.

    Raises
    ------
    PicksError
        If no second operator is picking.
    """
    model.step("Cancel second operator", pairs=_first_operator(model), first=None)


def second_round(pairs: Pairs) -> Pairs:
    """Return the pairs that are not off with both halves open: names and descriptions alone."""
    blank = tuple(
        Pair(pair.id, pair.role, note=annotated(annotated(pair.note, "source", ""), "target", ""))
        for pair in pairs
        if pair.role != "off" and (pair.source is not None or pair.target is not None)
    )
    if not blank:
        message = "There is no pair to pick again: the first operator picks before the second."
        raise PicksError(message)
    return blank


def repeatability(first: Pairs, second: Pairs) -> Repeatability:
    """Compare two operators' picks, pair by pair."""
    found = {side: _repeats(first, second, side) for side in ("source", "target")}
    source, target = found["source"], found["target"]
    said = [
        _said(repeats, side, unit)
        for repeats, side, unit in ((source, "source", "units"), (target, "target", "m"))
        if repeats is not None
    ]
    return Repeatability(source, target, " ".join(said) or "No place was picked twice.")


def with_sigmas(pairs: Pairs, found: Repeatability) -> Pairs:
    """Return the pairs with the picking sigma found where they state none."""
    return tuple(
        replace(
            pair,
            sigma_source=_stated(pair.sigma_source, found.source),
            sigma_target=_stated(pair.sigma_target, found.target),
        )
        for pair in pairs
    )


def _stated(sigma: float | None, found: Repeats | None) -> float | None:
    return found.sigma if sigma is None and found is not None and found.sigma > 0 else sigma


def _first_operator(model: Model) -> Pairs:
    if model.state.first is None:
        message = "No second operator is picking."
        raise PicksError(message)
    return model.state.first


def _repeats(first: Pairs, second: Pairs, side: Side) -> Repeats | None:
    again = {pair.id: pair.at(side) for pair in second}
    nothing = (np.nan, np.nan, np.nan)
    sessions = [
        np.array([pair.at(side) or nothing for pair in first], np.float64).reshape(-1, 3),
        np.array([again.get(pair.id) or nothing for pair in first], np.float64).reshape(-1, 3),
    ]
    if not np.isfinite(sessions[0] + sessions[1]).all(axis=1).any():
        return None
    return picking_sigma(sessions)


def _said(found: Repeats, side: str, unit: str) -> str:
    text = (
        f"Picking in the {side} is good to {found.sigma:.3g} {unit} per axis "
        f"({found.sigma_low:.2g} to {found.sigma_high:.2g}, {found.dof // 3} places twice)"
    )
    if found.bias_p_value < 0.05:
        text += f", and the operators differ systematically (p {found.bias_p_value:.2g})"
    return text + "."
