"""The list of keys, in a window that blocks nothing."""

from __future__ import annotations

from qtpy.QtCore import QSize, Qt
from qtpy.QtWidgets import (
    QDialog,
    QFrame,
    QGridLayout,
    QHBoxLayout,
    QLabel,
    QScrollArea,
    QVBoxLayout,
    QWidget,
)

from trigpoint_panel.actions import Told, keys_told

# The groups that stand one under the other, column by column.
COLUMNS = (("Files", "Pairs"), ("Views", "Mouse in a view", "Window"))


class KeysWindow(QDialog):
    """Every key and what it does, in groups; Esc closes it."""

    def __init__(self, parent: QWidget) -> None:
        super().__init__(parent)
        self.setWindowTitle("Keys and mouse")
        self.setModal(False)
        told = keys_told()
        self._list = QWidget(self)
        row = QHBoxLayout(self._list)
        row.setContentsMargins(16, 14, 16, 14)
        row.setSpacing(28)
        for groups in COLUMNS:
            column = QVBoxLayout()
            column.setSpacing(4)
            for group in groups:
                self._add(column, group, told[group])
            column.addStretch(1)
            row.addLayout(column)
        area = QScrollArea(self)
        area.setFrameShape(QFrame.Shape.NoFrame)
        area.setWidgetResizable(True)
        area.setWidget(self._list)
        whole = QVBoxLayout(self)
        whole.setContentsMargins(0, 0, 0, 0)
        whole.addWidget(area)
        # A person with large letters has a small screen for them: there the list scrolls.
        self.resize(self.sizeHint().boundedTo(self.screen().availableSize()))

    def sizeHint(self) -> QSize:
        """Return the room that the whole list wants."""
        return self._list.sizeHint()

    def _add(self, column: QVBoxLayout, group: str, told: list[Told]) -> None:
        heading = QLabel(group, self._list)
        heading.setProperty("role", "faint")
        if column.count():
            column.addSpacing(10)
        column.addWidget(heading)
        grid = QGridLayout()
        grid.setHorizontalSpacing(14)
        grid.setVerticalSpacing(4)
        grid.setColumnStretch(1, 1)
        # Alike in all groups of a column; a key that is wider still has what it needs.
        widest = self.fontMetrics().horizontalAdvance("Right or middle drag__")
        grid.setColumnMinimumWidth(0, widest)
        for row, (keys, about) in enumerate(told):
            key = QLabel(keys, self._list)
            key.setProperty("role", "heading")
            key.setAlignment(Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter)
            grid.addWidget(key, row, 0)
            grid.addWidget(QLabel(about, self._list), row, 1)
        column.addLayout(grid)
