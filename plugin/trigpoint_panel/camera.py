"""Where a view is seen from, and how the mouse and a similarity move it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from trigpoint.picks import FARTHEST
from trigpoint.similarity import Similarity

Vector = NDArray[np.float64]
Position = tuple[float, float, float]
Face = Literal["front", "back", "left", "right", "top"]

# Where the camera stands for each face: to the east, to the north, up.
STANDS: dict[Face, Position] = {
    "front": (0.0, -1.0, 0.0),
    "back": (0.0, 1.0, 0.0),
    "left": (-1.0, 0.0, 0.0),
    "right": (1.0, 0.0, 0.0),
    # Not quite overhead, where north would no longer be up in the picture.
    "top": (0.0, -0.001, 1.0),
}
# From the south-west and above: two sides and the top of what stands upright.
CORNER: Position = (-0.55, -1.0, 0.45)
# Degrees that the line of sight keeps from the vertical.
POLE = 0.05


@dataclass(frozen=True, slots=True)
class Camera:
    """Where a view is seen from, in absolute coordinates of its cloud's frame.

    Attributes
    ----------
    position, focal_point : tuple of float
    up : tuple of float
        What stands upright in the picture.
    view_angle : float
        Degrees, from the bottom of the picture to its top.
    parallel : bool
        Parallel projection in place of perspective.
    parallel_scale : float
        Half the height of the picture in the cloud's units, where the projection is parallel.
    """

    position: Position
    focal_point: Position
    up: Position = (0.0, 0.0, 1.0)
    view_angle: float = 30.0
    parallel: bool = False
    parallel_scale: float = 1.0

    @property
    def is_sound(self) -> bool:
        """Whether a picture can be seen from there: finite, and up is not along the sight."""
        numbers = (*self.position, *self.focal_point, *self.up, self.parallel_scale)
        # NaN is not below anything either.
        if not all(abs(number) <= FARTHEST for number in numbers):
            return False
        ahead, up = np.subtract(self.focal_point, self.position), np.asarray(self.up)
        least = 1e-9 * float(np.linalg.norm(ahead) * np.linalg.norm(up))
        across = float(np.linalg.norm(np.cross(ahead, up)))
        return across > least > 0 and 0 < self.view_angle < 180 and self.parallel_scale > 0

    @property
    def distance(self) -> float:
        """How far the focal point is."""
        return float(np.linalg.norm(np.subtract(self.focal_point, self.position)))

    @property
    def height(self) -> float:
        """Height of the picture at the focal point, in the cloud's units."""
        if self.parallel:
            return 2 * self.parallel_scale
        return float(2 * self.distance * np.tan(np.radians(self.view_angle / 2)))

    def through(self, similarity: Similarity) -> Camera:
        """Return the camera that sees the carried cloud as this one sees the cloud itself."""
        ends = similarity(np.array([self.position, self.focal_point]))
        return replace(
            self,
            position=_position(ends[0]),
            focal_point=_position(ends[1]),
            up=_position(similarity.turn(np.array([self.up]))[0]),
            parallel_scale=similarity.scale * self.parallel_scale,
        )

    def orbited(self, sideways: float, upward: float) -> Camera:
        """Turn about the focal point, in degrees; what is upright stays upright."""
        arm = np.subtract(self.position, self.focal_point)
        up = np.asarray(self.up) / np.linalg.norm(self.up)
        rise = np.degrees(np.arccos(np.clip(arm @ up / np.linalg.norm(arm), -1, 1)))
        lowered = np.clip(rise - upward, POLE, 180 - POLE) - rise
        side = np.cross(up, arm)
        side /= np.linalg.norm(side)
        turn = Rotation.from_rotvec(np.radians(sideways) * up)
        lift = Rotation.from_rotvec(np.radians(lowered) * side)
        return replace(self, position=_position(self.focal_point + (turn * lift).apply(arm)))

    def rolled(self, degrees: float) -> Camera:
        """Turn about the line of sight, which changes what is upright."""
        ahead = np.subtract(self.focal_point, self.position)
        side = np.cross(ahead, self.up)
        above = np.cross(side, ahead)
        turn = Rotation.from_rotvec(np.radians(degrees) * ahead / np.linalg.norm(ahead))
        return replace(self, up=_position(turn.apply(above / np.linalg.norm(above))))

    def panned(self, right: float, upward: float) -> Camera:
        """Move sideways and upwards, in heights of the picture."""
        ahead = np.subtract(self.focal_point, self.position)
        side = np.cross(ahead, self.up)
        side /= np.linalg.norm(side)
        above = np.cross(side, ahead) / np.linalg.norm(ahead)
        step = self.height * (right * side + upward * above)
        return self.moved(step)

    def moved(self, step: Vector) -> Camera:
        """Move without turning, by a vector."""
        return replace(
            self,
            position=_position(np.add(self.position, step)),
            focal_point=_position(np.add(self.focal_point, step)),
        )

    def zoomed(self, factor: float, about: Vector | None = None) -> Camera:
        """Come nearer by a factor, to a place that keeps its place in the picture."""
        centre = np.asarray(self.focal_point if about is None else about)
        position, focal_point = np.asarray(self.position), np.asarray(self.focal_point)
        return replace(
            self,
            position=_position(centre + (position - centre) / factor),
            focal_point=_position(centre + (focal_point - centre) / factor),
            parallel_scale=self.parallel_scale / factor,
        )

    def looking_at(self, place: Vector, height: float) -> Camera:
        """Look at a place from the same side, with a picture so high there."""
        ahead = np.subtract(self.focal_point, self.position)
        ahead /= np.linalg.norm(ahead)
        away = height / (2 * np.tan(np.radians(self.view_angle / 2)))
        return replace(
            self,
            position=_position(place - away * ahead),
            focal_point=_position(place),
            parallel_scale=height / 2,
        )

    def facing(self, face: Face, up: Position) -> Camera:
        """Look at the focal point straight from one side of what stands upright, or from above."""
        turned = camera_from(STANDS[face], up, np.asarray(self.focal_point), 1.0)
        return replace(turned, parallel=self.parallel)

    def projected(self, parallel: bool) -> Camera:
        """Switch between parallel and perspective projection; the picture keeps its size."""
        if parallel == self.parallel:
            return self
        switched = replace(self, parallel=parallel, parallel_scale=self.height / 2)
        return (
            switched if parallel else switched.looking_at(np.asarray(self.focal_point), self.height)
        )


def kept_camera(kept: Any) -> Camera | None:
    """Return the camera that a session's file holds; None if it holds none that is of use."""
    try:
        position, focal_point, up = (
            _position(np.array([float(number) for number in kept[name]]))
            for name in ("position", "focal_point", "up")
        )
        angle, half = float(kept["view_angle"]), float(kept["parallel_scale"])
        camera = Camera(position, focal_point, up, angle, kept["parallel"] is True, half)
        return camera if camera.is_sound else None
    except (KeyError, TypeError, ValueError, OverflowError):
        return None


def camera_from(stand: Position, up: Position, place: Vector, height: float) -> Camera:
    """Return a camera that stands on a side of a place: `stand` is east, north and up of it."""
    turn = upright(up)
    there = place + turn @ np.asarray(stand)
    start = Camera(_position(there), _position(place), _position(turn @ np.array([0.0, 0.0, 1.0])))
    return start.looking_at(np.asarray(place, np.float64), height)


def upright(up: Position) -> NDArray[np.float64]:
    """Return the rotation by the shortest way from z to what is up."""
    towards = np.asarray(up, np.float64) / np.linalg.norm(up)
    axis = np.cross([0.0, 0.0, 1.0], towards)
    sine = np.linalg.norm(axis)
    if sine < 1e-12:
        return np.diag([1.0, 1.0, 1.0]) if towards[2] > 0 else np.diag([1.0, -1.0, -1.0])
    angle = np.arctan2(sine, towards[2])
    return np.asarray(Rotation.from_rotvec(angle * axis / sine).as_matrix(), np.float64)


def _position(values: NDArray[np.float64]) -> Position:
    x, y, z = map(float, values)
    return x, y, z
