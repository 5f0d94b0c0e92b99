"""A project's audit as a child process: the same command line, in an interpreter of its own."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

from trigpoint_qgis import child, deps

START = "from trigpoint_reporting.cli import main; main()"


class AuditError(Exception):
    """The audit ended without a result; the message says why."""


def interpreter(environment: deps.Environment | None = None) -> tuple[str, ...]:
    """Return the command that takes ``-m MODULE`` or ``-c CODE`` and has trigpoint's packages.

    Parameters
    ----------
    environment : Environment, optional
        By default the one that is attached; without any, QGIS's own Python.

    Raises
    ------
    FileNotFoundError
        If there is no interpreter.
    """
    environment = environment or deps.attached()
    start = str(deps.HERE / "beside.py")
    if environment is None:
        return (str(child.base_python()), start)
    if environment.python is None:
        # A bare folder of packages, which no interpreter knows of by itself.
        return (str(child.base_python()), start, "--packages", str(environment.packages))
    return (str(environment.python), start)


def run_audit(
    project: Path,
    folder: Path | None = None,
    *,
    say: Callable[[str], None] = lambda _: None,
    poll: child.Poll = lambda: None,
    environment: deps.Environment | None = None,
) -> dict[str, Any]:
    """Run `trigpoint audit` and return what it says of the bundle: its path, zip and results.

    Parameters
    ----------
    project : Path
        A project.toml.
    folder : Path, optional
        Where the bundle goes; by default the folder `audit` beside the project.
    say : callable
        Told each step as it begins.
    poll : callable
        Called several times a second; raises to cancel.
    environment : Environment, optional
        By default the one that is attached.

    Raises
    ------
    AuditError
        If something is refused or breaks; nothing half-written is left.
    """
    arguments = [*interpreter(environment), "-c", START, "audit", str(project), "--json"]
    arguments += [] if folder is None else ["--out", str(folder)]
    told: list[str] = []

    def on_line(line: str) -> None:
        told.append(line)
        say(line)

    code, output = child.run(arguments, on_line=on_line, poll=poll)
    try:
        found = json.loads(output)
    except ValueError:
        last = next((line for line in reversed(told) if line.strip()), "it said nothing")
        message = f"The audit ended with code {code}: {last}"
        raise AuditError(message) from None
    if "error" in found:
        raise AuditError(found["error"]["message"])
    audit: dict[str, Any] = found["audits"][0]
    return audit
