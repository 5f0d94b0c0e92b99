"""A cloud as VTK draws it: its parts, what they share, and how wide thinned points are."""

import numpy as np
import pytest

pytest.importorskip(
    "pyvista", reason="the panel's packages are not installed", exc_type=ImportError
)
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkRenderingCore import vtkRenderer

from trigpoint_panel.layer import WIDEST, Layer
from trigpoint_panel.pace import FEWEST, STEPS

COUNT = 40_000


@pytest.fixture
def renderer():
    return vtkRenderer()


@pytest.fixture
def layer(renderer):
    rng = np.random.default_rng(0)
    made = Layer(
        rng.random((COUNT, 3)).astype(np.float32), rng.integers(0, 256, (COUNT, 3)).astype(np.uint8)
    )
    made.show_in(renderer)
    return made


def actors(renderer):
    return list(renderer.GetActors())


def rows(actor):
    cell = actor.GetMapper().GetInput().GetVerts()
    return vtk_to_numpy(cell.GetConnectivityArray())


def test_at_rest_every_point_is_drawn_once(layer, renderer):
    assert layer.drawn == COUNT
    assert not layer.is_thinned
    assert all(actor.GetVisibility() for actor in actors(renderer))
    drawn = np.concatenate([rows(actor) for actor in actors(renderer)])
    assert (np.sort(drawn) == np.arange(COUNT)).all()


def test_fewer_are_always_among_more(layer, renderer):
    shares = []
    for step in STEPS[:3]:
        layer.draw_at_most(step)
        assert layer.is_thinned
        drawn = [rows(actor) for actor in actors(renderer) if actor.GetVisibility()]
        shares.append(set(np.concatenate(drawn).tolist()))
        assert len(shares[-1]) == layer.drawn == step
    assert shares[0] < shares[1] < shares[2]
    layer.draw_at_most(None)
    assert layer.drawn == COUNT


def test_thinned_points_are_wider_to_keep_surfaces_closed(layer, renderer):
    def width():
        return actors(renderer)[0].GetProperty().GetPointSize()

    layer.set_size(3.0)
    assert width() == 3.0
    layer.draw_at_most(STEPS[2])
    assert width() == pytest.approx(3.0 * (COUNT / STEPS[2]) ** 0.5)
    layer.draw_at_most(0)
    assert layer.drawn == FEWEST
    assert width() == 3.0 * WIDEST


def test_all_parts_share_their_points_and_colours_which_are_uploaded_once(layer, renderer):
    layer.recolour(np.full((COUNT, 3), 7, np.uint8))
    parts = [actor.GetMapper().GetInput() for actor in actors(renderer)]
    assert len(parts) > 3
    assert len({id(part.GetPoints()) for part in parts}) == 1
    colours = parts[0].GetPointData().GetScalars()
    assert all(part.GetPointData().GetScalars() is colours for part in parts)
    # What has four bytes is taken as it is; VTK would convert three bytes for each part.
    for actor in actors(renderer):
        assert actor.GetMapper().MapScalars(1.0) is colours
    assert (vtk_to_numpy(colours) == [7, 7, 7, 255]).all()


def test_clouds_of_one_size_are_dealt_alike(layer, renderer):
    other = vtkRenderer()
    twin = Layer(np.zeros((COUNT, 3), np.float32), np.zeros((COUNT, 3), np.uint8))
    twin.show_in(other)
    assert not layer.is_thinned
    for one, same in zip(actors(renderer), actors(other), strict=True):
        assert (rows(one) == rows(same)).all()
    twin.leave(other)
    assert not actors(other)


def test_a_small_cloud_is_never_thinned():
    small = Layer(np.zeros((9, 3), np.float32), np.zeros((9, 3), np.uint8))
    small.draw_at_most(FEWEST)
    assert small.drawn == 9
    assert not small.is_thinned
