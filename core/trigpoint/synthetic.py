"""A scene with known truth: the clock tower, three simulated sensors and the picks between them."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pyproj
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation
from scipy.special import ndtr

from trigpoint.canonical import write_text
from trigpoint.clocktower import GROUND, MATERIALS, SITE, Tower, build_tower
from trigpoint.cloud import PointCloud
from trigpoint.files import write
from trigpoint.picks import Picks, picks_from, write_picks
from trigpoint.scanning import Fans, Hits, cast
from trigpoint.similarity import Points, Similarity
from trigpoint.starter import project_text

EPSG = 32615
SCALE = 3.260  # metres per unit of the neural frame
NEURAL, PHOTOGRAMMETRY = 500_000, 400_000  # points at density 1

CONTROL = ("plinth-sw", "course1-se", "course2-nw", "clock-s", "cornice-ne", "roof-se")
CHECK = ("plinth-nw", "course2-ne", "clock-n", "cornice-sw")
PICK_SOURCE = 0.0215  # one sigma per axis: units of the neural frame
PICK_TARGET = 0.070  # and metres


@dataclass(frozen=True, slots=True, eq=False)
class Scene:
    """What the sensors saw, what was picked, and the truth.

    Attributes
    ----------
    reference : PointCloud
        Airborne LiDAR in EPSG:32615.
    neural : PointCloud
        In its own frame, its coordinates rounded to float32 as nerfstudio exports them.
    photogrammetry : PointCloud
        In EPSG:32615.
    picks : Picks
        Six control and four check picks.
    truth : Similarity
        Maps the neural frame to EPSG:32615.
    corners : dict of str to ndarray of shape (3,)
        True places of the picks in EPSG:32615, by id.
    """

    reference: PointCloud
    neural: PointCloud
    photogrammetry: PointCloud
    picks: Picks
    truth: Similarity
    corners: dict[str, NDArray[np.float64]]


def clock_tower(
    *, seed: int = 42, density: float = 1.0, blunders: Mapping[str, ArrayLike] | None = None
) -> Scene:
    """Simulate the clock tower.

    Parameters
    ----------
    seed : int
        Of everything random; the same seed gives the same bytes.
    density : float
        Times the default number of points of every cloud.
    blunders : mapping of str to array_like of shape (3,), optional
        Pick ids, and how far the target of each is wrong, metres.

    Returns
    -------
    Scene
    """
    tower = build_tower()
    streams = np.random.SeedSequence(seed).spawn(5)
    frame, laser, photos, neural, picked = (np.random.default_rng(s) for s in streams)
    truth = _truth(frame)
    corners = {name: SITE + tower.corners[name] for name in (*CONTROL, *CHECK)}
    views = _photographs(tower, photos, density)
    return Scene(
        _lidar(tower, laser, density),
        _neural(tower, views, truth, neural, round(NEURAL * density)),
        _photogrammetry(tower, views, photos, round(PHOTOGRAMMETRY * density)),
        _picks(corners, truth, picked, blunders or {}),
        truth,
        corners,
    )


def write_project(folder: str | Path, scene: Scene) -> Path:
    """Write a scene as a project to audit, over one that is there, and return its project.toml.

    Beside the project's own files ``truth.json`` holds the similarity that the audit should find.
    """
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    write(folder / "lidar.laz", scene.reference)
    write(folder / "nerf.ply", scene.neural)
    write(folder / "sfm.laz", scene.photogrammetry)
    write_picks(folder / "picks.csv", scene.picks)
    write_text(folder / "truth.json", _truth_json(scene.truth))
    project = folder / "project.toml"
    write_text(project, project_text(PROJECT))
    return project


PROJECT = {
    'id = "my-building"': 'id = "tower"',
    'title = ""': 'title = "Clock tower"',
    'site = ""': 'site = "A simulated campus in EPSG:32615"',
    'purpose = ""': 'purpose = "Demonstration on simulated data whose truth is known"',
    "# date = 2026-09-21": "date = 2026-09-21",
    'path = "reference.laz"': 'path = "lidar.laz"',
    'crs = ""': f'crs = "EPSG:{EPSG}"',
    "# accuracy_m = 0.05": "accuracy_m = 0.05",
    'accuracy_source = ""': 'accuracy_source = "simulated: range noise and strip offsets"',
    "# [[reconstruction]]": "[[reconstruction]]",
    '# name = "sfm"': 'name = "sfm"',
    '# kind = "photogrammetry"': 'kind = "photogrammetry"',
    '# path = "sfm.laz"': 'path = "sfm.laz"',
}

# Flight lines over the tower: azimuth, distance aside, height above ground; degrees and metres.
FLIGHTS = ((17.0, -38.0, 118.0), (17.0, 42.0, 121.0), (107.0, 6.0, 116.0))
SCAN_TILTS = (-10.0, 0.0, 10.0)  # degrees fore and aft of the scanner's three channels
SCAN_SPACING = 0.16  # metres on the ground at density 1
SPEED = 8.0
RANGE_NOISE, STRIP_OFFSET = 0.015, 0.010

# Orbits of the camera: height, radius, number of photographs; metres.
ORBITS = ((9.0, 36.0, 12), (33.0, 33.0, 12), (62.0, 30.0, 12))
PIXEL = 0.0045  # radians at density 1
FAR = 60.0


@dataclass(frozen=True, slots=True, eq=False)
class _Views:
    """What all photographs show: points on surfaces, with what a reconstruction makes of them."""

    points: Points
    direction: Points
    triangle: NDArray[np.intp]
    facing: NDArray[np.float64]
    weight: NDArray[np.float64]
    is_steady: NDArray[np.bool_]


def _truth(rng: np.random.Generator) -> Similarity:
    rotation = Rotation.from_quat(rng.normal(size=4)).as_matrix()
    centre = np.array([[1.3, -0.9, 2.1]]) + rng.normal(0, 0.5, (1, 3))
    about = Similarity(SCALE, rotation, np.zeros(3))
    return Similarity(SCALE, rotation, SITE + [0, 0, 25.0] - about(centre)[0])


def _lidar(tower: Tower, rng: np.random.Generator, density: float) -> PointCloud:
    spacing = SCAN_SPACING / np.sqrt(density)
    strips = []
    for number, (azimuth, aside, height) in enumerate(FLIGHTS, start=1):
        along = _bearing(azimuth)
        across = _bearing(azimuth + 90.0)
        offset = rng.normal(0, STRIP_OFFSET, 3)
        for tilt in np.radians(SCAN_TILTS):
            reach = FAR + height * np.tan(abs(tilt))
            way = np.arange(-reach, reach, spacing)
            origin = way[:, None] * along + aside * across + [0.0, 0.0, height]
            step = spacing / height
            count = int(np.radians(100.0) / step)
            down = np.cos(tilt) * np.array([0.0, 0.0, -1.0]) + np.sin(tilt) * along
            fans = Fans(
                origin,
                np.broadcast_to(down, origin.shape),
                np.broadcast_to(across, origin.shape),
                -np.radians(50.0) + rng.uniform(0, step, len(way)),
                step,
                count,
            )
            hits = cast(fans, tower.triangles)
            facing = _facing(tower, hits)
            kept = facing > 0.05
            noise = rng.normal(0, RANGE_NOISE, len(facing))
            points = origin[hits.fan] + (hits.distance + noise)[:, None] * hits.direction + offset
            time = 4.6e8 + 120.0 * number + (way[hits.fan] + hits.ray / count * spacing) / SPEED
            name = tower.material[hits.triangle]
            reflectance = _of_materials(name, "reflectance")
            share = reflectance * (0.25 + 0.75 * facing) * rng.normal(1, 0.06, len(facing))
            strips.append(
                {
                    "points": points[kept],
                    "intensity": np.clip(share * 60_000, 0, 65_535).astype(np.uint16)[kept],
                    "classification": np.where(np.isin(name, GROUND), 2, 6).astype(np.uint8)[kept],
                    "gps_time": time[kept],
                    "point_source_id": np.full(kept.sum(), number, np.uint16),
                }
            )
    joined = {name: np.concatenate([strip[name] for strip in strips]) for name in strips[0]}
    return PointCloud(joined.pop("points"), SITE.copy(), joined, pyproj.CRS.from_epsg(EPSG))


def _photographs(tower: Tower, rng: np.random.Generator, density: float) -> _Views:
    pixel = PIXEL / np.sqrt(density)
    views = []
    for height, radius, number in ORBITS:
        start = rng.uniform(0, 2 * np.pi)
        for place in start + 2 * np.pi * np.arange(number) / number:
            camera = np.array([radius * np.cos(place), radius * np.sin(place), height])
            turn = np.arange(-0.72, 0.72, pixel) + rng.uniform(0, pixel) + place + np.pi
            forward = np.column_stack([np.cos(turn), np.sin(turn), np.zeros(len(turn))])
            first = np.full(len(turn), -1.25) + rng.uniform(0, pixel, len(turn))
            up = np.broadcast_to([0.0, 0.0, 1.0], forward.shape)
            origin = np.broadcast_to(camera, forward.shape)
            fans = Fans(origin, forward, up, first, pixel, int(2.3 / pixel))
            hits = cast(fans, tower.triangles)
            facing = _facing(tower, hits)
            views.append(
                _Views(
                    camera + hits.distance[:, None] * hits.direction,
                    hits.direction,
                    hits.triangle,
                    facing,
                    hits.distance**2 / np.maximum(facing, 0.2),
                    _steady(hits, (len(turn), fans.count)),
                )
            )
    return _Views(
        *(
            np.concatenate([getattr(view, name) for view in views])
            for name in ("points", "direction", "triangle", "facing", "weight", "is_steady")
        )
    )


def _steady(
    hits: Hits, shape: tuple[int, int], *, reach: int = 2, jump: float = 0.4
) -> NDArray[np.bool_]:
    """Tell which rays have a window about them that a matcher finds again in another photograph.

    There is sky or a jump in depth in the window of the others.
    """
    depth = np.full((shape[0] + 2 * reach, shape[1] + 2 * reach), np.inf)
    i, j = hits.fan + reach, hits.ray + reach
    depth[i, j] = hits.distance
    is_steady = np.ones(len(i), np.bool_)
    for di, dj in ((reach, 0), (0, reach), (1, 1), (1, -1)):
        # Across a slope the two sides cancel; across an edge they do not.
        bend = depth[i + di, j + dj] + depth[i - di, j - dj] - 2 * hits.distance
        is_steady &= np.abs(bend) < jump
    return is_steady


def _photogrammetry(
    tower: Tower, views: _Views, rng: np.random.Generator, count: int
) -> PointCloud:
    name = tower.material[views.triangle]
    is_matched = views.is_steady & (views.facing > 0.25)
    is_matched &= _pattern(views.points, 3) > _of_materials(name, "plain")
    chosen = _drawn(rng, np.where(is_matched, views.weight, 0.0), count)
    noise = rng.normal(0, 0.015, (len(chosen), 1)) * views.direction[chosen]
    noise += rng.normal(0, 0.005, (len(chosen), 3))
    points = views.points[chosen] + noise + [0.012, -0.015, 0.020]
    colours = _colours(tower, views, chosen, rng)
    attributes = {c: v.astype(np.uint16) * np.uint16(257) for c, v in colours.items()}
    return PointCloud(points, SITE.copy(), attributes, pyproj.CRS.from_epsg(EPSG))


def _neural(
    tower: Tower, views: _Views, truth: Similarity, rng: np.random.Generator, count: int
) -> PointCloud:
    floating = round(0.004 * count)
    chosen = _drawn(rng, np.where(views.facing > 0.08, views.weight, 0.0), count - floating)
    spread = np.where(rng.random(len(chosen)) < 0.06, 0.14, 0.035)
    depth = rng.normal(0, 1, len(chosen)) * spread + 0.05 * (
        _pattern(views.points[chosen], 5) - 0.5
    )
    points = views.points[chosen] + depth[:, None] * views.direction[chosen]
    points += rng.normal(0, 0.012, points.shape)
    points = np.concatenate([points, rng.uniform([-14, -14, 1], [14, 14, 62], (floating, 3))])
    colours = _colours(tower, views, chosen, rng)
    haze = rng.integers(120, 220, floating).astype(np.uint8)
    attributes = {c: np.concatenate([v, haze]) for c, v in colours.items()}
    local = truth.inverse()(points + SITE).astype(np.float32).astype(np.float64)
    return PointCloud(local, np.zeros(3), attributes)


def _picks(
    corners: Mapping[str, NDArray[np.float64]],
    truth: Similarity,
    rng: np.random.Generator,
    blunders: Mapping[str, ArrayLike],
) -> Picks:
    places = np.array(list(corners.values()))
    source = truth.inverse()(places) + rng.normal(0, PICK_SOURCE, places.shape)
    target = places + rng.normal(0, PICK_TARGET, places.shape)
    ids = list(corners)
    for name, error in blunders.items():
        target[ids.index(name)] += np.asarray(error, np.float64)
    n = len(ids)
    return picks_from(
        ids,
        source,
        target,
        roles=["control"] * len(CONTROL) + ["check"] * len(CHECK),
        sigma_source=np.full(n, PICK_SOURCE),
        sigma_target=np.full(n, PICK_TARGET),
    )


def _bearing(degrees: float) -> NDArray[np.float64]:
    turn = np.radians(degrees)
    return np.array([np.cos(turn), np.sin(turn), 0.0])


def _facing(tower: Tower, hits: Hits) -> NDArray[np.float64]:
    """Return the cosine of the angle between each ray and the normal of what it meets."""
    a, b, c = np.moveaxis(tower.triangles, 1, 0)
    normal = np.cross(b - a, c - a)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    return -np.einsum("ki,ki->k", hits.direction, normal[hits.triangle])


def _of_materials(names: NDArray[np.str_], what: str) -> NDArray[np.float64]:
    found, position = np.unique(names, return_inverse=True)
    return np.array([getattr(MATERIALS[str(name)], what) for name in found], np.float64)[position]


def _pattern(points: Points, seed: int) -> NDArray[np.float64]:
    """Return a smooth pattern over the site, in patches of a metre or so, even from 0 to 1."""
    rng = np.random.default_rng(seed)
    waves = rng.normal(size=(24, 3))
    waves *= (2 * np.pi / rng.uniform(1.5, 5.0, 24) / np.linalg.norm(waves, axis=1))[:, None]
    phases = rng.uniform(0, 2 * np.pi, 24)
    total = np.zeros(len(points))
    for wave, phase in zip(waves, phases, strict=True):
        total += np.sin(
            points[:, 0] * wave[0] + points[:, 1] * wave[1] + points[:, 2] * wave[2] + phase
        )

    return ndtr(total / np.sqrt(12.0))


def _drawn(rng: np.random.Generator, weight: NDArray[np.float64], count: int) -> NDArray[np.intp]:
    """Draw positions without repetition, in proportion to their weight."""
    with np.errstate(divide="ignore"):
        wait = rng.exponential(size=len(weight)) / weight
    count = min(count, int((weight > 0).sum()))
    return np.sort(np.argpartition(wait, count - 1)[:count])


def _colours(
    tower: Tower, views: _Views, chosen: NDArray[np.intp], rng: np.random.Generator
) -> dict[str, NDArray[np.uint8]]:
    triangle = views.triangle[chosen]
    a, b, c = np.moveaxis(tower.triangles, 1, 0)
    normal = np.cross(b - a, c - a)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    sun = np.array([-0.45, -0.60, 0.66])
    shade = 0.55 + 0.45 * np.clip(np.einsum("mi,i->m", normal, sun), 0, 1)[triangle]
    shade *= rng.normal(1, 0.05, len(chosen))
    tint = np.array([MATERIALS[str(name)].colour for name in tower.material])[triangle]
    values = np.clip(tint * shade[:, None], 0, 255).astype(np.uint8)
    return {name: values[:, i] for i, name in enumerate(("red", "green", "blue"))}


def _truth_json(truth: Similarity) -> str:

    return (
        json.dumps(
            {
                "scale": truth.scale,
                "rotation": truth.rotation.tolist(),
                "translation": truth.translation.tolist(),
            },
            indent=1,
        )
        + "\n"
    )
