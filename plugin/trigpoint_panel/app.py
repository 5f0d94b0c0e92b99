"""The panel in a window of its own: `trigpoint-panel [project.toml] [--demo]`."""

from __future__ import annotations

import argparse
import importlib.util
import os
import re
import signal
import subprocess
import sys
import traceback
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, NoReturn

import trigpoint

if TYPE_CHECKING:
    from qtpy.QtCore import QTimer
    from qtpy.QtWidgets import QApplication

    from trigpoint_panel.style import Theme
    from trigpoint_panel.window import Window

NEEDED = ("qtpy", "pyvista", "pyvistaqt", "vtkmodules", "matplotlib")
DISPLAYS = ("DISPLAY", "WAYLAND_DISPLAY", "QT_QPA_PLATFORM")
# Python hears of a signal only when it runs, and while nothing happens Qt runs alone.
LISTEN_MS = 200
# Qt aborts where it can't connect to a display, and Python never hears of it: another process tries
# first. It leaves no core dump.
TRY = """
import resource
from qtpy.QtGui import QGuiApplication
resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
QGuiApplication([])
"""
INSTALL = 'pip install "trigpoint[panel]"'


def main(arguments: list[str] | None = None) -> NoReturn:
    """Run the panel: 0 when its window is closed, 2 where it can't be shown."""
    given = _parser().parse_args(arguments)
    lacking = missing() or no_display()
    if lacking:
        print(f"trigpoint-panel: {lacking}", file=sys.stderr)
        sys.exit(2)
    application, window = start(given.project, demo=given.demo, theme=given.theme)
    sys.excepthook = window.report
    window.show()
    listening = close_on_interrupt(window)
    code = application.exec()
    listening.stop()
    still_working = not window.end()
    sys.stdout.flush()
    sys.stderr.flush()
    if still_working:  # a thread that could not be stopped would hold the process
        os._exit(code)
    sys.exit(code)


def missing() -> str:
    """Say what is not installed and what to do about it; empty: nothing is missing."""
    lacking = [name for name in NEEDED if importlib.util.find_spec(name) is None]
    if not lacking:
        try:
            import qtpy.QtWidgets  # noqa: F401
        except Exception as error:  # of qtpy's own kinds, or a library that Qt needs
            return f"Qt can't be loaded ({error}). Install what the panel needs: {INSTALL}"
        return ""
    return f"{', '.join(lacking)} missing. Install what the panel needs: {INSTALL}"


def no_display() -> str:
    """Say that there is nothing to show a window on, where Qt would abort the process."""
    if not sys.platform.startswith("linux"):
        return ""
    if not any(map(os.environ.get, DISPLAYS)):
        return (
            "There is no display (DISPLAY and WAYLAND_DISPLAY are not set): start it on a desktop."
        )
    tried = subprocess.run(
        [sys.executable, "-c", TRY],
        stderr=subprocess.PIPE,
        text=True,
        errors="replace",
        check=False,
    )
    if tried.returncode == 0:
        return ""
    found = re.search(r"^qt\.qpa\.\w+: (.+?)\.?$", tried.stderr, re.MULTILINE)
    why = found[1] if found else f"it ended with code {tried.returncode}"
    given = ", ".join(f"{name}={os.environ[name]}" for name in DISPLAYS if os.environ.get(name))
    return f"Qt can't show a window with {given} ({why}): start it on a desktop."


def close_on_interrupt(window: Window) -> QTimer:
    """Have Ctrl+C in the terminal close the window; pressed while it asks, it ends the process."""
    from qtpy.QtCore import QTimer

    def close(*_: object) -> None:
        signal.signal(signal.SIGINT, signal.SIG_DFL)
        if not window.close():
            signal.signal(signal.SIGINT, close)

    signal.signal(signal.SIGINT, close)
    listening = QTimer(window)
    listening.timeout.connect(lambda: None)
    listening.start(LISTEN_MS)
    return listening


def start(
    project: Path | None, *, demo: bool = False, theme: Theme | None = None
) -> tuple[QApplication, Window]:
    """Make the application and its window, and begin to open what was asked for."""
    from qtpy.QtCore import QTimer
    from qtpy.QtWidgets import QApplication

    from trigpoint_panel.style import apply_theme
    from trigpoint_panel.window import Window

    there = QApplication.instance()
    application = there if isinstance(there, QApplication) else QApplication(sys.argv[:1])
    application.setApplicationName("trigpoint-panel")
    application.setApplicationDisplayName("trigpoint")
    if theme is not None:
        apply_theme(application, theme)
    window = Window()
    if demo:
        QTimer.singleShot(0, window.panel.open_demo)
    elif project is not None:
        QTimer.singleShot(0, lambda: window.panel.desk.open_dropped(project.absolute()))
    else:
        QTimer.singleShot(0, window.panel.desk.offer_recovery)
    return application, window


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="trigpoint-panel",
        description="Pick the same points in two clouds, and see at once what the fit is worth.",
    )
    parser.add_argument("project", nargs="?", type=Path, help="a project.toml or a .trig.json")
    parser.add_argument("--demo", action="store_true", help="open the clock tower")
    parser.add_argument(
        "--theme", choices=("light", "dark"), help="colours; by default the desktop's"
    )
    parser.add_argument("--version", action="version", version=f"trigpoint {trigpoint.__version__}")
    return parser


def unexpected(
    kind: type[BaseException], error: BaseException, trace: TracebackType | None
) -> tuple[str, str]:
    """Return a sentence and the details of an error that nobody foresaw."""
    details = "".join(traceback.format_exception(kind, error, trace))
    return f"Something went wrong: {kind.__name__}: {error}.", details


if __name__ == "__main__":
    main()
