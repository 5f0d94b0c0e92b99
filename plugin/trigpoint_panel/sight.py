"""Sight: where places of a cloud are in a picture, and which point is seen at a place of it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from trigpoint_panel.camera import Camera

# Points looked at in one go while picking: what they need stays in the processor's cache.
BLOCK = 2**17
# How deep a picked surface may be, in tolerances: it may slope away by some 70 degrees.
SLOPE = 3.0
# A place is hidden by this many points or more, so many pixels' worth before it: one stray, or the
# slope of the surface that it is on, hide nothing.
HIDERS, BEFORE = 2, 20.0


@dataclass(frozen=True, slots=True, eq=False)
class Sight:
    """What a camera sees in a picture of some size; needs no rendered frame and no OpenGL.

    Attributes
    ----------
    camera : Camera
        In absolute coordinates.
    origin : ndarray of shape (3,)
        What local coordinates count about.
    size : tuple of int
        Width and height of the picture in device pixels.
    matrix : ndarray of shape (4, 4)
        From local coordinates to the picture, from -1 to 1.
    """

    camera: Camera
    origin: NDArray[np.float64]
    size: tuple[int, int]
    matrix: NDArray[np.float64]

    def project(self, local: NDArray[Any]) -> NDArray[np.float64]:
        """Return where local places, shape (n, 3), are in the picture: device pixels."""
        ends = np.column_stack([local, np.ones(len(local))]) @ self.matrix.T
        pixels = ends[:, :2] / ends[:, 3:]
        return np.asarray((pixels + 1) / 2 * self.size, np.float64)

    def depth(self, local: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return how far ahead of the camera local places, shape (n, 3), are."""
        ahead = np.subtract(self.camera.focal_point, self.camera.position)
        away = local + self.origin - self.camera.position
        return np.asarray(away @ (ahead / np.linalg.norm(ahead)), np.float64)

    def is_ahead(self, local: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Return which local places, shape (n, 3), are not behind the camera."""
        return np.asarray(self.depth(local) > 0)

    def pixel(self, deep: float) -> float:
        """Return the size of a device pixel so far ahead of the camera, in the cloud's units."""
        return float(self._pixels(np.array(deep)))

    def pick(
        self, columns: NDArray[np.float32], x: float, y: float, *, reach: float, width: float
    ) -> int | None:
        """Return which of the points is seen at a place of the picture.

        That is the front-most point whose square covers the place; beside all squares, the
        front-most within reach. On its surface the point nearest to the cursor is taken. VTK's
        point picker takes the point nearest to the ray however deep it lies, and so picks through
        walls.

        Parameters
        ----------
        columns : ndarray of shape (3, n)
            Local coordinates by axes: each is asked for itself, and its numbers lie side by side.
        x, y : float
            Device pixels from the bottom left.
        reach, width : float
            Device pixels: how far around to look, and how wide a point is drawn.
        """
        rows = self._near_ray(columns, x, y, reach)
        local = columns[:, rows].T.astype(np.float64)
        aside = np.abs(self.project(local) - [x, y])
        away = np.hypot(*aside.T)
        near = away <= reach
        rows, local, aside, away = rows[near], local[near], aside[near], away[near]
        if not len(rows):
            return None
        deep = self.depth(local)
        covers = aside.max(axis=1) <= width / 2
        front = float(deep[covers].min() if covers.any() else deep.min())
        behind = SLOPE * reach * self.pixel(front)
        surface = np.flatnonzero((deep >= front) & (deep <= front + behind))
        return int(rows[surface[np.argmin(away[surface])]])

    def is_hidden(
        self, columns: NDArray[np.float32], local: NDArray[np.float64], *, reach: float
    ) -> NDArray[np.bool_]:
        """Return which local places, shape (n, 3), have points before them.

        Parameters
        ----------
        columns : ndarray of shape (3, m)
            The points, by axes.
        local : ndarray of shape (n, 3)
        reach : float
            Device pixels around a place in which a point stands before it.
        """
        ahead = np.subtract(self.camera.focal_point, self.camera.position)
        ahead /= np.linalg.norm(ahead)
        away = float(ahead @ (self.origin - self.camera.position))
        deep = ahead.astype(np.float32) @ columns + np.float32(away)
        turn, shift = self.matrix[:, :3].astype(np.float32), self.matrix[:, 3].astype(np.float32)
        weight = turn[3] @ columns + shift[3]
        x, y = (((turn[k] @ columns + shift[k]) / weight + 1) / 2 * self.size[k] for k in range(2))
        # From left to right, the few points around a place are found without asking all.
        order = np.argsort(x)
        sorted_x = x[order]
        hidden = []
        far = self.depth(local)
        limits = far - BEFORE * self._pixels(far)
        for (left, bottom), limit in zip(self.project(local), limits, strict=True):
            start, end = np.searchsorted(sorted_x, [left - reach, left + reach])
            rows = order[start:end]
            rows = rows[np.abs(y[rows] - bottom) <= reach]
            before = (deep[rows] > 0) & (deep[rows] < limit)
            hidden.append(int(before.sum()) >= HIDERS)
        return np.array(hidden, np.bool_)

    def _pixels(self, deep: NDArray[np.float64]) -> NDArray[np.float64]:
        size = self.camera.height / self.size[1]
        if self.camera.parallel:
            return np.full_like(deep, size)
        return np.asarray(size * np.maximum(deep, 1e-9) / self.camera.distance)

    def _near_ray(
        self, columns: NDArray[np.float32], x: float, y: float, reach: float
    ) -> NDArray[np.intp]:
        """Find the points that may lie within some pixels of a place of the picture."""
        width, height = self.size
        across, upward, weight = self.matrix[[0, 1, 3]]
        # Pixels are ratios of two of these; what is behind the camera has a negative weight.
        across = across - (2 * x / width - 1) * weight
        upward = upward - (2 * y / height - 1) * weight
        # A pixel more, for the rounding of float32.
        wide, tall = 2 * (reach + 1) / width, 2 * (reach + 1) / height
        lines = np.array([across, upward, weight])
        turn, shift = lines[:, :3].astype(np.float32), lines[:, 3:].astype(np.float32)
        found = []
        for start in range(0, columns.shape[1], BLOCK):
            block = columns[:, start : start + BLOCK]
            u, w = turn[[0, 2]] @ block + shift[[0, 2]]
            rows = np.flatnonzero(np.abs(u) <= wide * w)
            v = turn[1] @ block[:, rows] + shift[1]
            found.append(start + rows[np.abs(v) <= tall * w[rows]])
        return np.concatenate(found)


def sight(
    vtk_camera: Any, camera: Camera, origin: NDArray[np.float64], size: tuple[int, int]
) -> Sight:
    """Return what one of VTK's cameras sees, that was aimed as `camera`."""
    matrix = vtk_camera.GetCompositeProjectionTransformMatrix(size[0] / size[1], -1, 1)
    rows = [[matrix.GetElement(i, j) for j in range(4)] for i in range(4)]
    return Sight(camera, origin, size, np.array(rows))


def aim(vtk_camera: Any, camera: Camera, origin: NDArray[np.float64]) -> None:
    """Set one of VTK's cameras, which counts about an origin."""
    vtk_camera.SetParallelProjection(camera.parallel)
    vtk_camera.SetViewAngle(camera.view_angle)
    vtk_camera.SetParallelScale(camera.parallel_scale)
    vtk_camera.SetFocalPoint(*np.subtract(camera.focal_point, origin))
    vtk_camera.SetPosition(*np.subtract(camera.position, origin))
    vtk_camera.SetViewUp(*camera.up)
