"""CloudView: one cloud in a window, with its header, mouse and picks."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from qtpy import QtCore, QtGui, QtWidgets

from trigpoint.similarity import Similarity
from trigpoint_panel.camera import Camera, Face, Position
from trigpoint_panel.canvas import Canvas, CanvasKind, make_canvas
from trigpoint_panel.colouring import ColourMode
from trigpoint_panel.ground import guess_up
from trigpoint_panel.header import Header
from trigpoint_panel.legend import LegendCard
from trigpoint_panel.loupe import ZOOM, Loupe
from trigpoint_panel.marks import Marker
from trigpoint_panel.opening import Opened
from trigpoint_panel.scene import Scene
from trigpoint_panel.snapping import Mode, SnapError, snap
from trigpoint_reporting.elevations import LIMIT_M

Side = Literal["source", "target"]
TITLES: dict[Side, str] = {"source": "Source", "target": "Target"}

# Pixels that the mouse may move between press and release of a click.
CLICK = 4
# Pixels around the cursor in which a point is picked, and around a pick that snaps look by default.
REACH, SNAP_REACH = 5.0, 40.0
# Milliseconds: the view rests before all points are drawn again; the mouse before it is asked what
# it points at; an OpenGL widget has until it must have a context.
REST, HOVER, PATIENCE = 200, 120, 1000
# Degrees for a drag across the height of the view, and zoom for a step of the wheel.
TURN, WHEEL = 180.0, 1.15
# Height of what is seen where the view has flown to, as a share of what it is where all is seen.
NEAR = 0.2


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


class CloudView(QtWidgets.QWidget):
    """One cloud, seen and picked in.

    Made of a header and a canvas; the canvas is made when the view is first shown, and whatever
    was set before is shown then. Everything may be called at any time. However much changes at
    once, one picture is drawn.

    Left drag turns, right or middle drag (or Shift) moves, Ctrl with left drag rolls, the wheel
    zooms to the cursor, a double click flies there while not picking.

    Signals
    -------
    picked (Picked)
    hovered (tuple of float or None)
        The point under the mouse, a moment after it rests.
    refused (str)
        One sentence: why a click made no pick.
    camera_changed ()
        The user has moved the camera.
    dropped (str)
        Path of a file dropped on the view.
    """

    picked = QtCore.Signal(object)
    hovered = QtCore.Signal(object)
    refused = QtCore.Signal(str)
    camera_changed = QtCore.Signal()
    dropped = QtCore.Signal(str)

    def __init__(
        self,
        side: Side,
        parent: QtWidgets.QWidget | None = None,
        *,
        canvas: CanvasKind = "auto",
    ) -> None:
        super().__init__(parent)
        self.side = side
        self.opened: Opened | None = None
        self.scene = Scene()
        self.canvas: Canvas | None = None
        self._kind = canvas
        self._closed = False
        self._aimed = False
        self._picking = False
        self._snap: tuple[Mode, float | None] = ("point", None)
        self._markers: tuple[Marker, ...] = ()
        self._ghost: Marker | None = None
        self._press: tuple[QtCore.QPointF, Any] | None = None
        self._last: QtCore.QPointF | None = None
        self._dragging = False
        self._mouse = QtCore.QPointF()
        self._loupe: Loupe | None = None
        self._magnified: Position | None = None
        self._magnifying = False
        self._ratio = 1.0

        self.header = Header(TITLES[side], self)
        self._stage = QtWidgets.QWidget(self)
        self._stage.setMinimumSize(120, 90)
        self._prompt = QtWidgets.QLabel(self._stage)
        self._prompt.setAlignment(QtCore.Qt.AlignmentFlag.AlignCenter)
        self._prompt.setWordWrap(True)
        self._prompt.setMargin(24)
        self.legend = LegendCard(self._stage)
        column = QtWidgets.QVBoxLayout(self)
        column.setContentsMargins(0, 0, 0, 0)
        column.setSpacing(0)
        column.addWidget(self.header)
        column.addWidget(self._stage, 1)
        column.addWidget(self._make_overlay_bar())
        self._stage.installEventFilter(self)
        self.setFocusPolicy(QtCore.Qt.FocusPolicy.StrongFocus)
        self.setAcceptDrops(True)
        self.setAccessibleName(f"{TITLES[side]} view")

        self._opener = self._timer(0, self._make_canvas)
        self._rest = self._timer(REST, self._refine)
        self._hover = self._timer(HOVER, self._tell_hovered)
        self._patience = self._timer(PATIENCE, self._check_canvas)
        self.header.mode_chosen.connect(self.colour_by)
        self.header.size_chosen.connect(self.set_point_size)
        self.header.eye_dome_chosen.connect(self.set_eye_dome)
        self.header.fit_chosen.connect(self.fit_view)
        self.header.face_chosen.connect(self.look)
        self.header.parallel_chosen.connect(self.set_parallel)
        self.header.up_chosen.connect(self._choose_up)
        self._follow_palette()
        self._describe()

    # The cloud

    def set_cloud(self, opened: Opened | None) -> None:
        """Show a cloud; None empties the view.

        Of a cloud that no CRS describes, up is guessed from the ground.
        """
        self._drop_loupe()
        self.opened = opened
        if opened is not None:
            self.scene.show(opened.cloud, unit=opened.unit)
            if opened.info.crs is None:
                self.scene.set_up(guess_up(opened.cloud.xyz))
            else:
                self.scene.set_up((0.0, 0.0, 1.0))
        else:
            self.scene.show(None)
        self._aimed = False
        self._describe()
        # A share of the points is there at once; the others follow.
        self._keep_moving()

    def set_prompt(self, text: str) -> None:
        """Say in an empty view what to do, such as "Open a source cloud (Ctrl+O)"."""
        self._prompt.setText(text)

    def set_distances(
        self, distances: NDArray[np.float64] | None, *, limit: float = LIMIT_M
    ) -> None:
        """Give each shown point its distance in metres, shape (n,), and colour by it."""
        self.scene.set_distances(distances, limit=limit)
        self._describe()
        self.refresh()

    def isolate(self, mask: NDArray[np.bool_] | None) -> None:
        """Show only some of the shown points, such as a zone; None shows all."""
        self._drop_loupe()
        self.scene.isolate(mask)
        self.refresh()

    # Markers and the overlay

    def set_markers(self, markers: Sequence[Marker]) -> None:
        """Show the picks and where to pick next, in place of the markers before."""
        if tuple(markers) != self._markers:
            self._markers = tuple(markers)
            self._mark()

    def set_ghost(self, ghost: Marker | None) -> None:
        """Show where an open pair's other half is expected; it is drawn orange."""
        if ghost != self._ghost:
            self._ghost = ghost
            self._mark()

    def set_overlay(self, opened: Opened | None, similarity: Similarity | None = None) -> None:
        """Show another cloud too, carried through `similarity` into this frame; None removes it.

        Another similarity for the same cloud costs nothing.
        """
        self._drop_loupe()
        self.scene.set_overlay(None if opened is None else opened.cloud, similarity)
        self._overlay_bar.setVisible(self.scene.has_overlay)
        self._overlay_state.setText("A+B")
        self.legend.show_legend(self.scene.legend)
        self._lay_out()
        self.refresh()

    def set_overlay_opacity(self, opacity: float) -> None:
        """Show the overlay from 0 (not at all) to 1 (fully)."""
        self._opacity.blockSignals(True)
        self._opacity.setValue(round(100 * opacity))
        self._opacity.blockSignals(False)
        self.scene.set_overlay_opacity(opacity)
        self.refresh()

    def swap(self) -> None:
        """Show only the cloud, then only the overlay, then both again."""
        self._overlay_state.setText(self.scene.swap())
        self.legend.show_legend(self.scene.legend if self.scene.shows_cloud else None)
        self.refresh()

    # How it looks

    def colour_by(self, mode: ColourMode) -> None:
        """Colour the cloud."""
        self.scene.colour_by(mode)
        self._describe()
        self.refresh()

    def set_point_size(self, pixels: float) -> None:
        """Set the width of the points in pixels."""
        self.scene.set_point_size(min(max(pixels, 1.0), 10.0))
        self._describe_states()
        self.refresh()

    def set_eye_dome(self, on: bool) -> None:
        """Turn eye-dome lighting on or off."""
        self.scene.set_eye_dome(on)
        self._describe_states()
        self.refresh()

    def set_up(self, up: Position) -> None:
        """Say which way is up in this cloud's frame."""
        self.scene.set_up(up)
        self._user_moved()

    # Picking

    def set_picking(self, on: bool) -> None:
        """Let clicks pick; drags turn the view whether or not they do."""
        self._picking = on
        shape = QtCore.Qt.CursorShape
        self._stage.setCursor(shape.CrossCursor if on else shape.ArrowCursor)
        if self.canvas is not None:
            self.canvas.surface.setCursor(shape.CrossCursor if on else shape.ArrowCursor)

    def set_snap(self, mode: Mode, radius: float | None = None) -> None:
        """Set what picks snap to, and how far around the click, in the cloud's units.

        Without a radius it follows the zoom: 40 pixels.
        """
        self._snap = mode, radius

    # The camera

    @property
    def camera(self) -> Camera:
        """Where the view is seen from."""
        return self.scene.camera

    def set_camera(self, camera: Camera) -> None:
        """See the view from elsewhere; does not emit `camera_changed`."""
        self._aimed = True
        self.scene.camera = camera
        self._describe_states()
        self._keep_moving()

    def fit_view(self) -> None:
        """Look at the whole cloud."""
        self.scene.fit()
        self._user_moved()

    def look(self, face: Face) -> None:
        """Look straight at the front, back, left, right or top."""
        self.scene.look(face)
        self._user_moved()

    def set_parallel(self, on: bool) -> None:
        """Switch between parallel and perspective projection."""
        self.scene.camera = self.camera.projected(on)
        self._describe_states()
        self._user_moved()

    def fly_to(self, xyz: Position) -> None:
        """Bring a place to the middle of the view, near enough to pick there."""
        height = min(self.camera.height, NEAR * self.scene.extent)
        self.scene.camera = self.camera.looking_at(np.asarray(xyz, np.float64), height)
        self._user_moved()

    def magnify(self, on: bool, at: Position | None = None) -> None:
        """Show a 4x inset: around the mouse, or around a place."""
        self._magnifying = on and self.opened is not None and self.canvas is not None
        self._magnified = at
        if not self._magnifying:
            if self._loupe is not None:
                self._loupe.hide()
            return
        if self._loupe is None:
            self._loupe = Loupe(self.scene, self._stage)
        self._move_loupe()

    def screenshot(self) -> QtGui.QImage:
        """Return what the canvas shows."""
        return self.canvas.picture() if self.canvas is not None else QtGui.QImage()

    def refresh(self) -> None:
        """Draw a new picture, once for all that changes before Qt paints next."""
        if self.canvas is not None:
            self.canvas.refresh()

    def shutdown(self) -> None:
        """Stop timers and free what VTK holds; may be called again."""
        if self._closed:
            return
        self._closed = True
        for timer in (self._opener, self._rest, self._hover, self._patience):
            timer.stop()
        self._stage.removeEventFilter(self)
        self._drop_loupe()
        self._drop_canvas()

    # Qt's events

    def showEvent(self, event: QtGui.QShowEvent) -> None:
        """Make the canvas when the view is first seen.

        Not earlier: a view that is made, then floated, before its first picture stays empty where
        OpenGL contexts are not shared (QGIS 3.22).
        """
        super().showEvent(event)
        if not self._closed and self.canvas is None:
            self._opener.start()
        elif self.canvas is not None and not self.canvas.works:
            self._patience.start()

    def changeEvent(self, event: QtCore.QEvent) -> None:
        """Follow a change between light and dark."""
        super().changeEvent(event)
        if event.type() == QtCore.QEvent.Type.PaletteChange and hasattr(self, "scene"):
            self._follow_palette()
            self.refresh()

    def dragEnterEvent(self, event: QtGui.QDragEnterEvent) -> None:
        """Take files."""
        if any(url.isLocalFile() for url in event.mimeData().urls()):
            event.acceptProposedAction()

    def dropEvent(self, event: QtGui.QDropEvent) -> None:
        """Hand on the first file."""
        paths = [url.toLocalFile() for url in event.mimeData().urls() if url.isLocalFile()]
        if paths:
            event.acceptProposedAction()
            self.dropped.emit(paths[0])

    def eventFilter(self, watched: QtCore.QObject, event: QtCore.QEvent) -> bool:
        """Follow the stage's size, and keep the mouse from VTK: the view moves its own camera."""
        kind, types = event.type(), QtCore.QEvent.Type
        if watched is self._stage:
            if kind == types.Resize:
                self._lay_out()
            return False
        if self.canvas is None or watched is not self.canvas.surface:
            return False
        if kind in (types.MouseButtonPress, types.MouseButtonDblClick):
            self._pressed(event)
        elif kind == types.MouseMove:
            self._moved(event)
        elif kind == types.MouseButtonRelease:
            self._released(event)
        elif kind == types.Wheel:
            self._wheeled(event)
        elif kind == types.Leave:
            self._hover.stop()
            self.hovered.emit(None)
            if self._loupe is not None and self._magnified is None:
                self._loupe.hide()
        elif kind != types.Enter:
            return False
        return True

    # The canvas

    def _make_canvas(self) -> None:
        if self._closed or self.canvas is not None:
            return
        self.canvas = make_canvas(self._stage, self._kind)
        self._ratio = self.devicePixelRatioF()
        self.canvas.surface.installEventFilter(self)
        self.canvas.setVisible(self.opened is not None)
        self._lay_out()
        self.scene.attach(self.canvas.plotter, ratio=self._ratio)
        self.set_picking(self._picking)
        if not self._aimed:
            self.scene.fit()
        self.refresh()
        self._patience.start()

    def _check_canvas(self) -> None:
        """Take the image canvas where an OpenGL widget got no context."""
        if self.canvas is None or not self.isVisible() or self.opened is None:
            return
        if not self.canvas.works:
            self._drop_canvas()
            self._kind = "image"
            self._make_canvas()

    def _drop_canvas(self) -> None:
        if self.canvas is None:
            return
        self._drop_loupe()
        self.canvas.surface.removeEventFilter(self)
        self.scene.detach()
        self.canvas.release()
        self.canvas.hide()
        self.canvas.deleteLater()
        self.canvas = None

    def _lay_out(self) -> None:
        area = self._stage.rect()
        self._prompt.setGeometry(area)
        if self.canvas is not None:
            if self.canvas.geometry() != area:
                self.canvas.setGeometry(area)
                self.scene.resized()
            if self.devicePixelRatioF() != self._ratio:
                # The window has moved to a screen of another density.
                self._ratio = self.devicePixelRatioF()
                self.scene.attach(self.canvas.plotter, ratio=self._ratio)
        self.legend.move(8, area.height() - self.legend.height() - 8)
        self.legend.raise_()

    def _describe(self) -> None:
        self.header.describe(self.opened)
        self.header.offer(self.scene.modes, self.scene.mode)
        self._describe_states()
        self.legend.show_legend(self.scene.legend)
        self._prompt.setVisible(self.opened is None)
        if self.canvas is not None:
            self.canvas.setVisible(self.opened is not None)
            self._patience.start()
        self._lay_out()

    def _describe_states(self) -> None:
        self.header.set_states(
            size=self.scene.point_size,
            eye_dome=self.scene.eye_dome,
            parallel=self.camera.parallel,
        )

    def _follow_palette(self) -> None:
        window = self.palette().color(QtGui.QPalette.ColorRole.Window)
        self.scene.set_dark(window.lightness() < 128)

    def _make_overlay_bar(self) -> QtWidgets.QWidget:
        self._overlay_bar = QtWidgets.QWidget(self)
        self._opacity = QtWidgets.QSlider(QtCore.Qt.Orientation.Horizontal)
        self._opacity.setRange(0, 100)
        self._opacity.setValue(100)
        self._opacity.setAccessibleName("Opacity of the overlaid source")
        self._opacity.valueChanged.connect(lambda value: self.set_overlay_opacity(value / 100))
        swap = QtWidgets.QToolButton()
        swap.setText("Swap")
        swap.setToolTip("Target alone, source alone, both (X)")
        swap.clicked.connect(self.swap)
        self._overlay_state = QtWidgets.QLabel("A+B")
        self._overlay_state.setToolTip("A: the target; B: the source, carried into its frame")
        row = QtWidgets.QHBoxLayout(self._overlay_bar)
        row.setContentsMargins(6, 2, 6, 2)
        row.addWidget(QtWidgets.QLabel("Overlaid source"))
        row.addWidget(self._opacity, 1)
        row.addWidget(self._overlay_state)
        row.addWidget(swap)
        self._overlay_bar.hide()
        return self._overlay_bar

    def _mark(self) -> None:
        ghost = () if self._ghost is None else (self._ghost,)
        self.scene.set_markers((*self._markers, *ghost))
        self.refresh()

    # The mouse

    def _pressed(self, event: Any) -> None:
        self.setFocus(QtCore.Qt.FocusReason.MouseFocusReason)
        at, buttons = _place(event), QtCore.Qt.MouseButton
        if self.opened is None:
            return
        is_double = event.type() == QtCore.QEvent.Type.MouseButtonDblClick
        if is_double and event.button() == buttons.LeftButton and not self._picking:
            row = self._row_at(at)
            if row is not None:
                self.fly_to(_position(self.scene.coordinates(row)))
            return
        self._press, self._last, self._dragging = (at, event.button()), at, False

    def _moved(self, event: Any) -> None:
        at = _place(event)
        self._mouse = at
        if self._press is None or self._last is None:
            self._hover.start()
            self._move_loupe()
            return
        start, button = self._press
        if not self._dragging and (at - start).manhattanLength() <= CLICK:
            return
        self._dragging = True
        step = (at - self._last) / max(1, self._stage.height())
        self._last = at
        modifiers, keys = event.modifiers(), QtCore.Qt.KeyboardModifier
        left = button == QtCore.Qt.MouseButton.LeftButton
        if left and modifiers & keys.ControlModifier:
            self.scene.camera = self.camera.rolled(TURN / 2 * step.x())
            self.scene.take_up()
        elif left and not modifiers & keys.ShiftModifier:
            self.scene.camera = self.camera.orbited(-TURN * step.x(), TURN * step.y())
        else:
            self.scene.camera = self.camera.panned(-step.x(), step.y())
        self._user_moved()

    def _released(self, event: Any) -> None:
        if self._press is None:
            return
        (_, button), dragged = self._press, self._dragging
        self._press, self._last, self._dragging = None, None, False
        left = button == QtCore.Qt.MouseButton.LeftButton
        if not dragged and left and self._picking:
            self._pick(_place(event))

    def _wheeled(self, event: Any) -> None:
        if self.opened is None:
            return
        angle = event.angleDelta()
        turns = (angle.y() or angle.x()) / 120
        at, height = _place(event), max(1, self._stage.height())
        right = (at.x() - self._stage.width() / 2) / height
        upward = (height / 2 - at.y()) / height
        about = np.asarray(self.camera.panned(right, upward).focal_point)
        self.scene.camera = self.camera.zoomed(WHEEL**turns, about)
        self._user_moved()

    def _user_moved(self) -> None:
        self._aimed = True
        self._keep_moving()
        self.camera_changed.emit()

    def _keep_moving(self) -> None:
        """Draw now what there is time for, and everything once the view rests."""
        if self.canvas is not None:
            self.scene.set_moving(True)
            self._rest.start()
        self._move_loupe()
        self.refresh()

    def _refine(self) -> None:
        was_thinned = self.scene.is_thinned
        self.scene.set_moving(False)
        if was_thinned:
            self.refresh()

    def _row_at(self, at: QtCore.QPointF) -> int | None:
        if self.canvas is None:
            return None
        reach = REACH / ZOOM if self._magnifying and self._magnified is None else REACH
        x, y = at.x() * self._ratio, (self._stage.height() - at.y()) * self._ratio
        return self.scene.pick_at(x, y, tolerance=reach)

    def _pick(self, at: QtCore.QPointF) -> None:
        row = self._row_at(at)
        if row is None:
            self.refused.emit(
                f"There is no point within {REACH:g} pixels of the click: zoom in, or click on "
                f"the cloud."
            )
            return
        raw = self.scene.coordinates(row)
        mode, radius = self._snap
        if radius is None:
            radius = SNAP_REACH * self.scene.pixel_at(row)
        try:
            found = snap(
                self.scene.around(row, 2 * radius),
                raw,
                mode,
                radius,
                up=np.asarray(self.scene.up, np.float64),
            )
        except SnapError as error:
            self.refused.emit(str(error))
            return
        clicked = ", ".join(f"{value:.3f}" for value in raw)
        note = f"{found.note}; clicked {clicked}" if found.note else ""
        self.picked.emit(Picked(_position(found.xyz), found.sigma, note, _position(raw)))

    def _tell_hovered(self) -> None:
        row = self._row_at(self._mouse)
        self.hovered.emit(None if row is None else _position(self.scene.coordinates(row)))

    # The magnifier

    def _move_loupe(self) -> None:
        if not self._magnifying or self._loupe is None:
            return
        at = self._mouse
        if self._magnified is not None:
            x, y = self.scene.project(self._magnified) / self._ratio
            at = QtCore.QPointF(x, self._stage.height() - y)
        self._loupe.look(at)
        self._loupe.show()
        self._loupe.raise_()

    def _drop_loupe(self) -> None:
        if self._loupe is not None:
            self._loupe.release()
            self._loupe.deleteLater()
            self._loupe = None
        self._magnifying = False

    def _choose_up(self, up: Position | None) -> None:
        if self.opened is not None:
            self.set_up(guess_up(self.opened.cloud.xyz) if up is None else up)

    def _timer(self, interval: int, slot: Any) -> QtCore.QTimer:
        timer = QtCore.QTimer(self)
        timer.setSingleShot(True)
        timer.setInterval(interval)
        timer.timeout.connect(slot)
        return timer


class Link(QtCore.QObject):
    """Ties the cameras of two views through a similarity; moving either moves the other."""

    def __init__(self, source: CloudView, target: CloudView) -> None:
        super().__init__(target)
        self._source, self._target = source, target
        self._similarity: Similarity | None = None
        source.camera_changed.connect(self._lead_target)
        target.camera_changed.connect(self._lead_source)

    @property
    def is_tied(self) -> bool:
        """Whether the cameras are tied."""
        return self._similarity is not None

    def follow(self, similarity: Similarity | None) -> None:
        """Tie the cameras through this similarity; None unties them.

        The source's camera goes where the target's is, since there up is known.
        """
        self._similarity = similarity
        self._lead_source()

    def _lead_target(self) -> None:
        if self._similarity is not None:
            self._target.set_camera(self._source.camera.through(self._similarity))

    def _lead_source(self) -> None:
        if self._similarity is not None:
            self._source.set_camera(self._target.camera.through(self._similarity.inverse()))


def _place(event: Any) -> QtCore.QPointF:
    # Qt 6 has position(), Qt 5 localPos(); of wheels both have position().
    return QtCore.QPointF(event.position() if hasattr(event, "position") else event.localPos())


def _position(values: NDArray[np.float64]) -> Position:
    x, y, z = map(float, values)
    return x, y, z
