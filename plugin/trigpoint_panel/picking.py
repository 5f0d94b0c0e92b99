"""Picking: a point of a scene, or what lies about it, as one half of a pair."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from trigpoint_panel.camera import Position
from trigpoint_panel.scene import Scene
from trigpoint_panel.snapping import Mode, snap

# Pixels around a pick that snaps look by default.
SNAP_REACH = 40.0


@dataclass(frozen=True, slots=True)
class Picked:
    """A pick in one view.

    Attributes
    ----------
    xyz : tuple of float
        Where it was snapped to: absolute, float64, in the cloud's frame.
    sigma : float
        One standard deviation along each axis, in the cloud's units.
    note : str
        How it was snapped and where the click was; empty where the point itself was taken.
    raw : tuple of float
        The clicked point of the cloud.
    """

    xyz: Position
    sigma: float
    note: str
    raw: Position


def pick(scene: Scene, row: int, mode: Mode, radius: float | None) -> Picked:
    """Pick a point of a scene, or what it is to be snapped to.

    Parameters
    ----------
    scene : Scene
    row : int
        Of the point that was clicked.
    mode : str
        What to snap to.
    radius : float or None
        How far around the click to look, in the cloud's units; None looks 40 pixels around.

    Raises
    ------
    SnapError
        If there is nothing to snap to.
    """
    raw = scene.coordinates(row)
    if radius is None:
        radius = SNAP_REACH * scene.pixel_at(row)
    around = scene.around(row, 2 * radius)
    found = snap(around, raw, mode, radius, up=np.asarray(scene.up, np.float64))
    clicked = ", ".join(f"{value:.3f}" for value in raw)
    note = f"{found.note}; clicked {clicked}" if found.note else ""
    return Picked(position_of(found.xyz), found.sigma, note, position_of(raw))


def position_of(values: NDArray[np.float64]) -> Position:
    """Return a place as plain numbers."""
    x, y, z = map(float, values)
    return x, y, z
