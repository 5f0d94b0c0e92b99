"""Making the environment beside QGIS: what is run, and what went wrong in a sentence."""

from __future__ import annotations

import os
import re
import shlex
import shutil
import subprocess  # nosec B404
from collections.abc import Callable
from importlib import metadata
from pathlib import Path

from trigpoint_qgis.child import Line, Poll, base_python, run
from trigpoint_qgis.deps import SIZE

# Kept as QGIS has them: packages compiled for another numpy could not be loaded beside it.
PINNED = ("numpy", "scipy")

# What a failed installation prints, and what to tell the user of it; the first match counts.
FAULTS = (
    (
        r"CERTIFICATE_VERIFY_FAILED|SSLError|certificate verify",
        "The connection's certificate was not accepted: a proxy or virus scanner may stand in "
        "between. Ask for its certificate and name it in PIP_CERT.",
    ),
    (
        r"ProxyError|407 Proxy|Cannot connect to proxy",
        "The proxy refused the connection. Set HTTPS_PROXY, with user and password if it asks.",
    ),
    (
        r"No space left|Errno 28|not enough space",
        f"The disk is full: {SIZE} is needed. Free some, or choose a folder on another disk.",
    ),
    (
        r"Temporary failure in name resolution|getaddrinfo|NewConnectionError|Network is "
        r"unreachable|ConnectTimeout|ReadTimeout|Connection refused|ConnectionResetError",
        "There is no way to the package index (pypi.org): is this machine on the network?",
    ),
    (
        r"No module named '?(ensurepip|venv|pip)\b|ensurepip is not\s+available",
        "This Python can't make environments: install its venv and pip (on Debian and Ubuntu: "
        "apt install python3-venv), then try again.",
    ),
    (
        r"Permission denied|Errno 13|Access is denied|WinError 5",
        "The folder can't be written: choose another, or close programs that use it.",
    ),
    (
        r"No matching distribution|Could not find a version",
        "A package has no build for this system and QGIS's Python: see the log.",
    ),
    (r"THESE PACKAGES DO NOT MATCH THE HASHES", "A download was damaged: try again."),
)


class InstallError(Exception):
    """The installation failed; the message says why in a sentence, `log` in full."""

    def __init__(self, message: str, log: str) -> None:
        super().__init__(message)
        self.log = log


def commands(folder: Path, python: Path | str, requirements: Path) -> list[list[str]]:
    """Return what makes an environment: two commands, each a list of arguments."""
    inside = folder / ("Scripts/python.exe" if str(python).endswith(".exe") else "bin/python")
    pins = [f"{name}=={metadata.version(name)}" for name in PINNED]
    install = [str(inside), "-m", "pip", "install", "--disable-pip-version-check"]
    install += ["--no-input", "--progress-bar", "off", "--only-binary", ":all:"]
    return [
        [str(python), "-m", "venv", "--clear", "--system-site-packages", str(folder)],
        [*install, "-r", str(requirements), *pins],
    ]


def as_text(every: list[list[str]]) -> str:
    """Write commands so that they can be pasted into a shell."""
    # As the shell of the system reads them.
    written = subprocess.list2cmdline if os.name == "nt" else shlex.join
    return "\n".join(written(each) for each in every)


def install(
    folder: Path,
    requirements: Path,
    *,
    on_line: Line = lambda _: None,
    poll: Poll = lambda: None,
    find_python: Callable[[], Path] = base_python,
) -> None:
    """Make the environment: all of it, or nothing is left.

    Parameters
    ----------
    folder : Path
        Of the environment; what is there is replaced.
    requirements : Path
        Lists the packages.
    on_line : callable
        Told each line of the log as it comes.
    poll : callable
        Called several times a second; raises to cancel.

    Raises
    ------
    InstallError
        If a command fails.
    """
    log: list[str] = []

    def keep(line: str) -> None:
        log.append(line)
        on_line(line)

    done = False
    try:
        for arguments in commands(folder, find_python(), requirements):
            keep(f"$ {shlex.join(arguments)}")
            code, _ = run(arguments, on_line=keep, poll=poll, merged=True)
            if code != 0:
                raise InstallError(classify("\n".join(log)), "\n".join(log))
        done = True
    except OSError as error:
        raise InstallError(classify(str(error), str(error)), "\n".join(log)) from error
    finally:
        if not done:
            shutil.rmtree(folder, ignore_errors=True)


def classify(log: str, otherwise: str = "The packages could not be installed: see the log.") -> str:
    """Say in a sentence why an installation failed."""
    for pattern, sentence in FAULTS:
        if re.search(pattern, log, re.IGNORECASE):
            return sentence
    return otherwise
