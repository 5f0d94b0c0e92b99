"""Simulated sensors: an airborne scanner, a camera, and two reconstructions from its photographs.

What is cast at a time does not grow with the density asked for: above 1 the scanner flies again and
the camera goes round again, so clouds of any size come in pieces.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import pyproj
from numpy.random import Generator, SeedSequence, default_rng
from numpy.typing import NDArray
from scipy.special import ndtr

from trigpoint.clocktower import GROUND, MATERIALS, SITE, Tower
from trigpoint.cloud import PointCloud
from trigpoint.scanning import Fans, Hits, cast
from trigpoint.similarity import Points, Similarity

CRS = pyproj.CRS.from_epsg(32615)
LASER, CAMERA = 1, 2  # random streams of a seed; `synthetic` has the others

# Flight lines over the tower: direction anticlockwise from east, distance aside, height above
# ground; degrees and metres.
# They cross, so that a line looks at each side of the tower.
FLIGHTS = (
    (17.0, -44.0, 112.0),
    (17.0, 48.0, 115.0),
    (107.0, -46.0, 110.0),
    (107.0, 43.0, 113.0),
)
SCAN_TILTS = (-10.0, 0.0, 10.0)  # degrees fore and aft of the scanner's three channels
SCAN_REACH = 50.0  # degrees to each side
SCAN_SPACING = 0.25  # metres on the ground, of each channel at density 1
SPEED = 8.0
START = 4.6e8  # GPS time less 1e9 seconds, as LAS counts it
RANGE_NOISE, STRIP_OFFSET = 0.015, 0.010  # metres, one sigma
FAR = 60.0  # from the tower to where a line begins

# Orbits of the camera: height, radius, number of photographs; metres.
ORBITS = ((9.0, 36.0, 12), (33.0, 33.0, 12), (62.0, 30.0, 12))
PIXEL = 0.0045  # radians at density 1
# Points that a photograph yields on a square metre that it faces, at density 1.
NEURAL, PHOTOGRAMMETRY = 5.8, 7.8
GRAZING = 0.2  # cosine below which a surface yields no more points for being seen aslant

# What a radiance field gets wrong: the share of its points that are fog about a surface, the depth
# of the fog, the noise in depth and in place and the waves of the others, metres.
FOG, FOG_DEPTH, DEPTH_NOISE, NOISE, WAVES = 0.06, 0.14, 0.045, 0.02, 0.05
FLOATERS, FLOATING = 0.004, 0.8  # share of the points, and how far in front of a surface
MATCHING_NOISE = 0.015
CONTROL_OFFSET = np.array([0.012, -0.015, 0.020])  # what the photographs' ground control got wrong
SUN = np.array([-0.45, -0.60, 0.66])


@dataclass(frozen=True, slots=True, eq=False)
class Photograph:
    """What the pixels of a photograph show, those of the sky left out.

    Attributes
    ----------
    points : ndarray of shape (n, 3)
        Metres from `SITE`.
    direction : ndarray of shape (n, 3)
        Unit vectors away from the camera.
    triangle : ndarray of shape (n,)
    facing : ndarray of shape (n,)
        Cosine of the angle of incidence.
    area : ndarray of shape (n,)
        Square metres of surface in a pixel of density 1; at most five times what they look like.
    is_steady : ndarray of shape (n,)
        Whether the window about the pixel is found again in another photograph.
    """

    points: Points
    direction: Points
    triangle: NDArray[np.intp]
    facing: NDArray[np.float64]
    area: NDArray[np.float64]
    is_steady: NDArray[np.bool_]


def generator(seed: int, *stream: int) -> Generator:
    """Return a generator for one of the independent random streams of a seed."""
    return default_rng(SeedSequence(seed, spawn_key=stream))


def strips(tower: Tower, density: float, *, seed: int) -> Iterator[PointCloud]:
    """Scan the tower from the air, a channel of a flight line at a time.

    Parameters
    ----------
    tower : Tower
    density : float
        At 1, about 140 points on a square metre of open ground.
    seed : int

    Yields
    ------
    PointCloud
        First returns: intensity, classification (2 ground, 6 building), gps_time, point_source_id.
    """
    passes, density = _passes(density)
    for lap in range(passes):
        for number, flight in enumerate(FLIGHTS, start=lap * len(FLIGHTS) + 1):
            rng = generator(seed, LASER, number)
            offset = rng.normal(0, STRIP_OFFSET, 3)
            for tilt in SCAN_TILTS:
                yield _strip(tower, flight, number, np.radians(tilt), offset, density, rng)


def photographs(tower: Tower, density: float, *, seed: int) -> Iterator[Photograph]:
    """Photograph the tower from three orbits, one after the other.

    Parameters
    ----------
    tower : Tower
    density : float
        Pixels, times those at 1.
    seed : int
    """
    passes, density = _passes(density)
    pixel = PIXEL / np.sqrt(density)
    for lap in range(passes):
        for orbit, (height, radius, number) in enumerate(ORBITS):
            rng = generator(seed, CAMERA, lap, orbit)
            start = rng.uniform(0, 2 * np.pi)
            for place in start + 2 * np.pi * np.arange(number) / number:
                camera = np.array([radius * np.cos(place), radius * np.sin(place), height])
                yield _photograph(tower, camera, place + np.pi, pixel, rng)


def photogrammetry(tower: Tower, photograph: Photograph, rng: Generator) -> PointCloud:
    """Match a photograph with its neighbours.

    Edges against the sky, thin things, what is seen aslant and patches of plain surfaces are lost;
    the rest is accurate.
    """
    plain = _of(tower, "plain")[photograph.triangle]
    expected = np.where(
        photograph.is_steady & (photograph.facing > 0.25), PHOTOGRAMMETRY * photograph.area, 0.0
    )
    chosen = np.flatnonzero(rng.random(len(expected)) < expected)
    chosen = chosen[_pattern(photograph.points[chosen], 3) > plain[chosen]]
    points = photograph.points[chosen] + CONTROL_OFFSET + rng.normal(0, 0.005, (len(chosen), 3))
    points += rng.normal(0, MATCHING_NOISE, (len(chosen), 1)) * photograph.direction[chosen]
    colours = _colours(tower, photograph, chosen, rng)
    attributes = {name: v.astype(np.uint16) * np.uint16(257) for name, v in colours.items()}
    return PointCloud(points, SITE.copy(), attributes, CRS)


def radiance(
    tower: Tower, photograph: Photograph, neural_from_target: Similarity, rng: Generator
) -> PointCloud:
    """Take points from a radiance field at the pixels of a photograph, in the field's own frame.

    Nothing that was seen is missing, but depth is noisier, wavy, foggy in places, and a few points
    float in front of what they show. Coordinates are rounded to float32, as nerfstudio exports.
    """
    expected = np.where(photograph.facing > 0.08, NEURAL * photograph.area, 0.0)
    chosen = np.flatnonzero(rng.random(len(expected)) < expected)
    spread = np.where(rng.random(len(chosen)) < FOG, FOG_DEPTH, DEPTH_NOISE)
    depth = rng.normal(0, 1, len(chosen)) * spread
    depth += WAVES * (_pattern(photograph.points[chosen], 5) - 0.5)
    points = photograph.points[chosen] + depth[:, None] * photograph.direction[chosen]
    points += rng.normal(0, NOISE, points.shape)
    floats = np.flatnonzero(rng.random(len(chosen)) < FLOATERS)
    lift = rng.exponential(FLOATING, (len(floats), 1))
    points[floats] -= lift * photograph.direction[chosen[floats]]
    attributes = _colours(tower, photograph, chosen, rng)
    for values in attributes.values():
        values[floats] = rng.integers(120, 220, len(floats))
    local = neural_from_target(points + SITE).astype(np.float32).astype(np.float64)
    return PointCloud(local, np.zeros(3), attributes)


def _passes(density: float) -> tuple[int, float]:
    if not 0 < density < np.inf:
        message = f"density {density} must be a number above zero."
        raise ValueError(message)
    passes = int(np.ceil(density))
    return passes, density / passes


def _strip(
    tower: Tower,
    flight: tuple[float, float, float],
    number: int,
    tilt: float,
    offset: NDArray[np.float64],
    density: float,
    rng: Generator,
) -> PointCloud:
    azimuth, aside, height = flight
    spacing = SCAN_SPACING / np.sqrt(density)
    along, across = _bearing(azimuth), _bearing(azimuth + 90.0)
    reach = FAR + height * np.tan(abs(tilt))
    # Begun anywhere: a plane of rays that runs along a wall exactly would meet it nowhere.
    way = np.arange(-reach, reach, spacing) + rng.uniform(0, spacing)
    origin = way[:, None] * along + aside * across + [0.0, 0.0, height]
    down = np.sin(tilt) * along - [0.0, 0.0, np.cos(tilt)]
    step = spacing / height
    first = rng.uniform(0, step, len(way)) - np.radians(SCAN_REACH)
    count = int(2 * np.radians(SCAN_REACH) / step)
    hits = cast(
        Fans(
            origin,
            np.broadcast_to(down, origin.shape),
            np.broadcast_to(across, origin.shape),
            first,
            step,
            count,
        ),
        tower.triangles,
    )
    facing = _facing(tower, hits)
    # A glancing pulse returns too little to be seen.
    kept = facing > 0.05
    fan, triangle, facing = hits.fan[kept], hits.triangle[kept], facing[kept]
    distance = hits.distance[kept] + rng.normal(0, RANGE_NOISE, len(fan))
    points = origin[fan] + distance[:, None] * hits.direction[kept] + offset
    returned = _of(tower, "reflectance")[triangle] * (0.25 + 0.75 * facing)
    returned *= rng.normal(1, 0.06, len(fan))
    is_ground = np.isin(tower.material, GROUND)[triangle]
    attributes: dict[str, NDArray[np.generic]] = {
        "intensity": np.clip(returned * 60_000, 0, 65_535).astype(np.uint16),
        "classification": np.where(is_ground, 2, 6).astype(np.uint8),
        "gps_time": START + 120.0 * number + (way[fan] + hits.ray[kept] / count * spacing) / SPEED,
        "point_source_id": np.full(len(fan), number, np.uint16),
    }
    return PointCloud(points, SITE.copy(), attributes, CRS)


def _photograph(
    tower: Tower, camera: NDArray[np.float64], heading: float, pixel: float, rng: Generator
) -> Photograph:
    turn = np.arange(-0.72, 0.72, pixel) + rng.uniform(0, pixel) + heading
    forward = np.column_stack([np.cos(turn), np.sin(turn), np.zeros(len(turn))])
    fans = Fans(
        np.broadcast_to(camera, forward.shape),
        forward,
        np.broadcast_to([0.0, 0.0, 1.0], forward.shape),
        np.full(len(turn), -1.25) + rng.uniform(0, pixel, len(turn)),
        pixel,
        int(2.3 / pixel),
    )
    hits = cast(fans, tower.triangles)
    facing = _facing(tower, hits)
    return Photograph(
        camera + hits.distance[:, None] * hits.direction,
        hits.direction,
        hits.triangle,
        facing,
        (PIXEL * hits.distance) ** 2 / np.maximum(facing, GRAZING),
        _steady(hits, (len(turn), fans.count)),
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


def _bearing(degrees: float) -> NDArray[np.float64]:
    turn = np.radians(degrees)
    return np.array([np.cos(turn), np.sin(turn), 0.0])


def _facing(tower: Tower, hits: Hits) -> NDArray[np.float64]:
    """Return the cosine of the angle between each ray and the normal of what it meets."""
    facing: NDArray[np.float64] = np.einsum(
        "ki,ki->k", -hits.direction, tower.normals[hits.triangle]
    )
    return facing


def _of(tower: Tower, what: str) -> NDArray[np.float64]:
    """Return a property of each triangle's material."""
    names, position = np.unique(tower.material, return_inverse=True)
    return np.array([getattr(MATERIALS[str(name)], what) for name in names], np.float64)[position]


def _pattern(points: Points, seed: int) -> NDArray[np.float64]:
    """Return a smooth pattern over the site, in patches of a metre or so, even from 0 to 1."""
    rng = default_rng(seed)
    waves = rng.normal(size=(24, 3))
    waves *= (2 * np.pi / rng.uniform(1.5, 5.0, 24) / np.linalg.norm(waves, axis=1))[:, None]
    x, y, z = points.T
    total = np.zeros(len(points))
    for wave, phase in zip(waves, rng.uniform(0, 2 * np.pi, 24), strict=True):
        total += np.sin(x * wave[0] + y * wave[1] + z * wave[2] + phase)
    return np.asarray(ndtr(total / np.sqrt(12.0)), np.float64)


def _colours(
    tower: Tower, photograph: Photograph, chosen: NDArray[np.intp], rng: Generator
) -> dict[str, NDArray[np.uint8]]:
    triangle = photograph.triangle[chosen]
    lit = np.clip(np.einsum("mi,i->m", tower.normals, SUN), 0, 1)[triangle]
    shade = (0.55 + 0.45 * lit) * rng.normal(1, 0.05, len(chosen))
    values = np.clip(_of(tower, "colour")[triangle] * shade[:, None], 0, 255).astype(np.uint8)
    return {name: values[:, i] for i, name in enumerate(("red", "green", "blue"))}
