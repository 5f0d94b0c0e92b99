from itertools import pairwise

import numpy as np
import pytest
from numpy.testing import assert_allclose

from trigpoint.clocktower import build_tower
from trigpoint.scanning import Fans, cast


def fans_at(origins, rng, *, step=0.02, count=120):
    """Fans of random planes that leave their origins for the world's middle."""
    forward = -origins / np.linalg.norm(origins, axis=1, keepdims=True)
    aside = np.cross(forward, rng.normal(size=forward.shape))
    aside /= np.linalg.norm(aside, axis=1, keepdims=True)
    return Fans(origins, forward, aside, np.full(len(origins), -step * count / 2), step, count)


def rays_of(fans):
    angle = fans.first[:, None] + fans.step * np.arange(fans.count)
    directions = np.cos(angle)[..., None] * fans.forward[:, None]
    directions += np.sin(angle)[..., None] * fans.aside[:, None]
    origins = np.broadcast_to(fans.origin[:, None], directions.shape)
    return origins.reshape(-1, 3), directions.reshape(-1, 3)


def first_hits(origins, directions, triangles):
    """Test every ray with every triangle, as Moeller and Trumbore do; no hit is at infinity."""
    a, b, c = np.moveaxis(triangles, 1, 0)
    across = np.cross(directions[:, None], c - a)
    facing = (across * (b - a)).sum(axis=2)
    away = origins[:, None] - a
    with np.errstate(divide="ignore", invalid="ignore"):
        u = (across * away).sum(axis=2) / facing
        turned = np.cross(away, b - a)
        v = (turned * directions[:, None]).sum(axis=2) / facing
        distance = (turned * (c - a)).sum(axis=2) / facing
    is_hit = (facing > 1e-12) & (u >= 0) & (v >= 0) & (u + v <= 1) & (distance > 0)
    return np.where(is_hit, distance, np.inf)


def found_by_cast(fans, triangles):
    hits = cast(fans, triangles)
    distance = np.full((len(fans.origin), fans.count), np.inf)
    distance[hits.fan, hits.ray] = hits.distance
    return hits, distance.ravel()


@pytest.mark.parametrize("seed", range(5))
def test_each_ray_stops_at_the_first_triangle_that_faces_it(seed):
    rng = np.random.default_rng(seed)
    triangles = rng.normal(scale=4, size=(60, 3, 3))
    around = rng.normal(size=(25, 3))
    fans = fans_at(30 * around / np.linalg.norm(around, axis=1, keepdims=True), rng)
    hits, found = found_by_cast(fans, triangles)
    expected = first_hits(*rays_of(fans), triangles).min(axis=1)
    assert np.isfinite(expected).sum() > 100
    assert_allclose(found, expected, rtol=1e-9)
    assert_allclose(np.linalg.norm(hits.direction, axis=1), 1)


def test_the_tower_hides_what_stands_behind_it():
    rng = np.random.default_rng(1)
    fans = fans_at(np.array([[40.0, 3, 30], [-30, 20, 50], [5, -38, 9], [3, 4, 110]]), rng)
    triangles = build_tower().triangles
    _, found = found_by_cast(fans, triangles)
    expected = first_hits(*rays_of(fans), triangles).min(axis=1)
    assert_allclose(found, expected, rtol=1e-9)


def test_nothing_is_seen_from_behind():
    floor = np.array([[[-9.0, -9, 0], [9, -9, 0], [0, 9, 0]]])
    rng = np.random.default_rng(2)
    above, below = np.array([[0.0, 0, 5]]), np.array([[0.0, 0, -5]])
    assert len(cast(fans_at(above, rng), floor).ray)
    assert not len(cast(fans_at(below, rng), floor).ray)


def test_no_ray_slips_between_triangles_or_is_counted_twice():
    # A floor cut in strips, whose edges the rays of the middle fan run along exactly.
    x = np.linspace(-10, 10, 41)
    quads = [
        [[(a, -10, 0), (b, -10, 0), (b, 10, 0)], [(a, -10, 0), (b, 10, 0), (a, 10, 0)]]
        for a, b in pairwise(x)
    ]
    way = np.linspace(-2, 2, 9)
    fans = Fans(
        np.column_stack([way, np.zeros(9), np.full(9, 5.0)]),
        np.tile([0.0, 0, -1], (9, 1)),
        np.tile([0.0, 1, 0], (9, 1)),
        np.full(9, -0.8),
        0.01,
        160,
    )
    hits = cast(fans, np.array(quads, float).reshape(-1, 3, 3))
    assert len(hits.ray) == 9 * 160
    assert len(np.unique(hits.fan * 160 + hits.ray)) == 9 * 160
