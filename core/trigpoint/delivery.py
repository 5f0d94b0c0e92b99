"""A folder written whole or not at all: what was there before stays until its successor is done."""

from __future__ import annotations

import hashlib
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pandas as pd

from trigpoint.canonical import plain, write_text


@contextmanager
def whole_folder(folder: Path) -> Iterator[Path]:
    """Yield an empty folder beside `folder`, and put it in its place if the work succeeds.

    A run that is killed leaves the previous folder as it was, and a draft beside it that the next
    run clears away.

    Parameters
    ----------
    folder : Path
        Where the result belongs. Its parents are made.
    """
    folder.parent.mkdir(parents=True, exist_ok=True)
    draft = folder.with_name(f".{folder.name}.draft")
    previous = folder.with_name(f".{folder.name}.previous")
    if previous.exists() and not folder.exists():
        previous.rename(folder)  # killed between the two renames below
    for leftover in (draft, previous):
        if leftover.exists():
            shutil.rmtree(leftover)
    draft.mkdir()
    try:
        yield draft
    except BaseException:
        shutil.rmtree(draft, ignore_errors=True)
        raise
    if folder.exists():
        folder.rename(previous)
    draft.rename(folder)
    shutil.rmtree(previous, ignore_errors=True)


def write_csv(path: Path, rows: object) -> None:
    """Write rows as CSV: numbers rounded as in results.json, missing ones empty."""
    table = pd.DataFrame(plain(rows))
    write_text(path, table.to_csv(index=False, lineterminator="\n"))


def sha256(path: Path) -> str:
    """Return the SHA-256 of a file, in hexadecimal."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
