"""Steering: where a camera goes for a drag, for the wheel, and for a place to be seen."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from trigpoint_panel.camera import Camera, Position
from trigpoint_panel.mouse import Drag

# Degrees for a drag across the height of the view, and zoom for a step of the wheel.
TURN, WHEEL = 180.0, 1.15
# Height of what is seen where the view has flown to, as a share of what it is where all is seen.
NEAR = 0.2
# The same where one is to recognise the place; and the turns from which it may be free to be seen.
AROUND = 0.7
TURNS = tuple((side, up) for up in (0, 30) for side in (0, 45, -45, 90, -90, 135, -135, 180))


def dragged(camera: Camera, drag: Drag, right: float, down: float) -> Camera:
    """Return the camera after a drag, of so many heights of the view."""
    if drag == "roll":
        return camera.rolled(TURN / 2 * right)
    if drag == "turn":
        return camera.orbited(-TURN * right, TURN * down)
    return camera.panned(-right, down)


def wheeled(camera: Camera, steps: float, right: float, upward: float) -> Camera:
    """Return the camera after steps of the wheel, so many heights of the view off its middle."""
    return camera.zoomed(WHEEL**steps, np.asarray(camera.panned(right, upward).focal_point))


def flown(camera: Camera, xyz: Position, extent: float) -> Camera:
    """Return the camera that looks at a place of a cloud from near enough to pick there."""
    height = min(camera.height, NEAR * extent)
    return camera.looking_at(np.asarray(xyz, np.float64), height)


def lookouts(camera: Camera, xyz: Position, extent: float) -> Iterator[Camera]:
    """Yield cameras that see a place of a cloud with what is around it, the least turned first."""
    straight = camera.looking_at(np.asarray(xyz, np.float64), AROUND * extent)
    for sideways, upward in TURNS:
        yield straight.orbited(sideways, upward)
