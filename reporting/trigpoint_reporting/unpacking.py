"""A bundle opened as a folder: as it lies, or unpacked from a zip that nobody vouches for."""

from __future__ import annotations

import shutil
import stat
import tempfile
import zipfile
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from trigpoint_reporting.manifest import BundleError, is_inside

# A bundle holds some dozens of files; text in it deflates to a twentieth, a bomb to a thousandth.
MOST_FILES = 10_000
MOST_RATIO = 100
FREE_BYTES = 10_000_000  # small files may deflate as they like


@contextmanager
def opened(path: Path) -> Iterator[Path]:
    """Yield a bundle's folder; that of a zip is temporary.

    Raises
    ------
    BundleError
        If there is no folder or zip, or the zip holds what a bundle does not: a path that leaves
        its folder, a link, a name twice, several folders, or more bytes than it can honestly hold.
    """
    if path.is_dir():
        yield path
        return
    if not path.is_file():
        message = f"{path}: there is no such bundle, neither folder nor zip."
        raise BundleError(message)
    with tempfile.TemporaryDirectory(prefix="trigpoint-") as temporary:
        try:
            with zipfile.ZipFile(path) as archive:
                top = _unpack(archive, path, Path(temporary))
        except (zipfile.BadZipFile, zlib.error, EOFError, NotImplementedError) as error:
            message = f"{path.name} is no zip that can be read: {error}."
            raise BundleError(message) from error
        yield Path(temporary) / top


def _unpack(archive: zipfile.ZipFile, path: Path, folder: Path) -> str:
    """Unpack into an empty folder; return the one folder that the zip holds."""
    entries = [entry for entry in archive.infolist() if not entry.is_dir()]
    names = [entry.filename for entry in entries]
    tops = {name.partition("/")[0] for name in names}
    size = sum(entry.file_size for entry in entries)
    most = max(FREE_BYTES, MOST_RATIO * path.stat().st_size)
    # A file's mode stands in the upper half; a zip from elsewhere may state none.
    modes = [entry.external_attr >> 16 for entry in entries]
    if not entries or len(tops) != 1 or any("/" not in name for name in names):
        fault = f"holds {len(tops)} things at its top; a bundle is one folder"
    elif bad := [name for name in names if not is_inside(name)]:
        fault = f"holds the path {bad[0]!r}, which leaves its folder"
    elif len({name.casefold() for name in names}) != len(names):
        fault = "holds a name twice"
    elif any(stat.S_IFMT(mode) not in (0, stat.S_IFREG) for mode in modes):
        fault = "holds a link or a device"
    elif any(entry.flag_bits & 1 for entry in entries):
        fault = "is encrypted"
    elif len(entries) > MOST_FILES or size > most:
        fault = f"would unpack to {len(entries):,} files of {size:,} bytes; a bundle would not"
    elif size > shutil.disk_usage(folder).free:
        fault = f"unpacks to {size:,} bytes, and there is no room for them in {folder.parent}"
    else:
        for entry in entries:
            target = folder / entry.filename
            target.parent.mkdir(parents=True, exist_ok=True)
            # Reading stops at the size that the entry states, whatever else is compressed there.
            with archive.open(entry) as source, target.open("xb") as file:
                shutil.copyfileobj(source, file, 2**20)
        return tops.pop()
    message = f"{path.name} {fault}: it is not unpacked."
    raise BundleError(message)
