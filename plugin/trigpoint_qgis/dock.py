"""The dock: the panel under its messages, or the card that says why it can't be shown."""

from __future__ import annotations

import os
import traceback
from collections.abc import Callable
from typing import Any

from qgis.core import Qgis, QgsApplication, QgsSettings
from qgis.PyQt.QtCore import PYQT_VERSION_STR, QCoreApplication, QEvent, QSize, Qt, QTimer
from qgis.PyQt.QtWidgets import QApplication, QDockWidget, QVBoxLayout, QWidget

from trigpoint_qgis import deps

# Wide enough for two views side by side: a docked column would show neither.
FLOATING = QSize(1150, 720)
NARROWEST = 480
# Of the height of QGIS's window, where the dock lies in it: its least height shows no cloud.
DOCKED = 0.58
# The second click of the two that float a dock is still held when it floats.
CLICK_MS = 250


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
        self.strip: Any = None
        self._attach = attach
        self._filled = False
        inside = QWidget(self)
        inside.setMinimumWidth(NARROWEST)
        self._column = QVBoxLayout(inside)
        self._column.setContentsMargins(0, 0, 0, 0)
        self._column.setSpacing(0)
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
        self.topLevelChanged.connect(self._moved)

    def showEvent(self, event: Any) -> None:
        """Fill the dock the first time, once it has the window that it will be drawn in.

        QGIS 3.22 shares no OpenGL contexts: a view that changes windows before it is first
        painted stays empty.
        """
        super().showEvent(event)
        if not self._filled:
            self._filled = True
            QTimer.singleShot(0, self.look_again)
        elif self.card is not None and self.card.waits:
            # The commands that it gave may have run meanwhile.
            self._attach()
            if not deps.lacking(deps.PANEL):
                QTimer.singleShot(0, self.look_again)

    def changeEvent(self, event: Any) -> None:
        """Follow the theme."""
        super().changeEvent(event)
        if event.type() == QEvent.Type.PaletteChange:
            # What lies in it hears of the change only afterwards.
            QTimer.singleShot(0, self._restyle)

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
            self._remove(self.strip)
            self.host = self.strip = None

    def _open(self) -> str:
        """Make the panel; return why not, if not."""
        # Before the first import of qtpy, which would otherwise choose for itself.
        os.environ["QT_API"] = f"pyqt{PYQT_VERSION_STR.split('.')[0]}"
        try:
            deps.load()
            from trigpoint_panel.panel import Panel
            from trigpoint_panel.strip import MessageStrip
            from trigpoint_qgis.host import QgisHost

            # Not QGIS's own bar: beside two buttons it leaves a narrow dock half a sentence.
            self.strip = MessageStrip(self.widget())
            self.host = QgisHost(self, self.strip)
            self.panel = Panel(self.host, parent=self.widget(), canvas=_canvas())
        except Exception as error:  # the dock must open: it is where the user learns of it
            QgsApplication.messageLog().logMessage(
                traceback.format_exc(), "Trigpoint", Qgis.MessageLevel.Critical
            )
            if self.host is not None:
                self.host.shutdown()
                self.strip.deleteLater()
                self.host = self.strip = None
            return f"{type(error).__name__}: {error}"
        self._column.addWidget(self.strip)
        self._column.addWidget(self.panel, 1)
        QTimer.singleShot(0, self._settle)
        return ""

    def _settle(self) -> None:
        """Give the panel its room, once it is shown in its own style and can be measured."""
        if self.panel is None:
            return
        # QGIS's window has a style sheet too: under it the panel's headings and notes are first
        # shown without the fonts and colours of its own.
        self.panel.setStyleSheet(self.panel.styleSheet())
        self._moved(self.isFloating())

    def _moved(self, floats: bool) -> None:
        """Give the views a height where the dock lies, and keep it in reach where it floats."""
        if not floats:
            window = self.parentWidget()
            window.resizeDocks([self], [round(DOCKED * window.height())], Qt.Orientation.Vertical)
        elif QApplication.mouseButtons() == Qt.MouseButton.NoButton:
            QTimer.singleShot(0, self._stay_on_screen)
        else:
            QTimer.singleShot(CLICK_MS, self._stay_on_screen)

    def _stay_on_screen(self) -> None:
        """Come back where a part is beyond the screen's edge; not while it is being dragged.

        Qt floats a dock where it lay, as large as it was when it floated last.
        """
        if not self.isFloating() or QApplication.mouseButtons() != Qt.MouseButton.NoButton:
            return
        free = self.screen().availableGeometry()
        border = self.frameGeometry().size() - self.size()
        self.resize(self.size().boundedTo(free.size() - border))
        frame = self.frameGeometry()
        frame.moveRight(min(frame.right(), free.right()))
        frame.moveBottom(min(frame.bottom(), free.bottom()))
        frame.moveLeft(max(frame.left(), free.left()))
        frame.moveTop(max(frame.top(), free.top()))
        self.move(frame.topLeft())

    def _restyle(self) -> None:
        if self.strip is not None:
            self.strip.restyle()

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
