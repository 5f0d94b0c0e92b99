"""Framing: how large a cloud is, and the camera that sees all of it, strays left out."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from trigpoint_panel.camera import Camera

# Tails left out when a view is fitted to its cloud: a few flyers would push the camera far away.
STRAY = 0.5
# Points that stand for all of them.
SAMPLE = 50_000
# Of a fitted picture, a little stays free around the cloud.
MARGIN = 1.06


def extent_of(local: NDArray[Any]) -> float:
    """Return the size of a cloud, shape (n, 3), from corner to corner."""
    low, high = np.percentile(_sample(local), [STRAY, 100 - STRAY], axis=0)
    return max(float(np.linalg.norm(high - low)), 1e-9)


def framed(
    camera: Camera, local: NDArray[Any], origin: NDArray[np.float64], size: tuple[int, int]
) -> Camera:
    """Return the camera that looks the same way and sees a whole cloud.

    Parameters
    ----------
    camera : Camera
    local : ndarray of shape (n, 3)
        At least one point.
    origin : ndarray of shape (3,)
        What they count about.
    size : tuple of int
        Width and height of the picture.
    """
    width, height = size
    ahead = np.subtract(camera.focal_point, camera.position)
    ahead /= np.linalg.norm(ahead)
    right = np.cross(ahead, camera.up)
    right /= np.linalg.norm(right)
    axes = np.array([right, np.cross(right, ahead), ahead])
    along = _sample(local).astype(np.float64) @ axes.T
    low, high = np.percentile(along, [STRAY, 100 - STRAY], axis=0)
    reach = 0.2 * (high - low) + 1e-9
    along = along[((along >= low - reach) & (along <= high + reach)).all(axis=1)]
    middle = (along.min(axis=0) + along.max(axis=0)) / 2
    wide, tall, deep = (along - middle).T
    half = np.maximum(np.abs(tall), np.abs(wide) * height / width)
    if not camera.parallel:
        # What is nearer than the middle looks larger.
        half = half - deep * np.tan(np.radians(camera.view_angle / 2))
    needed = 2 * MARGIN * max(float(half.max()), 1e-6)
    return camera.looking_at(origin + middle @ axes, needed)


def _sample(local: NDArray[Any]) -> NDArray[Any]:
    return local[:: max(1, len(local) // SAMPLE)]
