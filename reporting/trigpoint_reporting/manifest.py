"""Lists of files with their SHA-256, in the syntax that `sha256sum -c` checks without Python."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from trigpoint.canonical import write_text
from trigpoint.delivery import sha256
from trigpoint.errors import TrigpointError

# Everything in the bundle but itself.
MANIFEST = "manifest-sha256.txt"
# Everything that the report rests on, listed before the report is written: its own SHA-256 can
# stand in the report, which the manifest's can't, because the manifest lists the report.
RECORD = "record-sha256.txt"
# How many hexadecimal digits of the record's SHA-256 a footer shows.
PREFIX = 16


class BundleError(TrigpointError, ValueError):
    """A bundle can't be read as one, or may not be replaced."""

    code = "bundle"


def list_files(folder: Path) -> list[str]:
    """Return every file below a folder, as sorted paths with forward slashes."""
    found = (path for path in folder.rglob("*") if path.is_file())
    return sorted(path.relative_to(folder).as_posix() for path in found)


def hash_files(folder: Path) -> dict[str, str]:
    """Return the SHA-256 of every file below a folder, by path."""
    return {name: sha256(folder / name) for name in list_files(folder)}


def write_manifest(path: Path, hashes: Mapping[str, str]) -> None:
    """Write hashes as `sha256sum` prints them, sorted by path."""
    write_text(path, "".join(f"{hashes[name]}  {name}\n" for name in sorted(hashes)))


def read_manifest(path: Path) -> dict[str, str]:
    """Read hashes back, by path.

    Raises
    ------
    BundleError
        If the file is missing, a line is no hash and path, or a path is given twice or leaves the
        folder.
    """
    try:
        lines = path.read_text("utf-8").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        message = f"{path.name} is missing or is not UTF-8 text."
        raise BundleError(message) from error
    hashes: dict[str, str] = {}
    for number, line in enumerate(lines, 1):
        digest, _, name = line.partition("  ")
        sound = len(digest) == 64 and set(digest) <= set("0123456789abcdef")
        if not sound or not is_inside(name) or name in hashes:
            message = f"{path.name} line {number} is no SHA-256 and path of its own: {line[:80]!r}."
            raise BundleError(message)
        hashes[name] = digest
    return hashes


def is_inside(name: str) -> bool:
    """Tell whether a path with forward slashes stays inside its folder, on every system."""
    parts = name.split("/")
    odd = any(part in ("", ".", "..") for part in parts)
    return not odd and not any(character in name for character in ':\\\0\r\n"')


def record_hash(folder: Path) -> str:
    """Return the SHA-256 of a bundle's record: what its report states about what it rests on."""
    return sha256(folder / RECORD)
