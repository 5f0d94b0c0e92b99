"""The plugin's life in QGIS: what it adds, and takes away again to the last trace."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from qgis.core import Qgis, QgsApplication, QgsSettings
from qgis.PyQt.QtCore import QCoreApplication, QLocale, QThreadPool, QTranslator, QUrl
from qgis.PyQt.QtGui import QDesktopServices, QIcon
from qgis.PyQt.QtWidgets import QAction

from trigpoint_qgis import deps
from trigpoint_qgis.provider import TrigpointProvider

ICON = deps.HERE / "icon.svg"
HELP = deps.HERE / "help" / "index.html"
MENU = "Trigpoint"
PATIENCE_MS = 2000


class TrigpointPlugin:
    """The dock, the Processing provider, a page of settings, and help."""

    def __init__(self, iface: Any) -> None:
        self.iface = iface
        self.provider: TrigpointProvider | None = None
        self.dock: Any = None
        self.action: QAction | None = None
        self._actions: list[QAction] = []
        self._options: Any = None
        self._translator: QTranslator | None = None
        self._attach()
        self._translate()

    def initProcessing(self) -> None:
        """Add the provider; all that is called where there is no window."""
        self.provider = TrigpointProvider()
        QgsApplication.processingRegistry().addProvider(self.provider)

    def initGui(self) -> None:
        """Add the provider, the actions and the settings."""
        from trigpoint_qgis.options import OptionsFactory

        self.initProcessing()
        window = self.iface.mainWindow()
        self.action = QAction(QIcon(str(ICON)), self._tr("Trigpoint panel"), window)
        self.action.setObjectName("TrigpointPanelAction")
        self.action.setCheckable(True)
        self.action.triggered.connect(self.show_panel)
        self.iface.addToolBarIcon(self.action)
        about = QAction(QIcon(str(ICON)), self._tr("Trigpoint help"), window)
        about.setObjectName("TrigpointHelpAction")
        about.triggered.connect(self.show_help)
        self._actions = [self.action, about]
        for action in self._actions:
            self.iface.addPluginToMenu(MENU, action)
        self._options = OptionsFactory(self.environment_changed)
        self.iface.registerOptionsWidgetFactory(self._options)

    def unload(self) -> None:
        """Take everything away; QGIS asks for that too where it quits."""
        self.close_panel()
        _end_threads()
        if self.provider is not None:
            QgsApplication.processingRegistry().removeProvider(self.provider)
            self.provider = None
        if self._options is not None:
            self.iface.unregisterOptionsWidgetFactory(self._options)
            self._options = None
        if self.action is not None:
            self.iface.removeToolBarIcon(self.action)
        for action in self._actions:
            self.iface.removePluginMenu(MENU, action)
            action.deleteLater()
        self._actions, self.action = [], None
        if self._translator is not None:
            QCoreApplication.removeTranslator(self._translator)
            self._translator = None
        deps.detach()

    def show_panel(self, shown: bool = True) -> None:
        """Show or hide the dock; it is made when it is first asked for."""
        if self.dock is None:
            from trigpoint_qgis.dock import TrigpointDock

            self.dock = TrigpointDock(self.iface, self._attach)
            self.dock.visibilityChanged.connect(self.action.setChecked)
        self.dock.setVisible(shown)
        if shown:
            self.dock.raise_()

    def close_panel(self) -> None:
        """Close the dock for good, with all that runs in it."""
        if self.dock is not None:
            self.dock.visibilityChanged.disconnect(self.action.setChecked)
            self.dock.shutdown()
            self.iface.removeDockWidget(self.dock)
            self.dock.deleteLater()
            self.dock = None
            self.action.setChecked(False)

    def show_help(self) -> None:
        """Open the help in the browser."""
        QDesktopServices.openUrl(QUrl.fromLocalFile(str(HELP)))

    def environment_changed(self) -> None:
        """Look for the packages again: the user chose another folder."""
        self._attach()
        if self.dock is not None:
            self.dock.look_again()

    def _attach(self) -> str:
        """Let the packages beside QGIS be imported; return why not, if not."""
        chosen = str(QgsSettings().value("trigpoint/python_env", "") or "")
        profile = Path(QgsApplication.qgisSettingsDirPath())
        try:
            deps.attach(deps.locate(chosen, profile))
        except deps.FolderError as fault:
            deps.attach(None)
            QgsApplication.messageLog().logMessage(
                str(fault), "Trigpoint", Qgis.MessageLevel.Warning
            )
            return str(fault)
        return ""

    def _translate(self) -> None:
        name = str(QgsSettings().value("locale/userLocale", "") or QLocale.system().name())
        for path in (deps.HERE / "i18n" / f"trigpoint_{part}.qm" for part in (name, name[:2])):
            if path.is_file():
                self._translator = QTranslator()
                self._translator.load(str(path))
                QCoreApplication.installTranslator(self._translator)
                return

    def _tr(self, text: str) -> str:
        return QCoreApplication.translate("Trigpoint", text)


def _end_threads() -> None:
    """Let the threads of QGIS's tasks end while what they use is there.

    A thread that has asked for a password store, as that of QGIS's news feed has, closes it when it
    ends. Where QGIS quits it deletes the store first, and the idle threads that our jobs have kept
    from ending earlier would then take it down (3.40).
    """
    for pool in QgsApplication.taskManager().findChildren(QThreadPool):
        pool.waitForDone(PATIENCE_MS)
