"""E57, every scan of a file put where its pose says; read through pye57's libE57Format."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pye57
from numpy.typing import NDArray
from pye57 import libe57
from scipy.spatial.transform import Rotation

from trigpoint.crs import header_crs
from trigpoint.errors import CloudError
from trigpoint.formats.source import Attributes, Box, Chunk, Source
from trigpoint.similarity import Points, Similarity

FAULTS = (libe57.E57Exception, OSError, RuntimeError)

_CARTESIAN = ("cartesianX", "cartesianY", "cartesianZ")
_SPHERICAL = ("sphericalRange", "sphericalAzimuth", "sphericalElevation")
_NORMAL = ("nx", "ny", "nz")
# What other formats and programs call the same thing.
_NAMES = {
    "colorRed": "red",
    "colorGreen": "green",
    "colorBlue": "blue",
    "nor:normalX": "nx",
    "nor:normalY": "ny",
    "nor:normalZ": "nz",
}
# libE57Format knows no unsigned 64 bits.
_WHOLE = ("u1", "i1", "u2", "i2", "u4", "i4", "i8")
_NOT_ATTRIBUTES = {*_CARTESIAN, *_SPHERICAL, "cartesianInvalidState", "sphericalInvalidState"}


def opened(path: Path) -> Source:
    """Read the headers of all scans."""
    with pye57.E57(str(path)) as file:
        scans = [_Scan(file, k) for k in range(file.scan_count)]
        if not scans:
            message = f"{path.name} holds no scans."
            raise CloudError(message)
        text = (
            file.root["coordinateMetadata"].value()
            if file.root.isDefined("coordinateMetadata")
            else ""
        )
        version = ".".join(
            str(file.root[part].value())
            for part in ("versionMajor", "versionMinor")
            if file.root.isDefined(part)
        )
        places = np.concatenate([scan.places for scan in scans])
        steps = [scan.step for scan in scans]
    crs, cautions = header_crs(text, None, places.min(axis=0), places.max(axis=0))
    types = _types(scans)
    return Source(
        format=f"E57 {version}".strip(),
        chunks=partial(_chunks, path, types),
        attributes=tuple(types),
        points=sum(scan.points for scan in scans),
        step=np.full(3, max(steps)),
        crs=crs,
        scans=len(scans),
        cautions=cautions,
    )


class _Scan:
    """One scan of an open file: its fields with their types, and its pose."""

    def __init__(self, file: Any, index: int) -> None:
        node = file.data3d[index]
        header = file.get_header(index)
        prototype = libe57.StructureNode(node["points"].prototype())
        self.node = node
        self.image_file = file.image_file
        self.points = int(header.point_count)
        self.types = {name: _dtype(prototype[name]) for name in header.point_fields}
        self.axes = _CARTESIAN if set(_CARTESIAN) <= set(self.types) else _SPHERICAL
        if not set(self.axes) <= set(self.types):
            message = f"scan {index + 1} has {', '.join(self.types)}: it needs coordinates."
            raise CloudError(message)
        self.types |= dict.fromkeys(self.axes, np.dtype(np.float64))
        self.step = max(_step(prototype[axis]) for axis in self.axes)
        self.invalid = (
            "cartesianInvalidState" if self.axes == _CARTESIAN else "sphericalInvalidState"
        )
        self.pose = _pose(node)
        # Programs disagree on the frame of the bounds where there is a pose.
        posed = self.pose.translation.any()
        self.places = self.pose.translation[None, :] if posed else _corners(node)

    @property
    def attributes(self) -> dict[str, np.dtype[Any]]:
        """Types of what is not a coordinate, by our names."""
        return {_NAMES.get(n, n): t for n, t in self.types.items() if n not in _NOT_ATTRIBUTES}

    def read(self, size: int, names: list[str]) -> Iterator[Mapping[str, NDArray[Any]]]:
        """Read fields in blocks."""
        arrays = {name: np.empty(size, self.types[name]) for name in names}
        buffers = libe57.VectorSourceDestBuffer()
        for name, array in arrays.items():
            buffers.append(libe57.SourceDestBuffer(self.image_file, name, array, size, True, True))
        reader = self.node["points"].reader(buffers)
        while count := reader.read():
            yield {name: array[:count].copy() for name, array in arrays.items()}
        reader.close()


def _chunks(
    path: Path, types: dict[str, np.dtype[Any]], size: int, attributes: bool, box: Box | None
) -> Iterator[Chunk]:
    del box  # there is no index to use it with
    with pye57.E57(str(path)) as file:
        for index in range(file.scan_count):
            scan = _Scan(file, index)
            skipped = set() if attributes else {n for n in scan.types if n not in _NOT_ATTRIBUTES}
            for fields in scan.read(size, [n for n in scan.types if n not in skipped]):
                xyz = scan.pose(_cartesian([fields[axis] for axis in scan.axes], scan.axes))
                if scan.invalid in fields:
                    xyz[fields[scan.invalid] != 0] = np.nan
                found = {_NAMES.get(n, n): v for n, v in fields.items() if n not in _NOT_ATTRIBUTES}
                yield Chunk(xyz, _filled(found, types, scan, len(xyz)) if attributes else {})


def _filled(
    found: Attributes, types: dict[str, np.dtype[Any]], scan: _Scan, points: int
) -> Attributes:
    """Give every scan the same attributes, and turn the normals with the pose."""
    filled: Attributes = {}
    for name, dtype in types.items():
        # What a scan does not have is zero, or NaN where the type has it.
        blank = np.nan if dtype.kind == "f" else 0
        filled[name] = found[name].astype(dtype) if name in found else np.full(points, blank, dtype)
    if set(_NORMAL) <= set(filled):
        old = np.column_stack([filled[name] for name in _NORMAL]).astype(np.float64)
        for axis, name in enumerate(_NORMAL):
            filled[name] = scan.pose.turn(old)[:, axis].astype(filled[name].dtype)
    return filled


def _types(scans: list[_Scan]) -> dict[str, np.dtype[Any]]:
    """Every attribute of any scan, in a type that holds all of them."""
    types: dict[str, np.dtype[Any]] = {}
    for scan in scans:
        for name, dtype in scan.attributes.items():
            types[name] = np.promote_types(types.get(name, dtype), dtype)
    return types


def _dtype(node: Any) -> np.dtype[Any]:
    if isinstance(node, libe57.IntegerNode):
        low, high = node.minimum(), node.maximum()
        fits = (t for t in _WHOLE if np.iinfo(t).min <= low and high <= np.iinfo(t).max)
        return np.dtype(next(fits))
    if isinstance(node, libe57.FloatNode) and node.precision() == libe57.E57_SINGLE:
        return np.dtype(np.float32)
    return np.dtype(np.float64)


def _pose(node: Any) -> Similarity:
    rotation, translation = np.eye(3), np.zeros(3)
    if node.isDefined("pose"):
        pose = node["pose"]
        # By name: a file may list them in any order.
        if pose.isDefined("rotation"):
            turn = [pose["rotation"][name].value() for name in "xyzw"]
            rotation = Rotation.from_quat(turn).as_matrix()
        if pose.isDefined("translation"):
            translation = np.array([pose["translation"][name].value() for name in "xyz"])
    return Similarity(1.0, rotation, translation)


def _cartesian(columns: list[NDArray[Any]], axes: tuple[str, str, str]) -> Points:
    first, second, third = (column.astype(np.float64) for column in columns)
    if axes == _CARTESIAN:
        return np.column_stack([first, second, third])
    level = first * np.cos(third)
    return np.column_stack([level * np.cos(second), level * np.sin(second), first * np.sin(third)])


def _step(node: Any) -> float:
    """Return the spacing of single precision at the largest coordinate; 0 for anything finer."""
    if _dtype(node) != np.float32:
        return 0.0
    reach = np.float32(max(abs(node.minimum()), abs(node.maximum())))
    # Without bounds of its own the node has those of its type.
    return 0.0 if reach >= np.finfo(np.float32).max else float(np.spacing(reach))


def _corners(node: Any) -> Points:
    """Lowest and highest corner of the scan's bounds, shape (2, 3); NaN if it states none."""
    if not node.isDefined("cartesianBounds"):
        return np.full((2, 3), np.nan)
    bounds = node["cartesianBounds"]
    ends = ("Minimum", "Maximum")
    return np.array([[bounds[f"{axis}{end}"].value() for axis in "xyz"] for end in ends])
