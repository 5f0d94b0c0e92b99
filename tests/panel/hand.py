"""A hand that works the panel: real mouse and key events, where a person would send them."""

import time

import numpy as np
from qtpy.QtCore import QEvent, QPoint, QPointF, Qt
from qtpy.QtGui import QMouseEvent
from qtpy.QtTest import QTest
from qtpy.QtWidgets import QApplication, QLineEdit

LEFT = Qt.MouseButton.LeftButton
NONE = Qt.KeyboardModifier.NoModifier
CTRL = Qt.KeyboardModifier.ControlModifier
SHIFT = Qt.KeyboardModifier.ShiftModifier
Key = Qt.Key


class Hand:
    """Clicks, drags and types in a window with a panel."""

    def __init__(self, window):
        self.window = window
        self.panel = window.panel

    def come_to_the_front(self):
        """Show the window, and have the keys go to it; a display may need asking twice."""
        self.window.show()

        def active():
            self.window.raise_()
            self.window.activateWindow()
            QApplication.processEvents()
            return self.window.isActiveWindow()

        self.until(active, 20)

    def until(self, true, seconds=60.0):
        """Let events run until something holds."""
        end = time.monotonic() + seconds
        while not true():
            assert time.monotonic() < end, f"waited {seconds} s: {self.panel.line.text}"
            QApplication.processEvents()
            time.sleep(0.005)
        QApplication.processEvents()

    def idle(self, seconds=60.0):
        """Let the jobs end."""
        self.until(lambda: self.panel.foot.job is None, seconds)

    def rest(self, seconds=0.3):
        """Let timers go off."""
        end = time.monotonic() + seconds
        self.until(lambda: time.monotonic() > end)

    def key(self, key, modifiers=NONE, widget=None):
        """Press a key where the focus is."""
        QTest.keyClick(widget or QApplication.focusWidget() or self.panel, key, modifiers)
        QApplication.processEvents()

    def type(self, text):
        """Type text where the focus is."""
        QTest.keyClicks(QApplication.focusWidget(), text)
        QApplication.processEvents()

    def click(self, widget):
        """Click on a button."""
        QTest.mouseClick(widget, LEFT, NONE, widget.rect().center())
        QApplication.processEvents()

    def spot(self, view, xyz):
        """Return where a place is on a view's surface."""
        x, y = view.scene.project(np.asarray(xyz, float))
        ratio = view.devicePixelRatioF()
        surface = view.canvas.surface
        return QPoint(round(x / ratio), round(surface.height() - y / ratio))

    def pick(self, side, xyz):
        """Click on a place in one view, and return the pair that this made or completed."""
        view = self.panel.views.view(side)
        before = self.panel.model.pairs
        QTest.mouseClick(view.canvas.surface, LEFT, NONE, self.spot(view, xyz))
        self.until(lambda: self.panel.model.pairs != before, 5)
        return self.panel.model.selected

    def drag(self, side, by):
        """Turn a view: press in its middle, move, let go."""
        surface = self.panel.views.view(side).canvas.surface
        start = surface.rect().center()
        QTest.mousePress(surface, LEFT, NONE, start)
        for step in range(1, 5):
            # Qt 5's QTest.mouseMove holds no button down.
            here = QPointF(start + QPoint(*by) * step / 4)
            there = QPointF(surface.mapToGlobal(here.toPoint()))
            moved = QMouseEvent(
                QEvent.Type.MouseMove, here, there, Qt.MouseButton.NoButton, LEFT, NONE
            )
            QApplication.sendEvent(surface, moved)
        QTest.mouseRelease(surface, LEFT, NONE, start + QPoint(*by))
        QApplication.processEvents()

    def choose(self, name, key):
        """Make a cell of the pair table the current one by clicking on it."""
        table = self.panel.table
        table.scrollTo(table.index_of(name, key))
        at = table.visualRect(table.index_of(name, key)).center()
        QTest.mouseClick(table.viewport(), LEFT, NONE, at)
        QApplication.processEvents()

    def enter(self, name, key, text):
        """Type into a cell of the pair table, by keyboard."""
        self.choose(name, key)
        table = self.panel.table
        table.setFocus()
        self.key(Key.Key_F2, widget=table)
        (editor,) = [each for each in table.findChildren(QLineEdit) if each.isVisible()]
        editor.selectAll()
        QTest.keyClicks(editor, text)
        QTest.keyClick(editor, Key.Key_Return)
        QApplication.processEvents()
