"""Line icons drawn in the text's own colour, so that they suit light and dark."""

from __future__ import annotations

from qtpy.QtCore import QPointF, QRectF, Qt
from qtpy.QtGui import QColor, QIcon, QPainter, QPainterPath, QPen, QPixmap

# On a field of 24: M move, L line, C circle (x, y, radius), Z close; one stroke after another.
STROKES = {
    "source": "M 3 19 L 3 5 L 10 5 L 12 8 L 21 8 L 21 19 Z C 9 14 1 C 13 12 1 C 15 16 1",
    "reference": "M 3 19 L 3 5 L 10 5 L 12 8 L 21 8 L 21 19 Z M 12 10.5 L 16 17 L 8 17 Z",
    "pick": "M 12 2 L 12 9 M 12 15 L 12 22 M 2 12 L 9 12 M 15 12 L 22 12 C 12 12 1",
    "undo": "M 9 5 L 4 10 L 9 15 M 4 10 L 15 10 L 19 12 L 20 15 L 19 18 L 15 20 L 9 20",
    "redo": "M 15 5 L 20 10 L 15 15 M 20 10 L 9 10 L 5 12 L 4 15 L 5 18 L 9 20 L 15 20",
    "link": "M 10 14 L 14 10 M 9 8 L 12 5 L 16 5 L 19 8 L 19 12 L 16 15 "
    "M 15 16 L 12 19 L 8 19 L 5 16 L 5 12 L 8 9",
    "overlay": "M 3 8 L 12 3 L 21 8 L 12 13 Z M 3 13 L 12 18 L 21 13 M 3 17 L 12 22 L 21 17",
    "swap": "M 4 8 L 20 8 M 16 4 L 20 8 L 16 12 M 20 16 L 4 16 M 8 12 L 4 16 L 8 20",
    "next": "M 12 21 L 6 12 L 6 8 L 9 4 L 15 4 L 18 8 L 18 12 Z M 12 7 L 12 13 M 9 10 L 15 10",
    "magnify": "C 10 10 6 M 14.5 14.5 L 21 21 M 7 10 L 13 10 M 10 7 L 10 13",
    "pane": "M 3 4 L 21 4 L 21 20 L 3 20 Z M 15 4 L 15 20",
    "more": "M 4 4 L 12 12 L 4 20 M 13 4 L 21 12 L 13 20",
    "menu": "M 4 6 L 20 6 M 4 12 L 20 12 M 4 18 L 20 18",
}


def icon(name: str, colour: str, chosen: str) -> QIcon:
    """Return an icon, in another colour while its button is down."""
    made = QIcon()
    for stroke, state in ((colour, QIcon.State.Off), (chosen, QIcon.State.On)):
        for alpha, mode in ((255, QIcon.Mode.Normal), (90, QIcon.Mode.Disabled)):
            made.addPixmap(_drawn(STROKES[name], stroke, alpha), mode, state)
    return made


def _drawn(strokes: str, colour: str, alpha: int) -> QPixmap:
    size, ratio = 18, 3
    pixmap = QPixmap(size * ratio, size * ratio)
    pixmap.fill(Qt.GlobalColor.transparent)
    pen_colour = QColor(colour)
    pen_colour.setAlpha(alpha)
    painter = QPainter(pixmap)
    painter.setRenderHint(QPainter.RenderHint.Antialiasing)
    painter.scale(size * ratio / 24, size * ratio / 24)
    pen = QPen(pen_colour, 1.8)
    pen.setCapStyle(Qt.PenCapStyle.RoundCap)
    pen.setJoinStyle(Qt.PenJoinStyle.RoundJoin)
    painter.setPen(pen)
    painter.drawPath(_path(strokes))
    painter.end()
    pixmap.setDevicePixelRatio(ratio)
    return pixmap


def _path(strokes: str) -> QPainterPath:
    path, words = QPainterPath(), iter(strokes.split())
    for word in words:
        if word == "Z":
            path.closeSubpath()
            continue
        x, y = float(next(words)), float(next(words))
        if word == "M":
            path.moveTo(QPointF(x, y))
        elif word == "L":
            path.lineTo(QPointF(x, y))
        else:
            r = float(next(words))
            path.addEllipse(QRectF(x - r, y - r, 2 * r, 2 * r))
    return path
