"""Messages that wait in a strip, newest on top, instead of boxes that stand in the way."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial

from qtpy.QtCore import Qt, Signal
from qtpy.QtWidgets import (
    QApplication,
    QFrame,
    QHBoxLayout,
    QLabel,
    QPlainTextEdit,
    QSizePolicy,
    QToolButton,
    QVBoxLayout,
    QWidget,
)

from trigpoint_panel.style import look_of

# A level is a word and a sign before it is a colour.
WORDS = {"info": "Note", "success": "Done", "warning": "Doubt", "error": "Problem"}
SIGNS = {"info": "i", "success": "✓", "warning": "!", "error": "✗"}
MOST = 3  # messages at once; older ones make room


class Message(QFrame):
    """One sentence, what can be done about it, and its details folded away."""

    closed = Signal(object)

    def __init__(
        self,
        level: str,
        text: str,
        details: str,
        actions: Sequence[tuple[str, Callable[[], object]]],
        parent: QWidget,
    ) -> None:
        super().__init__(parent)
        self.level, self.text, self.details = level, text, details
        self.setObjectName("message")
        self.setAccessibleName(f"{WORDS[level]}: {text}")
        column = QVBoxLayout(self)
        column.setContentsMargins(10, 4, 4, 4)
        column.setSpacing(4)
        row = QHBoxLayout()
        row.setSpacing(8)
        column.addLayout(row)
        self.word = QLabel(f"{SIGNS[level]}  {WORDS[level]}", self)
        self.word.setObjectName("word")
        row.addWidget(self.word, 0, Qt.AlignmentFlag.AlignVCenter)
        self.label = QLabel(text, self)
        self.label.setTextFormat(Qt.TextFormat.PlainText)
        self.label.setWordWrap(True)
        self.label.setTextInteractionFlags(Qt.TextInteractionFlag.TextSelectableByMouse)
        self.label.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Preferred)
        row.addWidget(self.label, 1)
        self.buttons: list[QToolButton] = []
        for name, act in actions:
            self._button(row, name, partial(self._act, act))
        if details:
            self._details = QPlainTextEdit(details, self)
            self._details.setReadOnly(True)
            self._details.setFixedHeight(96)
            self._details.hide()
            column.addWidget(self._details)
            self._button(row, "Details", self._toggle_details)
            self._button(row, "Copy", self._copy)
        close = self._button(row, "✕", self.close_message)
        close.setAccessibleName("Close this message")
        close.setToolTip("Close this message")
        self.restyle()

    def close_message(self) -> None:
        """Go away."""
        self.closed.emit(self)

    def restyle(self) -> None:
        """Take the colours of the theme it is shown in."""
        look = look_of(self)
        colour = getattr(look, self.level)
        self.setStyleSheet(
            f"#message {{ background: {look.raised}; border: 0; "
            f"border-left: 4px solid {colour}; border-bottom: 1px solid {look.line}; }}"
            f"#word {{ color: {colour}; font-weight: 600; }}"
        )

    def _act(self, act: Callable[[], object]) -> None:
        self.close_message()
        act()

    def _button(self, row: QHBoxLayout, text: str, act: Callable[[], object]) -> QToolButton:
        button = QToolButton(self)
        button.setText(text)
        button.setAutoRaise(True)
        button.clicked.connect(lambda *_: act())
        row.addWidget(button, 0, Qt.AlignmentFlag.AlignVCenter)
        self.buttons.append(button)
        return button

    def _toggle_details(self) -> None:
        self._details.setVisible(self._details.isHidden())

    def _copy(self) -> None:
        QApplication.clipboard().setText(f"{self.text}\n\n{self.details}")


class MessageStrip(QWidget):
    """The messages there are, newest on top; nothing at all while there are none."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.messages: list[Message] = []
        self._column = QVBoxLayout(self)
        self._column.setContentsMargins(0, 0, 0, 0)
        self._column.setSpacing(0)
        self.hide()

    def add(
        self,
        level: str,
        text: str,
        details: str = "",
        actions: Sequence[tuple[str, Callable[[], object]]] = (),
    ) -> Message:
        """Show a message; the same one said again is shown once."""
        for old in list(self.messages):
            if old.text == text:
                self._remove(old)
        while len(self.messages) >= MOST:
            self._remove(self.messages[-1])
        message = Message(level, text, details, actions, self)
        message.closed.connect(self._remove)
        self.messages.insert(0, message)
        self._column.insertWidget(0, message)
        self.show()
        return message

    def texts(self) -> list[str]:
        """Return what is shown, newest first."""
        return [message.text for message in self.messages]

    def clear(self) -> None:
        """Take every message away."""
        for message in list(self.messages):
            self._remove(message)

    def restyle(self) -> None:
        """Take the colours of the theme it is shown in."""
        for message in self.messages:
            message.restyle()

    def _remove(self, message: Message) -> None:
        if message in self.messages:
            self.messages.remove(message)
            self._column.removeWidget(message)
            message.hide()
            message.deleteLater()
        self.setVisible(bool(self.messages))
