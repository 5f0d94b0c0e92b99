"""Pairs: what was picked so far, with either half still open, as frozen values."""

from __future__ import annotations

import re
from collections.abc import Collection
from dataclasses import dataclass, replace
from typing import Literal, cast, get_args

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike

from trigpoint.errors import PicksError
from trigpoint.picks import FARTHEST, LARGEST_SIGMA, SMALLEST_SIGMA, Picks, picks_from

Side = Literal["source", "target"]
Role = Literal["control", "check", "off"]
Place = tuple[float, float, float]

SIDES: tuple[Side, Side] = get_args(Side)
# As users read of the sides.
CALLED: dict[Side, str] = {"source": "source", "target": "reference"}
ROLES: tuple[Role, Role, Role] = get_args(Role)


@dataclass(frozen=True, slots=True)
class Pair:
    """One place in both frames, as far as it is picked.

    Attributes
    ----------
    id : str
        Its name: unique, and what people read.
    role : {"control", "check", "off"}
    source : tuple of three float or None
        Source units; None while that half is open.
    target : tuple of three float or None
        Metres.
    sigma_source, sigma_target : float or None
        Standard deviation per axis, in source units and metres; None where it is not known.
    note : str
        What was pointed at, then how each half was snapped: ``[source: ...]``.
    extra : tuple of (str, str)
        Other columns of the file that it came from.
    """

    id: str
    role: Role = "control"
    source: Place | None = None
    target: Place | None = None
    sigma_source: float | None = None
    sigma_target: float | None = None
    note: str = ""
    extra: tuple[tuple[str, str], ...] = ()

    def at(self, side: Side) -> Place | None:
        """Return one half."""
        return self.source if side == "source" else self.target

    @property
    def is_complete(self) -> bool:
        """Whether both halves are picked."""
        return self.source is not None and self.target is not None

    @property
    def is_half_open(self) -> bool:
        """Whether exactly one half is picked."""
        return (self.source is None) != (self.target is None)

    @property
    def open_side(self) -> Side | None:
        """The half that waits for its pick; None unless exactly one does."""
        if not self.is_half_open:
            return None
        return "source" if self.source is None else "target"

    def placed(
        self, side: Side, xyz: Place | None, *, sigma: float | None = None, note: str = ""
    ) -> Pair:
        """Return the pair with one half picked, or open again, and how it was snapped.

        The sigma and the snap's note belong to the half: they go with it.
        """
        noted = annotated(self.note, side, note if xyz is not None else "")
        if side == "source":
            return replace(self, source=xyz, sigma_source=sigma, note=noted)
        return replace(self, target=xyz, sigma_target=sigma, note=noted)


Pairs = tuple[Pair, ...]


def annotated(note: str, side: Side, text: str) -> str:
    """Return a note with what is said of one half's snap replaced; empty text takes it out.

    Examples
    --------
    >>> annotated("sill", "source", "corner of 3 planes")
    'sill [source: corner of 3 planes]'
    >>> annotated("sill [source: corner of 3 planes]", "source", "")
    'sill'
    """
    bare = re.sub(rf" ?\[{side}: [^\]]*\]", "", note)
    said = f"[{side}: {text.replace(']', ')')}]" if text else ""
    return " ".join(part for part in (bare, said) if part)


def find(pairs: Pairs, name: str | None) -> Pair | None:
    """Return the pair of that id, or None."""
    return next((pair for pair in pairs if pair.id == name), None)


def complete(pairs: Pairs) -> Pairs:
    """Return the pairs with both halves."""
    return tuple(pair for pair in pairs if pair.is_complete)


def with_role(pairs: Pairs, role: Role) -> Pairs:
    """Return the complete pairs of one role."""
    return tuple(pair for pair in pairs if pair.is_complete and pair.role == role)


def exchanged(pairs: Pairs, name: str, successor: Pair) -> Pairs:
    """Return the pairs with one of them exchanged, in its place."""
    return tuple(successor if pair.id == name else pair for pair in pairs)


def without(pairs: Pairs, names: Collection[str]) -> Pairs:
    """Return the pairs but those named."""
    return tuple(pair for pair in pairs if pair.id not in names)


def next_id(pairs: Pairs) -> str:
    """Return the id of a new pair: P and one more than the largest number in use.

    Examples
    --------
    >>> next_id((Pair("P1"), Pair("roof"), Pair("P7")))
    'P8'
    """
    numbers = [int(pair.id[1:]) for pair in pairs if re.fullmatch(r"P\d{1,9}", pair.id)]
    return f"P{max(numbers, default=0) + 1}"


def waiting(pairs: Pairs, selected: str | None, side: Side, *, newest: bool = True) -> Pair | None:
    """Return the pair whose half on this side a click fills; None: a new pair begins.

    That is the selected pair if its half there is open, else the last such pair, or with `newest`
    false the first.
    """
    chosen = find(pairs, selected)
    if chosen is not None and chosen.at(side) is None:
        return chosen
    open_ones = [pair for pair in pairs if pair.at(side) is None]
    return open_ones[-1 if newest else 0] if open_ones else None


def to_picks(pairs: Pairs) -> Picks:
    """Return the complete pairs as the engine's Picks.

    Raises
    ------
    PicksError
        For what the engine takes for no pick: an id given twice, a sigma not above zero.
    """
    whole = complete(pairs)
    names = dict.fromkeys(name for pair in whole for name, _ in pair.extra)
    cells = [dict(pair.extra) for pair in whole]
    return picks_from(
        [pair.id for pair in whole],
        [pair.source or () for pair in whole],
        [pair.target or () for pair in whole],
        roles=[pair.role for pair in whole],
        sigma_source=_sigmas([pair.sigma_source for pair in whole]),
        sigma_target=_sigmas([pair.sigma_target for pair in whole]),
        notes=[pair.note for pair in whole],
        extra=pd.DataFrame(
            {name: [row.get(name, "") for row in cells] for name in names},
            index=range(len(whole)),
            dtype=object,
        ),
    )


def from_picks(picks: Picks) -> Pairs:
    """Return the engine's Picks as pairs, or raise PicksError for what the panel can't hold."""
    names = [str(name) for name in picks.extra]
    extras = picks.extra.astype(str).to_numpy().tolist()
    return tuple(
        Pair(
            name.strip(),
            cast(Role, role),
            place_of(source),
            place_of(target),
            _known(sigma_source),
            _known(sigma_target),
            note,
            tuple(zip(names, extra, strict=True)),
        )
        for name, role, source, target, sigma_source, sigma_target, note, extra in zip(
            picks.ids,
            picks.roles.tolist(),
            picks.source.tolist(),
            picks.target.tolist(),
            picks.sigma_source.tolist(),
            picks.sigma_target.tolist(),
            picks.notes,
            extras,
            strict=True,
        )
    )


def refuse_taken(pairs: Pairs, name: str) -> str:
    """Return a new id stripped of blanks, or raise PicksError if it can't be one."""
    bare = name.strip()
    if not bare:
        message = "A pair needs a name: give it one of its own."
        raise PicksError(message)
    if find(pairs, bare) is not None:
        message = f"There is a pair {bare!r} already: choose another name."
        raise PicksError(message)
    return bare


def place_of(xyz: ArrayLike) -> Place:
    """Return three numbers that can be coordinates as a place, or raise PicksError."""
    values = np.asarray(xyz, np.float64)
    # NaN is not below anything either.
    if values.shape != (3,) or not (np.abs(values) <= FARTHEST).all():
        message = f"{values.tolist()} is no place: give three finite numbers up to {FARTHEST:g}."
        raise PicksError(message)
    x, y, z = values.tolist()
    return x, y, z


def sigma_of(value: float) -> float:
    """Return a number that can be a sigma, or raise PicksError."""
    if not SMALLEST_SIGMA <= value <= LARGEST_SIGMA:
        message = (
            f"A sigma of {value:g} can't be: give a number above zero, "
            f"from {SMALLEST_SIGMA:g} up to {LARGEST_SIGMA:,.0f}, or none."
        )
        raise PicksError(message)
    return float(value)


def _sigmas(values: list[float | None]) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
    return np.array([np.nan if value is None else value for value in values], np.float64)


def _known(sigma: float) -> float | None:
    return None if np.isnan(sigma) else sigma_of(sigma)
