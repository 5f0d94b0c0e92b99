"""Where a click meant to land: the point, a centroid, a summit, or the corner of three planes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from trigpoint.errors import TrigpointError
from trigpoint.similarity import Points

Mode = Literal["point", "centroid", "highest", "corner"]

Vector = NDArray[np.float64]
Place = tuple[Vector, float]  # where, and one standard deviation along each axis

# Points around a place that say how rough and how dense the cloud is there.
AROUND = 24
# Clicks a hand could as well have made: what they move a snap by is part of its sigma.
STARTS = 6
# Points a plane needs, in number and as a share of those within the radius.
FEWEST, LEAST = 20, 0.05
# Points and triples of them that planes are looked for with.
SAMPLE, TRIPLES = 3000, 400
# Planes closer in direction than this are one plane, or a step.
APART = np.cos(np.radians(20))
# Volume of the parallelepiped of three normals: below it the corner is drawn out along an edge.
FLAT = 0.2
# A corner known worse than this part of the radius is no corner.
VAGUE = 10


class SnapError(TrigpointError, ValueError):
    """There is nothing of that kind to snap to around the click."""

    code = "snap"


@dataclass(frozen=True, slots=True, eq=False)
class Snap:
    """Where a pick came to lie.

    Attributes
    ----------
    xyz : ndarray of shape (3,)
        In the coordinates of the points given.
    sigma : float
        One standard deviation along each axis, in the same units.
    note : str
        What was done, for the pair's note; empty for the point itself.
    """

    xyz: Vector
    sigma: float
    note: str


def snap(
    points: Points, at: Vector, mode: Mode, radius: float, *, up: Vector | None = None
) -> Snap:
    """Refine a click.

    The sigma joins what the fit itself leaves open with how far the result moves when the click
    falls on one of the points beside it instead: a centroid on a bare wall follows the click, the
    corner of three planes does not.

    Parameters
    ----------
    points : ndarray of shape (n, 3)
        Those within twice the radius of the click, at least; the clicked one among them.
    at : ndarray of shape (3,)
        The clicked point.
    mode : str
        "point", "centroid", "highest" or "corner".
    radius : float
        How far around the click to look, in the units of the points.
    up : ndarray of shape (3,), optional
        Where up is; by default along z.

    Raises
    ------
    SnapError
        If there is nothing of that kind within the radius.
    """
    if not radius > 0:
        message = f"The snap's radius is {radius:g}; it must be above zero."
        raise SnapError(message)
    local = np.asarray(points, np.float64) - at
    if mode == "point":
        return Snap(np.array(at, np.float64), _grain(local, np.zeros(3)), "")
    towards = np.array([0.0, 0.0, 1.0]) if up is None else np.asarray(up, np.float64)
    works: dict[Mode, Callable[[Vector], Place]] = {
        "centroid": lambda start: _centroid(local, start, radius),
        "highest": lambda start: _highest(local, start, radius, towards / np.linalg.norm(towards)),
        "corner": lambda start: _corner(local, start, radius),
    }
    work = works[mode]
    place, formal = work(np.zeros(3))
    moved = [
        there - place for start in _beside(local) if (there := _tried(work, start)) is not None
    ]
    scatter = float(np.sqrt(np.mean(np.square(moved)))) if moved else 0.0
    count = int((np.linalg.norm(local, axis=1) <= radius).sum())
    what = {"centroid": "centroid", "highest": "highest point", "corner": "corner of three planes"}
    note = f"{what[mode]} within {radius:g}, of {count} points"
    return Snap(place + at, float(np.hypot(formal, scatter)), note)


def _tried(work: Callable[[Vector], Place], start: Vector) -> Vector | None:
    try:
        return work(start)[0]
    except SnapError:
        return None


def _beside(local: Points) -> Points:
    """Return the points nearest to the click, without the clicked one."""
    distance = np.linalg.norm(local, axis=1)
    starts: Points = local[np.argsort(distance, kind="stable")[1 : 1 + STARTS]]
    return starts


def _within(local: Points, start: Vector, radius: float, *, fewest: int) -> Points:
    near: Points = local[((local - start) ** 2).sum(axis=1) <= radius**2]
    if len(near) < fewest:
        message = (
            f"Only {len(near)} points lie within {radius:g} of the click, and {fewest} are "
            f"needed: take a larger radius."
        )
        raise SnapError(message)
    return near


def _spread(points: Points) -> tuple[Vector, Vector, NDArray[np.float64]]:
    """Return the mean, the variances along the principal axes (falling), and those axes as rows."""
    mean: Vector = points.mean(axis=0)
    centred = points - mean
    _, singular, axes = np.linalg.svd(centred, full_matrices=False)
    return mean, singular**2 / len(points), axes


def _texture(local: Points, at: Vector) -> tuple[float, float]:
    """Return the distance between neighbours, and the scatter across the surface, at a place."""
    distance = np.linalg.norm(local - at, axis=1)
    nearest = np.argsort(distance, kind="stable")[:AROUND]
    if len(nearest) < 4:
        reach = float(distance[nearest].max(initial=0))
        return reach, reach
    spacing = float(distance[nearest].max() * np.sqrt(np.pi / len(nearest)))
    _, variances, _ = _spread(local[nearest])
    return spacing, float(np.sqrt(variances[2] * len(nearest) / (len(nearest) - 3)))


def _grain(local: Points, at: Vector) -> float:
    """Sigma of a place known to the nearest point: half a cell along the surface, noise across."""
    spacing, roughness = _texture(local, at)
    return float(np.sqrt((2 * spacing**2 / 12 + roughness**2) / 3))


def _centroid(local: Points, start: Vector, radius: float) -> Place:
    near = _within(local, start, radius, fewest=4)
    mean, variances, _ = _spread(near)
    return mean, float(np.sqrt(variances.sum() / 3 / len(near)))


def _highest(local: Points, start: Vector, radius: float, up: Vector) -> Place:
    near = _within(local, start, radius, fewest=AROUND)
    spacing, _ = _texture(local, start)
    height = near @ up
    for top in np.argsort(-height, kind="stable"):
        # A point with none beside it is a flyer, not a summit.
        if (np.linalg.norm(near - near[top], axis=1) <= 4 * spacing).sum() > 3:
            break
    else:
        message = f"No point within {radius:g} of the click has others beside it."
        raise SnapError(message)
    if np.linalg.norm(near[top] - start) > 0.9 * radius:
        message = (
            f"The cloud is highest at the edge of the radius of {radius:g}, so the summit lies "
            f"beyond it: click nearer to the top, or take a larger radius."
        )
        raise SnapError(message)
    # Whatever comes within the noise of the top could as well have been it: on a flat roof, much.
    _, roughness = _texture(near, near[top])
    below = np.sort(height[top] - height)
    rivals = near[height[top] - height <= max(2 * roughness, below[3])]
    rivals = rivals[(rivals - near[top]) @ up <= 0]
    across = rivals - near[top]
    across = across - np.outer(across @ up, up)
    return near[top], float(np.sqrt((np.mean((across**2).sum(axis=1)) + roughness**2) / 3))


def _corner(local: Points, start: Vector, radius: float) -> Place:
    near = _within(local, start, radius, fewest=3 * FEWEST)
    planes = _planes(near, radius)
    normals = np.array([normal for normal, _, _ in planes])
    volume = abs(float(np.linalg.det(normals)))
    if volume < FLAT:
        message = (
            f"The three planes within {radius:g} of the click nearly share one line: they meet in "
            f"no sharp corner."
        )
        raise SnapError(message)
    place = np.linalg.solve(normals, [offset for _, offset, _ in planes])
    if (away := float(np.linalg.norm(place - start))) > radius:
        message = (
            f"The three planes meet {away:.3g} from the click, outside the radius of {radius:g}: "
            f"click nearer to the corner."
        )
        raise SnapError(message)
    variances = [_variance(members, place) for _, _, members in planes]
    back = np.linalg.inv(normals)
    sigma = float(np.sqrt(np.einsum("ij,j,ij->", back, variances, back) / 3))
    if sigma > radius / VAGUE:
        message = (
            f"Three planes within {radius:g} of the click pin their corner down only to "
            f"{sigma:.2g}: the cloud is too rough or too thin here."
        )
        raise SnapError(message)
    return place, sigma


def _variance(members: Points, place: Vector) -> float:
    """Return the variance of a fitted plane's offset at a place, which may lie at its rim."""
    mean, variances, axes = _spread(members)
    lever = axes[:2] @ (place - mean)
    count = len(members)
    across = variances[2] * count / (count - 3)
    return float(across / count * (1 + (lever**2 / variances[:2]).sum()))


Plane = tuple[Vector, float, Points]  # unit normal, offset, and the points it was fitted to


def _planes(near: Points, radius: float) -> list[Plane]:
    """Find three planes of different directions, and fit each to its own points."""
    rng = np.random.default_rng(0)
    sample = near if len(near) <= SAMPLE else near[rng.choice(len(near), SAMPLE, replace=False)]
    band = 3 * _noise(sample, radius)
    found: list[Plane] = []
    left = sample
    for which in ("first", "second", "third"):
        plane = _largest(left, band, [normal for normal, _, _ in found], rng)
        if plane is None or len(plane[2]) < max(FEWEST, LEAST * len(sample)):
            message = (
                f"There is no {which} plane within {radius:g} of the click: a corner needs three "
                f"that differ by 20 degrees and more."
            )
            raise SnapError(message)
        found.append(plane)
        left = left[np.abs(left @ plane[0] - plane[1]) > band]
    for _ in range(3):
        away = np.array([np.abs(near @ normal - offset) for normal, offset, _ in found])
        inside = away <= band
        # Where two planes meet a point may be of either, and would pull both out of true.
        parts = [near[inside[k] & (inside.sum(axis=0) == 1)] for k in range(3)]
        if min(map(len, parts)) < FEWEST:
            message = f"The planes within {radius:g} of the click are too small to be fitted."
            raise SnapError(message)
        found = [_fitted(part) for part in parts]
        band = 3 * max(float(np.sqrt(_spread(part)[1][2])) for part in parts) + 1e-9 * radius
    return found


def _noise(sample: Points, radius: float) -> float:
    """Return the scatter across the surfaces: that of small patches, most of which hold no edge."""
    rng = np.random.default_rng(1)
    centres = sample[rng.choice(len(sample), min(len(sample), 60), replace=False)]
    size = min(len(sample), max(AROUND, len(sample) // 15))
    across = []
    for centre in centres:
        distance = ((sample - centre) ** 2).sum(axis=1)
        patch = sample[np.argpartition(distance, size - 1)[:size]]
        across.append(np.sqrt(_spread(patch)[1][2] * size / (size - 3)))
    return float(np.clip(np.quantile(across, 0.4), 1e-4 * radius, radius / 8))


def _largest(
    points: Points, band: float, others: list[Vector], rng: np.random.Generator
) -> Plane | None:
    """Find the plane through three of the points that most of them lie in."""
    if len(points) < FEWEST:
        return None
    corners = points[rng.integers(0, len(points), (TRIPLES, 3))]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = np.linalg.norm(normals, axis=1)
    usable = length > band**2
    normals = normals / np.where(usable, length, 1)[:, None]
    for other in others:
        usable &= np.abs(normals @ other) < APART
    if not usable.any():
        return None
    normals, corners = normals[usable], corners[usable]
    offsets = (normals * corners[:, 0]).sum(axis=1)
    # Near points count more (MSAC): counted alike, a slanting cut through two faces wins.
    square = ((points @ normals.T - offsets) / band) ** 2
    best = int(np.argmax(np.maximum(1 - square, 0).sum(axis=0)))
    members = points[square[:, best] <= 1]
    for _ in range(3):
        if len(members) < FEWEST:
            return None
        normal, offset, _ = _fitted(members)
        members = points[np.abs(points @ normal - offset) <= band]
    return _fitted(members) if len(members) >= FEWEST else None


def _fitted(members: Points) -> Plane:
    mean, _, axes = _spread(members)
    return axes[2], float(axes[2] @ mean), members
