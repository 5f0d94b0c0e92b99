"""A folder written whole or not at all: what was there before stays until its successor is done."""

from __future__ import annotations

import ctypes
import hashlib
import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from tempfile import TemporaryDirectory

import pandas as pd

from trigpoint.canonical import plain, write_text
from trigpoint.errors import ProjectError

try:
    import fcntl
except ImportError:  # Windows, where a folder can't be locked
    fcntl = None  # type: ignore[assignment]


@contextmanager
def whole_folder(folder: Path) -> Iterator[Path]:
    """Yield an empty folder beside `folder`, and put it in its place if the work succeeds.

    A run that is killed leaves the previous folder as it was, and a draft beside it that the next
    run clears away. The zip of the previous folder goes before it: whenever the run is killed, no
    zip lies beside a folder that it was not made from.

    Parameters
    ----------
    folder : Path
        Where the result belongs. Its parents are made.

    Raises
    ------
    ProjectError
        If another run is writing the same folder.
    """
    folder.parent.mkdir(parents=True, exist_ok=True)
    draft = _draft_of(folder)
    previous = folder.with_name(f".{folder.name}.previous")
    with _claimed(folder):
        if previous.exists() and not folder.exists():
            previous.rename(folder)  # killed between the two renames of `_put`
        draft.mkdir(exist_ok=True)
        for leftover in (previous, *draft.iterdir()):
            if leftover.is_dir() and not leftover.is_symlink():
                shutil.rmtree(leftover)
            else:
                leftover.unlink(missing_ok=True)
        try:
            yield draft
        except BaseException:
            shutil.rmtree(draft, ignore_errors=True)
            raise
        archive_of(folder).unlink(missing_ok=True)
        _put(draft, folder, previous)


def check_writable(folder: Path) -> None:
    """Raise ProjectError where `whole_folder` could not write a folder; leave nothing behind.

    To be called before work that takes long.
    """
    made = [each for each in folder.parents if not each.exists()]
    try:
        folder.parent.mkdir(parents=True, exist_ok=True)
        with TemporaryDirectory(prefix=f".{folder.name}.", dir=folder.parent):
            pass
    except OSError as error:
        message = (
            f"Nothing can be written to {folder.parent}: {error.strerror}. Choose another folder "
            "(--out), or make that one writable."
        )
        raise ProjectError(message) from error
    finally:
        for each in made:
            with suppress(OSError):  # not made after all, or by now somebody's
                each.rmdir()


def clear_draft(folder: Path) -> None:
    """Clear away the draft that a killed run left beside `folder`; another run's stays."""
    if _draft_of(folder).exists():
        with suppress(ProjectError, OSError), _claimed(folder):
            shutil.rmtree(_draft_of(folder), ignore_errors=True)


def archive_of(folder: Path) -> Path:
    """Return where a folder's zip lies: beside it, ``<folder>.zip``."""
    return folder.with_name(f"{folder.name}.zip")


def _draft_of(folder: Path) -> Path:
    return folder.with_name(f".{folder.name}.draft")


def _put(draft: Path, folder: Path, previous: Path) -> None:
    """Put a finished draft in its folder's place, in one step where the system can."""
    if not folder.exists():
        draft.rename(folder)
    elif _exchanged(draft, folder):
        shutil.rmtree(draft, ignore_errors=True)
    else:
        folder.rename(previous)
        draft.rename(folder)
        shutil.rmtree(previous, ignore_errors=True)


def _exchanged(one: Path, other: Path) -> bool:
    # Linux alone can swap two folders so that no moment is without either; Python does not ask it.
    exchange = getattr(ctypes.CDLL(None), "renameat2", None) if os.name == "posix" else None
    if exchange is None:
        return False
    here = -100  # AT_FDCWD
    swap = 2  # RENAME_EXCHANGE
    return bool(exchange(here, os.fsencode(one), here, os.fsencode(other), swap) == 0)


@contextmanager
def _claimed(folder: Path) -> Iterator[None]:
    """Hold a folder for this process alone; the claim ends with the process, however it ends."""
    if fcntl is None:
        yield
        return
    lock = folder.with_name(f".{folder.name}.lock")
    handle = os.open(lock, os.O_RDWR | os.O_CREAT)
    try:
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
            # Whoever held it last may have taken it away meanwhile.
            held = lock.exists() and os.path.samestat(os.fstat(handle), lock.stat())
        except BlockingIOError:
            held = False
        if not held:
            message = f"Another run is writing {folder} now; wait for it."
            raise ProjectError(message)
        try:
            yield
        finally:
            lock.unlink(missing_ok=True)
    finally:
        os.close(handle)


def write_csv(path: Path, rows: object) -> None:
    """Write rows as CSV: numbers rounded as in results.json, missing ones empty."""
    table = pd.DataFrame(plain(rows))
    write_text(path, table.to_csv(index=False, lineterminator="\n"))


def sha256(path: Path) -> str:
    """Return the SHA-256 of a file, in hexadecimal."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
