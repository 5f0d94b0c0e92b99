"""What a scene is drawn on: an OpenGL widget, or a painted image where those cannot run."""

from __future__ import annotations

import os
from functools import partial
from typing import Any, Literal

import numpy as np
import pyvista as pv
from numpy.typing import NDArray
from qtpy import QtCore, QtGui, QtWidgets
from vtkmodules.util import numpy_support
from vtkmodules.vtkCommonCore import vtkUnsignedCharArray

CanvasKind = Literal["auto", "gl", "image"]

# Qt platforms that have no OpenGL widgets.
WITHOUT_GL = ("offscreen", "minimal", "vnc")


class Canvas(QtWidgets.QWidget):
    """A place that a plotter draws on, once for any number of requests.

    Attributes
    ----------
    plotter : pyvista plotter
    surface : QWidget
        What gets the mouse.
    kind : str
        "gl" or "image".
    """

    plotter: Any
    surface: QtWidgets.QWidget
    kind: CanvasKind

    def refresh(self) -> None:
        """Ask for a new picture; it is drawn once, when Qt next paints."""
        raise NotImplementedError

    @property
    def works(self) -> bool:
        """Whether pictures can be drawn; asked a moment after the canvas was shown."""
        raise NotImplementedError

    def release(self) -> None:
        """Free what VTK holds; the canvas can't be used after."""
        raise NotImplementedError


class GlCanvas(Canvas):
    """An OpenGL widget: the fast way, where Qt can share a context with VTK."""

    kind = "gl"

    def __init__(self, parent: QtWidgets.QWidget | None = None) -> None:
        from pyvistaqt import QtInteractor

        super().__init__(parent)
        # Its timer would render five times a second whether or not anything has changed.
        self.plotter = QtInteractor(self, auto_update=False, multi_samples=0)
        self.surface = self.plotter
        # Keys are the panel's shortcuts, and VTK's own would close or repaint the view.
        self.surface.setFocusPolicy(QtCore.Qt.FocusPolicy.NoFocus)
        self.surface.setAcceptDrops(False)
        layout = QtWidgets.QVBoxLayout(self)
        layout.setContentsMargins(0, 0, 0, 0)
        layout.addWidget(self.surface)

    def refresh(self) -> None:
        """Ask for a new picture; it is drawn once, when Qt next paints."""
        self.surface.update()

    @property
    def works(self) -> bool:
        """Whether the widget has an OpenGL context."""
        return bool(self.plotter.isValid())

    def resizeEvent(self, event: QtGui.QResizeEvent) -> None:
        """Tell VTK the size at once: it would learn it only with the first picture."""
        super().resizeEvent(event)
        window, ratio = self.plotter.render_window, self.devicePixelRatioF()
        if window is not None:
            window.SetSize(
                max(1, round(self.width() * ratio)), max(1, round(self.height() * ratio))
            )

    def release(self) -> None:
        """Free what VTK holds; the canvas can't be used after."""
        self.plotter.close()


class ImageCanvas(Canvas):
    """An off-screen picture painted into a widget: runs wherever VTK renders at all."""

    kind = "image"

    def __init__(self, parent: QtWidgets.QWidget | None = None) -> None:
        super().__init__(parent)
        if not (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")) and os.name != "nt":
            # VTK would look for a display first, and write that there is none.
            os.environ.setdefault("VTK_DEFAULT_OPENGL_WINDOW", "vtkEGLRenderWindow")
        self.plotter = pv.Plotter(off_screen=True, window_size=[400, 300])
        self.plotter.render_window.SetMultiSamples(0)
        self.surface = self
        self._pixels: NDArray[np.uint8] | None = None
        self._image = QtGui.QImage()
        self._stale = True
        self.setMouseTracking(True)
        self.setMinimumSize(80, 60)
        # A window may be deleted by Qt, with no one to ask for an orderly end.
        self.destroyed.connect(partial(_close, self.plotter))

    def refresh(self) -> None:
        """Ask for a new picture; it is drawn once, when Qt next paints."""
        self._stale = True
        self.update()

    @property
    def works(self) -> bool:
        """Always: what can't be rendered off the screen can't be rendered."""
        return True

    def release(self) -> None:
        """Free what VTK holds; the canvas can't be used after."""
        self._stale = False
        _close(self.plotter)

    def resizeEvent(self, event: QtGui.QResizeEvent) -> None:
        """Draw anew in the new size."""
        super().resizeEvent(event)
        self._fit_window()
        self._stale = True

    def paintEvent(self, event: QtGui.QPaintEvent) -> None:
        """Paint the picture, drawn anew if it is stale."""
        del event
        if self._stale:
            self._render()
        painter = QtGui.QPainter(self)
        painter.drawImage(0, 0, self._image)
        painter.end()

    def _fit_window(self) -> None:
        window, ratio = self.plotter.render_window, self.devicePixelRatioF()
        if window is not None:
            window.SetSize(
                max(1, round(self.width() * ratio)), max(1, round(self.height() * ratio))
            )

    def _render(self) -> None:
        self._stale = False
        window, ratio = self.plotter.render_window, self.devicePixelRatioF()
        if window is None:
            return
        self._fit_window()
        window.Render()
        width, height = window.GetSize()
        pixels = vtkUnsignedCharArray()
        window.GetPixelData(0, 0, width - 1, height - 1, 0, pixels, 0)
        rows = numpy_support.vtk_to_numpy(pixels).reshape(height, width, 3)  # type: ignore[no-untyped-call]
        # QImage reads these bytes as long as it lives.
        self._pixels = np.ascontiguousarray(rows[::-1])
        self._image = QtGui.QImage(
            self._pixels.data, width, height, 3 * width, QtGui.QImage.Format.Format_RGB888
        )
        self._image.setDevicePixelRatio(ratio)


def _close(plotter: Any, *_: object) -> None:
    if plotter.render_window is not None:
        plotter.close()


def make_canvas(parent: QtWidgets.QWidget | None = None, kind: CanvasKind = "auto") -> Canvas:
    """Make the canvas that was asked for, or by itself the one that can run here."""
    platform = QtGui.QGuiApplication.platformName()
    if kind == "auto":
        kind = "image" if platform in WITHOUT_GL else "gl"
    return ImageCanvas(parent) if kind == "image" else GlCanvas(parent)
