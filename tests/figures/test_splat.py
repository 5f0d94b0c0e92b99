import numpy as np
import pytest

from trigpoint_reporting.splat import Splat, extent, grown, pixels_of, splat

SIDES = ("north", "east", "south", "west", "above")
# A point at the east, north and top of the window shows where each view puts those.
BOX = np.array([[0.0, 0.0, 0.0], [10.0, 8.0, 6.0]])


def seen(points, side, *, pixel=1.0, size=0.0, box=BOX):
    return splat(np.asarray(points, float), side, window=extent(box, side), pixel=pixel, size=size)


@pytest.mark.parametrize(
    ("side", "row", "column"),
    [("north", 1, 0), ("south", 1, 9), ("east", 1, 7), ("west", 1, 0), ("above", 0, 9)],
)
def test_a_known_point_lands_on_the_right_pixel(side, row, column):
    image = seen([[9.5, 7.5, 4.5]], side)
    assert np.argwhere(image.index == 0).tolist() == [[row, column]]


@pytest.mark.parametrize(
    ("side", "front"), [("north", 1), ("south", 0), ("east", 3), ("west", 2), ("above", 5)]
)
def test_the_point_nearest_to_the_viewer_is_seen(side, front):
    middle = np.array([5.5, 3.5, 2.5])
    steps = np.array([[0, -3, 0], [0, 3, 0], [-3, 0, 0], [3, 0, 0], [0, 0, -2], [0, 0, 2]])
    image = seen(middle + steps, side)
    axis = {"north": 1, "south": 1, "east": 0, "west": 0, "above": 2}[side]
    rows, columns = np.nonzero(image.index == front)
    assert len(rows) == 1
    behind = front ^ 1
    assert not (image.index == behind).any()
    assert abs(image.depth[rows[0], columns[0]]) == pytest.approx(
        abs((middle + steps)[front, axis])
    )


def test_of_points_equally_near_the_first_is_seen():
    assert seen([[1.5, 2.0, 1.5]] * 5, "south").index.max() == 0


def test_points_outside_the_window_are_left_out():
    outside = [[-0.1, 1, 1], [10.1, 1, 1], [1, 1, -0.1], [1, 1, 6.1]]
    assert (seen(outside, "south").index == -1).all()


def test_a_wall_is_true_to_scale(offset):
    rng = np.random.default_rng(3)
    wall = np.column_stack(
        [rng.uniform(2, 6, 40_000), np.full(40_000, 4.0), rng.uniform(1, 4, 40_000)]
    )
    image = seen(wall + offset, "south", pixel=0.1, box=BOX + offset)
    rows, columns = np.nonzero(image.index >= 0)
    assert (columns.min(), columns.max()) == (20, 59)
    assert (rows.min(), rows.max()) == (20, 49)
    assert (image.index >= 0).sum() * 0.1**2 == pytest.approx(4 * 3, rel=1e-3)


def test_a_point_covers_its_size_about_itself():
    image = seen([[5.5, 1.0, 3.5]], "south", size=3.0)
    assert np.argwhere(image.index == 0).tolist() == [[r, c] for r in (1, 2, 3) for c in (4, 5, 6)]


def test_a_covering_point_stays_behind_a_nearer_one():
    image = seen([[5.5, 5.0, 3.5], [6.5, 1.0, 3.5]], "south", size=3.0)
    assert image.index[2, 6] == 1
    assert image.index[2, 5] == 1
    assert image.index[2, 4] == 0


def test_nothing_is_seen_of_no_points():
    image = seen(np.empty((0, 3)), "east")
    assert image.index.shape == pixels_of(extent(BOX, "east"), 1.0)[::-1]
    assert (image.index == -1).all()


@pytest.mark.parametrize("edge", [1, 2, 3, 4, 50])
def test_growing_agrees_with_doing_it_point_by_point(edge):
    rng = np.random.default_rng(edge)
    depth = np.where(rng.random((9, 7)) < 0.3, rng.random((9, 7)), -np.inf)
    index = np.where(np.isfinite(depth), np.arange(63).reshape(9, 7), -1)
    made = grown(Splat(index, depth), edge)
    start = -((edge - 1) // 2)
    expected = np.full((9, 7), -np.inf)
    for row, column in np.argwhere(np.isfinite(depth)):
        rows = slice(max(0, row + start), max(0, row + start + edge))
        columns = slice(max(0, column + start), max(0, column + start + edge))
        expected[rows, columns] = np.maximum(expected[rows, columns], depth[row, column])
    np.testing.assert_array_equal(made.depth, expected)
    seen_at = made.index >= 0
    np.testing.assert_array_equal(depth.ravel()[made.index[seen_at]], expected[seen_at])
