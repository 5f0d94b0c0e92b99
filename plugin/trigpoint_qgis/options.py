"""The plugin's page in QGIS's Options: the environment, and how clouds are drawn."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

from qgis.core import QgsSettings
from qgis.gui import QgsFileWidget, QgsOptionsPageWidget, QgsOptionsWidgetFactory
from qgis.PyQt.QtCore import QCoreApplication, Qt
from qgis.PyQt.QtGui import QIcon
from qgis.PyQt.QtWidgets import QComboBox, QFormLayout, QLabel

from trigpoint_qgis import deps

# What the panel calls them, and what the user reads.
CANVASES = (
    ("auto", "OpenGL where it works, else images"),
    ("gl", "OpenGL"),
    ("image", "Images (slower, works everywhere)"),
)


class OptionsFactory(QgsOptionsWidgetFactory):
    """Makes the page when the Options are opened."""

    def __init__(self, changed: Callable[[], object]) -> None:
        super().__init__("Trigpoint", QIcon(str(deps.HERE / "icon.svg")))
        self._changed = changed

    def createWidget(self, parent: Any) -> QgsOptionsPageWidget:
        """Make the page."""
        return OptionsPage(parent, self._changed)


class OptionsPage(QgsOptionsPageWidget):
    """Where the packages are, and what draws the clouds."""

    def __init__(self, parent: Any, changed: Callable[[], object]) -> None:
        super().__init__(parent)
        self._changed = changed
        settings = QgsSettings()
        self.folder = QgsFileWidget(self)
        self.folder.setStorageMode(QgsFileWidget.StorageMode.GetDirectory)
        self.folder.setFilePath(str(settings.value("trigpoint/python_env", "") or ""))
        self.canvas = QComboBox(self)
        for value, title in CANVASES:
            self.canvas.addItem(self._tr(title), value)
        chosen = str(settings.value("trigpoint/canvas", "auto"))
        self.canvas.setCurrentIndex(max(0, self.canvas.findData(chosen)))
        note = QLabel(
            self._tr(
                "A virtual environment or a folder of Python packages. Empty: the one that the "
                "panel installs in your profile. It comes after QGIS's own packages, never before."
            ),
            self,
        )
        note.setWordWrap(True)
        self.fault = QLabel(self)
        self.fault.setWordWrap(True)
        self.fault.setTextFormat(Qt.TextFormat.PlainText)
        font = self.fault.font()
        font.setBold(True)
        self.fault.setFont(font)
        self.folder.fileChanged.connect(self._judge)
        self._judge()
        form = QFormLayout(self)
        form.addRow(self._tr("Python environment"), self.folder)
        form.addRow("", self.fault)
        form.addRow("", note)
        form.addRow(self._tr("Clouds are drawn with"), self.canvas)

    def apply(self) -> None:
        """Keep what was chosen."""
        settings = QgsSettings()
        settings.setValue("trigpoint/canvas", self.canvas.currentData())
        before = str(settings.value("trigpoint/python_env", "") or "")
        folder = self.folder.filePath().strip()
        if folder != before:
            settings.setValue("trigpoint/python_env", folder)
            self._changed()

    def _judge(self, _path: str = "") -> None:
        """Say at once why a folder can't be used: once the page is closed nobody would."""
        folder, fault = self.folder.filePath().strip(), ""
        try:
            if folder:
                deps.find_environment(Path(folder))
        except (deps.FolderError, OSError) as error:
            fault = str(error)
        self.fault.setText(fault)
        self.fault.setVisible(bool(fault))

    def _tr(self, text: str) -> str:
        return QCoreApplication.translate("Trigpoint", text)
