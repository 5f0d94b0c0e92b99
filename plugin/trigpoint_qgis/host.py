"""QGIS as the panel's host: its settings, message log, task manager, dialogs and map."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from qgis.core import Qgis, QgsApplication, QgsProject, QgsSettings, QgsTask
from qgis.gui import QgsProjectionSelectionDialog
from qgis.PyQt.QtCore import QUrl
from qgis.PyQt.QtGui import QDesktopServices
from qgis.PyQt.QtWidgets import QWidget

from trigpoint_panel.host import chosen_file, chosen_place
from trigpoint_panel.strip import MessageStrip
from trigpoint_qgis import auditing, results

PREFIX = "trigpoint/"
LEVELS = {
    "info": Qgis.MessageLevel.Info,
    "success": Qgis.MessageLevel.Success,
    "warning": Qgis.MessageLevel.Warning,
    "error": Qgis.MessageLevel.Critical,
}


class QgisHost:
    """The host of the panel in QGIS.

    Parameters
    ----------
    window : QWidget
        Over which dialogs open.
    strip : MessageStrip
        In which messages appear: the panel's own, since a floating panel may cover QGIS's.
    """

    def __init__(self, window: QWidget, strip: MessageStrip) -> None:
        self._window, self._strip = window, strip
        self._tasks: list[_JobTask] = []
        self._dialogs: list[Any] = []

    def setting(self, key: str, default: Any) -> Any:
        """Return what the user chose before, as a value of the default's type."""
        found = QgsSettings().value(PREFIX + key, default)
        if isinstance(default, bool) and isinstance(found, str):
            return found == "true"
        if isinstance(default, (int, float)) and found is not None:
            try:
                return type(default)(found)
            except (TypeError, ValueError):
                return default
        return found

    def set_setting(self, key: str, value: Any) -> None:
        """Remember what the user chose."""
        QgsSettings().setValue(PREFIX + key, value)

    def message(
        self,
        level: str,
        text: str,
        details: str = "",
        actions: Sequence[tuple[str, Callable[[], object]]] = (),
    ) -> None:
        """Tell the user something in the panel's message strip, and QGIS's log of its details."""
        if details:
            QgsApplication.messageLog().logMessage(f"{text}\n{details}", "Trigpoint", LEVELS[level])
        self._strip.add(level, text, details, actions)

    def clear_messages(self) -> None:
        """Take away what no longer holds."""
        self._strip.clear()

    def run(self, job: Any) -> None:
        """Run a job as a task of QGIS, with its place in the task bar."""
        self._tasks = [task for task in self._tasks if not task.job.settled]
        task = _JobTask(job)
        self._tasks.append(task)
        QgsApplication.taskManager().addTask(task)

    def open_file(self, title: str, filters: str) -> Path | None:
        """Let the user choose a file that is there."""
        return chosen_file(self, self._window, title, filters, home=self._home())

    def save_file(self, title: str, filters: str, suggestion: str) -> Path | None:
        """Let the user choose where a file goes."""
        home = self._home()
        return chosen_place(self, self._window, title, filters, suggestion, home=home)

    def choose_crs(self, current: str, chosen: Callable[[str], object]) -> None:
        """Let the user choose a CRS in QGIS's own dialog, which blocks nothing."""
        from qgis.core import QgsCoordinateReferenceSystem

        dialog = QgsProjectionSelectionDialog(self._window)
        named = QgsCoordinateReferenceSystem(current) if current else QgsProject.instance().crs()
        if named.isValid():
            dialog.setCrs(named)
        dialog.accepted.connect(lambda: chosen(dialog.crs().authid() or dialog.crs().toWkt()))
        dialog.finished.connect(lambda _result: self._dialogs.remove(dialog))
        self._dialogs.append(dialog)
        dialog.setModal(False)
        dialog.show()

    def add_layer(self, path: Path, kind: str) -> None:
        """Add a result to the map."""
        results.add(Path(path), kind, self.message)

    def open_document(self, path: Path) -> None:
        """Open a finished document with what the desktop opens such with, or say where it is."""
        if not QDesktopServices.openUrl(QUrl.fromLocalFile(str(path))):
            self.message("warning", f"Nothing here opens {path.name}. It is {path}.")

    def python(self) -> Sequence[str]:
        """Return the command of the interpreter that holds the packages, for child processes."""
        return auditing.interpreter()

    def shutdown(self) -> None:
        """Cancel what runs, and wait up to two seconds for each task to end."""
        results.stop()
        for dialog in list(self._dialogs):
            dialog.close()
        for task in self._tasks:
            if not task.job.settled:
                task.job.cancel()
                task.waitForFinished(2000)
        self._tasks.clear()

    def _home(self) -> str:
        return QgsProject.instance().homePath() or str(Path.home())


class _JobTask(QgsTask):
    """One of the panel's jobs, as a task of QGIS."""

    def __init__(self, job: Any) -> None:
        super().__init__(f"Trigpoint: {job.title}", results.QUIET)
        self.job = job
        job.progress.connect(self._tell)

    def run(self) -> bool:
        """Do the work, in a thread of QGIS's."""
        self.job.run()
        return True

    def cancel(self) -> None:
        """Give up on it: the user asked QGIS to."""
        if self.job.running:
            self.job.cancel()
        super().cancel()

    def _tell(self, fraction: float, _text: str) -> None:
        if fraction >= 0:
            self.setProgress(100 * fraction)
