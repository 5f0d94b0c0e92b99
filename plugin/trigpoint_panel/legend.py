"""A small card that says how to read a view's colours."""

from __future__ import annotations

from qtpy import QtCore, QtGui, QtWidgets

from trigpoint_panel.colouring import Legend

WIDE, PAD, BAR = 150, 8, 10


class LegendCard(QtWidgets.QWidget):
    """Paints a legend: a ramp with its ends, or named swatches."""

    def __init__(self, parent: QtWidgets.QWidget) -> None:
        super().__init__(parent)
        self._legend: Legend | None = None
        self._note = ""
        self.setAttribute(QtCore.Qt.WidgetAttribute.WA_TransparentForMouseEvents)
        self.hide()

    def show_legend(self, legend: Legend | None, note: str = "") -> None:
        """Show a legend and a line that says what else to know; nothing without both."""
        self._legend, self._note = (Legend("") if note and legend is None else legend), note
        self.setVisible(self._legend is not None)
        if self._legend is not None:
            self.setAccessibleName(" ".join(filter(None, (_words(self._legend), note))))
            self.resize(self.sizeHint())
            self.update()

    def sizeHint(self) -> QtCore.QSize:
        """Return the size that the legend's lines need."""
        legend = self._legend
        if legend is None:
            return QtCore.QSize(0, 0)
        line = self.fontMetrics().height() + 3
        names = [legend.title, *(name for _, name in legend.swatches)]
        widest = max(self.fontMetrics().horizontalAdvance(name) for name in names)
        widest = max(widest, self.fontMetrics().horizontalAdvance(self._note) - BAR - 6)
        ends = self.fontMetrics().horizontalAdvance(legend.low + legend.high) + 20
        width = max(WIDE if legend.ramp else 0, widest + BAR + 6, ends) + 2 * PAD
        heads = bool(legend.title) + bool(self._note)
        height = line * (heads + len(legend.swatches)) + (BAR + line if legend.ramp else 0)
        return QtCore.QSize(width, height + 2 * PAD - 3)

    def paintEvent(self, event: QtGui.QPaintEvent) -> None:
        """Paint the card."""
        del event
        legend = self._legend
        if legend is None:
            return
        painter = QtGui.QPainter(self)
        painter.setRenderHint(QtGui.QPainter.RenderHint.Antialiasing)
        ground = self.palette().color(QtGui.QPalette.ColorRole.Window)
        ground.setAlpha(225)
        painter.setBrush(ground)
        painter.setPen(QtCore.Qt.PenStyle.NoPen)
        painter.drawRoundedRect(self.rect(), 4, 4)
        painter.setPen(self.palette().color(QtGui.QPalette.ColorRole.WindowText))
        line = self.fontMetrics().height() + 3
        wide, top = self.width() - 2 * PAD, PAD
        left = QtCore.Qt.AlignmentFlag.AlignLeft
        for head in filter(None, (self._note, legend.title)):
            painter.drawText(QtCore.QRect(PAD, top, wide, line), left, head)
            top += line
        if legend.ramp:
            self._paint_ramp(painter, legend, QtCore.QRect(PAD, top, wide, BAR))
            top += BAR + 2
            ends = QtCore.QRect(PAD, top, wide, line)
            painter.drawText(ends, left, legend.low)
            painter.drawText(ends, QtCore.Qt.AlignmentFlag.AlignRight, legend.high)
            top += line
        for colour, name in legend.swatches:
            painter.fillRect(PAD, top + (line - BAR) // 2 - 1, BAR, BAR, QtGui.QColor(colour))
            painter.drawText(QtCore.QRect(PAD + BAR + 6, top, wide, line), left, name)
            top += line
        painter.end()

    def _paint_ramp(self, painter: QtGui.QPainter, legend: Legend, bar: QtCore.QRect) -> None:
        count = len(legend.ramp)
        for k, colour in enumerate(legend.ramp):
            start, end = (bar.left() + bar.width() * i // count for i in (k, k + 1))
            painter.fillRect(start, bar.top(), end - start, bar.height(), QtGui.QColor(colour))


def _words(legend: Legend) -> str:
    names = ", ".join(name for _, name in legend.swatches)
    ends = f" from {legend.low} to {legend.high}" if legend.ramp else ""
    return f"{legend.title}{ends}{': ' if names else ''}{names}"
