"""Cameras: what is upright stays upright, and a carried camera sees the carried cloud alike."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from trigpoint_panel.camera import CORNER, STANDS, Camera, camera_from, upright

PLACE = np.array([741_020.0, 4_279_060.0, 170.0])


def picture(camera, points):
    """Where points are in the picture, in heights of it, from its middle."""
    ahead = np.subtract(camera.focal_point, camera.position)
    ahead /= np.linalg.norm(ahead)
    right = np.cross(ahead, camera.up)
    right /= np.linalg.norm(right)
    above = np.cross(right, ahead)
    seen = points - camera.position
    deep = camera.distance if camera.parallel else seen @ ahead
    scale = camera.height / camera.distance * deep
    return np.column_stack([seen @ right / scale, seen @ above / scale])


@pytest.mark.parametrize("parallel", [False, True])
@pytest.mark.parametrize("seed", range(5))
def test_a_carried_camera_sees_the_carried_cloud_alike(similarity_from, offset, seed, parallel):
    fit = similarity_from(seed, offset)
    points = np.random.default_rng(seed).normal(size=(50, 3))
    camera = camera_from(CORNER, (0.1, 0.2, 0.9), np.zeros(3), 4.0).projected(parallel)
    there = picture(camera.through(fit), fit(points))
    assert np.abs(there - picture(camera, points)).max() < 1e-7
    back = camera.through(fit).through(fit.inverse())
    assert np.abs(np.subtract(back.position, camera.position)).max() < 1e-7
    assert back.parallel_scale == pytest.approx(camera.parallel_scale)


@given(
    st.lists(st.tuples(st.floats(-400, 400), st.floats(-400, 400)), max_size=8),
    st.sampled_from(list(STANDS)),
)
def test_turning_keeps_the_distance_and_never_tips_over(turns, face):
    camera = camera_from(STANDS[face], (0, 0, 1), PLACE, 40.0)
    for sideways, upward in turns:
        turned = camera.orbited(sideways, upward)
        assert turned.distance == pytest.approx(camera.distance, rel=1e-9)
        assert turned.up == camera.up
        ahead = np.subtract(turned.focal_point, turned.position) / turned.distance
        assert abs(ahead @ np.array(turned.up)) < 1 - 1e-8
        camera = turned


def test_a_drag_upwards_looks_from_below():
    camera = camera_from(STANDS["front"], (0, 0, 1), PLACE, 40.0)
    assert camera.orbited(0, 30).position[2] > PLACE[2]
    assert camera.orbited(0, -30).position[2] < PLACE[2]


def test_zooming_keeps_what_is_under_the_cursor():
    camera = camera_from(CORNER, (0, 0, 1), PLACE, 40.0)
    under = np.asarray(camera.panned(0.3, -0.2).focal_point)
    for each in (camera, camera.projected(True)):
        nearer = each.zoomed(2.0, under)
        assert np.abs(picture(nearer, under[None]) - picture(each, under[None])).max() < 1e-6
        assert nearer.height == pytest.approx(each.height / 2)


def test_moving_brings_what_was_aside_to_the_middle():
    camera = camera_from(CORNER, (0, 0, 1), PLACE, 40.0)
    aside = camera.panned(0.25, 0.1)
    assert picture(camera, np.array([aside.focal_point]))[0] == pytest.approx([0.25, 0.1])


def test_switching_the_projection_and_back_changes_nothing():
    camera = camera_from(CORNER, (0, 0, 1), PLACE, 40.0)
    parallel = camera.projected(True)
    assert parallel.height == pytest.approx(camera.height)
    back = parallel.zoomed(2.0).projected(False)
    assert back.height == pytest.approx(camera.height / 2)
    assert not back.parallel


def test_rolling_a_quarter_lays_what_stood():
    camera = camera_from(STANDS["front"], (0, 0, 1), np.zeros(3), 4.0)
    assert np.abs(camera.rolled(90.0).up) == pytest.approx([1, 0, 0], abs=1e-9)


@pytest.mark.parametrize("up", [(0, 0, 1), (0, 0, -1), (0, 1, 0), (1, 0, 0), (0.3, -0.5, 0.2)])
def test_what_is_up_stands_upright(up):
    turn = upright(up)
    assert turn @ [0, 0, 1] == pytest.approx(np.array(up) / np.linalg.norm(up))
    assert np.linalg.det(turn) == pytest.approx(1)
    camera = camera_from(STANDS["top"], up, PLACE, 10.0)
    ahead = np.subtract(camera.focal_point, camera.position) / camera.distance
    assert ahead @ (np.array(up) / np.linalg.norm(up)) == pytest.approx(-1, abs=1e-5)


def test_a_camera_is_plain_numbers():
    from dataclasses import asdict

    camera = camera_from(CORNER, (0, 0, 1), PLACE, 40.0).orbited(3, 4).panned(0.1, 0.2)
    assert Camera(**asdict(camera)) == camera
    assert all(type(value) is float for value in camera.position)
