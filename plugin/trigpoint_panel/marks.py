"""Numbered places in a view: what each is, and how its kind looks."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, NamedTuple

from trigpoint_reporting.style import BLUE, GREY, ORANGE, PURPLE

Position = tuple[float, float, float]
Kind = Literal["control", "check", "off", "ghost", "next"]


@dataclass(frozen=True, slots=True)
class Marker:
    """A numbered place in a view.

    Attributes
    ----------
    xyz : tuple of float
        Absolute, in the cloud's frame.
    label : str
        Shown beside it, whatever is in front.
    kind : str
        "control", "check", "off", "ghost" (where a pick is expected) or "next" (where to pick).
    selected : bool
    flag : str
        What the fit says against it, in one word such as "suspect": it gets a red ring, and its
        label says so.
    """

    xyz: Position
    label: str
    kind: Kind = "control"
    selected: bool = False
    flag: str = ""

    @property
    def rank(self) -> int:
        """Who chooses first where a label is to stand: the selected one, then what is flagged."""
        if self.selected or self.flag:
            return 0 if self.selected else 1
        return ("ghost", "next", "control", "check", "off").index(self.kind) + 2


class Look(NamedTuple):
    """How a kind is drawn: never told by its colour alone."""

    colour: str
    ink: str
    is_round: bool
    is_hollow: bool


# Letters on their label stand out by 4.5 to 1 or more.
LOOKS: dict[Kind, Look] = {
    "control": Look(BLUE, "#FFFFFF", True, False),
    # Green of the figures is too light for white letters, and black ones would look like a ghost's.
    "check": Look("#00724F", "#FFFFFF", False, False),
    "off": Look(GREY, "#FFFFFF", True, True),
    "ghost": Look(ORANGE, "#000000", True, True),
    "next": Look(PURPLE, "#000000", False, True),
}
FLAGGED = Look("#B3261E", "#FFFFFF", True, False)
SELECTED = Look("#000000", "#FFFFFF", True, False)
