"""A label that gives way: what does not fit is left out, or ends in three dots."""

from __future__ import annotations

from qtpy.QtCore import Qt
from qtpy.QtGui import QPainter, QPaintEvent
from qtpy.QtWidgets import QLabel, QSizePolicy, QWidget


class ElidedLabel(QLabel):
    """A line of text that gives way.

    Parameters
    ----------
    parent : QWidget, optional
    parted : bool
        Whether what stands behind a comma is left out whole where there is no room for it; a
        number cut short would be another number. Else, and at last, the text ends in three dots.
    """

    def __init__(self, parent: QWidget | None = None, *, parted: bool = False) -> None:
        super().__init__(parent)
        self._parted = parted
        self.setTextFormat(Qt.TextFormat.PlainText)
        self.setSizePolicy(QSizePolicy.Policy.Ignored, QSizePolicy.Policy.Preferred)
        self.setMinimumWidth(40)

    @property
    def shown(self) -> str:
        """As much of the text as there is room for."""
        text = self.text()
        shown = self._elided(text)
        while self._parted and ", " in text and shown != text:
            text = text.rpartition(", ")[0]
            shown = self._elided(text)
        return shown

    def paintEvent(self, event: QPaintEvent) -> None:
        """Paint as much of the text as there is room for."""
        shown = self.shown
        if shown == self.text():  # where it can be selected
            super().paintEvent(event)
            return
        painter = QPainter(self)
        painter.drawText(self.contentsRect(), Qt.AlignmentFlag.AlignVCenter, shown)
        painter.end()

    def _elided(self, text: str) -> str:
        way, width = Qt.TextElideMode.ElideRight, self.contentsRect().width()
        return self.fontMetrics().elidedText(text, way, width)
