"""Fingerprints: the SHA-256 of files, by which a session knows them again."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from trigpoint.delivery import sha256


def content_of(path: Path) -> str | None:
    """Return the SHA-256 of a file read anew; None where there is none to read."""
    try:
        return sha256(path)
    except OSError:
        return None


class Fingerprints:
    """SHA-256 of files, each worked out once for as long as its size and date stay."""

    def __init__(self) -> None:
        self._known: dict[tuple[Path, int, int], str] = {}

    def of(self, path: Path, *, hashing: bool = True) -> dict[str, Any]:
        """Return `bytes` and `sha256` of a file; without `hashing` only a hash that is known.

        Raises
        ------
        OSError
            If it can't be read.
        """
        at = path / "ept.json" if path.is_dir() else path
        status = at.stat()
        key = (at, status.st_size, status.st_mtime_ns)
        if hashing and key not in self._known:
            self._known[key] = sha256(at)
        said = {"bytes": status.st_size, "sha256": self._known.get(key)}
        return {name: value for name, value in said.items() if value is not None}
