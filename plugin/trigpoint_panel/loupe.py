"""The magnifier: what is around the mouse or a place, four times as large."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from qtpy import QtCore, QtGui, QtWidgets

from trigpoint_panel.camera import Camera, Position
from trigpoint_panel.canvas import ImageCanvas
from trigpoint_panel.lighting import EyeDome
from trigpoint_panel.scene import Scene
from trigpoint_panel.sight import aim
from trigpoint_panel.stage import Stage

ZOOM = 4
SIDE = 200
# Its points are wider, or the surfaces in it would fall apart.
WIDER = ZOOM**0.5
# Pixels between the mouse and the inset, so that the hand does not cover what it shows.
AWAY = 28


class Loupe(ImageCanvas):
    """An inset with its own picture of a scene."""

    def __init__(self, scene: Scene, parent: QtWidgets.QWidget) -> None:
        super().__init__(parent)
        self._scene = scene
        self.setFixedSize(SIDE, SIDE)
        self.setAttribute(QtCore.Qt.WidgetAttribute.WA_TransparentForMouseEvents)
        self.plotter.suppress_rendering = True
        self._lighting = EyeDome(self.plotter.renderer)
        self._lighting.measure(scene.extent)
        self._lighting.switch(True)
        scene.add_renderer(self.plotter.renderer, wider=WIDER)

    def look(self, at: QtCore.QPointF) -> None:
        """Show what is around a place of the parent, and stand beside it."""
        parent = self.parentWidget()
        if parent is None:
            return
        width, height = parent.width(), parent.height()
        self.plotter.renderer.SetBackground(*self._scene.background)
        camera = narrowed(self._scene.camera, (at.x(), at.y()), (width, height), SIDE / ZOOM)
        aim(self.plotter.renderer.GetActiveCamera(), camera, self._scene.origin)
        self.plotter.renderer.ResetCameraClippingRange()
        left = at.x() + AWAY if at.x() + AWAY + SIDE <= width else at.x() - AWAY - SIDE
        top = at.y() - AWAY - SIDE if at.y() - AWAY - SIDE >= 0 else at.y() + AWAY
        self.move(
            round(min(max(left, 0), max(width - SIDE, 0))),
            round(min(max(top, 0), max(height - SIDE, 0))),
        )
        self.refresh()

    def paintEvent(self, event: QtGui.QPaintEvent) -> None:
        """Paint the picture, a cross that leaves the middle free, and a frame."""
        super().paintEvent(event)
        painter = QtGui.QPainter(self)
        middle, gap = SIDE / 2, 6.0
        for width, colour in ((4, QtGui.QColor("white")), (2, QtGui.QColor("black"))):
            painter.setPen(QtGui.QPen(colour, width))
            for dx, dy in ((1, 0), (-1, 0), (0, 1), (0, -1)):
                ends = [QtCore.QPointF(middle + r * dx, middle + r * dy) for r in (gap, gap + 18)]
                painter.drawLine(*ends)
        painter.setPen(QtGui.QPen(self.palette().color(QtGui.QPalette.ColorRole.Highlight), 3))
        painter.drawRect(self.rect())
        painter.end()

    def release(self) -> None:
        """Free what VTK holds."""
        self._scene.remove_renderer(self.plotter.renderer)
        self._lighting.release()
        super().release()


class Magnifier:
    """Keeps a loupe over a stage while it is wanted.

    Parameters
    ----------
    scene : Scene
    stage : Stage
    """

    def __init__(self, scene: Scene, stage: Stage) -> None:
        self._scene, self._stage = scene, stage
        self._loupe: Loupe | None = None
        self._is_on = False
        self._place: Position | None = None

    @property
    def is_at_mouse(self) -> bool:
        """Whether what is under the mouse is magnified."""
        return self._is_on and self._place is None

    def show(self, place: Position | None) -> None:
        """Magnify a place, or what is under the mouse, from when that is told next."""
        self._is_on, self._place = True, place
        if self._loupe is None:
            self._loupe = Loupe(self._scene, self._stage)

    def follow(self, mouse: QtCore.QPointF | None) -> None:
        """Show what is to be magnified now; the mouse is at a place of the stage, or elsewhere."""
        if not self._is_on or self._loupe is None:
            return
        at = mouse
        if self._place is not None:
            x, y = self._scene.project(self._place) / self._stage.ratio
            at = QtCore.QPointF(x, self._stage.height() - y)
        if at is None:
            self._loupe.hide()
            return
        self._loupe.look(at)
        self._loupe.show()
        self._loupe.raise_()

    def hide(self) -> None:
        """Magnify nothing."""
        self._is_on, self._place = False, None
        if self._loupe is not None:
            self._loupe.hide()

    def drop(self) -> None:
        """Magnify nothing, and free what VTK holds."""
        self._is_on = False
        if self._loupe is not None:
            self._loupe.release()
            self._loupe.deleteLater()
            self._loupe = None


def narrowed(
    camera: Camera, at: tuple[float, float], size: tuple[float, float], side: float
) -> Camera:
    """Return the camera that sees only a square about a place of the picture, all in pixels.

    It stands where the other one stands, so it sees the same surfaces in front.
    """
    width, height = size
    right, upward = (at[0] - width / 2) / height, (height / 2 - at[1]) / height
    aside = camera.panned(right, upward)
    if camera.parallel:
        return replace(aside, parallel_scale=camera.parallel_scale * side / height)
    # Away from the middle the same angle covers more of the plane.
    stretch = np.hypot(1, np.hypot(right, upward) * camera.height / camera.distance)
    half = np.tan(np.radians(camera.view_angle / 2)) * side / height / stretch
    return replace(
        camera, focal_point=aside.focal_point, view_angle=float(2 * np.degrees(np.arctan(half)))
    )
