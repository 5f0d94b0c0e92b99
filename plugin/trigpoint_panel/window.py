"""The window of the stand-alone panel: its title, its message strip, and the way out."""

from __future__ import annotations

import sys
from pathlib import Path
from types import TracebackType

from qtpy.QtCore import QByteArray, QEvent, QSettings, QTimer
from qtpy.QtGui import QCloseEvent, QGuiApplication
from qtpy.QtWidgets import QMainWindow, QMessageBox, QVBoxLayout, QWidget

from trigpoint_panel.app import unexpected
from trigpoint_panel.canvas import CanvasKind
from trigpoint_panel.host import StandaloneHost
from trigpoint_panel.panel import Panel
from trigpoint_panel.strip import MessageStrip

FIRST = (1320, 780)  # of the window, in pixels, where the screen has room


class Window(QMainWindow):
    """One panel in a window of its own.

    Parameters
    ----------
    settings : QSettings, optional
        By default the user's own.
    canvas : {"auto", "gl", "image"}
    scratch : Path, optional
        See `trigpoint_panel.panel.Panel`.
    """

    def __init__(
        self,
        settings: QSettings | None = None,
        *,
        canvas: CanvasKind = "auto",
        scratch: Path | None = None,
    ) -> None:
        super().__init__()
        inside = QWidget(self)
        column = QVBoxLayout(inside)
        column.setContentsMargins(0, 0, 0, 0)
        column.setSpacing(0)
        self.strip = MessageStrip(inside)
        self.host = StandaloneHost(self, self.strip, settings)
        self.panel = Panel(self.host, parent=inside, canvas=canvas, scratch=scratch)
        column.addWidget(self.strip)
        column.addWidget(self.panel, 1)
        self.setCentralWidget(inside)
        self._ended = True
        self._is_open = True
        self.panel.title_changed.connect(self._name)
        self._name(self.panel.title)
        self._place()

    def ask_unsaved(self) -> str:
        """Ask what is to become of changes that are not saved: save, discard or cancel."""
        button = QMessageBox.StandardButton
        box = QMessageBox(self)
        box.setIcon(QMessageBox.Icon.Question)
        box.setWindowTitle("Unsaved session")
        box.setText(f"Save the changes to {self.panel.session.name}?")
        box.setStandardButtons(button.Save | button.Discard | button.Cancel)
        box.setDefaultButton(button.Save)
        answer = box.exec()
        return {int(button.Save.value): "save", int(button.Discard.value): "discard"}.get(
            int(getattr(answer, "value", answer)), "cancel"
        )

    def end(self) -> bool:
        """Stop everything; tell whether all threads have ended."""
        if self._is_open:
            self._is_open = False
            self.panel.shutdown()
            self._ended = self.host.shutdown()
        return self._ended

    def report(
        self, kind: type[BaseException], error: BaseException, trace: TracebackType | None
    ) -> None:
        """Tell of an error that nobody foresaw; the panel stays usable."""
        text, details = unexpected(kind, error, trace)
        sys.stderr.write(details)
        if self._is_open and not issubclass(kind, KeyboardInterrupt):
            QTimer.singleShot(0, lambda: self.host.message("error", text, details))

    def closeEvent(self, event: QCloseEvent) -> None:
        """Ask about what is not saved, the one question that stands in the way."""
        if self._is_open and self.panel.session.is_modified:
            answer = self.ask_unsaved()
            if answer == "cancel" or (answer == "save" and not self.panel.desk.save()):
                event.ignore()
                return
        if self._is_open:
            # Also where all was undone since it was kept: there is nothing left to offer.
            self.panel.session.discard_autosave()
        self.host.set_setting("window/geometry", self.saveGeometry())
        self.host.set_setting("window/across", self.panel.across.saveState())
        self.host.set_setting("window/upright", self.panel.upright.saveState())
        self.end()
        event.accept()

    def changeEvent(self, event: QEvent) -> None:
        """Follow the theme."""
        super().changeEvent(event)
        if event.type() == QEvent.Type.PaletteChange and hasattr(self, "strip"):
            self.strip.restyle()

    def _name(self, title: str) -> None:
        self.setWindowTitle(title)

    def _place(self) -> None:
        """Open where the window was last, or as large as the screen allows."""
        screen = QGuiApplication.primaryScreen()
        room = screen.availableGeometry()
        self.resize(min(FIRST[0], room.width()), min(FIRST[1], room.height()))
        kept = self.host.setting("window/geometry", QByteArray())
        if isinstance(kept, QByteArray) and not kept.isEmpty():
            self.restoreGeometry(kept)
        for name, splitter in (("across", self.panel.across), ("upright", self.panel.upright)):
            kept = self.host.setting(f"window/{name}", QByteArray())
            if isinstance(kept, QByteArray) and not kept.isEmpty():
                splitter.restoreState(kept)
