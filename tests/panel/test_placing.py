"""Labels beside their marks: none covers a mark, another label, or what must stay free."""

import numpy as np
import pytest

pytest.importorskip(
    "pyvista", reason="the panel's packages are not installed", exc_type=ImportError
)
from trigpoint_panel.placing import SPOTS, Wish, boxes_of, place

AREA = (400.0, 300.0)


def wish(x, y, rank=0, before=None):
    return Wish(x, y, 8.0, 60.0, 17.0, rank, before)


def meet(one, other):
    return (one[:2] < other[2:]).all() and (other[:2] < one[2:]).all()


def boxes(wishes, spots):
    return [
        boxes_of(each)[spot] for each, spot in zip(wishes, spots, strict=True) if spot is not None
    ]


def test_a_label_alone_stands_at_the_best_spot():
    assert place([wish(200, 150)], AREA) == [0]


@pytest.mark.parametrize("count", [10, 40, 120])
def test_labels_cover_no_mark_no_label_and_nothing_that_is_taken(count):
    rng = np.random.default_rng(count)
    wishes = [wish(*xy) for xy in rng.uniform([120, 60], [280, 240], (count, 2))]
    card = np.array([0.0, 220.0, 150.0, 300.0])
    placed = boxes(wishes, place(wishes, AREA, [tuple(card)]))
    assert len(placed) >= 8
    for k, box in enumerate(placed):
        assert (box[:2] >= 0).all()
        assert (box[2:] <= AREA).all()
        assert not meet(box, card)
        assert not any(meet(box, other) for other in placed[:k])
        for each in wishes:
            assert not meet(box, np.array([each.x - 8, each.y - 8, each.x + 8, each.y + 8]))


def test_a_label_near_the_border_stays_inside():
    for corner in ((3, 3), (397, 3), (3, 297), (397, 297)):
        (spot,) = place([wish(*corner)], AREA)
        assert spot is not None


def test_where_there_is_no_room_the_first_in_rank_has_it():
    crowd = [wish(30 + 0.1 * k, 30, rank=9 - k) for k in range(10)]
    spots = place(crowd, (150.0, 60.0))
    assert spots[9] is not None
    assert spots[0] is None


def test_a_label_keeps_its_spot_while_it_is_free():
    assert place([wish(200, 150, before=5)], AREA) == [5]
    assert place([wish(200, 150, before=5)], AREA, [(100, 100, 190, 200)]) == [0]


def test_a_label_goes_farther_away_before_it_is_left_out():
    around = [wish(200, 150, rank=k) for k in range(12)]
    steps = [SPOTS[spot][2] for spot in place(around, AREA) if spot is not None]
    assert min(steps) == 0
    assert max(steps) > 0
