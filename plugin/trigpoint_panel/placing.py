"""Placing: where labels stand beside their marks, so that none covers a mark or another label."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

# Left, top, right and bottom, in pixels from the top left.
Box = tuple[float, float, float, float]

# Where a label may stand, the best first; then the same farther away, with a line to the mark.
SIDES = ((1, 0), (1, -1), (1, 1), (-1, 0), (-1, -1), (-1, 1), (0, -1), (0, 1))
STEPS = (0.0, 16.0, 34.0, 56.0)
SPOTS = tuple((x, y, step) for step in STEPS for x, y in SIDES)
ACROSS, DOWN, FARTHER = np.array(SPOTS).T
# Between a label and what else is drawn.
GAP = 2.0


class Wish(NamedTuple):
    """A label that is to stand beside a mark.

    Attributes
    ----------
    x, y : float
        Of the mark's middle.
    radius : float
        Of the mark.
    wide, tall : float
        Of the label.
    rank : int
        The lower, the earlier it may choose.
    before : int or None
        The spot that it has: kept while that is free, or labels would jump as the view turns.
    """

    x: float
    y: float
    radius: float
    wide: float
    tall: float
    rank: int
    before: int | None = None


def place(
    wishes: Sequence[Wish], area: tuple[float, float], taken: Sequence[Box] = ()
) -> list[int | None]:
    """Find a spot for each label; None where all would cover something.

    Parameters
    ----------
    wishes : sequence of Wish
        Marks are kept free, whether or not they get their label.
    area : tuple of float
        Width and height of the view; labels stay inside.
    taken : sequence of Box
        What must not be covered either.

    Returns
    -------
    list of int or None
        Indices of `SPOTS`.
    """
    marks = [(w.x - w.radius, w.y - w.radius, w.x + w.radius, w.y + w.radius) for w in wishes]
    # By edges: to ask each for itself is ten times as fast as to ask for boxes.
    full = np.array([*taken, *marks], np.float64).reshape(-1, 4).T
    spots: list[int | None] = [None] * len(wishes)
    for k in sorted(range(len(wishes)), key=lambda k: wishes[k].rank):
        boxes = boxes_of(wishes[k])
        inside = np.all((boxes[:, :2] >= GAP) & (boxes[:, 2:] <= np.subtract(area, GAP)), axis=1)
        left, top, right, bottom = np.add(boxes, [-GAP, -GAP, GAP, GAP]).T[:, :, None]
        beside = (right <= full[0]) | (full[2] <= left)
        free = np.flatnonzero(
            inside & np.all(beside | (bottom <= full[1]) | (full[3] <= top), axis=1)
        )
        if len(free):
            before = wishes[k].before
            spots[k] = spot = before if before in free else int(free[0])
            full = np.column_stack([full, boxes[spot]])
    return spots


def boxes_of(wish: Wish) -> NDArray[np.float64]:
    """Return a label's box at each spot, shape (len(SPOTS), 4)."""
    reach = wish.radius + GAP + FARTHER
    left = wish.x + ACROSS * reach - wish.wide * (1 - ACROSS) / 2
    top = wish.y + DOWN * reach - wish.tall * (1 - DOWN) / 2
    return np.column_stack([left, top, left + wish.wide, top + wish.tall])
