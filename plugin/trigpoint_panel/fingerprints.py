"""Fingerprints: the SHA-256 of files, by which a session knows them again."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from trigpoint.delivery import sha256


def content_of(path: Path) -> str | None:
    """Return the SHA-256 of a file read anew; None where there is none to read."""
    try:
        return sha256(path)
    except OSError:
        return None


@dataclass(frozen=True, slots=True)
class Fingerprint:
    """A file as it was when it was read.

    Attributes
    ----------
    path : Path
    stamp : tuple of int
        Its size, and when it was written.
    sha256 : str
    """

    path: Path
    stamp: tuple[int, int]
    sha256: str

    @property
    def is_outdated(self) -> bool:
        """Whether the file holds something else by now; one that has gone does not."""
        try:
            return stamp_of(self.path) != self.stamp and sha256(_file(self.path)) != self.sha256
        except OSError:
            return False


def fingerprint_of(path: Path) -> Fingerprint:
    """Read a file anew; OSError if it can't be."""
    return Fingerprint(path, stamp_of(path), sha256(_file(path)))


def stamp_of(path: Path) -> tuple[int, int]:
    """Return a file's size and when it was written; OSError if it is not there."""
    status = _file(path).stat()
    return status.st_size, status.st_mtime_ns


def _file(path: Path) -> Path:
    """Return the file that stands for a path: of a folder of tiles, its index."""
    return path / "ept.json" if path.is_dir() else path


class Fingerprints:
    """SHA-256 of files, each worked out once for as long as its size and date stay."""

    def __init__(self) -> None:
        self._known: dict[tuple[Path, int, int], str] = {}
        self._kept: dict[Path, Fingerprint] = {}

    def keep(self, fingerprint: Fingerprint) -> None:
        """Say from now on what a file was when it was read, whatever becomes of it."""
        self._kept[fingerprint.path] = fingerprint

    def of(self, path: Path, *, hashing: bool = True) -> dict[str, Any]:
        """Return `bytes` and `sha256` of a file; without `hashing` only a hash that is known.

        Raises
        ------
        OSError
            If it can't be read.
        """
        at, stamp = _file(path), stamp_of(path)
        if (kept := self._kept.get(path)) is not None:
            return {"bytes": kept.stamp[0], "sha256": kept.sha256}
        key = (at, *stamp)
        if hashing and key not in self._known:
            self._known[key] = sha256(at)
        said = {"bytes": stamp[0], "sha256": self._known.get(key)}
        return {name: value for name, value in said.items() if value is not None}
