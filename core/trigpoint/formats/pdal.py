"""Every other format, EPT among them, through PDAL where it is installed."""

from __future__ import annotations

import importlib
import json
import os
import shutil
import subprocess
import tempfile
import weakref
from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import laspy
import numpy as np

from trigpoint.crs import header_crs
from trigpoint.errors import CloudError, MissingPackageError
from trigpoint.formats import las
from trigpoint.formats.source import Box, Chunk, Source

FAULTS = (*las.FAULTS, subprocess.SubprocessError, TypeError)

# By the end of the name. Some came after PDAL 2.2, and some are plugins: PDAL says so itself.
READERS = {
    "ept.json": "readers.ept",
    ".bpf": "readers.bpf",
    ".csd": "readers.optech",
    ".h5": "readers.icebridge",
    ".icebridge": "readers.icebridge",
    ".i3s": "readers.i3s",
    ".ntf": "readers.nitf",
    ".nsf": "readers.nitf",
    ".obj": "readers.obj",
    ".pts": "readers.pts",
    ".ptx": "readers.ptx",
    ".qi": "readers.qfit",
    ".rdbx": "readers.rdb",
    ".rxp": "readers.rxp",
    ".sbet": "readers.sbet",
    ".slpk": "readers.slpk",
    ".tindex": "readers.tindex",
}
# What PDAL calls the colours that point format 6 has no place for.
_NAMES = {"Red": "red", "Green": "green", "Blue": "blue", "Infrared": "nir"}

ABSENT = (
    "it is read through PDAL, which is not installed. PyPI has only its source package: install it "
    "from conda-forge (conda install -c conda-forge python-pdal), or name the pdal command in "
    "TRIGPOINT_PDAL."
)


def reader_of(path: Path) -> str | None:
    """Name PDAL's reader of a file; None if there is none."""
    name = path.name.lower()
    return next((reader for end, reader in READERS.items() if name.endswith(end)), None)


def pipeline(path: Path, reader: str, target: Path, *, box: Box | None = None) -> str:
    """Make the JSON that turns a file into LAS with every dimension kept.

    Point format 6 holds no colour, so that PDAL adds colours only where there are some, as extra
    dimensions. Understood by PDAL 2.2 and later.

    Examples
    --------
    >>> stages = json.loads(pipeline(Path("a.bpf"), "readers.bpf", Path("b.las")))["pipeline"]
    >>> [stage["type"] for stage in stages]
    ['readers.bpf', 'writers.las']
    """
    source: dict[str, Any] = {"type": reader, "filename": str(path)}
    if (
        box is not None
        and reader == "readers.ept"
        and np.isfinite([box.low[:2], box.high[:2]]).all()
    ):
        # PDAL takes a box in plan or in space, and no infinite ends.
        axes = 3 if np.isfinite([box.low, box.high]).all() else 2
        ends = zip(box.low[:axes].tolist(), box.high[:axes].tolist(), strict=True)
        source["bounds"] = f"({', '.join(f'[{low!r}, {high!r}]' for low, high in ends)})"
    writer = {
        "type": "writers.las",
        "filename": str(target),
        "minor_version": 4,
        "dataformat_id": 6,
        "extra_dims": "all",
        # PDAL 2.2 takes "auto" for a scale too, and writes whole units.
        **{f"scale_{axis}": las.GROUND_STEP for axis in "xyz"},
        **{f"offset_{axis}": "auto" for axis in "xyz"},
    }
    return json.dumps({"pipeline": [source, writer]})


def opened(path: Path) -> Source:
    """Read what EPT says of itself; turn any other format into LAS, once."""
    reader = reader_of(path)
    assert reader is not None
    return _tiled(path) if reader == "readers.ept" else _converted(path, reader)


def run(stages: str) -> None:
    """Run a pipeline with the command in TRIGPOINT_PDAL, the pdal module, or the pdal command.

    Raises
    ------
    CloudError
        If PDAL refuses it, with PDAL's own words.
    MissingPackageError
        If there is no PDAL.
    """
    named = os.environ.get("TRIGPOINT_PDAL")
    try:
        module = None if named else importlib.import_module("pdal")
    except ImportError:
        module = None
    command = named or shutil.which("pdal")
    if module is not None:
        try:
            module.Pipeline(stages).execute()
        except RuntimeError as error:
            message = f"PDAL: {' '.join(str(error).split())}"
            raise CloudError(message) from error
    elif command:
        done = subprocess.run(
            [command, "pipeline", "--stdin"],
            input=stages,
            capture_output=True,
            text=True,
            check=False,
        )
        if done.returncode:
            message = f"PDAL: {' '.join((done.stderr or done.stdout).split())}"
            raise CloudError(message)
    else:
        raise MissingPackageError(ABSENT)


def _tiled(path: Path) -> Source:
    description = json.loads(path.read_text(encoding="utf-8"))
    corners = np.array(description["boundsConforming"], np.float64)
    extent = Box(corners[:3], corners[3:])
    crs, cautions = header_crs(description.get("srs", {}).get("wkt"), None, *extent)
    dimensions = {entry["name"]: entry for entry in description["schema"]}
    return Source(
        format="EPT, through PDAL",
        chunks=partial(_query, path),
        attributes=tuple(_las_name(n) for n in dimensions if n not in ("X", "Y", "Z")),
        extent=extent,
        points=description["points"],
        step=np.array([dimensions[axis].get("scale", 0.0) for axis in "XYZ"]),
        crs=crs,
        cautions=cautions,
    )


def _las_name(name: str) -> str:
    """Return what laspy calls a dimension of PDAL: GpsTime is gps_time."""
    apart = "".join(f"_{c.lower()}" if c.isupper() else c for c in name).lstrip("_")
    return apart if apart in laspy.PointFormat(8).dimension_names else _NAMES.get(name, name)


def _query(path: Path, size: int, attributes: bool, box: Box | None) -> Iterator[Chunk]:
    with tempfile.TemporaryDirectory(prefix="trigpoint-") as folder:
        target = Path(folder) / "cloud.las"
        run(pipeline(path, "readers.ept", target, box=box))
        yield from _renamed(target, size, attributes, None)


def _converted(path: Path, reader: str) -> Source:
    copy = _Copy(path, reader)
    found = las.opened(copy.path)
    return replace(
        found,
        format=f"{reader.removeprefix('readers.').upper()}, through PDAL",
        chunks=copy.chunks,
        attributes=tuple(_NAMES.get(name, name) for name in found.attributes),
        # How finely PDAL wrote for us says nothing about the file.
        step=None,
    )


class _Copy:
    """A file turned into LAS, for as long as someone may read it."""

    def __init__(self, path: Path, reader: str) -> None:
        folder = tempfile.mkdtemp(prefix="trigpoint-")
        weakref.finalize(self, shutil.rmtree, folder, ignore_errors=True)
        self.path = Path(folder) / "cloud.las"
        run(pipeline(path, reader, self.path))

    def chunks(self, size: int, attributes: bool, box: Box | None) -> Iterator[Chunk]:
        """Read it."""
        yield from _renamed(self.path, size, attributes, box)


def _renamed(path: Path, size: int, attributes: bool, box: Box | None) -> Iterator[Chunk]:
    for chunk in las.opened(path).chunks(size, attributes, box):
        names = {_NAMES.get(name, name): values for name, values in chunk.attributes.items()}
        yield chunk._replace(attributes=names)
