"""Cells of the pair table as they are typed: the way to pick without a mouse."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any, Literal

from trigpoint.errors import PicksError
from trigpoint.picks import FARTHEST
from trigpoint_panel.pairs import ROLES, SIDES, Pair, Pairs, Place, Side, find, sigma_of

Column = Literal[
    "id",
    "role",
    "source_x",
    "source_y",
    "source_z",
    "target_x",
    "target_y",
    "target_z",
    "sigma_source",
    "sigma_target",
    "note",
]
# The cells that hold a coordinate: whose, and which.
PLACES: dict[str, tuple[Side, int]] = {
    f"{side}_{axis}": (side, number) for side in SIDES for number, axis in enumerate("xyz")
}
# A place of which some coordinates are typed already.
Draft = tuple[float | None, float | None, float | None]
NOTHING: Draft = (None, None, None)


class Drafts:
    """Halves that are typed in part, each until it is whole."""

    def __init__(self) -> None:
        self._kept: dict[tuple[str, Side], Draft] = {}

    def of(self, name: str, side: Side) -> Draft:
        """Return what is typed so far of a half."""
        return self._kept.get((name, side), NOTHING)

    def typed(self, name: str, side: Side, draft: Draft) -> Place | None:
        """Keep what is typed so far; return the place, kept no longer, once it is whole."""
        x, y, z = draft
        if x is None or y is None or z is None:
            self._kept[name, side] = draft
            return None
        self._kept.pop((name, side), None)
        return x, y, z

    def keep_open(self, pairs: Pairs) -> None:
        """Forget those whose half has been picked, or whose pair has gone."""
        self._kept = {
            (name, side): draft
            for (name, side), draft in self._kept.items()
            if (pair := find(pairs, name)) is not None and pair.at(side) is None
        }

    def clear(self) -> None:
        """Forget them all."""
        self._kept.clear()


def typed_place(half: Draft, axis: int, text: str) -> Draft:
    """Return a place with what was typed into one of its three cells.

    Three numbers in one cell, between blanks, semicolons or commas, are the whole place; nothing
    takes a number away.

    Raises
    ------
    PicksError
        If the text is neither one number nor three, or a number is too large.

    Examples
    --------
    >>> typed_place((1.0, None, None), 1, "2,5")
    (1.0, 2.5, None)
    >>> typed_place((None, None, None), 0, "741008.4, 4279056.3, 153.8")
    (741008.4, 4279056.3, 153.8)
    """
    numbers = _numbers(text) if text.strip() else [None]
    for number in numbers:
        if number is not None and abs(number) > FARTHEST:
            message = f"{number:g} is no coordinate: type numbers up to {FARTHEST:g}."
            raise PicksError(message)
    if len(numbers) == 3:
        return numbers[0], numbers[1], numbers[2]
    if len(numbers) != 1:
        message = f"{text.strip()!r} is not a coordinate: type one number, or x, y and z."
        raise PicksError(message)
    x, y, z = (numbers[0] if at == axis else value for at, value in enumerate(half))
    return x, y, z


def typed_cell(pair: Pair, column: str, text: str) -> Pair:
    """Return a pair with what was typed as its role, one of its sigmas or its note.

    Raises
    ------
    PicksError
        If it can't be that.
    """
    bare = " ".join(text.split())
    if column == "note":
        return replace(pair, note=bare)
    if column == "role":
        for role in ROLES:
            if bare.lower() == role:
                return replace(pair, role=role)
        message = f"The role {bare!r} is not known: type control, check or off."
        raise PicksError(message)
    changes: dict[str, Any] = {column: sigma_of(_number(bare)) if bare else None}
    return replace(pair, **changes)


def _numbers(text: str) -> list[float]:
    """Read one number, or three between blanks, semicolons or commas."""
    cells = text.replace(";", " ").split()
    if len(cells) == 1 and cells[0].count(",") == 2:
        cells = cells[0].split(",")
    return [_number(cell.rstrip(",")) for cell in cells]


def _number(text: str) -> float:
    """Read a number with a decimal point, or with a decimal comma where there is no point."""
    plain = text.strip()
    if plain.count(",") == 1 and "." not in plain:
        plain = plain.replace(",", ".")
    try:
        value = float(plain) if "_" not in plain else math.nan
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        message = f"{text.strip()!r} is not a number: type digits, with a decimal point."
        raise PicksError(message)
    return value
