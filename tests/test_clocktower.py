import numpy as np
import pytest
from numpy.testing import assert_allclose

from trigpoint.clocktower import MATERIALS, TURN_DEG, build_tower


@pytest.fixture(scope="module")
def tower():
    return build_tower()


def in_tower_axes(points):
    c, s = np.cos(np.radians(TURN_DEG)), np.sin(np.radians(TURN_DEG))
    x, y = points[..., 0], points[..., 1]
    return np.stack([c * x + s * y, c * y - s * x, points[..., 2]], axis=-1)


def middles_of(tower, material):
    return in_tower_axes(tower.triangles[tower.material == material].mean(axis=1))


def test_the_tower_is_ten_metres_wide_and_sixty_tall(tower):
    brick = in_tower_axes(tower.triangles[tower.material == "brick"])
    shaft = brick[brick[..., 0].max(axis=1) < 6]
    assert_allclose(np.ptp(shaft.reshape(-1, 3)[:, :2], axis=0), 10)
    assert tower.triangles[..., 2].min() == 0
    assert tower.triangles[..., 2].max() == 60


def test_every_triangle_has_a_known_material_and_an_area(tower):
    a, b, c = np.moveaxis(tower.triangles, 1, 0)
    assert (np.linalg.norm(np.cross(b - a, c - a), axis=1) > 1e-6).all()
    assert set(tower.material) == set(MATERIALS)
    assert_allclose(np.linalg.norm(tower.normals, axis=1), 1)


def test_what_can_be_picked_is_a_corner(tower):
    vertices = tower.triangles.reshape(-1, 3)
    for name, place in tower.corners.items():
        assert np.linalg.norm(vertices - place, axis=1).min() < 1e-9, name


def test_corners_are_where_their_names_say(tower):
    for name, place in tower.corners.items():
        x, y, _ = in_tower_axes(place)
        for letter in name.rpartition("-")[2]:
            assert {"n": y > 0, "s": y < 0, "e": x > 0, "w": x < 0}[letter], name


def test_four_dials_look_outward_from_recesses(tower):
    dials = middles_of(tower, "dial")
    outward = in_tower_axes(tower.normals[tower.material == "dial"])
    reach = (dials[:, :2] * outward[:, :2]).sum(axis=1)
    assert ((reach > 4.5) & (reach < 4.9)).all()
    assert len(np.unique(outward.round(6) + 0.0, axis=0)) == 4


@pytest.mark.parametrize("material", ["lawn", "paving"])
def test_the_ground_faces_up(tower, material):
    assert_allclose(tower.normals[tower.material == material], np.array([[0, 0, 1.0]] * 2))


def test_no_sensor_looks_into_a_wall(tower):
    """From outside, what a ray meets first shows its front, or triangles are missing."""
    rng = np.random.default_rng(3)
    around = rng.uniform(0, 2 * np.pi, 400)
    sensor = np.column_stack([40 * np.cos(around), 40 * np.sin(around), rng.uniform(2, 110, 400)])
    chosen = rng.choice(len(tower.triangles), 400)
    shares = rng.dirichlet(np.ones(3), 400)
    away = np.einsum("kv,kvi->ki", shares, tower.triangles[chosen]) - sensor
    a, b, c = np.moveaxis(tower.triangles, 1, 0)
    across = np.cross(away[:, None], c - a)
    facing = (across * (b - a)).sum(axis=2)
    turned = np.cross(sensor[:, None] - a, b - a)
    with np.errstate(divide="ignore", invalid="ignore"):
        u = (across * (sensor[:, None] - a)).sum(axis=2) / facing
        v = (turned * away[:, None]).sum(axis=2) / facing
        distance = (turned * (c - a)).sum(axis=2) / facing
    is_met = (u > -1e-9) & (v > -1e-9) & (u + v < 1 + 1e-9) & (distance > 0)
    first = np.where(is_met, distance, np.inf).argmin(axis=1)
    row = np.arange(len(away))
    assert is_met.any(axis=1).all()
    assert (facing[row, first] > 0).all()
