"""Whose an autosave is: a lock beside it, which the system lifts when its window is gone."""

from __future__ import annotations

import os
import sys
from contextlib import suppress
from pathlib import Path

if sys.platform == "win32":
    import msvcrt
else:
    import fcntl


class Ownership:
    """A hold on one autosave; nobody else has one until it is released or its process dies."""

    def __init__(self, path: Path, handle: int | None) -> None:
        self._path, self._handle = path, handle

    def release(self) -> None:
        """Let go, and leave no lock behind."""
        if self._handle is None:
            return
        with suppress(OSError):  # Windows removes no open file; there it stays, and locks nothing
            self._path.unlink(missing_ok=True)
        os.close(self._handle)


def own(autosave: Path) -> Ownership | None:
    """Take hold of an autosave, whether it is there yet or not; None: somebody has it."""
    path = _lock_of(autosave)
    while True:
        try:
            handle = os.open(path, os.O_RDWR | os.O_CREAT, 0o666)
        except OSError:  # nobody can write there, and so nobody keeps it
            return Ownership(path, None)
        if not _locked(handle):
            os.close(handle)
            return None
        # Its former owner may have removed it between the two: the lock would be on no file.
        with suppress(FileNotFoundError):
            if os.path.samestat(os.fstat(handle), path.stat()):
                return Ownership(path, handle)
        os.close(handle)


def is_owned(autosave: Path) -> bool:
    """Whether a window that is still open keeps this autosave."""
    try:
        handle = os.open(_lock_of(autosave), os.O_RDWR)
    except OSError:
        return False
    try:
        return not _locked(handle)
    finally:
        os.close(handle)


def _lock_of(autosave: Path) -> Path:
    return autosave.with_name(f"{autosave.name}.lock")


def _locked(handle: int) -> bool:
    """Try to lock an open file; closing it unlocks it."""
    try:
        if sys.platform == "win32":
            msvcrt.locking(handle, msvcrt.LK_NBLCK, 1)
        else:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except (BlockingIOError, PermissionError):
        return False
    except OSError:  # a file system that knows no locks: there an autosave is anybody's
        return True
    return True
