"""The dock: the panel, or the card that says why it can't be shown, under a bar of messages."""

from __future__ import annotations

import os
import traceback
from collections.abc import Callable
from typing import Any

from qgis.core import Qgis, QgsApplication, QgsSettings
from qgis.gui import QgsMessageBar
from qgis.PyQt.QtCore import PYQT_VERSION_STR, QCoreApplication, QSize, Qt, QTimer
from qgis.PyQt.QtWidgets import QDockWidget, QSizePolicy, QVBoxLayout, QWidget

from trigpoint_qgis import deps

# Wide enough for two views side by side: a docked column would show neither.
FLOATING = QSize(1150, 720)
SMALLEST = QSize(480, 320)


class TrigpointDock(QDockWidget):
    """Holds the panel. Closing it hides it; `shutdown` ends it.

    Parameters
    ----------
    iface : QgisInterface
    attach : callable
        Looks for the environment again, and returns why it can't be used, or nothing.
    """

    def __init__(self, iface: Any, attach: Callable[[], str]) -> None:
        super().__init__("Trigpoint", iface.mainWindow())
        self.setObjectName("TrigpointDock")
        self.panel: Any = None
        self.card: Any = None
        self.host: Any = None
        self._attach = attach
        self._filled = False
        inside = QWidget(self)
        inside.setMinimumSize(SMALLEST)
        self._column = QVBoxLayout(inside)
        self._column.setContentsMargins(0, 0, 0, 0)
        self._column.setSpacing(0)
        self.bar = QgsMessageBar(inside)
        self.bar.setSizePolicy(QSizePolicy.Policy.Minimum, QSizePolicy.Policy.Fixed)
        self._column.addWidget(self.bar)
        self.setWidget(inside)
        iface.addDockWidget(Qt.DockWidgetArea.BottomDockWidgetArea, self)
        settings = QgsSettings()
        geometry = settings.value("trigpoint/dock/geometry")
        if settings.value("trigpoint/dock/floating", True, type=bool):
            self.setFloating(True)
            if geometry is None or not self.restoreGeometry(geometry):
                free = self.screen().availableGeometry()
                self.resize(FLOATING.boundedTo(free.size()))
                self.move(free.center() - self.rect().center())

    def showEvent(self, event: Any) -> None:
        """Fill the dock the first time, once it has the window that it will be drawn in.

        QGIS 3.22 shares no OpenGL contexts: a view that changes windows before it is first
        painted stays empty.
        """
        super().showEvent(event)
        if not self._filled:
            self._filled = True
            QTimer.singleShot(0, self.look_again)

    def look_again(self) -> None:
        """Show the panel if all it needs is there, else the card."""
        if self.panel is not None or not self._filled:
            return
        fault = self._attach()
        lacks = deps.lacking(deps.PANEL)
        if self.card is not None:
            self._remove(self.card)
            self.card = None
        if not lacks:
            fault = self._open()
        if self.panel is None:
            from trigpoint_qgis.card import DependencyCard

            self.card = DependencyCard(lacks, self.look_again, fault, self.widget())
            self._column.addWidget(self.card, 1)

    def shutdown(self) -> None:
        """End what runs, close the views and remember where the dock was; may be called again."""
        settings = QgsSettings()
        if self._filled:
            settings.setValue("trigpoint/dock/floating", self.isFloating())
            if self.isFloating():
                settings.setValue("trigpoint/dock/geometry", self.saveGeometry())
        self._filled = False
        if self.card is not None:
            self.card.shutdown()
            self._remove(self.card)
            self.card = None
        if self.panel is not None:
            panel, self.panel = self.panel, None
            panel.shutdown()
            self.host.shutdown()
            self._remove(panel)
            self.host = None

    def _open(self) -> str:
        """Make the panel; return why not, if not."""
        # Before the first import of qtpy, which would otherwise choose for itself.
        os.environ["QT_API"] = f"pyqt{PYQT_VERSION_STR.split('.')[0]}"
        try:
            deps.load()
            from trigpoint_panel.panel import Panel
            from trigpoint_qgis.host import QgisHost

            self.host = QgisHost(self, self.bar)
            self.panel = Panel(self.host, parent=self.widget(), canvas=_canvas())
        except Exception as error:  # the dock must open: it is where the user learns of it
            QgsApplication.messageLog().logMessage(
                traceback.format_exc(), "Trigpoint", Qgis.MessageLevel.Critical
            )
            return f"{type(error).__name__}: {error}"
        self._column.addWidget(self.panel, 1)
        return ""

    def _remove(self, widget: QWidget) -> None:
        self._column.removeWidget(widget)
        widget.hide()
        widget.deleteLater()

    def tr(self, text: str) -> str:
        """Translate."""
        return QCoreApplication.translate("Trigpoint", text)


def _canvas() -> str:
    """Return what clouds are drawn with: what the user chose, else what survives floating.

    Where QGIS shares no OpenGL contexts (3.22) a view loses all it has drawn when it changes
    windows, and QGIS crashes when it is painted next.
    """
    chosen = str(QgsSettings().value("trigpoint/canvas", "auto"))
    shared = QCoreApplication.testAttribute(Qt.ApplicationAttribute.AA_ShareOpenGLContexts)
    return "image" if chosen == "auto" and not shared else chosen
