"""The audit, made by the command line in a process of its own."""

from __future__ import annotations

import json
import os
import queue
import signal
import subprocess
import sys
import threading
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any

from trigpoint.bundle import bundle_path
from trigpoint.delivery import clear_draft
from trigpoint.errors import TrigpointError
from trigpoint.project import Project
from trigpoint_panel.jobs import Tick

RUN = "from trigpoint_reporting.cli import main; main()"
# A host such as QGIS sets these for its own Python; another interpreter would trip over them.
OF_THE_HOST = ("PYTHONHOME", "PYTHONPATH")
# Seconds that a process which was asked to stop gets to clear away what it has half written.
GRACE = 3.0
# Shares of an audit's time: until the report, and each of the report's steps.
MEASURED = 0.55
REPORT = {
    "executing the notebook": 0.6,
    "writing report.html": 0.85,
    "writing report.pdf": 0.9,
}


class AuditError(TrigpointError):
    """The audit did not come to an end."""

    code = "audit"


@dataclass(frozen=True, slots=True, eq=False)
class Audited:
    """A bundle that an audit left.

    Attributes
    ----------
    folder, archive : Path
    results : dict
        What is in its results.json.
    """

    folder: Path
    archive: Path
    results: dict[str, Any]

    @property
    def verdict(self) -> str:
        """PASS, CONDITIONAL, FAIL or NOT TESTED."""
        return str(self.results["verdict"])

    @property
    def documents(self) -> tuple[Path, ...]:
        """The report's files that there are: HTML, then PDF."""
        every = (self.folder / "report.html", self.folder / "report.pdf")
        return tuple(path for path in every if path.is_file())


def audit(tick: Tick, python: Sequence[str], project: Project) -> Audited:
    """Run `trigpoint audit` on a project file, and stop it if the user gives up.

    Parameters
    ----------
    tick : callable
        See `trigpoint_panel.jobs.Tick`.
    python : sequence of str
        Command of the interpreter that holds the packages.
    project : Project
        As it was written at its path.

    Raises
    ------
    AuditError
        If the audit refused its input, or broke down.
    CancelledError
        If the user gave up; nothing half-written is left.
    """
    tick(0.0, "Starting the audit")
    command = [*python, "-c", RUN, "audit", str(project.path), "--json"]
    child = subprocess.Popen(
        command,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        encoding="utf-8",
        errors="replace",
        env={name: value for name, value in os.environ.items() if name not in OF_THE_HOST},
        # A group of its own: the report's kernel is a grandchild, and must go with it.
        start_new_session=os.name == "posix",
    )
    lines: queue.Queue[str | None] = queue.Queue()
    printed: list[str] = []
    assert child.stdout is not None
    assert child.stderr is not None
    readers = [
        threading.Thread(target=_collect, args=(child.stdout, printed), daemon=True),
        threading.Thread(target=_pass_on, args=(child.stderr, lines), daemon=True),
    ]
    for reader in readers:
        reader.start()
    said: list[str] = []
    share, step = 0.0, 1.0 / (2 + 5 * len(project.reconstructions))
    try:
        while True:
            try:
                line = lines.get(timeout=0.1)
            except queue.Empty:
                tick(share, said[-1] if said else "Starting the audit")  # or hear of a cancel
                continue
            if line is None:
                break
            said.append(line)
            share = REPORT.get(line, min(share + MEASURED * step, max(MEASURED, share)))
            tick(share, line)
        for reader in readers:
            reader.join()
        code = child.wait()
    except BaseException:
        _stop(child)
        clear_draft(bundle_path(project))  # where it heard too late to clear up itself
        raise
    return _outcome(code, "".join(printed), said)


def _outcome(code: int, printed: str, said: list[str]) -> Audited:
    try:
        found = json.loads(printed)
    except json.JSONDecodeError:
        found = {}
    if "audits" in found:
        (done,) = found["audits"]
        return Audited(Path(done["path"]), Path(done["zip"]), done["results"])
    if "error" in found:
        raise AuditError(found["error"]["message"])
    last = said[-1] if said else "it said nothing"
    message = f"The audit broke down (exit code {code}): {last}."
    raise AuditError(message)


def _collect(stream: IO[str], printed: list[str]) -> None:
    with stream:
        printed.append(stream.read())


def _pass_on(stream: IO[str], lines: queue.Queue[str | None]) -> None:
    with stream:
        for line in stream:
            if line.strip():
                lines.put(line.strip())
    lines.put(None)


def _stop(child: subprocess.Popen[str]) -> None:
    """Ask the process to clear up and go; end it, and its own children, if it does not."""
    if sys.platform == "win32":
        child.terminate()
        child.wait(GRACE)
        return
    for number in (signal.SIGINT, signal.SIGKILL):
        try:
            os.killpg(child.pid, number)
        except ProcessLookupError:
            return
        try:
            child.wait(GRACE)
        except subprocess.TimeoutExpired:
            continue
        if number == signal.SIGINT:
            continue  # whoever of its children did not hear it
    child.wait()
