"""Stage: a view's canvas, the marks over it, a legend in a corner, a prompt while it is empty."""

from __future__ import annotations

from typing import Any

from qtpy import QtCore, QtGui, QtWidgets

from trigpoint_panel.canvas import Canvas, CanvasKind, make_canvas
from trigpoint_panel.legend import LegendCard
from trigpoint_panel.marklayer import MarkLayer
from trigpoint_panel.scene import Scene

# Milliseconds that an OpenGL widget has until it must have a context.
PATIENCE = 1000
# Where the legend may stand, the best first: from the left, and from the top.
CORNERS = ((0, 1), (1, 1), (0, 0), (1, 0))


class Stage(QtWidgets.QWidget):
    """Makes the canvas when it is first shown, and another where that one cannot draw.

    Attributes
    ----------
    canvas : Canvas or None
    ratio : float
        Device pixels per pixel of the canvas.
    marks : MarkLayer
    legend : LegendCard

    Signals
    -------
    made ()
        There is a canvas, and the scene is drawn on it.
    dropped ()
        The canvas is about to go.
    """

    made = QtCore.Signal()
    dropped = QtCore.Signal()

    def __init__(
        self, scene: Scene, parent: QtWidgets.QWidget | None = None, *, kind: CanvasKind = "auto"
    ) -> None:
        super().__init__(parent)
        self.canvas: Canvas | None = None
        self.ratio = 1.0
        self._scene, self._kind = scene, kind
        self._closed, self._is_filled = False, False
        self.setMinimumSize(120, 90)
        self._prompt = QtWidgets.QLabel(self)
        self._prompt.setAlignment(QtCore.Qt.AlignmentFlag.AlignCenter)
        self._prompt.setWordWrap(True)
        self._prompt.setMargin(24)
        self.marks = MarkLayer(scene, self)
        self.marks.hide()
        self.legend = LegendCard(self)
        self._corner = CORNERS[0]
        self._opener = self._timer(0, self._make_canvas)
        self._patience = self._timer(PATIENCE, self._check_canvas)

    def set_prompt(self, text: str) -> None:
        """Say what to do while the stage is empty."""
        self._prompt.setText(text)

    def fill(self, on: bool) -> None:
        """Show the canvas, or the prompt."""
        self._is_filled = on
        self._prompt.setVisible(not on)
        if self.canvas is not None:
            self.canvas.setVisible(on)
            self.marks.setVisible(on)
            self._patience.start()
        self.lay_out()

    def lay_out(self) -> None:
        """Fit everything to the stage's size, and to the density of its screen."""
        area = self.rect()
        self._prompt.setGeometry(area)
        if self.canvas is not None:
            if self.canvas.geometry() != area:
                self.canvas.setGeometry(area)
                self._scene.resized()
            if self.devicePixelRatioF() != self.ratio:
                # The window has moved to a screen of another density.
                self.ratio = self.devicePixelRatioF()
                self._scene.attach(self.canvas.plotter, ratio=self.ratio)
        self.marks.setGeometry(area)
        self.marks.raise_()
        self._place_legend()
        self.legend.raise_()

    def refresh(self) -> None:
        """Draw a new picture, once for all that changes before Qt paints next."""
        if self.canvas is not None:
            self.canvas.refresh()
            self.marks.update()

    def settle(self) -> bool:
        """Look anew at what hides what, once the view rests; tell whether that has changed."""
        if not self._scene.is_drawn:
            return False
        before = self.legend.pos()
        self._place_legend()
        return self.marks.look() or self.legend.pos() != before

    def _place_legend(self) -> None:
        """Put the legend where it covers the fewest marks, and keep the labels away from it."""
        if self._scene.is_drawn:
            reach = QtCore.QMargins(8, 8, 8, 8)
            pixels = [QtCore.QPoint(round(x), round(y)) for x, y in self.marks.pixels()]

            def covered(corner: tuple[int, int]) -> tuple[int, bool]:
                card = self._card(corner).marginsAdded(reach)
                return sum(card.contains(pixel) for pixel in pixels), corner != self._corner

            self._corner = min(CORNERS, key=covered)
        self.legend.move(self._card(self._corner).topLeft())
        # Not yet shown itself, it is told apart from one that has nothing to show.
        self.marks.keep_clear(None if self.legend.isHidden() else self.legend.geometry())

    def _card(self, corner: tuple[int, int]) -> QtCore.QRect:
        room = self.size() - self.legend.size() - QtCore.QSize(16, 16)
        at = QtCore.QPoint(8 + corner[0] * room.width(), 8 + corner[1] * room.height())
        return QtCore.QRect(at, self.legend.size())

    def shutdown(self) -> None:
        """Stop timers and free what VTK holds."""
        self._closed = True
        self._opener.stop()
        self._patience.stop()
        self._drop_canvas()

    def showEvent(self, event: QtGui.QShowEvent) -> None:
        """Make the canvas when the stage is first seen.

        Not earlier: a view that is made, then floated, before its first picture stays empty where
        OpenGL contexts are not shared (QGIS 3.22).
        """
        super().showEvent(event)
        if not self._closed and self.canvas is None:
            self._opener.start()
        elif self.canvas is not None and not self.canvas.works:
            self._patience.start()

    def resizeEvent(self, event: QtGui.QResizeEvent) -> None:
        """Fit everything to the new size."""
        super().resizeEvent(event)
        if not self._closed:
            self.lay_out()

    def _make_canvas(self) -> None:
        if self._closed or self.canvas is not None:
            return
        self.canvas = make_canvas(self, self._kind)
        self.ratio = self.devicePixelRatioF()
        self.canvas.setVisible(self._is_filled)
        self.lay_out()
        self._scene.attach(self.canvas.plotter, ratio=self.ratio)
        self.marks.setVisible(self._is_filled)
        self.settle()
        self.made.emit()
        self._patience.start()

    def _check_canvas(self) -> None:
        """Take the image canvas where an OpenGL widget got no context."""
        if self.canvas is None or not self.isVisible() or not self._is_filled:
            return
        if not self.canvas.works:
            self._drop_canvas()
            self._kind = "image"
            self._make_canvas()

    def _drop_canvas(self) -> None:
        if self.canvas is None:
            return
        self.dropped.emit()
        self.marks.hide()
        self._scene.detach()
        self.canvas.release()
        self.canvas.hide()
        self.canvas.deleteLater()
        self.canvas = None

    def _timer(self, interval: int, slot: Any) -> QtCore.QTimer:
        timer = QtCore.QTimer(self)
        timer.setSingleShot(True)
        timer.setInterval(interval)
        timer.timeout.connect(slot)
        return timer
