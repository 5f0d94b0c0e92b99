"""Which module reads and writes which file, and how its failures are told."""

from __future__ import annotations

import importlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from trigpoint.errors import CloudError, MissingPackageError, TrigpointError
from trigpoint.formats import foreign
from trigpoint.formats.source import Source

READERS = {
    ".las": "las",
    ".laz": "las",
    ".ply": "ply",
    ".e57": "e57",
    ".pcd": "pcd",
    ".xyz": "text",
    ".csv": "text",
    ".txt": "text",
    ".asc": "text",
}
WRITERS = {
    ".las": "las",
    ".laz": "las",
    ".ply": "ply",
    ".xyz": "text",
    ".csv": "text",
    ".txt": "text",
}


def opened(path: Path) -> tuple[Source, tuple[type[Exception], ...]]:
    """Open a file with the module that reads it, and name what that module's libraries raise.

    Raises
    ------
    CloudError
        If there is no such file, it is no point cloud, or its header is damaged.
    MissingPackageError
        If the module's library is not installed.
    """
    if not path.exists():
        message = f"{path}: there is no such file."
        raise CloudError(message)
    if path.is_dir() and (path / "ept.json").exists():
        path = path / "ept.json"
    backend = backend_of(_reader(path), path)
    if path.is_file() and not path.stat().st_size:
        message = f"{path.name} is empty, 0 bytes: copy or export it again."
        raise CloudError(message)
    with named(path, backend.FAULTS):
        return backend.opened(path), backend.FAULTS


def _reader(path: Path) -> str:
    suffix = path.suffix.lower()
    if other := foreign.recognised(path):
        message = f"{path.name} is not a point cloud: it is {other}."
        raise CloudError(message)
    if suffix in READERS:
        return READERS[suffix]
    pdal = backend_of("pdal", path)
    if pdal.reader_of(path):
        return "pdal"
    known = ", ".join([*READERS, *pdal.READERS])
    message = (
        f"{path.name}: {suffix or 'no suffix'} is not a format known here; these are: {known}."
    )
    raise CloudError(message)


def backend_of(name: str, path: Path) -> Any:
    """Import a format's module, which brings its library."""
    try:
        return importlib.import_module(f"trigpoint.formats.{name}")
    except ImportError as error:
        message = (
            f"{path.name}: {path.suffix} files need the package {error.name}, which is not "
            f"installed here: pip install {error.name}"
        )
        raise MissingPackageError(message) from error


@contextmanager
def named(path: Path, faults: tuple[type[Exception], ...]) -> Iterator[None]:
    """Turn what is said about a broken file into one error that names the file."""
    try:
        yield
    except (CloudError, MissingPackageError) as error:
        if path.name in str(error):
            raise
        message = f"{path.name}: {error}"
        raise type(error)(message) from error
    except TrigpointError:
        raise
    except faults as error:
        reason = " ".join(str(error).split()) or type(error).__name__
        message = f"{path.name} can't be read as {path.suffix.lstrip('.').upper()}: {reason}"
        raise CloudError(message) from error
