"""Messages that wait in a strip, newest on top, instead of boxes that stand in the way."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial

from qtpy.QtCore import QSize, Qt, QTimer, Signal
from qtpy.QtGui import QResizeEvent, QTextOption
from qtpy.QtWidgets import (
    QApplication,
    QBoxLayout,
    QFrame,
    QHBoxLayout,
    QLabel,
    QLayout,
    QPlainTextEdit,
    QSizePolicy,
    QToolButton,
    QVBoxLayout,
    QWidget,
)

from trigpoint_panel.style import look_of

# A level is a word and a sign before it is a colour.
WORDS = {"info": "Note", "success": "Done", "warning": "Warning", "error": "Problem"}
SIGNS = {"info": "i", "success": "✓", "warning": "!", "error": "✗"}
MOST = 3  # messages at once; older ones make room
ROOMY = 480  # pixels; where a message would have less beside its buttons, they go below it
MARGIN = 2  # pixels above and below a sentence
LEFT, RIGHT = 10, 4  # of a message
LINES = 5  # of a message at once; what is longer scrolls


class Sentence(QPlainTextEdit):
    """A text as high as its lines, to be read and copied whole in whatever width there is.

    A label would ask for the width of its longest word, and a path is one word.
    """

    def __init__(self, text: str, parent: QWidget | None = None) -> None:
        super().__init__(text, parent)
        self._fits = False
        self._later = QTimer(self)
        self._later.setSingleShot(True)
        self._later.timeout.connect(self._tell)
        self.setObjectName("sentence")
        self.setReadOnly(True)
        self.setTabChangesFocus(True)
        self.setFocusPolicy(Qt.FocusPolicy.ClickFocus)
        self.setWordWrapMode(QTextOption.WrapMode.WrapAtWordBoundaryOrAnywhere)
        self.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        self.setFrameShape(QFrame.Shape.NoFrame)
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Fixed)
        self.viewport().setAutoFillBackground(False)
        self.document().setDocumentMargin(MARGIN)
        self._fit()

    def minimumSizeHint(self) -> QSize:
        """Return the room it needs: a few words' width."""
        return QSize(160, self.height())

    def resizeEvent(self, event: QResizeEvent) -> None:
        """Take the height that the new width asks for."""
        super().resizeEvent(event)
        self._fit()

    def _tell(self) -> None:
        """Tell every layout that this stands in how high it is now."""
        layouts: list[QLayout] = []
        widget: QWidget | None = self
        while widget is not None and not widget.isWindow():
            widget.updateGeometry()
            widget = widget.parentWidget()
            layout = None if widget is None else widget.layout()
            if layout is not None:
                layouts.append(layout)
        # One that came and went hidden waits for a request that it has had.
        for each in reversed(layouts):
            each.activate()

    def _fit(self) -> None:
        if self._fits:
            return  # a scroll bar that comes or goes resizes it again
        self._fits = True
        policy = Qt.ScrollBarPolicy
        self.setVerticalScrollBarPolicy(policy.ScrollBarAlwaysOff)
        lines = int(self.document().size().height())  # of a plain text Qt counts lines here
        scrolls = lines > LINES
        if scrolls:
            self.setVerticalScrollBarPolicy(policy.ScrollBarAlwaysOn)
        # What scrolls has no margin below: the top of one more line would show in it.
        below = 0 if scrolls else MARGIN + 2
        height = min(lines, LINES) * self.cursorRect().height() + MARGIN + below
        if height != self.height():
            self.setFixedHeight(height)
            # A layout that is just being made does not hear of it: tell it again afterwards.
            self._later.start()
        self._fits = False


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
        column.setContentsMargins(LEFT, 4, RIGHT, 4)
        column.setSpacing(4)
        self._sides = QBoxLayout(QBoxLayout.Direction.LeftToRight)
        self._sides.setSpacing(4)
        top = QHBoxLayout()
        top.setSpacing(8)
        top.addLayout(self._sides, 1)
        column.addLayout(top)
        said, row = self._said, self._ways = QHBoxLayout(), QHBoxLayout()
        said.setSpacing(8)
        row.setSpacing(8)
        row.addStretch(1)
        self._sides.addLayout(said, 1)
        self._sides.addLayout(row)
        self.word = QLabel(f"{SIGNS[level]}  {WORDS[level]}", self)
        self.word.setObjectName("word")
        said.addWidget(self.word, 0, Qt.AlignmentFlag.AlignVCenter)
        self.sentence = Sentence(text, self)
        said.addWidget(self.sentence, 1, Qt.AlignmentFlag.AlignVCenter)
        self.buttons: list[QToolButton] = []
        for name, act in actions:
            self._button(row, name, partial(self._act, act, name.endswith("…")))
        if details:
            self._details = QPlainTextEdit(details, self)
            self._details.setReadOnly(True)
            self._details.setFixedHeight(96)
            self._details.hide()
            column.addWidget(self._details)
            self._button(row, "Details", self._toggle_details)
            self._button(row, "Copy", self._copy)
        self._has_ways = bool(self.buttons)
        close = self._button(top, "✕", self.close_message)
        close.setAccessibleName("Close this message")
        close.setToolTip("Close this message")
        self.restyle()

    def minimumSizeHint(self) -> QSize:
        """Return the room it needs: the buttons may go below the sentence."""
        widest = max(side.minimumSize().width() for side in (self._said, self._ways))
        rest = self.buttons[-1].sizeHint().width() + 8 + LEFT + RIGHT
        return QSize(widest + rest, super().minimumSizeHint().height())

    def resizeEvent(self, event: QResizeEvent) -> None:
        """Put the buttons below the sentence where there is no room beside it."""
        super().resizeEvent(event)
        others = self.word.sizeHint().width() + self._ways.sizeHint().width()
        beside = not self._has_ways or self.width() - others >= ROOMY
        way = QBoxLayout.Direction
        self._sides.setDirection(way.LeftToRight if beside else way.TopToBottom)

    def close_message(self) -> None:
        """Go away."""
        self.closed.emit(self)

    def restyle(self) -> None:
        """Take the colours of the theme it is shown in."""
        # Its own ground is what was chosen last: ask where it lies.
        look = look_of(self.parentWidget())
        colour = getattr(look, self.level)
        self.setStyleSheet(
            f"#message {{ background: {look.raised}; border: 0; "
            f"border-left: 4px solid {colour}; border-bottom: 1px solid {look.line}; }}"
            f"#word {{ color: {colour}; font-weight: 600; }}"
            "#sentence { background: transparent; border: 0; }"
        )

    def _act(self, act: Callable[[], object], asks_first: bool) -> None:
        """Act and go away; what asks first can be given up, and then the message still holds."""
        if not asks_first:
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
