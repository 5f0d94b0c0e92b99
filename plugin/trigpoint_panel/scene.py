"""What one view shows, without Qt: a cloud, its colours, markers, an overlay and a camera."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import NDArray
from vtkmodules.vtkRenderingOpenGL2 import vtkEDLShading, vtkRenderStepsPass

from trigpoint.cloud import PointCloud
from trigpoint.similarity import Points, Similarity
from trigpoint_panel.camera import CORNER, STANDS, Camera, Face, Position, camera_from
from trigpoint_panel.colouring import ColourMode, Colours, Legend, coloured, modes_of
from trigpoint_panel.layer import Layer
from trigpoint_panel.marks import Marker, Marks
from trigpoint_panel.pace import FIRST, Pace
from trigpoint_reporting.elevations import LIMIT_M

# Tails left out when a view is fitted to its cloud: a few flyers would push the camera far away.
STRAY = 0.5
# Points that stand for all of them where a view is fitted.
SAMPLE = 50_000
# Of a fitted picture, a little stays free around the cloud.
MARGIN = 1.06
# Width of the points in pixels; near to the cloud they grow up to GROWTH times, to stay a surface.
POINT, GROWTH = 3.0, 3.0
LIGHT, DARK = (0.957, 0.961, 0.969), (0.094, 0.106, 0.125)

# Points looked at in one go while picking: what they need stays in the processor's cache.
BLOCK = 2**17
# How deep a picked surface may be, in tolerances: it may slope away by some 70 degrees.
SLOPE = 3.0


class Scene:
    """What one view shows; drawn by any PyVista plotter, and kept when that one is replaced.

    Everything that crosses its border is in absolute coordinates of the cloud's frame, in float64;
    VTK gets float32 about an origin in the middle of the cloud. Nothing renders here: whoever owns
    the plotter does, once for each action of the user.

    Parameters
    ----------
    coarse : int
        Points of a cloud drawn while the view first moves; then the pictures' times tell.
    """

    def __init__(self, *, coarse: int = FIRST) -> None:
        self.cloud: PointCloud | None = None
        self.origin = np.zeros(3)
        self.mode: ColourMode | None = None
        self.legend: Legend | None = None
        self._pace = Pace(coarse)
        self._clock: list[int] = []
        self._begun = 0.0
        self._unit = "m"
        self._local = np.empty((0, 3), np.float32)
        self._extent = 1.0
        self._columns = np.empty((3, 0), np.float32)
        self._rows: NDArray[np.intp] | None = None
        self._colours: Colours = np.empty((0, 3), np.uint8)
        self._distances: NDArray[np.float64] | None = None
        self._limit = LIMIT_M
        self._layer: Layer | None = None
        self._overlay: tuple[PointCloud, Layer, NDArray[np.float64]] | None = None
        self._similarity: Similarity | None = None
        self._opacity, self._shows_cloud, self._shows_overlay = 1.0, True, True
        self._markers: tuple[Marker, ...] = ()
        self._marks: Marks | None = None
        self._lighting: Any = None
        self._plotter: Any = None
        self._ratio, self._size, self._drawn = 1.0, POINT, POINT
        self._eye_dome, self._dark, self._moving = True, False, False
        self._up: Position = (0.0, 0.0, 1.0)
        self._camera = camera_from(CORNER, self._up, np.zeros(3), 1.0)

    # The plotter

    def attach(self, plotter: Any, *, ratio: float = 1.0) -> None:
        """Draw everything with a plotter from now on; `ratio` is device pixels per pixel."""
        self.detach()
        self._plotter, self._ratio = plotter, ratio
        plotter.suppress_rendering = True
        self._marks = Marks(self.renderer, ratio)
        self._lighting = eye_dome()
        window = plotter.render_window
        self._clock = [
            window.AddObserver("StartEvent", self._begin),
            window.AddObserver("EndEvent", self._end),
        ]
        for layer in self._layers():
            layer.show_in(self.renderer)
        self.set_point_size(self._size)
        self.set_eye_dome(self._eye_dome)
        self.set_dark(self._dark)
        self._draw_markers()
        self._aim()

    def detach(self) -> None:
        """Let go of the plotter; what is shown is remembered."""
        if self._plotter is None:
            return
        window = self._plotter.render_window
        for observer in self._clock:
            window.RemoveObserver(observer)
        self.renderer.SetPass(None)
        self._lighting.ReleaseGraphicsResources(window)
        if self._marks is not None:
            self._marks.close()
        for layer in self._layers():
            layer.leave(self.renderer)
        self._plotter = self._marks = None

    @property
    def renderer(self) -> Any:
        """VTK's renderer."""
        return self._plotter.renderer

    @property
    def size(self) -> tuple[int, int]:
        """Width and height of the picture in device pixels."""
        if self._plotter is None:
            return 400, 300
        width, height = self._plotter.render_window.GetSize()
        return max(1, width), max(1, height)

    def _layers(self) -> list[Layer]:
        overlay = [self._overlay[1]] if self._overlay is not None else []
        return [*([self._layer] if self._layer is not None else []), *overlay]

    def add_renderer(self, renderer: Any, *, wider: float = 1.0) -> None:
        """Let another renderer draw the clouds too, with wider points and without markers."""
        for layer in self._layers():
            layer.show_in(renderer, wider=wider)

    def remove_renderer(self, renderer: Any) -> None:
        """Undo `add_renderer`."""
        for layer in self._layers():
            layer.leave(renderer)

    # The cloud

    def show(self, cloud: PointCloud | None, *, unit: str = "m") -> None:
        """Show a cloud in place of the one before, in its most telling colours; look at it all."""
        self.cloud, self._unit, self._rows, self._distances = cloud, unit, None, None
        self.mode, self.legend = None, None
        if cloud is None or not len(cloud):
            self.cloud = None
            self._local = np.empty((0, 3), np.float32)
            self._draw_layer()
            return
        middle = np.floor(cloud.xyz.mean(axis=0))
        self.origin = cloud.origin + middle
        self._local = _about(cloud.xyz, middle)
        sample = self._local[:: max(1, len(self._local) // SAMPLE)]
        low, high = np.percentile(sample, [STRAY, 100 - STRAY], axis=0)
        self._extent = max(float(np.linalg.norm(high - low)), 1e-9)
        self._paint(modes_of(cloud)[0])
        self._draw_layer()
        self._place_overlay()
        self._draw_markers()
        self.fit()

    @property
    def modes(self) -> tuple[ColourMode, ...]:
        """What the cloud can be coloured by."""
        if self.cloud is None:
            return ()
        return modes_of(self.cloud, has_distances=self._distances is not None)

    def colour_by(self, mode: ColourMode) -> None:
        """Colour the cloud by something it has."""
        if mode in self.modes:
            self._paint(mode)
            if self._layer is not None:
                self._layer.recolour(self._shown(self._colours))

    def set_distances(
        self, distances: NDArray[np.float64] | None, *, limit: float = LIMIT_M
    ) -> None:
        """Colour by a distance in metres for each point, shape (n,); None takes it away.

        Distances are told apart up to `limit`.
        """
        self._distances, self._limit = distances, limit
        if self.cloud is not None:
            mode = "distance" if distances is not None else self.mode
            self.colour_by(mode if mode in self.modes else self.modes[0])

    def isolate(self, mask: NDArray[np.bool_] | None) -> None:
        """Show only some of the points; None shows all."""
        self._rows = None if mask is None else np.flatnonzero(mask)
        if self.cloud is not None:
            self._draw_layer()

    def coordinates(self, row: int) -> NDArray[np.float64]:
        """Return the absolute coordinates of a point, as precise as they were read."""
        assert self.cloud is not None
        return np.asarray(self.cloud.xyz[row] + self.cloud.origin, np.float64)

    def around(self, row: int, radius: float) -> Points:
        """Return the absolute coordinates of the shown points in a box about a point."""
        assert self.cloud is not None
        rows = self._boxed(self._local[row], radius)
        return np.asarray(self.cloud.xyz[rows] + self.cloud.origin, np.float64)

    def _boxed(self, centre: NDArray[np.float32], radius: float) -> NDArray[np.intp]:
        x, y, z = self._columns
        rows: NDArray[np.intp] = np.flatnonzero(np.abs(x - centre[0]) <= radius)
        rows = rows[np.abs(y[rows] - centre[1]) <= radius]
        rows = rows[np.abs(z[rows] - centre[2]) <= radius]
        return rows if self._rows is None else self._rows[rows]

    def _paint(self, mode: ColourMode) -> None:
        assert self.cloud is not None
        up = np.asarray(self._up, np.float64)
        self._colours, self.legend = coloured(
            self.cloud,
            mode,
            up=up,
            distances=self._distances,
            limit=self._limit,
            unit=self._unit,
        )
        self.mode = mode

    def _shown(self, values: NDArray[Any]) -> NDArray[Any]:
        return values if self._rows is None else values[self._rows]

    def _drop_layer(self) -> None:
        if self._layer is not None and self._plotter is not None:
            self._layer.leave(self.renderer)
        self._layer = None

    def _draw_layer(self) -> None:
        self._drop_layer()
        shown = self._shown(self._local)
        # By axes: picking asks each for itself, and finds its numbers side by side.
        self._columns = np.ascontiguousarray(shown.T)
        if len(shown):
            self._layer = Layer(shown, self._shown(self._colours))
            self._layer.draw_at_most(self._share)
            self._layer.set_visible(self._shows_cloud)
            if self._plotter is not None:
                self._layer.show_in(self.renderer)
            self._resize_points()

    # The overlay

    @property
    def has_overlay(self) -> bool:
        """Whether another cloud is shown too."""
        return self._overlay is not None

    def set_overlay(self, cloud: PointCloud | None, similarity: Similarity | None = None) -> None:
        """Show another cloud too, carried through `similarity` into this frame; None removes it.

        The cloud is uploaded once; another similarity only moves it.
        """
        self._similarity = similarity
        if self._overlay is not None and self._overlay[0] is not cloud:
            if self._plotter is not None:
                self._overlay[1].leave(self.renderer)
            self._overlay = None
            self._shows_cloud = self._shows_overlay = True
        if cloud is not None and self._overlay is None:
            middle = np.floor(cloud.xyz.mean(axis=0))
            colours, _ = coloured(cloud, modes_of(cloud)[0], up=np.array([0.0, 0.0, 1.0]))
            layer = Layer(_about(cloud.xyz, middle), colours)
            layer.draw_at_most(self._share)
            self._overlay = cloud, layer, cloud.origin + middle
            self._resize_points()
            if self._plotter is not None:
                layer.show_in(self.renderer)
        self._place_overlay()

    def set_overlay_opacity(self, opacity: float) -> None:
        """Show the overlay from 0 (not at all) to 1 (fully)."""
        self._opacity = min(max(opacity, 0.0), 1.0)
        self._place_overlay()

    @property
    def shows_cloud(self) -> bool:
        """Whether the cloud itself is shown, and not only the overlay."""
        return self._shows_cloud

    def swap(self) -> str:
        """Show only the cloud, then only the overlay, then both again; say which: A, B, or A+B."""
        order = {(True, True): (True, False), (True, False): (False, True)}
        if self._overlay is not None:
            now = self._shows_cloud, self._shows_overlay
            self._shows_cloud, self._shows_overlay = order.get(now, (True, True))
        self._place_overlay()
        return {(True, False): "A", (False, True): "B"}.get(
            (self._shows_cloud, self._shows_overlay), "A+B"
        )

    def _place_overlay(self) -> None:
        if self._layer is not None:
            self._layer.set_visible(self._shows_cloud)
        if self._overlay is None:
            return
        _, layer, origin = self._overlay
        similarity = self._similarity or Similarity(1.0, np.eye(3), np.zeros(3))
        matrix = np.eye(4)
        matrix[:3, :3] = similarity.scale * similarity.rotation
        # Between the two origins, so that nothing large is left for float32.
        matrix[:3, 3] = similarity(origin[None, :])[0] - self.origin
        layer.set_matrix(matrix)
        layer.set_opacity(self._opacity if self._shows_cloud else 1.0)
        layer.set_visible(self._shows_overlay)

    # How it looks

    def set_point_size(self, pixels: float) -> None:
        """Set the width of the points in pixels."""
        self._size = pixels
        self._resize_points()

    def _resize_points(self) -> None:
        share = self._extent / max(self._camera.height, 1e-12)
        self._drawn = self._size * self._ratio * min(max(share, 1.0) ** 0.5, GROWTH)
        for layer in self._layers():
            layer.set_size(self._drawn)

    @property
    def point_size(self) -> float:
        """Width of the points in pixels."""
        return self._size

    def set_eye_dome(self, on: bool) -> None:
        """Darken the edges in depth, or do not."""
        self._eye_dome = on
        self._thin()

    @property
    def eye_dome(self) -> bool:
        """Whether edges in depth are darkened."""
        return self._eye_dome

    def set_dark(self, dark: bool) -> None:
        """Choose a dark or a light background."""
        self._dark = dark
        if self._plotter is not None:
            self.renderer.SetBackground(*self.background)

    @property
    def background(self) -> Position:
        """Red, green and blue of the background, 0 to 1."""
        return DARK if self._dark else LIGHT

    def set_moving(self, moving: bool) -> None:
        """Draw while the view moves what there is time for, and everything when it rests."""
        if moving != self._moving:
            self._moving = moving
            if not moving:
                self._pace.rested()
            self._thin()

    @property
    def is_thinned(self) -> bool:
        """Whether less is drawn than there is, since the view moves."""
        return self._is_unlit or any(layer.is_thinned for layer in self._layers())

    @property
    def _share(self) -> int | None:
        return self._pace.count if self._moving else None

    @property
    def _is_unlit(self) -> bool:
        return self._eye_dome and self._moving and not self._pace.is_lit

    def _thin(self) -> None:
        for layer in self._layers():
            layer.draw_at_most(self._share)
        if self._plotter is not None:
            lit = self._eye_dome and not self._is_unlit
            self.renderer.SetPass(self._lighting if lit else None)

    def _begin(self, *_: object) -> None:
        self._begun = perf_counter()

    def _end(self, window: Any, _: object) -> None:
        layers = self._layers()
        if not self._moving or not layers:
            return
        # A graphics card may not even have begun.
        window.WaitForCompletion()
        took = perf_counter() - self._begun
        if self._pace.took(took, max(layer.drawn for layer in layers)):
            self._thin()

    def set_markers(self, markers: Sequence[Marker]) -> None:
        """Show these markers in place of those before."""
        self._markers = tuple(markers)
        self._draw_markers()

    def _draw_markers(self) -> None:
        if self._marks is not None:
            self._marks.draw(self._markers, self.origin)
            self._marks.arrange(self._is_ahead, self._project)

    # The camera

    @property
    def camera(self) -> Camera:
        """Where the view is seen from."""
        return self._camera

    @camera.setter
    def camera(self, camera: Camera) -> None:
        self._camera = camera
        self._aim()

    def set_up(self, up: Position) -> None:
        """Say which way is up in the cloud's frame; the view turns to it."""
        if up == self._up:
            return
        self._up = up
        if self.cloud is not None:
            if self.mode == "height":
                self.colour_by("height")
            self._camera = camera_from(CORNER, up, self.origin, 1.0)
            self.fit()

    @property
    def up(self) -> Position:
        """Which way is up."""
        return self._up

    def take_up(self) -> None:
        """Take what is upright in the picture as up."""
        self._up = self._camera.up
        if self.mode == "height":
            self.colour_by("height")

    @property
    def extent(self) -> float:
        """Size of the cloud from corner to corner, strays left out."""
        return self._extent

    def look(self, face: Face) -> None:
        """Look at the whole cloud straight from one side, or from above."""
        parallel = self._camera.parallel
        turned = camera_from(STANDS[face], self._up, np.asarray(self._camera.focal_point), 1.0)
        self._camera = replace(turned, parallel=parallel)
        self.fit()

    def fit(self) -> None:
        """Look at the whole cloud from where the camera is turned to; strays are left out."""
        if self.cloud is None:
            return
        sample = self._shown(self._local)
        sample = sample[:: max(1, len(sample) // SAMPLE)].astype(np.float64)
        if not len(sample):
            return
        camera, (width, height) = self._camera, self.size
        if not camera.is_sound:
            camera = camera_from(CORNER, self._up, self.origin, 1.0)
        ahead = np.subtract(camera.focal_point, camera.position)
        ahead /= np.linalg.norm(ahead)
        right = np.cross(ahead, camera.up)
        right /= np.linalg.norm(right)
        axes = np.array([right, np.cross(right, ahead), ahead])
        along = sample @ axes.T
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
        self.camera = camera.looking_at(self.origin + middle @ axes, needed)

    def resized(self) -> None:
        """Arrange the labels anew, for a picture of another size."""
        self._aim()

    def _aim(self) -> None:
        if self._plotter is None:
            return
        camera, ours = self.renderer.GetActiveCamera(), self._camera
        aim(camera, ours, self.origin)
        self._resize_points()
        self.renderer.ResetCameraClippingRange()
        if self._marks is not None:
            self._marks.arrange(self._is_ahead, self._project)

    def _is_ahead(self, local: NDArray[np.float64]) -> NDArray[np.bool_]:
        position = np.subtract(self._camera.position, self.origin)
        ahead = np.subtract(self._camera.focal_point, self._camera.position)
        return np.asarray((local - position) @ ahead > 0)

    # Pixels

    def pick_at(self, x: float, y: float, *, tolerance: float = 5.0) -> int | None:
        """Return the row of the point seen at a place of the picture.

        That is the front-most point whose square covers the place; beside all squares, the
        front-most within the tolerance. On its surface the point nearest to the cursor is taken.
        VTK's point picker takes the point nearest to the ray however deep it lies, and so picks
        through walls. This needs no rendered frame and no OpenGL.

        Parameters
        ----------
        x, y : float
            Device pixels from the bottom left.
        tolerance : float
            Pixels, scaled as the picture is.
        """
        if self.cloud is None or self._plotter is None or not self._shows_cloud:
            return None
        reach = tolerance * self._ratio
        rows = self._near_ray(x, y, reach)
        local = self._columns[:, rows].T.astype(np.float64)
        aside = np.abs(self._project(local) - [x, y])
        away = np.hypot(*aside.T)
        near = away <= reach
        rows, local, aside, away = rows[near], local[near], aside[near], away[near]
        if not len(rows):
            return None
        ahead = np.subtract(self._camera.focal_point, self._camera.position)
        deep = (local + self.origin - self._camera.position) @ (ahead / np.linalg.norm(ahead))
        covers = aside.max(axis=1) <= self._drawn / 2
        front = float(deep[covers].min() if covers.any() else deep.min())
        behind = SLOPE * reach * self._pixel(front)
        surface = np.flatnonzero((deep >= front) & (deep <= front + behind))
        row = int(rows[surface[np.argmin(away[surface])]])
        return row if self._rows is None else int(self._rows[row])

    def _near_ray(self, x: float, y: float, reach: float) -> NDArray[np.intp]:
        """Find the shown points that may lie within some pixels of a place of the picture."""
        width, height = self.size
        across, upward, weight = self._projection()[[0, 1, 3]]
        # Pixels are ratios of two of these; what is behind the camera has a negative weight.
        across = across - (2 * x / width - 1) * weight
        upward = upward - (2 * y / height - 1) * weight
        # A pixel more, for the rounding of float32.
        wide, tall = 2 * (reach + 1) / width, 2 * (reach + 1) / height
        lines = np.array([across, upward, weight])
        turn, shift = lines[:, :3].astype(np.float32), lines[:, 3:].astype(np.float32)
        found = []
        for start in range(0, self._columns.shape[1], BLOCK):
            block = self._columns[:, start : start + BLOCK]
            u, w = turn[[0, 2]] @ block + shift[[0, 2]]
            rows = np.flatnonzero(np.abs(u) <= wide * w)
            v = turn[1] @ block[:, rows] + shift[1]
            found.append(start + rows[np.abs(v) <= tall * w[rows]])
        return np.concatenate(found)

    def project(self, xyz: Position | NDArray[np.float64]) -> NDArray[np.float64]:
        """Return where absolute places, shape (3,) or (n, 3), are in the picture: device pixels."""
        places = np.asarray(xyz, np.float64)
        pixels = self._project(np.atleast_2d(places) - self.origin)
        return pixels if places.ndim == 2 else pixels[0]

    def pixel_at(self, row: int) -> float:
        """Return the size of a pixel, scaled as the picture is, at a point: in its units."""
        camera = self._camera
        ahead = np.subtract(camera.focal_point, camera.position) / camera.distance
        deep = float((self.coordinates(row) - camera.position) @ ahead)
        return self._pixel(deep) * self._ratio

    def _pixel(self, deep: float) -> float:
        """Return the size of a device pixel so far ahead of the camera, in the cloud's units."""
        size = self._camera.height / self.size[1]
        return size if self._camera.parallel else size * max(deep, 1e-9) / self._camera.distance

    def _projection(self) -> NDArray[np.float64]:
        """Return the 4x4 matrix from local coordinates to the picture, from -1 to 1."""
        width, height = self.size
        camera = self.renderer.GetActiveCamera()
        matrix = camera.GetCompositeProjectionTransformMatrix(width / height, -1, 1)
        return np.array([[matrix.GetElement(i, j) for j in range(4)] for i in range(4)])

    def _project(self, local: NDArray[Any]) -> NDArray[np.float64]:
        ends = np.column_stack([local, np.ones(len(local))]) @ self._projection().T
        pixels = ends[:, :2] / ends[:, 3:]
        return np.asarray((pixels + 1) / 2 * self.size, np.float64)


def eye_dome() -> Any:
    """Return a render pass that darkens the edges in depth."""
    lighting = vtkEDLShading()
    lighting.SetDelegatePass(vtkRenderStepsPass())
    return lighting


def aim(vtk_camera: Any, camera: Camera, origin: NDArray[np.float64]) -> None:
    """Set one of VTK's cameras, which counts about an origin."""
    vtk_camera.SetParallelProjection(camera.parallel)
    vtk_camera.SetViewAngle(camera.view_angle)
    vtk_camera.SetParallelScale(camera.parallel_scale)
    vtk_camera.SetFocalPoint(*np.subtract(camera.focal_point, origin))
    vtk_camera.SetPosition(*np.subtract(camera.position, origin))
    vtk_camera.SetViewUp(*camera.up)


def _about(xyz: Points, middle: NDArray[np.float64]) -> NDArray[np.float32]:
    local = np.empty(xyz.shape, np.float32)
    for axis in range(3):
        # The difference in float64 first: at UTM coordinates float32 has steps of half a metre.
        local[:, axis] = xyz[:, axis] - middle[axis]
    return local
