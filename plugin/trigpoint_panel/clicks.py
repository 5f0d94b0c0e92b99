"""Clicks: whose half a click fills, as a pure function of the state."""

from __future__ import annotations

from dataclasses import dataclass

from trigpoint.errors import PicksError
from trigpoint_panel.pairs import Pair, Pairs, Place, Side, exchanged, next_id, waiting
from trigpoint_panel.state import State


@dataclass(frozen=True, slots=True)
class Placed:
    """What a click did.

    Attributes
    ----------
    id : str
        The pair whose half it filled.
    warning : str
        A doubt in one sentence, or empty.
    """

    id: str
    warning: str


@dataclass(frozen=True, slots=True)
class Click:
    """What becomes of the pairs when a place is clicked.

    Attributes
    ----------
    id : str
        The pair whose half it fills.
    found : Pair or None
        That pair before; None where it begins one.
    pairs : tuple of Pair
    selected : str
        Id of the pair that the next click completes.
    text : str
        What undo calls it.
    """

    id: str
    found: Pair | None
    pairs: Pairs
    selected: str
    text: str


def clicked(
    state: State, side: Side, place: Place, *, sigma: float | None = None, note: str = ""
) -> Click:
    """Fill the half of the selected pair, else of the last open on that side, else of a new one.

    Raises
    ------
    PicksError
        When a second operator has picked all.
    """
    found = waiting(state.pairs, state.selected, side, newest=not state.is_second_operator)
    if found is None and state.is_second_operator:
        message = "Every pair is picked again on this side: end the second operator's round."
        raise PicksError(message)
    pair = found or Pair(next_id(state.pairs))
    known = state.pairs if found else (*state.pairs, pair)
    filled = pair.placed(side, place, sigma=sigma, note=note)
    verb = "Complete" if filled.is_complete else "Pick"
    pairs = exchanged(known, pair.id, filled)
    selected = pair.id
    if filled.is_complete and state.is_second_operator:
        selected = next((each.id for each in pairs if not each.is_complete), pair.id)
    return Click(pair.id, found, pairs, selected, f"{verb} {pair.id} in the {side}")
