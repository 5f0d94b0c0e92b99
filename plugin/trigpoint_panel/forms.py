"""What the tabs at the side are made of: sections, rows, sentences, and fields that keep quiet."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any

from qtpy.QtCore import QLocale, QObject, QSignalBlocker, Qt, Signal
from qtpy.QtWidgets import (
    QDoubleSpinBox,
    QFormLayout,
    QFrame,
    QHBoxLayout,
    QLabel,
    QLineEdit,
    QPushButton,
    QScrollArea,
    QSizePolicy,
    QVBoxLayout,
    QWidget,
)

from trigpoint.errors import TrigpointError


class NumberBox(QDoubleSpinBox):
    """A field for a number with a decimal point; a comma typed or pasted becomes one.

    Refused, it would leave "0,05" as 005: five metres.
    """

    def validate(self, text: str, pos: int) -> Any:
        """Look at what is typed, its comma read as a point."""
        return super().validate(text.replace(",", "."), pos)


class Tab(QScrollArea):
    """A column of sections that scrolls where there is too little room.

    Attributes
    ----------
    refused : Signal(str)
        Why a setting can't be.
    """

    refused = Signal(str)

    def __init__(self, name: str, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName(name)
        self.setFrameShape(QFrame.Shape.NoFrame)
        self.setWidgetResizable(True)
        self.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        self.inside = QWidget(self)
        self.column = QVBoxLayout(self.inside)
        self.column.setContentsMargins(10, 8, 10, 10)
        self.column.setSpacing(6)
        self.setWidget(self.inside)

    @property
    def needed(self) -> int:
        """Width below which something of it would be cut off."""
        return self.inside.minimumSizeHint().width() + self.verticalScrollBar().sizeHint().width()

    def change(self, take: Callable[..., object], **changes: object) -> None:
        """Change settings, and tell it if they can't be."""
        try:
            take(**changes)
        except TrigpointError as error:
            self.refused.emit(str(error))

    def heading(self, text: str) -> QLabel:
        """Add a section's heading."""
        label = QLabel(text, self.inside)
        label.setProperty("role", "heading")
        if self.column.count():
            self.column.addSpacing(6)
        self.column.addWidget(label)
        return label

    def sentence(self, text: str = "", *, faint: bool = False) -> QLabel:
        """Add a sentence that wraps, and that can be selected and copied."""
        label = QLabel(text, self.inside)
        label.setTextFormat(Qt.TextFormat.PlainText)
        label.setWordWrap(True)
        label.setTextInteractionFlags(Qt.TextInteractionFlag.TextSelectableByMouse)
        label.setSizePolicy(QSizePolicy.Policy.Ignored, QSizePolicy.Policy.Preferred)
        if faint:
            label.setProperty("role", "faint")
        self.column.addWidget(label)
        label.setVisible(bool(text))
        return label

    def form(self) -> QFormLayout:
        """Add rows of a name and a field."""
        form = QFormLayout()
        form.setContentsMargins(0, 0, 0, 0)
        form.setHorizontalSpacing(8)
        form.setVerticalSpacing(4)
        form.setFieldGrowthPolicy(QFormLayout.FieldGrowthPolicy.AllNonFixedFieldsGrow)
        form.setRowWrapPolicy(QFormLayout.RowWrapPolicy.DontWrapRows)
        self.column.addLayout(form)
        return form

    def buttons(self, *named: tuple[str, Callable[[], object]]) -> list[QPushButton]:
        """Add a row of buttons."""
        row = QHBoxLayout()
        row.setSpacing(6)
        made = []
        for text, act in named:
            button = QPushButton(text, self.inside)
            button.clicked.connect(lambda *_, act=act: act())
            row.addWidget(button)
            made.append(button)
        row.addStretch(1)
        self.column.addLayout(row)
        return made


def with_points() -> QLocale:
    """Return the locale of what the panel reads and writes, whatever the desktop's: points.

    No separator of thousands, which elsewhere is what parts the decimals.
    """
    locale = QLocale.c()
    locale.setNumberOptions(
        QLocale.NumberOption.RejectGroupSeparator | QLocale.NumberOption.OmitGroupSeparator
    )
    return locale


def say(label: QLabel, text: str, level: str = "") -> None:
    """Change a sentence and its level; an empty one takes no room."""
    label.setText(text)
    label.setVisible(bool(text))
    if label.property("level") != level:
        label.setProperty("level", level)
        label.style().unpolish(label)
        label.style().polish(label)


def numbers(text: str) -> tuple[float, ...]:
    """Read numbers between commas, semicolons or blanks.

    A comma between two digits is a decimal one, unless there is a point too: "0,05" is five
    hundredths, never nought and five.

    Raises
    ------
    ValueError
        If one of them is none.

    Examples
    --------
    >>> numbers("0.05,0.10; 0.2")
    (0.05, 0.1, 0.2)
    >>> numbers("0,05, 0,1")
    (0.05, 0.1)
    """
    words = re.split(r"[;\s]+|,(?!\d)|(?<!\d),", text)
    parted = (word.split(",") if "." in word else [word.replace(",", ".")] for word in words)
    return tuple(float(number) for each in parted for number in each if number)


def listed(values: Sequence[float]) -> str:
    """Write numbers so that `numbers` reads them again."""
    return ", ".join(f"{value:g}" for value in values)


@contextmanager
def quietly(*objects: QObject) -> Iterator[None]:
    """Change fields without their telling anyone."""
    blockers = [QSignalBlocker(each) for each in objects]
    try:
        yield
    finally:
        for blocker in blockers:
            blocker.unblock()


def show_text(field: QLineEdit, text: str) -> None:
    """Put text into a field, unless it is there or being typed over."""
    if field.text() != text and not (field.hasFocus() and field.isModified()):
        with quietly(field):
            field.setText(text)
            field.setCursorPosition(0)
