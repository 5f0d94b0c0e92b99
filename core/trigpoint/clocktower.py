"""The clock tower as triangles: what the simulated sensors look at."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from trigpoint.similarity import Points

# Where the tower's foot stands in EPSG:32615, metres, and how far it is turned from the grid.
SITE = np.array([741_012.0, 4_279_063.0, 152.0])
TURN_DEG = 17.0


class Material(NamedTuple):
    """What a surface looks like: colour, share of light returned, share too plain to match."""

    colour: tuple[int, int, int]
    reflectance: float
    plain: float


MATERIALS = {
    "lawn": Material((104, 122, 74), 0.45, 0.02),
    "paving": Material((158, 152, 142), 0.35, 0.05),
    "brick": Material((154, 92, 70), 0.40, 0.04),
    "limestone": Material((206, 194, 168), 0.60, 0.08),
    "glass": Material((52, 60, 70), 0.08, 0.85),
    "dial": Material((238, 234, 222), 0.70, 0.97),
    "slate": Material((88, 94, 104), 0.18, 0.50),
    "copper": Material((112, 156, 138), 0.30, 0.45),
    "gilding": Material((206, 168, 72), 0.55, 0.60),
    "iron": Material((62, 62, 66), 0.15, 0.90),
}
GROUND = ("lawn", "paving")


@dataclass(frozen=True, slots=True, eq=False)
class Tower:
    """A site as triangles, in metres east, north and up of `SITE`.

    Attributes
    ----------
    triangles : ndarray of shape (m, 3, 3)
        Corners, counterclockwise seen from outside.
    normals : ndarray of shape (m, 3)
        Outward unit vectors.
    material : ndarray of shape (m,)
        Names out of `MATERIALS`.
    corners : dict of str to ndarray of shape (3,)
        Structural points that a person could pick.
    """

    triangles: NDArray[np.float64]
    normals: NDArray[np.float64]
    material: NDArray[np.str_]
    corners: dict[str, NDArray[np.float64]]


def build_tower() -> Tower:
    """Build the tower, the lower building east of it, and the ground."""
    parts = [
        *_ground(),
        *_shaft(),
        *_clock_stage(),
        *_crown(),
        *_lower_building(),
    ]
    triangles = _turned(np.concatenate([triangles for _, triangles in parts]))
    a, b, c = np.moveaxis(triangles, 1, 0)
    normals = np.cross(b - a, c - a)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    material = np.repeat([name for name, _ in parts], [len(triangles) for _, triangles in parts])
    corners = {name: _turned(np.array(place)) for name, place in CORNERS.items()}
    return Tower(triangles, normals, material, corners)


# Half widths and heights of the tower's parts, metres.
PLINTH, PLINTH_TOP = 5.35, 1.8
WALL = 5.0
COURSES = ((12.0, 12.5), (24.0, 24.6))
COURSE = 5.25
PIER, PIER_HALF = 4.55, 0.6
RECESS, RECESS_LOW, RECESS_HIGH, RECESS_DEPTH = 2.3, 28.2, 32.8, 0.40
DIAL = 2.0
WALL_TOP, CORNICE, CORNICE_TOP = 36.0, 5.65, 37.0
EAVE, ROOF_TOP, ROOF_WIDTH = 5.35, 45.5, 1.7
LANTERN_TOP, LANTERN_ROOF_TOP = 49.0, 52.5
SPIRE_TOP = 60.0

CORNERS = {
    "plinth-sw": (-PLINTH, -PLINTH, PLINTH_TOP),
    "plinth-nw": (-PLINTH, PLINTH, PLINTH_TOP),
    "course1-se": (COURSE, -COURSE, COURSES[0][1]),
    "course2-nw": (-COURSE, COURSE, COURSES[1][1]),
    "course2-ne": (COURSE, COURSE, COURSES[1][1]),
    "clock-s": (-RECESS, -WALL, RECESS_LOW),
    "clock-n": (-RECESS, WALL, RECESS_HIGH),
    "cornice-ne": (CORNICE, CORNICE, CORNICE_TOP),
    "cornice-sw": (-CORNICE, -CORNICE, CORNICE_TOP),
    "roof-se": (ROOF_WIDTH, -ROOF_WIDTH, ROOF_TOP),
}

Part = tuple[str, NDArray[np.float64]]


def _ground() -> list[Part]:
    west, east, south, north = -20.0, 22.0, -19.0, 19.0
    lawn = _quad((west, south, 0), (east, south, 0), (east, north, 0), (west, north, 0))
    w = 9.0
    paving = _quad((-w, -w, 0.04), (w, -w, 0.04), (w, w, 0.04), (-w, w, 0.04))
    return [("lawn", lawn), ("paving", paving)]


def _shaft() -> list[Part]:
    windows = [(-2.6, 3.6, -1.5, 6.6), (1.5, 3.6, 2.6, 6.6)]
    middle = [(-2.6, 15.5, -1.5, 19.5), (1.5, 15.5, 2.6, 19.5)]
    parts: list[Part] = [
        ("limestone", _prism(PLINTH, 0.0, PLINTH, PLINTH_TOP)),
        ("limestone", _ring(PLINTH, WALL, PLINTH_TOP)),
    ]
    bottom = PLINTH_TOP
    for (low, high), holes in zip(COURSES, (windows, middle), strict=True):
        parts += _walls(bottom, low, holes, depth=0.30, back="glass")
        parts += _band(low, high, COURSE)
        bottom = high
    for x in (-PIER, PIER):
        for y in (-PIER, PIER):
            parts.append(("limestone", _box((x, y), PIER_HALF, PLINTH_TOP, WALL_TOP)))
    return parts


def _clock_stage() -> list[Part]:
    hole = (-RECESS, RECESS_LOW, RECESS, RECESS_HIGH)
    parts = _walls(COURSES[1][1], WALL_TOP, [hole], depth=RECESS_DEPTH, back="limestone")
    middle = (RECESS_LOW + RECESS_HIGH) / 2
    for turn in range(4):
        rim = _circle(DIAL, 32)
        # A dial stands a little proud of its recess, with hands as far in front of it.
        face = WALL - RECESS_DEPTH + 0.12
        at = np.column_stack([rim[:, 0], np.full(len(rim), -face), rim[:, 1] + middle])
        parts.append(("dial", _quarter(_cap(at), turn)))
        parts.append(("gilding", _quarter(_hand(0.09, 1.7, 0.35, middle, face + 0.06), turn)))
        parts.append(("gilding", _quarter(_hand(0.12, 1.2, 2.2, middle, face + 0.06), turn)))
    return [*parts, *_band(WALL_TOP, CORNICE_TOP, CORNICE)]


def _crown() -> list[Part]:
    lantern = 1.35
    parts: list[Part] = [
        ("slate", _prism(EAVE, CORNICE_TOP, ROOF_WIDTH, ROOF_TOP)),
        ("limestone", _cap(_square(ROOF_WIDTH, ROOF_TOP))),
        ("limestone", _frustum(_circle(lantern, 8), ROOF_TOP, ROOF_TOP + 0.7)),
        ("limestone", _cap(_at(_circle(lantern, 8), ROOF_TOP + 0.7))),
        ("limestone", _frustum(_circle(lantern + 0.1, 8), LANTERN_TOP - 0.4, LANTERN_TOP)),
        ("limestone", _cap(_at(_circle(lantern + 0.1, 8), LANTERN_TOP - 0.4))[:, ::-1]),
        ("copper", _frustum(_circle(lantern + 0.35, 16), LANTERN_TOP, LANTERN_ROOF_TOP, 0.12)),
        ("copper", _cap(_at(_circle(lantern + 0.35, 16), LANTERN_TOP))[:, ::-1]),
        ("gilding", _ball(0.38, LANTERN_ROOF_TOP + 0.3)),
        ("iron", _frustum(_circle(0.13, 8), LANTERN_ROOF_TOP + 0.5, SPIRE_TOP, 0.2)),
        ("gilding", _ball(0.22, 56.0)),
    ]
    for x, y in _circle(lantern - 0.15, 8):
        parts.append(("limestone", _box((x, y), 0.13, ROOF_TOP + 0.7, LANTERN_TOP - 0.4)))
    return parts


def _lower_building() -> list[Part]:
    west, east, south, north, eave, ridge = 7.2, 18.5, -8.0, 8.0, 9.5, 13.5
    middle, over = (west + east) / 2, 0.4
    a, b, c, d = (west, south), (east, south), (east, north), (west, north)
    sides = [
        _quad((*p, 0), (*q, 0), (*q, eave), (*p, eave)) for p, q in ((a, b), (b, c), (c, d), (d, a))
    ]
    gables = np.array(
        [
            [(*a, eave), (*b, eave), (middle, south, ridge)],
            [(*c, eave), (*d, eave), (middle, north, ridge)],
        ]
    )
    drop = over * (ridge - eave) / (middle - west)
    slopes = [
        _quad(
            (west - over, north + over, eave - drop),
            (west - over, south - over, eave - drop),
            (middle, south - over, ridge),
            (middle, north + over, ridge),
        ),
        _quad(
            (east + over, south - over, eave - drop),
            (east + over, north + over, eave - drop),
            (middle, north + over, ridge),
            (middle, south - over, ridge),
        ),
    ]
    thickness = np.array([0.0, 0.0, 0.05])
    soffits = [slope[:, ::-1] - thickness for slope in slopes]
    rims = [slope[[0, 0, 0, 1], [0, 1, 2, 2]] for slope in slopes]
    fascias = [_mantle(rim - thickness, rim) for rim in rims]
    return [
        ("brick", np.concatenate([*sides, gables])),
        ("slate", np.concatenate(slopes)),
        ("limestone", np.concatenate([*soffits, *fascias])),
    ]


def _walls(
    low: float,
    high: float,
    holes: list[tuple[float, float, float, float]],
    *,
    depth: float,
    back: str,
) -> list[Part]:
    """Build four brick walls with the same recesses, whose reveals are limestone."""
    cuts_x = sorted({-WALL, WALL, *(x for hole in holes for x in hole[::2])})
    cuts_z = sorted({low, high, *(z for hole in holes for z in hole[1::2])})
    panels, reveals, backs = [], [], []
    for x0, x1 in pairwise(cuts_x):
        for z0, z1 in pairwise(cuts_z):
            is_hole = any(a <= x0 < c and b <= z0 < d for a, b, c, d in holes)
            if not is_hole:
                panels.append(_upright(x0, x1, z0, z1, -WALL))
    for a, b, c, d in holes:
        y0, y1 = -WALL, -WALL + depth
        backs.append(_upright(a, c, b, d, y1))
        reveals += [
            _quad((a, y0, b), (c, y0, b), (c, y1, b), (a, y1, b)),
            _quad((a, y1, d), (c, y1, d), (c, y0, d), (a, y0, d)),
            _quad((a, y0, b), (a, y1, b), (a, y1, d), (a, y0, d)),
            _quad((c, y1, b), (c, y0, b), (c, y0, d), (c, y1, d)),
        ]
    parts = []
    for name, pieces in (("brick", panels), ("limestone", reveals), (back, backs)):
        parts += [(name, _quarter(np.concatenate(pieces), turn)) for turn in range(4)]
    return parts


def _band(low: float, high: float, half: float) -> list[Part]:
    """Run a string course or cornice round the shaft: front, top and underside."""
    return [
        ("limestone", _prism(half, low, half, high)),
        ("limestone", _ring(half, WALL - 1.0, high)),
        ("limestone", _ring(half, WALL - 1.0, low)[:, ::-1]),
    ]


def _quad(a: ArrayLike, b: ArrayLike, c: ArrayLike, d: ArrayLike) -> NDArray[np.float64]:
    return np.array([[a, b, c], [a, c, d]], np.float64)


def _upright(x0: float, x1: float, z0: float, z1: float, y: float) -> NDArray[np.float64]:
    return _quad((x0, y, z0), (x1, y, z0), (x1, y, z1), (x0, y, z1))


def _square(half: float, z: float, at: tuple[float, float] = (0.0, 0.0)) -> Points:
    x, y = at
    return np.array(
        [
            (x - half, y - half, z),
            (x + half, y - half, z),
            (x + half, y + half, z),
            (x - half, y + half, z),
        ]
    )


def _circle(radius: float, sides: int) -> NDArray[np.float64]:
    angle = 2 * np.pi * (np.arange(sides) + 0.5) / sides
    return radius * np.column_stack([np.cos(angle), np.sin(angle)])


def _at(plan: NDArray[np.float64], z: float) -> Points:
    return np.column_stack([plan, np.full(len(plan), z)])


def _mantle(low: Points, high: Points) -> NDArray[np.float64]:
    """Quads between two rings of the same number of corners."""
    rings = zip(low, np.roll(low, -1, 0), np.roll(high, -1, 0), high, strict=True)
    return np.concatenate([_quad(*corners) for corners in rings])


def _prism(half_low: float, low: float, half_high: float, high: float) -> NDArray[np.float64]:
    return _mantle(_square(half_low, low), _square(half_high, high))


def _ring(half: float, inner: float, z: float) -> NDArray[np.float64]:
    return _mantle(_square(half, z), _square(inner, z))


def _frustum(
    plan: NDArray[np.float64], low: float, high: float, taper: float = 1.0
) -> NDArray[np.float64]:
    return _mantle(_at(plan, low), _at(plan * taper, high))


def _cap(ring: Points) -> NDArray[np.float64]:
    after = np.roll(ring, -1, 0)
    centre = np.broadcast_to(ring.mean(axis=0), ring.shape)
    return np.stack([ring, after, centre], axis=1)


def _box(at: tuple[float, float], half: float, low: float, high: float) -> NDArray[np.float64]:
    bottom, top = _square(half, low, at), _square(half, high, at)
    return np.concatenate([_mantle(bottom, top), _cap(top)])


def _ball(radius: float, z: float) -> NDArray[np.float64]:
    tilts = np.radians([-80.0, -40.0, 0.0, 40.0, 80.0])
    rings = [_at(_circle(radius * np.cos(t), 8), z + radius * np.sin(t)) for t in tilts]
    return np.concatenate([_mantle(low, high) for low, high in pairwise(rings)])


def _hand(half: float, reach: float, angle: float, middle: float, y: float) -> NDArray[np.float64]:
    along = np.array([np.sin(angle), np.cos(angle)]) * reach
    aside = np.array([np.cos(angle), -np.sin(angle)]) * half
    ring = [-aside, aside, along + aside * 0.3, along - aside * 0.3]
    return _quad(*[(x, -y, z + middle) for x, z in ring])


def _quarter(triangles: NDArray[np.float64], turns: int) -> NDArray[np.float64]:
    """Turn by quarters about the tower's axis: south, east, north, west."""
    for _ in range(turns):
        triangles = np.stack([-triangles[..., 1], triangles[..., 0], triangles[..., 2]], axis=-1)
    return triangles


def _turned(places: NDArray[np.float64]) -> NDArray[np.float64]:
    c, s = np.cos(np.radians(TURN_DEG)), np.sin(np.radians(TURN_DEG))
    x, y = places[..., 0], places[..., 1]
    return np.stack([c * x - s * y, s * x + c * y, places[..., 2]], axis=-1)
