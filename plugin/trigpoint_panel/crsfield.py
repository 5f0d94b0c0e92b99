"""A small window in which a CRS is typed and named back before it is taken."""

from __future__ import annotations

from collections.abc import Callable

from qtpy.QtCore import Qt
from qtpy.QtWidgets import QDialog, QDialogButtonBox, QLabel, QLineEdit, QVBoxLayout, QWidget

from trigpoint.crs import parse_crs
from trigpoint.errors import TrigpointError


class CrsField(QDialog):
    """Type EPSG:32615, read what that is, take it; nothing else is blocked meanwhile."""

    def __init__(self, parent: QWidget, current: str, chosen: Callable[[str], object]) -> None:
        super().__init__(parent)
        self._chosen = chosen
        self.setWindowTitle("Coordinate reference system")
        self.setModal(False)
        self.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose, False)
        column = QVBoxLayout(self)
        column.addWidget(QLabel("Code of the reference's projected CRS, such as EPSG:32615.", self))
        self.field = QLineEdit(current, self)
        self.field.setPlaceholderText("EPSG:…")
        self.field.setAccessibleName("CRS code")
        column.addWidget(self.field)
        self.found = QLabel(self)
        self.found.setWordWrap(True)
        column.addWidget(self.found)
        self.buttons = QDialogButtonBox(
            QDialogButtonBox.StandardButton.Ok | QDialogButtonBox.StandardButton.Cancel, self
        )
        self.buttons.accepted.connect(self.accept)
        self.buttons.rejected.connect(self.reject)
        column.addWidget(self.buttons)
        self.setMinimumWidth(380)
        self.field.textChanged.connect(self._look_up)
        self._look_up(current)

    def accept(self) -> None:
        """Take what was typed."""
        super().accept()
        self._chosen(_code(self.field.text()))

    def _look_up(self, text: str) -> None:
        usable, says = False, ""
        if text.strip():
            try:
                crs = parse_crs(_code(text))
                if crs is None:
                    says = "There is no such CRS."
                elif crs.is_geographic:
                    says = f"{crs.name} is in degrees: choose a projected one."
                else:
                    usable, says = True, crs.name
            except TrigpointError as error:
                says = str(error)
        self.found.setText(says)
        self.buttons.button(QDialogButtonBox.StandardButton.Ok).setEnabled(usable)


def _code(text: str) -> str:
    text = text.strip()
    return f"EPSG:{text}" if text.isdigit() else text
