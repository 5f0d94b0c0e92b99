"""Snaps on shapes whose corner, summit and middle are known."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from trigpoint_panel.snapping import SnapError, snap


def corner_of(seed, *, noise=0.01, count=900, size=1.0, flyers=0):
    """A corner of three faces, turned at random, at the origin."""
    rng = np.random.default_rng(seed)
    u, v = rng.uniform(0, size, (2, count))
    none = np.zeros(count)
    which = np.arange(count) % 3
    faces = [np.column_stack(face) for face in ((u, v, none), (u, none, v), (none, u, v))]
    points = np.choose(which[:, None], faces) + rng.normal(scale=noise, size=(count, 3))
    points = np.concatenate([points, rng.uniform(-size, size, (flyers, 3))])
    return points @ Rotation.random(random_state=seed).as_matrix().T


def clicked(points, place=(0.0, 0.0, 0.0)):
    return points[np.argmin(np.linalg.norm(points - place, axis=1))]


def patch(seed, *, count=4000, noise=0.01, size=4.0):
    """A level patch."""
    rng = np.random.default_rng(seed)
    plan = rng.uniform(-size / 2, size / 2, (count, 2))
    return np.column_stack([plan, rng.normal(scale=noise, size=count)])


@pytest.mark.parametrize("seed", range(20))
def test_a_corner_is_found_within_its_own_sigma(seed, offset):
    points = corner_of(seed)
    found = snap(points + offset, clicked(points) + offset, "corner", 0.6)
    error = np.linalg.norm(found.xyz - offset)
    assert error < 4 * np.sqrt(3) * found.sigma
    assert found.sigma < 0.005
    assert "corner of three planes within 0.6" in found.note


def test_the_sigma_of_a_corner_is_neither_boast_nor_modesty():
    ratios = []
    for seed in range(100, 140):
        points = corner_of(seed)
        found = snap(points, clicked(points), "corner", 0.6)
        ratios.append(np.square(found.xyz).mean() / found.sigma**2)
    assert 0.3 < np.mean(ratios) < 1.5


def test_a_corner_beats_the_point_that_was_clicked():
    for seed in range(20):
        points = corner_of(seed, noise=0.02)
        near = points[np.linalg.norm(points, axis=1) < 0.2]
        click = near[seed % len(near)]
        found = snap(points, click, "corner", 0.6)
        assert np.linalg.norm(found.xyz) < np.linalg.norm(click)


@pytest.mark.parametrize("noise", [0.0, 0.001, 0.03])
def test_a_corner_is_found_in_clean_and_in_rough_clouds(noise):
    points = corner_of(3, noise=noise, count=3000)
    found = snap(points, clicked(points), "corner", 0.6)
    assert np.linalg.norm(found.xyz) < 4 * np.sqrt(3) * found.sigma + 1e-9
    assert found.sigma < 0.5 * noise + 1e-9


def test_flyers_do_not_move_a_corner():
    points = corner_of(5, count=2000, flyers=300)
    found = snap(points, clicked(points), "corner", 0.6)
    assert np.linalg.norm(found.xyz) < 0.005


def test_a_click_beside_the_corner_finds_the_same_one():
    points = corner_of(9, count=4000)
    near = snap(points, clicked(points), "corner", 0.6)
    off = snap(
        points, clicked(points, points[np.linalg.norm(points, axis=1) < 0.2][7]), "corner", 0.6
    )
    assert np.linalg.norm(near.xyz - off.xyz) < 0.005


def test_the_same_click_gives_the_same_corner():
    points = corner_of(1)
    first, second = (snap(points, clicked(points), "corner", 0.6) for _ in range(2))
    assert (first.xyz == second.xyz).all()
    assert first.sigma == second.sigma


def test_an_edge_of_two_planes_is_no_corner():
    rng = np.random.default_rng(0)
    u, v = rng.uniform(-1, 1, (2, 4000))
    faces = np.where(np.arange(4000)[:, None] % 2, np.c_[u, abs(v), 0 * v], np.c_[u, 0 * v, abs(v)])
    points = faces + rng.normal(scale=0.01, size=faces.shape)
    with pytest.raises(SnapError, match=r"no third plane within 0\.6"):
        snap(points, clicked(points), "corner", 0.6)


def test_a_step_is_no_corner():
    lower, upper = patch(0), patch(1)
    points = np.concatenate([lower[lower[:, 0] < 0], upper[upper[:, 0] > 0] + [0, 0, 0.3]])
    with pytest.raises(SnapError, match=r"no (second|third) plane"):
        snap(points, clicked(points), "corner", 0.5)


def test_planes_that_meet_far_away_are_refused():
    points = corner_of(2, count=9000)
    away = clicked(points, points[np.argmax(np.linalg.norm(points, axis=1))] * 0.4)
    with pytest.raises(SnapError):
        snap(points, away, "corner", 0.2)


def test_too_few_points_are_counted():
    points = corner_of(0, count=30)
    with pytest.raises(SnapError, match=r"Only \d+ points lie within 0.6 of the click, and 60"):
        snap(points, clicked(points), "corner", 0.6)


def test_the_highest_point_of_a_cone_is_its_tip(offset):
    rng = np.random.default_rng(4)
    plan = rng.uniform(-1, 1, (20_000, 2))
    points = np.column_stack([plan, 2 - 2 * np.linalg.norm(plan, axis=1)])
    points += rng.normal(scale=0.003, size=points.shape)
    click = clicked(points, (0.1, 0.1, 1.7))
    found = snap(points + offset, click + offset, "highest", 0.6)
    assert np.linalg.norm(found.xyz - offset - [0, 0, 2]) < 0.05
    assert found.sigma < 0.05


def test_the_highest_point_follows_what_is_up():
    rng = np.random.default_rng(4)
    plan = rng.uniform(-1, 1, (20_000, 2))
    points = np.column_stack([plan, 2 - 2 * np.linalg.norm(plan, axis=1)])
    turned = points[:, [2, 0, 1]]
    click = clicked(turned, (1.7, 0.1, 0.1))
    found = snap(turned, click, "highest", 0.6, up=np.array([1.0, 0, 0]))
    assert np.linalg.norm(found.xyz - [2, 0, 0]) < 0.05


def test_a_flat_roof_has_no_certain_summit():
    points = patch(1)
    roof = snap(points, clicked(points), "highest", 1.0)
    assert roof.sigma > 0.1


def test_a_flyer_is_no_summit():
    rng = np.random.default_rng(4)
    plan = rng.uniform(-1, 1, (20_000, 2))
    points = np.column_stack([plan, 2 - 2 * np.linalg.norm(plan, axis=1)])
    points = np.concatenate([points, [[0.05, 0, 2.4]]])
    found = snap(points, clicked(points, (0.05, 0.05, 1.85)), "highest", 0.7)
    assert found.xyz[2] < 2.01


def test_a_wall_that_goes_on_has_no_summit_within_reach():
    wall = patch(2)[:, [0, 2, 1]]
    with pytest.raises(SnapError, match=r"edge of the radius of 0\.5"):
        snap(wall, clicked(wall), "highest", 0.5)


def test_the_centroid_of_a_ball_is_its_middle(offset):
    rng = np.random.default_rng(0)
    ball = rng.normal(size=(2000, 3))
    ball *= 0.1 / np.linalg.norm(ball, axis=1)[:, None]
    found = snap(ball + offset, ball[7] + offset, "centroid", 0.3)
    assert np.linalg.norm(found.xyz - offset) < 4 * np.sqrt(3) * found.sigma
    assert found.sigma < 0.003


def test_the_centroid_of_a_bare_wall_follows_the_click_and_says_so():
    points = patch(3)
    wall = snap(points, clicked(points), "centroid", 0.5)
    assert wall.sigma > 0.3 * snap(points, clicked(points), "point", 0.5).sigma


def test_a_point_stays_where_it_is_and_knows_its_grain(offset):
    points = patch(3, noise=0.02)
    at = clicked(points) + offset
    found = snap(points + offset, at, "point", 0.5)
    assert (found.xyz == at).all()
    assert found.note == ""
    # Half a cell of 63 mm along the surface, 20 mm across it.
    assert found.sigma == pytest.approx(np.sqrt((2 * 0.063**2 / 12 + 0.02**2) / 3), rel=0.4)


@pytest.mark.parametrize("radius", [0.0, -1.0, float("nan")])
def test_a_radius_of_nothing_is_refused(radius):
    with pytest.raises(SnapError, match="above zero"):
        snap(patch(0), patch(0)[0], "centroid", radius)
