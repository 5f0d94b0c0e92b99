"""The list of keys, in a window that blocks nothing."""

from __future__ import annotations

from qtpy.QtCore import Qt
from qtpy.QtWidgets import QDialog, QGridLayout, QLabel, QWidget

from trigpoint_panel.actions import keys_told


class KeysWindow(QDialog):
    """Every key and what it does, in two columns; Esc closes it."""

    def __init__(self, parent: QWidget) -> None:
        super().__init__(parent)
        self.setWindowTitle("Keys")
        self.setModal(False)
        grid = QGridLayout(self)
        grid.setContentsMargins(16, 14, 16, 14)
        grid.setHorizontalSpacing(14)
        grid.setVerticalSpacing(4)
        told = keys_told()
        half = (len(told) + 1) // 2
        for position, (keys, about) in enumerate(told):
            row, side = position % half, 2 * (position // half)
            key = QLabel(keys, self)
            key.setProperty("role", "heading")
            key.setAlignment(Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter)
            grid.addWidget(key, row, side)
            grid.addWidget(QLabel(about, self), row, side + 1)
