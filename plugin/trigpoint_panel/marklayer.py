"""The marks over a view's picture: shapes, labels beside them, and what is hidden shown as such."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from qtpy import QtCore, QtGui, QtWidgets

from trigpoint_panel.marks import FLAGGED, LOOKS, SELECTED, Look, Marker
from trigpoint_panel.placing import SPOTS, Box, Wish, boxes_of, place
from trigpoint_panel.scene import Scene

# Pixels: half a mark, with its rim; how much larger a selected one is; a flagged one's ring.
RADIUS, RIM, CHOSEN, RING = 5.5, 2.0, 1.4, 4.0
# Letters, the space around them, and the longest name that is not shortened: pixels, and a share
# of the view.
LETTERS, PAD, LONGEST, SHARE = 12, 5, 170, 0.35
# Pixels around a mark in which the mouse points at it.
POINTED = 10.0


class MarkLayer(QtWidgets.QWidget):
    """Paints the markers of a scene over its canvas.

    Qt does it, not VTK: it shapes the letters of every script, and draws them as sharp as the
    screen is. No lighting changes their colours.

    Attributes
    ----------
    markers : tuple of Marker
    hidden : ndarray of bool
        Which of them something lies in front of.
    labels : dict of str to QRectF
        Where the labels stand that there was room for.
    """

    def __init__(self, scene: Scene, parent: QtWidgets.QWidget) -> None:
        super().__init__(parent)
        self._scene = scene
        self.markers: tuple[Marker, ...] = ()
        self.hidden = np.zeros(0, np.bool_)
        self.labels: dict[str, QtCore.QRectF] = {}
        self._taken: tuple[Box, ...] = ()
        self._spots: dict[str, int | None] = {}
        self._pointed: str | None = None
        self.setAttribute(QtCore.Qt.WidgetAttribute.WA_TransparentForMouseEvents)
        font = self.font()
        font.setPixelSize(LETTERS)
        font.setBold(True)
        self.setFont(font)

    def show_markers(self, markers: Sequence[Marker]) -> None:
        """Show these markers in place of those before."""
        self.markers = tuple(markers)
        self.hidden = np.zeros(len(self.markers), np.bool_)
        self.update()

    def look(self) -> bool:
        """Find out which marks are hidden now; tell whether that has changed."""
        before, self.hidden = self.hidden, self._scene.is_hidden(self._places())
        return not np.array_equal(before, self.hidden)

    def keep_clear(self, rect: QtCore.QRect | None) -> None:
        """Let no label stand in a rectangle."""
        self._taken = () if rect is None else (_box(QtCore.QRectF(rect)),)

    def point_at(self, at: QtCore.QPointF | None) -> bool:
        """Show the label of the mark at a place, if none was shown; tell whether that changes."""
        pointed = None
        if at is not None and self.markers:
            pixels = self.pixels()
            away = np.hypot(*(pixels - [at.x(), at.y()]).T)
            nearest = int(np.argmin(away))
            if away[nearest] <= POINTED:
                pointed = self.markers[nearest].label
        was, self._pointed = self._pointed, pointed
        return was != pointed and any(
            name is not None and self._spots.get(name) is None for name in (was, pointed)
        )

    def pixels(self) -> NDArray[np.float64]:
        """Return where the markers are, shape (n, 2); far outside of it what is not ahead."""
        places = self._places()
        pixels = self._scene.project(places) / self.devicePixelRatioF()
        pixels[:, 1] = self.height() - pixels[:, 1]
        pixels[~self._scene.is_ahead(places)] = -1e6
        return pixels

    def paintEvent(self, event: QtGui.QPaintEvent) -> None:
        """Paint lines to labels that stand apart, then the marks, then the labels."""
        del event
        self.labels = {}
        if not self.markers:
            return
        pixels = self.pixels()
        seen = np.all((pixels >= 0) & (pixels <= [self.width(), self.height()]), axis=1)
        # What chooses last is painted first.
        order = sorted(np.flatnonzero(seen).tolist(), key=lambda k: -self.markers[k].rank)
        wishes = {k: self._wish(k, pixels[k]) for k in order}
        area = float(self.width()), float(self.height())
        spots = dict(zip(wishes, place(list(wishes.values()), area, self._taken), strict=True))
        self._spots = {self.markers[k].label: spot for k, spot in spots.items()}
        painter = QtGui.QPainter(self)
        painter.setRenderHint(QtGui.QPainter.RenderHint.Antialiasing)
        rects = {
            k: _rect(boxes_of(wishes[k])[spot]) for k, spot in spots.items() if spot is not None
        }
        for k, rect in rects.items():
            if SPOTS[spots[k] or 0][2] > 0:
                self._paint_line(painter, k, pixels[k], rect)
        for k in order:
            self._paint_mark(painter, k, QtCore.QPointF(*pixels[k]))
            wanted = self.markers[k].selected or self.markers[k].label == self._pointed
            if wanted and k not in rects:
                rects[k] = self._beside(wishes[k])
        for k, rect in rects.items():
            self._paint_label(painter, k, rect)
            self.labels[self.markers[k].label] = rect
        painter.end()

    def _places(self) -> NDArray[np.float64]:
        return np.array([marker.xyz for marker in self.markers], np.float64).reshape(-1, 3)

    def _text(self, k: int) -> str:
        marker = self.markers[k]
        middle = QtCore.Qt.TextElideMode.ElideMiddle
        longest = round(min(LONGEST, SHARE * self.width()))
        name = self.fontMetrics().elidedText(marker.label, middle, longest)
        name = f"{name}: {marker.flag}" if marker.flag else name
        return f"({name})" if self.hidden[k] else name

    def _radius(self, k: int) -> float:
        return RADIUS * (CHOSEN if self.markers[k].selected else 1.0)

    def _wish(self, k: int, pixel: NDArray[np.float64]) -> Wish:
        marker, metrics = self.markers[k], self.fontMetrics()
        radius = self._radius(k) + (RING if marker.flag else RIM)
        wide = metrics.horizontalAdvance(self._text(k)) + 2 * PAD
        rank = 2 * marker.rank + int(self.hidden[k])
        before = self._spots.get(marker.label)
        x, y = map(float, pixel)
        return Wish(x, y, radius, float(wide), metrics.height() + 2.0, rank, before)

    def _beside(self, wish: Wish) -> QtCore.QRectF:
        """Return a label's box at the first spot, pushed into the view."""
        rect = _rect(boxes_of(wish)[0])
        rect.moveLeft(min(max(rect.left(), 2.0), max(self.width() - rect.width() - 2, 2.0)))
        rect.moveTop(min(max(rect.top(), 2.0), max(self.height() - rect.height() - 2, 2.0)))
        return rect

    def _look(self, k: int) -> Look:
        marker = self.markers[k]
        if marker.selected:
            return SELECTED
        return FLAGGED if marker.flag else LOOKS[marker.kind]

    def _paint_line(
        self, painter: QtGui.QPainter, k: int, pixel: NDArray[np.float64], rect: QtCore.QRectF
    ) -> None:
        end = QtCore.QPointF(
            min(max(pixel[0], rect.left()), rect.right()),
            min(max(pixel[1], rect.top()), rect.bottom()),
        )
        for colour, width in (("#FFFFFF", 2.6), (self._look(k).colour, 1.2)):
            painter.setPen(QtGui.QPen(QtGui.QColor(colour), width))
            painter.drawLine(QtCore.QPointF(*pixel), end)

    def _paint_mark(self, painter: QtGui.QPainter, k: int, at: QtCore.QPointF) -> None:
        marker, radius = self.markers[k], self._radius(k)
        look = LOOKS[marker.kind]
        colour, white = QtGui.QColor(look.colour), QtGui.QColor("white")
        none = QtCore.Qt.BrushStyle.NoBrush
        draw = painter.drawEllipse if look.is_round else _square(painter)
        if marker.flag:
            for ring, width in ((white, 4.5), (QtGui.QColor(FLAGGED.colour), 2.5)):
                painter.setBrush(none)
                painter.setPen(QtGui.QPen(ring, width))
                painter.drawEllipse(at, radius + RING, radius + RING)
        if self.hidden[k]:
            dashes = QtGui.QPen(colour, 2.0)
            dashes.setDashPattern([1.6, 1.2])
            painter.setBrush(none)
            for pen in (QtGui.QPen(white, 4.0), dashes):
                painter.setPen(pen)
                draw(at, radius, radius)
            return
        painter.setPen(QtGui.QPen(QtGui.QColor("black"), 2.5 if marker.selected else 1.0))
        painter.setBrush(white)
        draw(at, radius + RIM, radius + RIM)
        painter.setPen(QtCore.Qt.PenStyle.NoPen)
        painter.setBrush(colour)
        draw(at, radius, radius)
        if look.is_hollow:
            painter.setBrush(white)
            draw(at, radius / 2, radius / 2)

    def _paint_label(self, painter: QtGui.QPainter, k: int, rect: QtCore.QRectF) -> None:
        marker, look = self.markers[k], self._look(k)
        ground, ink, pen = QtGui.QColor(look.colour), QtGui.QColor(look.ink), None
        if self.hidden[k] and not marker.selected:
            pen = QtGui.QPen(QtGui.QColor(look.colour), 1.4, QtCore.Qt.PenStyle.DashLine)
            ground = self.palette().color(QtGui.QPalette.ColorRole.Window)
            ink = self.palette().color(QtGui.QPalette.ColorRole.WindowText)
        elif marker.selected:
            # A frame: on a dark picture black alone would not be seen.
            pen = QtGui.QPen(QtGui.QColor("white"), 2.0)
        painter.setBrush(ground)
        painter.setPen(QtCore.Qt.PenStyle.NoPen if pen is None else pen)
        painter.drawRoundedRect(rect, 2.5, 2.5)
        painter.setPen(ink)
        painter.drawText(rect, QtCore.Qt.AlignmentFlag.AlignCenter, self._text(k))


def _square(painter: QtGui.QPainter) -> Callable[..., Any]:
    """Return what draws a square as `drawEllipse` draws a circle."""

    def draw(at: QtCore.QPointF, wide: float, tall: float) -> None:
        painter.drawRect(QtCore.QRectF(at.x() - wide, at.y() - tall, 2 * wide, 2 * tall))

    return draw


def _rect(box: NDArray[np.float64]) -> QtCore.QRectF:
    left, top, right, bottom = map(float, box)
    return QtCore.QRectF(left, top, right - left, bottom - top)


def _box(rect: QtCore.QRectF) -> Box:
    return rect.left(), rect.top(), rect.right(), rect.bottom()
