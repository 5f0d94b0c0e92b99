"""A session's file: what is saved, found again after a crash, and missed when it has moved."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from trigpoint.errors import TrigpointError
from trigpoint_panel.model import Model
from trigpoint_panel.state import State


class SessionError(TrigpointError, ValueError):
    """A session can't be read or written."""

    code = "session"


@dataclass(frozen=True, slots=True)
class Opened:
    """What a session file or a project.toml holds.

    Attributes
    ----------
    state : State
    cameras : dict
        Of each view, as it was saved; the panel's own business.
    doubts : tuple of str
        A sentence for each file that has moved or changed since.
    """

    state: State
    cameras: dict[str, Any]
    doubts: tuple[str, ...]


def read_session(path: Path | str) -> Opened:
    """Read a .trig.json; raises SessionError in one sentence."""
    raise NotImplementedError


class Session:
    """Where a model is kept: its file, its autosave beside it (``<session>~``), its cameras."""

    def __init__(self, model: Model, *, scratch: Path) -> None:
        """Keep a model; what has no file yet is autosaved in the folder `scratch`."""
        self.model = model
        self.scratch = scratch
        self.path: Path | None = None
        self.cameras: dict[str, Any] = {}

    @property
    def is_modified(self) -> bool:
        """Whether there is something to save."""
        raise NotImplementedError

    def open(self, path: Path | str) -> tuple[str, ...]:
        """Open a .trig.json or a project.toml into the model; returns doubts, a sentence each."""
        raise NotImplementedError

    def save(self, path: Path | str | None = None) -> None:
        """Save to `path`, by default where it was saved before; the autosave goes."""
        raise NotImplementedError

    def autosave(self) -> str:
        """Write ``<session>~`` (or into `scratch`); never raises: returns a sentence or empty."""
        raise NotImplementedError

    def discard_autosave(self) -> None:
        """Remove the autosave: the session is saved, or is given up."""
        raise NotImplementedError

    def recoverable(self, path: Path | str | None = None) -> tuple[Path, ...]:
        """Return autosaves newer than the session at `path`, or those in `scratch`."""
        raise NotImplementedError

    def recover(self, autosave: Path) -> tuple[str, ...]:
        """Take an autosave over into the model, modified, under the session's own path."""
        raise NotImplementedError

    def write_project(self, path: Path | str | None = None) -> Path:
        """Write project.toml and picks.csv that `trigpoint audit` takes; return project.toml."""
        raise NotImplementedError
