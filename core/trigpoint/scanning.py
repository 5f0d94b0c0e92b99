"""Rays in fans cast on triangles: what a simulated sensor sees first."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from trigpoint.similarity import Points


@dataclass(frozen=True, slots=True, eq=False)
class Fans:
    """Rays in planes: a scanner's lines along a flight, or a photograph's columns.

    Ray `j` of fan `i` leaves ``origin[i]`` along ``cos(a) forward[i] + sin(a) aside[i]`` with
    ``a = first[i] + j * step``.

    Attributes
    ----------
    origin, forward, aside : ndarray of shape (n, 3)
        `forward` and `aside` are orthogonal unit vectors.
    first : ndarray of shape (n,)
        Radians, each within a half turn of `forward`.
    step : float
        Radians.
    count : int
        Rays in a fan.
    """

    origin: Points
    forward: Points
    aside: Points
    first: NDArray[np.float64]
    step: float
    count: int


@dataclass(frozen=True, slots=True, eq=False)
class Hits:
    """Where rays meet their first triangle, ordered by fan and ray.

    Attributes
    ----------
    fan, ray, triangle : ndarray of shape (k,)
        Positions in what was cast.
    distance : ndarray of shape (k,)
        Along the ray.
    direction : ndarray of shape (k, 3)
        Unit vectors, away from the sensor.
    """

    fan: NDArray[np.intp]
    ray: NDArray[np.intp]
    triangle: NDArray[np.intp]
    distance: NDArray[np.float64]
    direction: Points


def cast(fans: Fans, triangles: NDArray[np.float64]) -> Hits:
    """Find the first triangle that each ray meets from its front.

    A fan's plane cuts a triangle in a segment, so the rays that meet it are one run: no ray is
    tested against a triangle that it misses.

    Parameters
    ----------
    fans : Fans
    triangles : ndarray of shape (m, 3, 3)
        Corners, counterclockwise seen from outside. None may reach round behind a sensor further
        than a half turn from where its fans begin.
    """
    corner = triangles[:, 0]
    outward = np.cross(triangles[:, 1] - corner, triangles[:, 2] - corner)
    plane = np.cross(fans.forward, fans.aside)
    side = np.einsum("ni,vmi->vnm", plane, np.ascontiguousarray(triangles.swapaxes(0, 1)))
    side -= np.einsum("ni,ni->n", plane, fans.origin)[:, None]
    clearance = np.einsum("ni,mi->nm", fans.origin, outward)
    clearance -= np.einsum("mi,mi->m", corner, outward)
    is_cut = (side.min(axis=0) < 0) & (side.max(axis=0) >= 0) & (clearance > 0)

    fan, triangle = np.nonzero(is_cut)
    side, clearance = side[:, fan, triangle].T, clearance[fan, triangle]
    ends = _segment(side, triangles[triangle] - fans.origin[fan, None])
    angle = np.arctan2(
        np.einsum("kei,ki->ke", ends, fans.aside[fan]),
        np.einsum("kei,ki->ke", ends, fans.forward[fan]),
    )
    # Half-open, so that a ray through an edge that two triangles share meets one of them.
    bounds = np.ceil((np.sort(angle, axis=1) - fans.first[fan, None]) / fans.step)
    start, stop = np.clip(bounds, 0, fans.count).astype(np.intp).T
    length = stop - start
    piece = np.repeat(np.arange(len(fan)), length)
    ray = np.arange(len(piece)) + np.repeat(start - (np.cumsum(length) - length), length)

    fan, triangle = fan[piece], triangle[piece]
    at = (fans.first[fan] + ray * fans.step)[:, None]
    direction = np.cos(at) * fans.forward[fan] + np.sin(at) * fans.aside[fan]
    distance = -clearance[piece] / np.einsum("ki,ki->k", direction, outward[triangle])
    order = np.lexsort([distance, ray, fan])
    same = (np.diff(fan[order]) == 0) & (np.diff(ray[order]) == 0)
    nearest = order[np.concatenate([[True], ~same])] if len(order) else order
    return Hits(
        fan[nearest], ray[nearest], triangle[nearest], distance[nearest], direction[nearest]
    )


def _segment(side: NDArray[np.float64], corners: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the two ends, shape (k, 2, 3), of what a plane cuts out of each triangle."""
    is_behind = side < 0
    lone = np.where(is_behind.sum(axis=1) == 1, is_behind.argmax(axis=1), is_behind.argmin(axis=1))
    row = np.arange(len(side))
    near, far = corners[row, lone], side[row, lone]
    ends = []
    for other in ((lone + 1) % 3, (lone + 2) % 3):
        share = far / (far - side[row, other])
        ends.append(near + share[:, None] * (corners[row, other] - near))
    return np.stack(ends, axis=1)
