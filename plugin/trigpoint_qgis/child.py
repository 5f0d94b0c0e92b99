"""Running another interpreter: its lines as they come, cancelled with everything it started."""

from __future__ import annotations

import os
import queue
import signal
import subprocess  # nosec B404
import sys
import threading
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path

# They tell QGIS's own Python where it is, and would mislead another.
OF_QGIS = ("PYTHONHOME", "PYTHONPATH")
# Seconds in which a program that was asked to stop may clear away what it has half written.
GRACE = 3.0

Line = Callable[[str], None]
# Told of nothing; raises where the work is to stop.
Poll = Callable[[], None]


def run(
    arguments: Sequence[str],
    *,
    on_line: Line = lambda _: None,
    poll: Poll = lambda: None,
    merged: bool = False,
) -> tuple[int, str]:
    """Run a program to its end and return its exit code and its standard output.

    Parameters
    ----------
    arguments : sequence of str
    on_line : callable
        Told each line of standard error, and of standard output where the two are merged.
    poll : callable
        Called several times a second; what it raises ends the program and is raised again.
    merged : bool
        Standard output is told line by line instead of returned.
    """
    # A list of arguments, and never a shell.
    process = subprocess.Popen(  # nosec B603
        list(arguments),
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT if merged else subprocess.PIPE,
        text=True,
        encoding="utf-8",
        errors="replace",
        env={name: value for name, value in os.environ.items() if name not in OF_QGIS}
        | {"PYTHONUTF8": "1"},
        start_new_session=os.name == "posix",
        creationflags=getattr(subprocess, "CREATE_NO_WINDOW", 0),
    )
    lines: queue.Queue[str] = queue.Queue()
    told, kept = (process.stdout, None) if merged else (process.stderr, process.stdout)
    output: list[str] = []
    readers = [threading.Thread(target=lambda: [lines.put(line) for line in told or ()])]
    if kept is not None:
        readers.append(threading.Thread(target=lambda: output.append(kept.read())))
    for reader in readers:
        reader.start()
    with process:
        try:
            while any(reader.is_alive() for reader in readers) or not lines.empty():
                poll()
                with suppress(queue.Empty):
                    on_line(lines.get(timeout=0.2).rstrip())
        except BaseException:
            _end(process)
            raise
        finally:
            for reader in readers:
                reader.join(timeout=5)
    return process.returncode, "".join(output)


def base_python() -> Path:
    """Return the interpreter that QGIS's own Python comes from.

    Inside QGIS `sys.executable` may be QGIS itself, which would open the arguments as layers.

    Raises
    ------
    FileNotFoundError
        If there is none of the running version.
    """
    own = f"{sys.version_info.major}.{sys.version_info.minor}"
    prefix = Path(sys.base_prefix)
    places = [prefix / "python.exe", prefix / "bin" / f"python{own}", prefix / "bin" / "python3"]
    for place in places:
        if not place.is_file():
            continue
        code, said = run([str(place), "-c", "import sys; print('%d.%d' % sys.version_info[:2])"])
        if code == 0 and said.strip() == own:
            return place
    message = f"There is no Python {own} below {prefix}: QGIS brings none that can be run."
    raise FileNotFoundError(message)


def _end(process: subprocess.Popen[str]) -> None:
    """Ask a program and all it started to stop, and end them if they do not."""
    if os.name == "posix":
        with suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGINT)
            with suppress(subprocess.TimeoutExpired):
                process.wait(GRACE)
            os.killpg(process.pid, signal.SIGKILL)
    else:
        process.kill()
    process.wait()
