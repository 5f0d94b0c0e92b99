"""Mouse: what a hand on the mouse asks of a view."""

from __future__ import annotations

from typing import Any, Literal

from qtpy import QtCore

Drag = Literal["turn", "move", "roll"]

# Pixels that the mouse may move between press and release of a click.
CLICK = 4
# Milliseconds that the mouse rests before it is asked what it points at.
HOVER = 120


class Mouse(QtCore.QObject):
    """The mouse over a surface; nothing of it reaches the surface itself.

    Attributes
    ----------
    at : QPointF or None
        Where it moved last; None: it is elsewhere.
    picks : bool
        Whether clicks pick; a double click flies otherwise.

    Signals
    -------
    pressed ()
    clicked (QPointF)
        With the left button, while clicks pick.
    asked (QPointF)
        With the right button, which was not dragged: what can be done here.
    doubled (QPointF)
        With the left button, while clicks do not pick.
    dragged (str, QPointF)
        "turn", "move" or "roll", and by how many pixels since it was told last.
    wheeled (QPointF, float)
        Where, and how many steps.
    moved ()
        With no button down.
    rested ()
    left ()
    """

    pressed = QtCore.Signal()
    clicked = QtCore.Signal(object)
    asked = QtCore.Signal(object)
    doubled = QtCore.Signal(object)
    dragged = QtCore.Signal(str, object)
    wheeled = QtCore.Signal(object, float)
    moved = QtCore.Signal()
    rested = QtCore.Signal()
    left = QtCore.Signal()

    def __init__(self, parent: QtCore.QObject) -> None:
        super().__init__(parent)
        self.at: QtCore.QPointF | None = None
        self.picks = False
        self._press: tuple[QtCore.QPointF, Any] | None = None
        self._last = QtCore.QPointF()
        self._dragging = False
        self._hover = QtCore.QTimer(self)
        self._hover.setSingleShot(True)
        self._hover.setInterval(HOVER)
        self._hover.timeout.connect(self.rested)

    def stop(self) -> None:
        """Let no timer go off."""
        self._hover.stop()

    def eventFilter(self, watched: QtCore.QObject, event: QtCore.QEvent) -> bool:
        """Keep the mouse from VTK: the view moves its own camera."""
        del watched
        kind, types = event.type(), QtCore.QEvent.Type
        if kind in (types.MouseButtonPress, types.MouseButtonDblClick):
            self._pressed(event)
        elif kind == types.MouseMove:
            self._moved(event)
        elif kind == types.MouseButtonRelease:
            self._released(event)
        elif kind == types.Wheel:
            angle = self._angle(event)
            self.wheeled.emit(_place(event), angle / 120)
        elif kind == types.Leave:
            self._hover.stop()
            self.at = None
            self.left.emit()
        elif kind != types.Enter:
            return False
        return True

    @staticmethod
    def _angle(event: Any) -> int:
        angle = event.angleDelta()
        return int(angle.y() or angle.x())

    def _pressed(self, event: Any) -> None:
        self.pressed.emit()
        at, button = _place(event), event.button()
        is_double = event.type() == QtCore.QEvent.Type.MouseButtonDblClick
        if is_double and button == QtCore.Qt.MouseButton.LeftButton and not self.picks:
            self.doubled.emit(at)
            return
        self._press, self._last, self._dragging = (at, button), at, False

    def _moved(self, event: Any) -> None:
        at = _place(event)
        self.at = at
        if self._press is None:
            self._hover.start()
            self.moved.emit()
            return
        start, button = self._press
        if not self._dragging and (at - start).manhattanLength() <= CLICK:
            return
        self._dragging = True
        step, self._last = at - self._last, at
        modifiers, keys = event.modifiers(), QtCore.Qt.KeyboardModifier
        drag: Drag = "move"
        if button == QtCore.Qt.MouseButton.LeftButton:
            if modifiers & keys.ControlModifier:
                drag = "roll"
            elif not modifiers & keys.ShiftModifier:
                drag = "turn"
        self.dragged.emit(drag, step)

    def _released(self, event: Any) -> None:
        if self._press is None:
            return
        (_, button), dragged = self._press, self._dragging
        self._press, self._dragging = None, False
        if not dragged and button == QtCore.Qt.MouseButton.LeftButton and self.picks:
            self.clicked.emit(_place(event))
        elif not dragged and button == QtCore.Qt.MouseButton.RightButton:
            self.asked.emit(_place(event))


def _place(event: Any) -> QtCore.QPointF:
    # Qt 6 has position(), Qt 5 localPos(); of wheels both have position().
    return QtCore.QPointF(event.position() if hasattr(event, "position") else event.localPos())
