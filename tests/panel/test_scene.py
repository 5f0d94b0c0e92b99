"""A scene drawn off the screen: precision, picking, what is drawn while moving, and looks."""

from dataclasses import replace

import numpy as np
import pytest

from trigpoint.cloud import cloud_from
from trigpoint.similarity import Similarity

pytest.importorskip(
    "pyvista", reason="the panel's packages are not installed", exc_type=ImportError
)
import pyvista as pv
from vtkmodules.util import numpy_support
from vtkmodules.vtkCommonCore import vtkUnsignedCharArray

from trigpoint_panel.camera import camera_from
from trigpoint_panel.pace import FEWEST
from trigpoint_panel.scene import Scene

HIGH = np.array([0.0, 0.0, 500.0])


@pytest.fixture
def plotter():
    made = pv.Plotter(off_screen=True, window_size=(400, 300))
    made.render_window.SetMultiSamples(0)
    yield made
    made.close()


@pytest.fixture
def scene(plotter, opened_tower):
    made = Scene(coarse=FEWEST)
    made.attach(plotter)
    made.show(opened_tower().cloud)
    yield made
    made.detach()


def shot(plotter):
    window = plotter.render_window
    window.Render()
    pixels = vtkUnsignedCharArray()
    window.GetPixelData(0, 0, 399, 299, 0, pixels, 0)
    return numpy_support.vtk_to_numpy(pixels).reshape(300, 400, 3)[::-1].astype(int)


def inked(picture, scene):
    ground = np.round(255 * np.array(scene.background))
    return (np.abs(picture - ground).max(axis=2) > 12).mean()


def test_the_whole_cloud_is_in_the_picture(scene, plotter):
    pixels = scene.project(scene.cloud.coordinates)
    assert (pixels >= 0).all()
    assert (pixels <= [400, 300]).all()
    assert np.ptp(pixels[:, 1]) / 300 > 0.75
    assert inked(shot(plotter), scene) > 0.1


def test_a_few_flyers_do_not_push_the_camera_away(scene, opened_tower):
    near = scene.camera.distance
    points = opened_tower().cloud.coordinates
    points[:20] += 5000
    scene.show(cloud_from(points))
    assert scene.camera.distance < 1.3 * near


def test_fitting_ends_what_nothing_can_be_seen_from(scene):
    scene.camera = replace(scene.camera, position=(np.nan,) * 3)
    scene.fit()
    assert scene.camera.is_sound
    assert (scene.project(scene.cloud.coordinates) >= 0).all()


@pytest.mark.parametrize("parallel", [False, True])
@pytest.mark.parametrize("face", ["front", "left", "top"])
def test_what_is_picked_is_under_the_cursor(scene, face, parallel):
    scene.camera = scene.camera.projected(parallel)
    scene.look(face)
    assert scene.camera.parallel == parallel
    rng = np.random.default_rng(0)
    hits = 0
    for x, y in rng.uniform([100, 75], [300, 225], (25, 2)):
        row = scene.pick_at(x, y)
        if row is not None:
            hits += 1
            assert np.hypot(*(scene.project(scene.coordinates(row)) - [x, y])) <= 5
    assert hits >= 8


@pytest.mark.parametrize("closer", [0.2, 1.0, 4.0])
def test_five_pixels_are_five_pixels_far_from_the_focal_point_too(scene, closer):
    # The focal point far behind or before what is seen: VTK's own cylinder would be off by as much.
    camera = scene.camera
    ahead = np.subtract(camera.focal_point, camera.position)
    scene.camera = replace(camera, focal_point=tuple(camera.position + closer * ahead))
    for x, y in np.random.default_rng(1).uniform([150, 100], [250, 200], (20, 2)):
        row = scene.pick_at(x, y)
        if row is not None:
            assert np.hypot(*(scene.project(scene.coordinates(row)) - [x, y])) <= 5


def test_the_front_is_picked_and_not_what_is_behind(scene):
    scene.look("front")
    picked = [scene.pick_at(200 + dx, 150 + dy) for dx in (-6, 0, 6) for dy in (-40, 0, 40)]
    heights = [scene.coordinates(row) for row in picked if row is not None]
    assert len(heights) >= 8
    assert all(place[1] < 4_279_000 - 1.9 for place in heights)


def test_beside_the_cloud_there_is_nothing_to_pick(scene):
    assert scene.pick_at(2, 298) is None
    scene.show(None)
    assert scene.pick_at(200, 150) is None


def test_a_pick_is_as_precise_as_the_file(scene, opened_tower):
    cloud = opened_tower().cloud
    row = scene.pick_at(200, 120)
    assert (scene.coordinates(row) == cloud.coordinates[row]).all()
    # What VTK draws is float32 about an origin nearby, not at UTM.
    assert np.abs(scene._shown.local).max() < 30
    drawn = scene._shown.local.astype(np.float64) + scene.origin
    assert np.abs(drawn - cloud.coordinates).max() < 2e-6


def test_the_same_is_picked_while_few_points_are_drawn(scene, plotter):
    resting = [scene.pick_at(x, 140) for x in (190, 200, 210)]
    full = inked(shot(plotter), scene)
    scene.set_moving(True)
    assert scene.is_thinned
    assert [scene.pick_at(x, 140) for x in (190, 200, 210)] == resting
    assert inked(shot(plotter), scene) > 0.5 * full


def test_a_slow_machine_gets_less_while_the_view_moves_and_the_same_picture_after(scene, plotter):
    before = shot(plotter)
    scene.set_moving(True)
    shot(plotter)
    assert scene._layer.drawn == FEWEST
    lit = shot(plotter)
    scene._motion.pace.is_lit = False
    scene._motion.apply()
    assert shot(plotter).mean() > lit.mean()
    scene.set_moving(False)
    assert not scene.is_thinned
    assert (shot(plotter) == before).all()


def test_isolated_points_alone_are_shown_and_picked(scene, plotter):
    before = inked(shot(plotter), scene)
    heights = scene.cloud.coordinates[:, 2]
    scene.isolate(heights > 160)
    assert inked(shot(plotter), scene) < before
    scene.look("front")
    rows = [scene.pick_at(x, y) for x in range(120, 280, 20) for y in range(40, 280, 20)]
    found = [row for row in rows if row is not None]
    assert found
    assert all(heights[row] > 160 for row in found)
    assert (scene.around(found[0], 1.0)[:, 2] > 160).all()
    scene.isolate(None)
    scene.look("front")
    assert any(heights[row] < 160 for x in range(120, 280, 20) if (row := scene.pick_at(x, 60)))


def test_around_a_point_is_what_a_box_holds(scene):
    row = scene.pick_at(200, 120)
    near = scene.around(row, 0.5)
    expected = np.abs(scene.cloud.coordinates - scene.coordinates(row)).max(axis=1) <= 0.5
    assert abs(len(near) - expected.sum()) <= 1


@pytest.mark.parametrize("parallel", [False, True])
def test_a_place_behind_the_cloud_is_hidden_and_one_on_its_surface_is_not(scene, parallel):
    scene.camera = scene.camera.projected(parallel)
    scene.look("front")
    picked = [scene.coordinates(scene.pick_at(200 + dx, 150)) for dx in (-8, 0, 8)]
    assert not scene.is_hidden(np.array(picked)).any()
    behind = np.array([[741_000.0, 4_279_002.0, 160.0], [741_000.0, 4_279_010.0, 155.0]])
    assert scene.is_hidden(behind).all()
    assert not scene.is_hidden(behind + np.array([5.0, 0, 0])).any()
    scene.look("back")
    assert not scene.is_hidden(behind).any()
    assert scene.is_ahead(behind).all()


def test_one_stray_point_hides_nothing(scene):
    across = np.linspace(-5, 5, 100)
    wall = np.array([[x, 0.0, z] for x in across for z in across])
    scene.show(cloud_from(np.vstack([wall, [[0.0, -3.0, 0.0]]])))
    scene.look("front")
    assert not scene.is_hidden(np.zeros((1, 3))).any()


def test_a_picked_place_on_sloping_ground_is_not_hidden_by_it(scene):
    scene.camera = camera_from((0, -1, 0.25), (0, 0, 1), np.array([741_000.0, 4_279_000, 150]), 30)
    place = np.array([[741_004.0, 4_278_995.0, 150.0]])
    assert not scene.is_hidden(place).any()


def test_an_overlay_lies_on_the_cloud_that_it_was_made_from(scene, plotter, similarity_from):
    fit = similarity_from(3, np.array([741_000.0, 4_279_000.0, 150.0]))
    source = cloud_from(fit.inverse()(scene.cloud.coordinates))
    alone = shot(plotter)
    assert not scene.has_overlay
    scene.set_overlay(source, fit)
    scene.swap()
    assert scene.shows_cloud
    assert np.abs(shot(plotter) - alone).mean() < 0.01
    assert scene.swap() == "B"
    carried = shot(plotter)
    both = (np.abs(carried - 244).max(axis=2) > 12) == (np.abs(alone - 244).max(axis=2) > 12)
    assert both.mean() > 0.99
    assert scene.pick_at(200, 120) is None
    scene.set_overlay(source, Similarity(fit.scale, fit.rotation, fit.translation + HIGH))
    assert inked(shot(plotter), scene) == 0
    scene.set_overlay(None)
    assert np.abs(shot(plotter) - alone).mean() < 0.01


def test_an_overlay_fades(scene, plotter):
    scene.set_overlay(cloud_from(scene.cloud.coordinates + HIGH / 20), None)
    pictures = []
    for opacity in (0.0, 0.5, 1.0):
        scene.set_overlay_opacity(opacity)
        pictures.append(shot(plotter))
    ground = np.round(255 * np.array(scene.background))
    far = [np.abs(picture[:60] - ground).mean() for picture in pictures]
    assert far[0] < far[1] < far[2]


def test_eye_dome_lighting_is_on_and_can_be_turned_off(scene, plotter):
    lit = shot(plotter)
    scene.set_eye_dome(False)
    flat = shot(plotter)
    assert lit.mean() < flat.mean()
    scene.set_eye_dome(True)
    assert np.abs(shot(plotter) - lit).mean() < 0.01


@pytest.mark.parametrize("attribute", ["height", "classification", "distance_m"])
@pytest.mark.parametrize("rise", [90.0, 45.0, 22.0])
def test_flat_ground_is_drawn_in_the_colours_of_the_legend(scene, plotter, attribute, rise):
    across = np.linspace(-10, 10, 250)
    ground = np.stack([*np.meshgrid(across, across), np.zeros((250, 250))], axis=2).reshape(-1, 3)
    # A step at one end, or all were of one height and class.
    step = np.array([[x, 10.0, z] for x in across for z in across / 5 + 2])
    rows = len(ground), len(step)
    values = {
        "height": {},
        "classification": {"classification": np.repeat([2, 6], rows).astype(np.uint8)},
        "distance_m": {"distance_m": np.repeat([0.12, 0.45], rows)},
    }[attribute]
    scene.show(cloud_from(np.vstack([ground, step]), attributes=values))
    scene.colour_by({"classification": "class", "distance_m": "distance"}.get(attribute, "height"))
    assert scene.eye_dome
    lean = np.radians(min(rise, 89.9))
    stand = (0.0, -float(np.cos(lean)), float(np.sin(lean)))
    scene.camera = camera_from(stand, (0, 0, 1), np.zeros(3), 12.0)
    drawn = shot(plotter)[140:160, 180:220]
    (colour,) = np.unique(scene._colours[: rows[0]], axis=0)
    legend = [*scene.legend.ramp, *(swatch for swatch, _ in scene.legend.swatches)]
    assert "#" + bytes(colour.tolist()).hex() in legend
    assert np.abs(drawn - colour).max() <= 8


def test_a_step_in_depth_has_a_dark_edge(scene, plotter):
    scene.colour_by("height")
    scene.look("front")
    lit = shot(plotter)
    scene.set_eye_dome(False)
    darkened = (lit.sum(axis=2) < 0.7 * shot(plotter).sum(axis=2)).mean()
    assert 0.002 < darkened < 0.1


def test_a_scene_outlives_its_plotter(scene, plotter):
    scene.set_dark(True)
    scene.set_point_size(5)
    scene.look("left")
    before = shot(plotter)
    other = pv.Plotter(off_screen=True, window_size=(400, 300))
    other.render_window.SetMultiSamples(0)
    scene.attach(other)
    assert np.abs(shot(other) - before).mean() < 0.5
    scene.detach()
    other.close()


def test_everything_can_be_set_before_there_is_a_plotter(opened_tower, plotter):
    scene = Scene()
    scene.set_eye_dome(False)
    scene.show(opened_tower(crs=None).cloud)
    scene.set_up((0, 1, 0))
    scene.colour_by("height")
    scene.set_overlay(opened_tower(100, crs=None).cloud)
    scene.isolate(np.arange(30_000) % 2 == 0)
    assert scene.pick_at(10, 10) is None
    scene.attach(plotter)
    assert inked(shot(plotter), scene) > 0.05


def test_distances_are_shown_and_taken_away(scene):
    scene.set_distances(np.linspace(0, 1, 30_000))
    assert scene.mode == "distance"
    assert scene.legend.title == "Distance"
    scene.set_distances(None)
    assert scene.mode == "rgb"
    assert scene.legend is None
    assert "distance" not in scene.modes


def test_an_empty_cloud_is_an_empty_view(scene, plotter):
    scene.show(cloud_from(np.empty((0, 3))))
    assert scene.cloud is None
    assert inked(shot(plotter), scene) == 0


@pytest.mark.parametrize("ratio", [1.0, 2.0])
def test_five_pixels_grow_with_the_density_of_the_screen(plotter, ratio):
    scene = Scene()
    scene.attach(plotter, ratio=ratio)
    scene.show(cloud_from([[0.0, 0, 0], [0, 0, 1]]))
    x, y = scene.project(np.zeros(3))
    assert scene.pick_at(x + 8, y) == (0 if ratio == 2 else None)
    scene.detach()
