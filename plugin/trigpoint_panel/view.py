"""CloudView: one cloud in a window, with its header, mouse and picks."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from qtpy import QtCore, QtGui, QtWidgets

from trigpoint.similarity import Similarity
from trigpoint_panel.camera import Camera, Face, Position
from trigpoint_panel.canvas import Canvas, CanvasKind
from trigpoint_panel.colouring import ColourMode
from trigpoint_panel.ground import guess_up
from trigpoint_panel.header import Header
from trigpoint_panel.loupe import ZOOM, Magnifier
from trigpoint_panel.marks import Marker
from trigpoint_panel.mouse import Drag, Mouse
from trigpoint_panel.opening import Opened
from trigpoint_panel.overlaybar import OverlayBar
from trigpoint_panel.picking import pick, position_of
from trigpoint_panel.scene import Scene
from trigpoint_panel.snapping import Mode, SnapError
from trigpoint_panel.stage import Stage
from trigpoint_panel.steering import dragged, flown, lookouts, wheeled
from trigpoint_reporting.elevations import LIMIT_M

Side = Literal["source", "target"]
TITLES: dict[Side, str] = {"source": "Source", "target": "Reference"}

# Pixels around the cursor in which a point is picked.
REACH = 5.0
# Milliseconds that the view rests before all points are drawn again.
REST = 200
# Pixels of the frame that tells which view has the keys.
FRAME = 2


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
        self._closed = False
        self._aimed = False
        self._snap: tuple[Mode, float | None] = ("point", None)
        self._markers: tuple[Marker, ...] = ()
        self._ghost: Marker | None = None
        self._part = ""

        self.header = Header(TITLES[side], self)
        self._stage = Stage(self.scene, self, kind=canvas)
        self.legend = self._stage.legend
        self._mouse = Mouse(self)
        self._magnifier = Magnifier(self.scene, self._stage)
        self._overlay_bar = OverlayBar(self)
        column = QtWidgets.QVBoxLayout(self)
        column.setContentsMargins(FRAME, FRAME, FRAME, FRAME)
        column.setSpacing(0)
        column.addWidget(self.header)
        column.addWidget(self._stage, 1)
        column.addWidget(self._overlay_bar)
        self.setFocusPolicy(QtCore.Qt.FocusPolicy.StrongFocus)
        self.setAttribute(QtCore.Qt.WidgetAttribute.WA_StyledBackground)  # a frame, when focused
        self.setAcceptDrops(True)
        self.setAccessibleName(f"{TITLES[side]} view")

        self._rest = QtCore.QTimer(self)
        self._rest.setSingleShot(True)
        self._rest.setInterval(REST)
        self._rest.timeout.connect(self._refine)
        self._stage.made.connect(self._enter_canvas)
        self._stage.dropped.connect(self._leave_canvas)
        self._mouse.pressed.connect(self._take_focus)
        self._mouse.clicked.connect(self._pick)
        self._mouse.asked.connect(self._offer_menu)
        self._mouse.doubled.connect(self._fly_under)
        self._mouse.dragged.connect(self._drag)
        self._mouse.wheeled.connect(self._zoom)
        self._mouse.moved.connect(self._follow_mouse)
        self._mouse.rested.connect(self._tell_hovered)
        self._mouse.left.connect(self._forget_mouse)
        self._overlay_bar.opacity_chosen.connect(self.set_overlay_opacity)
        self._overlay_bar.swap_chosen.connect(self.swap)
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
        self._magnifier.drop()
        self.opened, self._part = opened, ""
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
        self._stage.set_prompt(text)

    def set_distances(
        self, distances: NDArray[np.float64] | None, *, limit: float = LIMIT_M
    ) -> None:
        """Give each shown point its distance in metres, shape (n,), and colour by it."""
        self.scene.set_distances(distances, limit=limit)
        self._describe()
        self.refresh()

    def isolate(self, mask: NDArray[np.bool_] | None, name: str = "") -> None:
        """Show only some of the shown points, such as a zone, and say so; None shows all."""
        self._magnifier.drop()
        self.scene.isolate(mask)
        self._part = f"Only {name} is shown" if mask is not None and name else ""
        self._tell_colours()
        self._stage.settle()
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
        self._magnifier.drop()
        self.scene.set_overlay(None if opened is None else opened.cloud, similarity)
        self._overlay_bar.setVisible(self.scene.has_overlay)
        self._overlay_bar.set_state("A+B")
        self._tell_colours()
        self._stage.settle()
        self.refresh()

    def set_overlay_opacity(self, opacity: float) -> None:
        """Show the overlay from 0 (not at all) to 1 (fully)."""
        self._overlay_bar.set_opacity(opacity)
        self.scene.set_overlay_opacity(opacity)
        self._stage.settle()
        self.refresh()

    def swap(self) -> None:
        """Show only the cloud, then only the overlay, then both again."""
        self._overlay_bar.set_state(self.scene.swap())
        self._tell_colours()
        self._stage.settle()
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
        self._mouse.picks = on
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
        self.scene.camera = flown(self.camera, xyz, self.scene.extent)
        self._user_moved()

    def show_place(self, xyz: Position) -> None:
        """Bring a place to the middle with what is around it, from where nothing hides it."""
        straight, *others = lookouts(self.camera, xyz, self.scene.extent)
        for camera in (straight, *others):
            self.scene.camera = camera
            if not self.scene.is_hidden(np.array([xyz], np.float64))[0]:
                break
        else:
            self.scene.camera = straight
        self._user_moved()

    def magnify(self, on: bool, at: Position | None = None) -> None:
        """Show a 4x inset: around the mouse, or around a place."""
        if on and self.opened is not None and self.canvas is not None:
            self._magnifier.show(at)
            self._follow_mouse()
        else:
            self._magnifier.hide()

    def refresh(self) -> None:
        """Draw a new picture, once for all that changes before Qt paints next."""
        self._stage.refresh()

    def shutdown(self) -> None:
        """Stop timers and free what VTK holds; may be called again."""
        if self._closed:
            return
        self._closed = True
        self._rest.stop()
        self._mouse.stop()
        self._magnifier.drop()
        self._stage.shutdown()

    # Qt's events

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

    # The canvas

    @property
    def canvas(self) -> Canvas | None:
        """What the view is drawn on, once it was shown."""
        return self._stage.canvas

    def _enter_canvas(self) -> None:
        assert self.canvas is not None
        self.canvas.surface.installEventFilter(self._mouse)
        self.set_picking(self._mouse.picks)
        if not self._aimed:
            self.scene.fit()
        self.refresh()

    def _leave_canvas(self) -> None:
        assert self.canvas is not None
        self._magnifier.drop()
        self.canvas.surface.removeEventFilter(self._mouse)

    def _describe(self) -> None:
        self.header.describe(self.opened)
        self.header.offer(self.scene.modes, self.scene.mode)
        self._describe_states()
        self._stage.fill(self.opened is not None)
        self._tell_colours()

    def _tell_colours(self) -> None:
        self.legend.show_legend(self.scene.legend if self.scene.shows_cloud else None, self._part)
        self._stage.lay_out()

    def _describe_states(self) -> None:
        self.header.set_states(
            size=self.scene.point_size,
            eye_dome=self.scene.eye_dome,
            parallel=self.camera.parallel,
        )

    def _follow_palette(self) -> None:
        window = self.palette().color(QtGui.QPalette.ColorRole.Window)
        self.scene.set_dark(window.lightness() < 128)

    def _offer_menu(self, at: QtCore.QPointF) -> None:
        surface = self.canvas.surface if self.canvas is not None else self
        self.header.more.menu().popup(surface.mapToGlobal(at.toPoint()))

    def _mark(self) -> None:
        ghost = () if self._ghost is None else (self._ghost,)
        self._stage.marks.show_markers((*self._markers, *ghost))
        self._stage.settle()
        self.refresh()

    # The mouse

    def _take_focus(self) -> None:
        self.setFocus(QtCore.Qt.FocusReason.MouseFocusReason)

    def _fly_under(self, at: QtCore.QPointF) -> None:
        row = self._row_at(at)
        if row is not None:
            self.fly_to(position_of(self.scene.coordinates(row)))

    def _drag(self, drag: Drag, pixels: QtCore.QPointF) -> None:
        step = pixels / max(1, self._stage.height())
        self.scene.camera = dragged(self.camera, drag, step.x(), step.y())
        if drag == "roll":
            self.scene.take_up()
        self._user_moved()

    def _zoom(self, at: QtCore.QPointF, steps: float) -> None:
        height = max(1, self._stage.height())
        right = (at.x() - self._stage.width() / 2) / height
        upward = (height / 2 - at.y()) / height
        self.scene.camera = wheeled(self.camera, steps, right, upward)
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
        self._follow_mouse()
        self.refresh()

    def _refine(self) -> None:
        was_thinned = self.scene.is_thinned
        self.scene.set_moving(False)
        if self._stage.settle() or was_thinned:
            self.refresh()

    def _row_at(self, at: QtCore.QPointF) -> int | None:
        if self.canvas is None:
            return None
        reach = REACH / ZOOM if self._magnifier.is_at_mouse else REACH
        ratio = self._stage.ratio
        x, y = at.x() * ratio, (self._stage.height() - at.y()) * ratio
        return self.scene.pick_at(x, y, tolerance=reach)

    def _pick(self, at: QtCore.QPointF) -> None:
        row = self._row_at(at)
        if row is None:
            self.refused.emit(
                f"There is no point within {REACH:g} pixels of the click: zoom in, or click on "
                f"the cloud."
            )
            return
        try:
            self.picked.emit(pick(self.scene, row, *self._snap))
        except SnapError as error:
            self.refused.emit(str(error))

    def _tell_hovered(self) -> None:
        at = self._mouse.at
        if at is None:
            return
        row = self._row_at(at)
        self._point_at(at)
        self.hovered.emit(None if row is None else position_of(self.scene.coordinates(row)))

    def _follow_mouse(self) -> None:
        self._magnifier.follow(self._mouse.at)

    def _forget_mouse(self) -> None:
        self.hovered.emit(None)
        self._point_at(None)
        self._follow_mouse()

    def _point_at(self, at: QtCore.QPointF | None) -> None:
        if self.scene.is_drawn and self._stage.marks.point_at(at):
            self._stage.marks.update()

    def _choose_up(self, up: Position | None) -> None:
        if self.opened is not None:
            self.set_up(guess_up(self.opened.cloud.xyz) if up is None else up)
