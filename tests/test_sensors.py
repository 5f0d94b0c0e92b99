from itertools import pairwise

import numpy as np
import pytest
from numpy.testing import assert_allclose

from trigpoint import sensors
from trigpoint.clocktower import SITE, TURN_DEG, build_tower
from trigpoint.cloud import concatenate
from trigpoint.similarity import Similarity

SEED = 42
# A neural frame that is the site's own, so that its points can be looked at.
HOME = Similarity(1.0, np.eye(3), -SITE)


@pytest.fixture(scope="module")
def tower():
    return build_tower()


@pytest.fixture(scope="module")
def flown(tower):
    """Nine strips, three of each flight line, at full density."""
    return list(sensors.strips(tower, 1.0, seed=SEED))


@pytest.fixture
def exact_strips(tower, monkeypatch):
    """The same of a scanner that makes no errors, at a tenth of the density."""
    monkeypatch.setattr(sensors, "RANGE_NOISE", 0.0)
    monkeypatch.setattr(sensors, "STRIP_OFFSET", 0.0)
    return [cloud.xyz for cloud in sensors.strips(tower, 0.1, seed=SEED)]


@pytest.fixture(scope="module")
def pictured(tower):
    """Both reconstructions at full density, in metres from the site."""
    matched, radiant = [], []
    for photograph in sensors.photographs(tower, 1.0, seed=SEED):
        rng = np.random.default_rng(len(matched))
        matched.append(sensors.photogrammetry(tower, photograph, rng))
        radiant.append(sensors.radiance(tower, photograph, HOME, rng))
    return concatenate(matched).xyz, concatenate(radiant).xyz


def in_tower_axes(points):
    c, s = np.cos(np.radians(TURN_DEG)), np.sin(np.radians(TURN_DEG))
    x, y = points[:, 0], points[:, 1]
    return np.column_stack([c * x + s * y, c * y - s * x, points[:, 2]])


def on_wall(points, side, *, low, high, half=3.5):
    """Which points lie on one wall of the shaft, in tower axes, between its corner piers."""
    axis, sign = {"e": (0, 1), "w": (0, -1), "n": (1, 1), "s": (1, -1)}[side]
    out, along, up = points[:, axis] * sign, points[:, 1 - axis], points[:, 2]
    return (np.abs(out - 5) < 0.15) & (np.abs(along) < half) & (up > low) & (up < high)


def distances(points, triangles):
    """Distances, shape (n,), from points to the nearest of some triangles."""
    a, b, c = np.moveaxis(triangles, 1, 0)
    normal = np.cross(b - a, c - a)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    away = points[:, None] - a
    height = (away * normal).sum(axis=2)
    inside = np.ones(height.shape, bool)
    nearest = np.full(height.shape, np.inf)
    for p, q in ((a, b), (b, c), (c, a)):
        edge = q - p
        from_p = points[:, None] - p
        inside &= (np.cross(edge, from_p) * normal).sum(axis=2) >= 0
        share = np.clip((from_p * edge).sum(axis=2) / (edge**2).sum(axis=1), 0, 1)
        gap = from_p - share[..., None] * edge
        nearest = np.minimum(nearest, (gap**2).sum(axis=2))
    return np.sqrt(np.where(inside, height**2, nearest).min(axis=1))


def sample(points, count, seed=0):
    return points[np.random.default_rng(seed).choice(len(points), count, replace=False)]


def test_an_exact_scanner_measures_the_surface(tower, exact_strips):
    for points in exact_strips:
        assert distances(sample(points, 100), tower.triangles).max() < 1e-9


def test_a_scanner_in_the_air_sees_nothing_that_faces_down(tower, exact_strips):
    soffits = tower.triangles[tower.normals[:, 2] < -1e-9]
    assert len(soffits) > 20
    for points in exact_strips:
        low = points[points[:, 2] > 5]
        assert distances(sample(low, 300), soffits).min() > 1e-9


def test_every_return_has_a_free_line_to_the_aircraft(tower, exact_strips):
    a, b, c = np.moveaxis(tower.triangles, 1, 0)
    ways = [(flight, np.radians(tilt)) for flight in sensors.FLIGHTS for tilt in sensors.SCAN_TILTS]
    for points, ((azimuth, aside, height), tilt) in zip(exact_strips, ways, strict=True):
        points = sample(points, 150)
        turn = np.radians(azimuth)
        along = np.array([np.cos(turn), np.sin(turn), 0])
        # The plane that the channel scans in says where along its way the aircraft was.
        way = points @ along - (height - points[:, 2]) * np.tan(tilt)
        aircraft = way[:, None] * along + aside * np.array([-np.sin(turn), np.cos(turn), 0])
        aircraft[:, 2] = height
        ray = (points - aircraft)[:, None]
        across = np.cross(ray, c - a)
        facing = (across * (b - a)).sum(axis=2)
        turned = np.cross(aircraft[:, None] - a, b - a)
        with np.errstate(divide="ignore", invalid="ignore"):
            u = (across * (aircraft[:, None] - a)).sum(axis=2) / facing
            v = (turned * ray).sum(axis=2) / facing
            distance = (turned * (c - a)).sum(axis=2) / facing
            is_met = (u > 0) & (v > 0) & (u + v < 1) & (distance > 0)
        is_between = is_met & (distance < 1 - 1e-6)
        assert not is_between.any()


def test_lidar_errs_by_its_range_noise_and_strip_offset(tower, flown):
    points = np.concatenate([sample(cloud.xyz, 60) for cloud in flown])
    error = distances(points, tower.triangles)
    assert 0.008 < np.sqrt((error**2).mean()) < 0.025
    assert error.max() < 0.08


def test_facades_are_sparse_and_ground_and_roof_are_dense(flown):
    points = in_tower_axes(np.concatenate([cloud.xyz for cloud in flown]))
    x, y, z = points.T
    ground = ((np.abs(x + 13) < 3) & (np.abs(y) < 10) & (z < 0.5)).sum() / 120
    facade = sum(on_wall(points, side, low=20, high=23.5).sum() for side in "ewns") / (4 * 24.5)
    roof_area = 2 * (2 * 5.35 + 2 * 1.7) * np.hypot(5.35 - 1.7, 8.5)
    roof = ((z > 37.1) & (z < 45.4)).sum() / roof_area
    assert 100 < ground < 200
    assert roof > 60
    assert facade < ground / 4


def test_crossing_lines_scan_every_side_of_the_tower(flown):
    points = in_tower_axes(np.concatenate([cloud.xyz for cloud in flown]))
    counts = [on_wall(points, side, low=20, high=23.5).sum() for side in "ewns"]
    assert max(counts) < 1.5 * min(counts)


def test_ground_is_classified_as_ground_and_the_rest_as_building(flown):
    for cloud in flown:
        is_ground = cloud.attributes["classification"] == 2
        assert cloud.xyz[is_ground, 2].max() < 0.2
        assert set(np.unique(cloud.attributes["classification"])) == {2, 6}


def test_strips_say_when_and_on_which_line_they_were_flown(flown):
    lines = [np.unique(cloud.attributes["point_source_id"]).tolist() for cloud in flown]
    assert lines == [[line] for line in (1, 2, 3, 4) for _ in sensors.SCAN_TILTS]
    times = [cloud.attributes["gps_time"] for cloud in flown]
    for one, after in pairwise(times[:: len(sensors.SCAN_TILTS)]):
        assert one.max() < after.min()


def test_strips_do_not_depend_on_where_reading_stops(tower, flown):
    again = next(sensors.strips(tower, 1.0, seed=SEED))
    assert_allclose(again.xyz, flown[0].xyz, rtol=0, atol=0)


def test_the_lower_building_hides_the_wall_behind_it(flown, pictured):
    matched, radiant = (in_tower_axes(points) for points in pictured)
    scanned = in_tower_axes(np.concatenate([cloud.xyz for cloud in flown]))
    assert not on_wall(matched, "e", low=2, high=4, half=2.0).any()
    assert on_wall(matched, "w", low=2, high=4, half=2.0).sum() > 500
    hidden, open_ = (on_wall(radiant, side, low=2, high=4, half=2.0).sum() for side in "ew")
    assert hidden < open_ / 3
    # Behind it is only what comes down the gap, not what would come through the building.
    x, y, z = scanned.T
    assert not ((x > 8) & (x < 17.5) & (np.abs(y) < 7) & (z < 8)).any()


def test_photogrammetry_loses_what_is_thin_or_plain(flown, pictured):
    matched, radiant = (in_tower_axes(points) for points in pictured)
    scanned = in_tower_axes(np.concatenate([cloud.xyz for cloud in flown]))

    def spire(points):
        return ((np.hypot(points[:, 0], points[:, 1]) < 0.5) & (points[:, 2] > 53)).sum()

    def columns(points):
        return ((np.abs(points[:, :2]).max(axis=1) < 2) & (np.abs(points[:, 2] - 47.4) < 1)).sum()

    def dials(points):
        face = np.abs(np.abs(points[:, :2]).max(axis=1) - 4.72) < 0.1
        plan = np.abs(points[:, :2]).min(axis=1)
        return (face & (np.hypot(plan, points[:, 2] - 30.5) < 1.8)).sum()

    assert spire(scanned) > 100
    assert spire(radiant) > 400
    assert spire(matched) == 0
    assert columns(matched) < 0.2 * columns(radiant)
    assert dials(matched) < 0.3 * dials(radiant)


def test_photogrammetry_is_the_more_accurate_and_neural_points_float(tower, pictured):
    matched_points, radiant_points = pictured
    matched = distances(sample(matched_points, 800), tower.triangles)
    radiant = distances(sample(radiant_points, 800), tower.triangles)
    assert np.sqrt((matched**2).mean()) == pytest.approx(0.02, abs=0.005)
    assert not (matched > 0.5).any()
    near = radiant < 0.5
    assert np.sqrt((radiant[near] ** 2).mean()) == pytest.approx(0.04, abs=0.01)
    # Of the few that float, a share floats further out than this.
    parts = np.array_split(sample(radiant_points, 4_000, seed=1), 8)
    floating = np.concatenate([distances(part, tower.triangles) for part in parts]) > 0.5
    assert 0.001 < floating.mean() < 0.004


@pytest.mark.parametrize("density", [0.0, -1.0, np.inf, np.nan])
def test_a_density_that_makes_no_points_is_refused(tower, density):
    with pytest.raises(ValueError, match="must be a number above zero"):
        next(sensors.strips(tower, density, seed=SEED))
