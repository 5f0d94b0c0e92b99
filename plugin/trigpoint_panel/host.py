"""What the panel asks of whoever shows it: settings, messages, files, threads."""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, Literal, Protocol

from qtpy.QtCore import QSettings, QUrl
from qtpy.QtGui import QDesktopServices
from qtpy.QtWidgets import QFileDialog, QWidget

from trigpoint_panel.crsfield import CrsField
from trigpoint_panel.jobs import Job, Pool
from trigpoint_panel.strip import MessageStrip

Level = Literal["info", "success", "warning", "error"]
Action = tuple[str, Callable[[], object]]


class Host(Protocol):
    """What the panel asks of whoever shows it: a window of its own, or QGIS."""

    def setting(self, key: str, default: Any) -> Any:
        """Return what the user chose before, as a value of the default's type."""
        ...

    def set_setting(self, key: str, value: Any) -> None:
        """Remember what the user chose: a bool, number, string or bytes."""
        ...

    def message(
        self, level: Level, text: str, details: str = "", actions: Sequence[Action] = ()
    ) -> None:
        """Tell the user something in one sentence, without being in the way."""
        ...

    def clear_messages(self) -> None:
        """Take away what no longer holds."""
        ...

    def run(self, job: Job) -> None:
        """Run a job off the GUI thread."""
        ...

    def open_file(self, title: str, filters: str) -> Path | None:
        """Let the user choose a file that is there."""
        ...

    def save_file(self, title: str, filters: str, suggestion: str) -> Path | None:
        """Let the user choose where a file goes."""
        ...

    def choose_crs(self, current: str, chosen: Callable[[str], object]) -> None:
        """Let the user choose a CRS, and tell it by its name (EPSG:32615) once it is chosen."""
        ...

    def add_layer(self, path: Path, kind: str) -> None:
        """Show a result beside the host's own data; a window of its own has nowhere to."""
        ...

    def open_document(self, path: Path) -> None:
        """Open a finished document with what the desktop opens such with."""
        ...

    def python(self) -> Sequence[str]:
        """Return the command of the interpreter that holds the packages, for child processes."""
        ...

    def shutdown(self) -> bool:
        """Cancel what runs, wait a little for it to end, and tell whether it has."""
        ...


def chosen_file(host: Host, window: QWidget, title: str, filters: str, *, home: str) -> Path | None:
    """Ask for a file that is there, beginning where the last one was; at first, at `home`."""
    folder = str(host.setting("folder", home))
    name, _ = QFileDialog.getOpenFileName(window, title, folder, filters)
    return _remembered(host, name)


def chosen_place(
    host: Host, window: QWidget, title: str, filters: str, suggestion: str, *, home: str
) -> Path | None:
    """Ask where a file goes, beginning where the last one was; at first, at `home`."""
    place = str(Path(host.setting("folder", home)) / suggestion)
    name, _ = QFileDialog.getSaveFileName(window, title, place, filters)
    return _remembered(host, name)


def _remembered(host: Host, name: str) -> Path | None:
    if not name:
        return None
    path = Path(name)
    host.set_setting("folder", str(path.parent))
    return path


class StandaloneHost:
    """The host of a window of its own.

    Parameters
    ----------
    window : QWidget
        Over which dialogs open.
    strip : MessageStrip
        In which messages appear.
    settings : QSettings, optional
        By default the user's own.
    """

    def __init__(
        self, window: QWidget, strip: MessageStrip, settings: QSettings | None = None
    ) -> None:
        self._window = window
        self._strip = strip
        self._settings = QSettings("trigpoint", "panel") if settings is None else settings
        self._pool = Pool()
        self._crs_field: CrsField | None = None

    def setting(self, key: str, default: Any) -> Any:
        """Return what the user chose before, as a value of the default's type."""
        found: Any = self._settings.value(key, default)
        if isinstance(default, bool) and isinstance(found, str):
            return found == "true"  # as an INI file keeps it
        if isinstance(default, int | float) and found is not None:
            try:
                return type(default)(found)
            except (TypeError, ValueError):
                return default
        return found

    def set_setting(self, key: str, value: Any) -> None:
        """Remember what the user chose."""
        self._settings.setValue(key, value)

    def message(
        self, level: Level, text: str, details: str = "", actions: Sequence[Action] = ()
    ) -> None:
        """Tell the user something in the window's message strip."""
        self._strip.add(level, text, details, actions)

    def clear_messages(self) -> None:
        """Take away what no longer holds."""
        self._strip.clear()

    def run(self, job: Job) -> None:
        """Run a job off the GUI thread."""
        self._pool.run(job)

    def open_file(self, title: str, filters: str) -> Path | None:
        """Let the user choose a file that is there."""
        return chosen_file(self, self._window, title, filters, home=str(Path.home()))

    def save_file(self, title: str, filters: str, suggestion: str) -> Path | None:
        """Let the user choose where a file goes."""
        home = str(Path.home())
        return chosen_place(self, self._window, title, filters, suggestion, home=home)

    def choose_crs(self, current: str, chosen: Callable[[str], object]) -> None:
        """Let the user type a CRS in a small window that blocks nothing."""
        if self._crs_field is not None:
            self._crs_field.close()
        self._crs_field = CrsField(self._window, current, chosen)
        self._crs_field.show()

    def add_layer(self, path: Path, kind: str) -> None:
        """Do nothing: there is no map here."""

    def open_document(self, path: Path) -> None:
        """Open a finished document with what the desktop opens such with."""
        QDesktopServices.openUrl(QUrl.fromLocalFile(str(path)))

    def python(self) -> Sequence[str]:
        """Return this interpreter."""
        return (sys.executable,)

    def shutdown(self) -> bool:
        """Cancel what runs, wait up to two seconds for it to end, and tell whether it has."""
        return self._pool.wait(2000)
