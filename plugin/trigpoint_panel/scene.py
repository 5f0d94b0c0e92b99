"""What one view shows, without Qt: a cloud, its colours, an overlay and a camera."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from trigpoint.cloud import PointCloud
from trigpoint.similarity import Points, Similarity
from trigpoint_panel.camera import CORNER, Camera, Face, Position, camera_from
from trigpoint_panel.colouring import ColourMode, Colours, Legend, coloured, modes_of
from trigpoint_panel.framing import extent_of, framed
from trigpoint_panel.layer import Layer
from trigpoint_panel.motion import Motion
from trigpoint_panel.overlay import Overlay
from trigpoint_panel.pace import FIRST
from trigpoint_panel.shown import Shown
from trigpoint_panel.sight import Sight, aim, sight
from trigpoint_reporting.elevations import LIMIT_M

# Width of the points in pixels; near to the cloud they grow up to GROWTH times, to stay a surface.
POINT, GROWTH = 3.0, 3.0
# Points that tell what the cloud hides.
TELLING = 200_000
LIGHT, DARK = (0.957, 0.961, 0.969), (0.094, 0.106, 0.125)


class Scene:
    """What one view shows; drawn by any PyVista plotter, and kept when that one is replaced.

    Everything that crosses its border is in absolute coordinates of the cloud's frame, in float64;
    VTK gets float32 about an origin in the middle of the cloud. Nothing renders here: whoever owns
    the plotter does, once for each action of the user.

    Parameters
    ----------
    coarse : int
        Points of a cloud drawn while the view first moves; then the pictures' times tell.

    Attributes
    ----------
    cloud : PointCloud or None
    origin : ndarray of shape (3,)
        What VTK counts about.
    extent : float
        Size of the cloud from corner to corner, strays left out.
    point_size : float
        Width of the points in pixels.
    mode : str or None
        What the cloud is coloured by.
    legend : Legend or None
    """

    def __init__(self, *, coarse: int = FIRST) -> None:
        self.cloud: PointCloud | None = None
        self.origin = np.zeros(3)
        self.mode: ColourMode | None = None
        self.legend: Legend | None = None
        self.extent, self.point_size = 1.0, POINT
        self._shown: Shown | None = None
        self._colours: Colours = np.empty((0, 3), np.uint8)
        self._distances: NDArray[np.float64] | None = None
        self._limit, self._unit = LIMIT_M, "m"
        self._layer: Layer | None = None
        self._overlay = Overlay()
        self._motion = Motion(self._layers, coarse)
        self._plotter: Any = None
        self._ratio, self._drawn, self._dark = 1.0, POINT, False
        self._up: Position = (0.0, 0.0, 1.0)
        self._camera = camera_from(CORNER, self._up, np.zeros(3), 1.0)

    # The plotter

    def attach(self, plotter: Any, *, ratio: float = 1.0) -> None:
        """Draw everything with a plotter from now on; `ratio` is device pixels per pixel."""
        self.detach()
        self._plotter, self._ratio = plotter, ratio
        plotter.suppress_rendering = True
        for layer in self._layers():
            layer.show_in(self.renderer)
        self._motion.attach(self.renderer)
        self.set_point_size(self.point_size)
        self.set_dark(self._dark)
        self._aim()

    def detach(self) -> None:
        """Let go of the plotter; what is shown is remembered."""
        if self._plotter is None:
            return
        self._motion.detach()
        for layer in self._layers():
            layer.leave(self.renderer)
        self._plotter = None

    @property
    def is_drawn(self) -> bool:
        """Whether there is a plotter."""
        return self._plotter is not None

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
        return [layer for layer in (self._layer, self._overlay.layer) if layer is not None]

    def _enter(self, layer: Layer | None) -> None:
        self._motion.apply()
        self._resize_points()
        if layer is not None and self._plotter is not None:
            layer.show_in(self.renderer)

    def _leave(self, layer: Layer | None) -> None:
        if layer is not None and self._plotter is not None:
            layer.leave(self.renderer)

    def add_renderer(self, renderer: Any, *, wider: float = 1.0) -> None:
        """Let another renderer draw the clouds too, with wider points."""
        for layer in self._layers():
            layer.show_in(renderer, wider=wider)

    def remove_renderer(self, renderer: Any) -> None:
        """Undo `add_renderer`."""
        for layer in self._layers():
            layer.leave(renderer)

    # The cloud

    def show(self, cloud: PointCloud | None, *, unit: str = "m") -> None:
        """Show a cloud in place of the one before, in its most telling colours; look at it all."""
        self.cloud, self._unit, self._distances = cloud, unit, None
        self.mode, self.legend = None, None
        if cloud is None or not len(cloud):
            self.cloud = self._shown = None
            self._draw_layer()
            return
        self._shown = Shown(cloud)
        self.origin = self._shown.origin
        self.extent = extent_of(self._shown.local)
        self._motion.measure(self.extent)
        self._paint(modes_of(cloud)[0])
        self._draw_layer()
        self._place_overlay()
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
            if self._layer is not None and self._shown is not None:
                self._layer.recolour(self._shown.of(self._colours))

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
        if self._shown is not None:
            self._shown.isolate(mask)
            self._draw_layer()

    def coordinates(self, row: int) -> NDArray[np.float64]:
        """Return the absolute coordinates of a point, as precise as they were read."""
        assert self._shown is not None
        return self._shown.coordinates(row)

    def around(self, row: int, radius: float) -> Points:
        """Return the absolute coordinates of the shown points in a box about a point."""
        assert self._shown is not None
        return self._shown.around(row, radius)

    def _paint(self, mode: ColourMode) -> None:
        assert self.cloud is not None
        up, limit = np.asarray(self._up, np.float64), self._limit
        self._colours, self.legend = coloured(
            self.cloud, mode, up=up, distances=self._distances, limit=limit, unit=self._unit
        )
        self.mode = mode

    def _draw_layer(self) -> None:
        self._leave(self._layer)
        self._layer = None
        if self._shown is not None and len(self._shown.local):
            self._layer = Layer(self._shown.local, self._shown.of(self._colours))
            self._layer.set_visible(self._overlay.shows_own)
            self._enter(self._layer)

    # The overlay

    @property
    def has_overlay(self) -> bool:
        """Whether another cloud is shown too."""
        return self._overlay.cloud is not None

    def set_overlay(self, cloud: PointCloud | None, similarity: Similarity | None = None) -> None:
        """Show another cloud too, carried through `similarity` into this frame; None removes it.

        The cloud is uploaded once; another similarity only moves it.
        """
        self._overlay.similarity = similarity
        if cloud is not self._overlay.cloud:
            self._leave(self._overlay.layer)
            self._overlay.carry(cloud)
            self._enter(self._overlay.layer)
        self._place_overlay()

    def set_overlay_opacity(self, opacity: float) -> None:
        """Show the overlay from 0 (not at all) to 1 (fully)."""
        self._overlay.opacity = min(max(opacity, 0.0), 1.0)
        self._place_overlay()

    @property
    def shows_cloud(self) -> bool:
        """Whether the cloud itself is shown, and not only the overlay."""
        return self._overlay.shows_own

    def swap(self) -> str:
        """Show only the cloud, then only the overlay, then both again; say which: A, B, or A+B."""
        state = self._overlay.swap()
        self._place_overlay()
        return state

    def _place_overlay(self) -> None:
        if self._layer is not None:
            self._layer.set_visible(self._overlay.shows_own)
        self._overlay.place(self.origin)

    # How it looks

    def set_point_size(self, pixels: float) -> None:
        """Set the width of the points in pixels."""
        self.point_size = pixels
        self._resize_points()

    def _resize_points(self) -> None:
        share = self.extent / max(self._camera.height, 1e-12)
        self._drawn = self.point_size * self._ratio * min(max(share, 1.0) ** 0.5, GROWTH)
        for layer in self._layers():
            layer.set_size(self._drawn)

    def set_eye_dome(self, on: bool) -> None:
        """Darken the edges in depth, or do not."""
        self._motion.eye_dome = on
        self._motion.apply()

    @property
    def eye_dome(self) -> bool:
        """Whether edges in depth are darkened."""
        return self._motion.eye_dome

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
        self._motion.set_moving(moving)

    @property
    def is_thinned(self) -> bool:
        """Whether less is drawn than there is, since the view moves."""
        return self._motion.is_thinned

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

    def look(self, face: Face) -> None:
        """Look at the whole cloud straight from one side, or from above."""
        self._camera = self._camera.facing(face, self._up)
        self.fit()

    def fit(self) -> None:
        """Look at the whole cloud from where the camera is turned to; strays are left out."""
        if self._shown is not None and len(self._shown.local):
            if not self._camera.is_sound:
                self._camera = camera_from(CORNER, self._up, self.origin, 1.0)
            self.camera = framed(self._camera, self._shown.local, self.origin, self.size)

    def resized(self) -> None:
        """Take note that the picture has another size."""
        self._aim()

    def _aim(self) -> None:
        if self._plotter is None:
            return
        aim(self.renderer.GetActiveCamera(), self._camera, self.origin)
        self._resize_points()
        self.renderer.ResetCameraClippingRange()

    # Pixels

    def pick_at(self, x: float, y: float, *, tolerance: float = 5.0) -> int | None:
        """Return the row of the point seen at a place of the picture.

        Parameters
        ----------
        x, y : float
            Device pixels from the bottom left.
        tolerance : float
            Pixels, scaled as the picture is.
        """
        if self._shown is None or self._plotter is None or not self._overlay.shows_own:
            return None
        reach = tolerance * self._ratio
        row = self._sight().pick(self._shown.columns, x, y, reach=reach, width=self._drawn)
        return None if row is None else self._shown.row(row)

    def project(self, xyz: Position | NDArray[np.float64]) -> NDArray[np.float64]:
        """Return where absolute places, shape (3,) or (n, 3), are in the picture: device pixels."""
        places = np.asarray(xyz, np.float64)
        pixels = self._sight().project(np.atleast_2d(places) - self.origin)
        return pixels if places.ndim == 2 else pixels[0]

    def is_ahead(self, xyz: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Return which absolute places, shape (n, 3), are not behind the camera."""
        return self._sight().is_ahead(xyz - self.origin)

    def is_hidden(self, xyz: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Return which absolute places, shape (n, 3), have a cloud that is seen in front of them.

        Of a large cloud, a share of the points tells.
        """
        hidden = np.zeros(len(xyz), np.bool_)
        if self._plotter is None:
            return hidden
        seen = [self._overlay.columns(self.origin, TELLING)]
        if self._shown is not None and self._overlay.shows_own:
            columns = self._shown.columns
            seen.append(columns[:, :: -(-columns.shape[1] // TELLING) or 1])
        reach = max(self._drawn / 2, 3.0 * self._ratio)
        for columns in seen:
            hidden |= self._sight().is_hidden(columns, xyz - self.origin, reach=reach)
        return hidden

    def pixel_at(self, row: int) -> float:
        """Return the size of a pixel, scaled as the picture is, at a point: in its units."""
        seen = self._sight()
        deep = float(seen.depth((self.coordinates(row) - self.origin)[None])[0])
        return seen.pixel(deep) * self._ratio

    def _sight(self) -> Sight:
        return sight(self.renderer.GetActiveCamera(), self._camera, self.origin, self.size)
