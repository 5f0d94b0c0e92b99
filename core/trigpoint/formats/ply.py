"""PLY, ASCII and binary, float and double, clouds and meshes; read through plyfile."""

from __future__ import annotations

import io
import re
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
import plyfile
from numpy.typing import NDArray

from trigpoint.cautions import Caution
from trigpoint.errors import CloudError
from trigpoint.formats.source import (
    Attributes,
    Box,
    Chunk,
    Plan,
    Source,
    axes_of,
    chunk_of_records,
    columns_of,
    cut_short,
)

FAULTS = (plyfile.PlyParseError, OSError, ValueError, UnicodeDecodeError)

# What plyfile says where a file ends too soon.
_ENDED = "early end-of-file"
_TYPES = {
    "i1": "char",
    "u1": "uchar",
    "i2": "short",
    "u2": "ushort",
    "i4": "int",
    "u4": "uint",
    "f4": "float",
    "f8": "double",
}
# float64 counts whole numbers up to here.
_EXACT = 2**53
_HEAD_BYTES = 4096
_FACE = np.dtype([("corners", "u1"), ("vertex_indices", "<i4", (3,))])


def opened(path: Path) -> Source:
    """Read the header; binary vertices stay on the disk until they are asked for."""
    try:
        ply = _parsed(path)
    except plyfile.PlyParseError as error:
        if _ENDED not in str(error):
            raise
        message = f"{path.name} ends within its header: it is no PLY, or cut short."
        if isinstance(error, plyfile.PlyElementParseError):
            element, row = error.element, error.row or 0
            what = {"vertex": "points", "face": "faces"}.get(element.name, element.name)
            message = cut_short(path, row, element.count, what)
        raise CloudError(message) from error
    if "vertex" not in ply:
        message = f"{path.name} has no vertices: a point cloud needs them."
        raise CloudError(message)
    vertex = ply["vertex"]
    names = tuple(p.name for p in vertex.properties)
    axes = axes_of(names, path)
    if "f_dc_0" in names and {"opacity", "scale_0", "rot_0"} & set(names):
        message = (
            f"{path.name} is a Gaussian splat: it needs more than its positions moved (rotations, "
            f"scales, harmonics). Export a point cloud from it, or use splat-transform."
        )
        raise CloudError(message)
    lists = [p.name for p in vertex.properties if isinstance(p, plyfile.PlyListProperty)]
    others = [e.name for e in ply.elements if e.name not in ("vertex", "face") and e.count]
    lost = [*lists, *others]
    caution = Caution("attribute_dropped", f"not read from {path.name}: {', '.join(lost)}.")
    order = "ASCII" if ply.text else {"<": "little", ">": "big"}[ply.byte_order] + " endian"
    types = {vertex.ply_property(axis).val_dtype for axis in axes}
    return Source(
        format=f"PLY 1.0, {order}, {_TYPES.get(max(types), '')}",
        chunks=partial(_chunks, ply, axes),
        attributes=tuple(n for n in names if n not in (*axes, *lists)),
        points=vertex.count,
        is_single="f8" not in types and bool({"f4"} & types),
        cautions=(caution,) if lost else (),
    )


def write(path: Path, chunks: Iterator[Chunk], plan: Plan) -> tuple[Caution, ...]:
    """Write binary little-endian PLY with double coordinates, and triangles where there are any.

    Attributes of several columns become several properties; whole numbers of 64 bits become
    doubles.
    """
    cautions: dict[str, Caution] = {}
    if plan.crs is not None:
        message = f"PLY holds no CRS: the coordinates written are in {plan.crs.name}."
        cautions["crs"] = Caution("crs_missing", message)
    faces: list[NDArray[np.int64]] = []
    points, record = 0, None
    with path.open("wb") as file:
        for chunk in chunks:
            columns = _columns(chunk.attributes, cautions)
            if record is None:
                record = np.dtype(
                    [(a, "<f8") for a in "xyz"]
                    + [(n, v.dtype.newbyteorder("<")) for n, v in columns.items()]
                )
                _write_header(file, record, 0, None)
            rows = np.empty(len(chunk.xyz), record)
            for axis, name in enumerate("xyz"):
                rows[name] = chunk.xyz[:, axis]
            for name, values in columns.items():
                rows[name] = values
            file.write(rows.tobytes())
            if chunk.faces is not None:
                faces.append(chunk.faces + points)
            points += len(rows)
        triangles = np.concatenate(faces) if faces else None
        if triangles is not None:
            rows = np.empty(len(triangles), _FACE)
            rows["corners"], rows["vertex_indices"] = 3, triangles
            file.write(rows.tobytes())
        file.seek(0)
        assert record is not None
        _write_header(file, record, points, None if triangles is None else len(triangles))
    return tuple(cautions.values())


def _parsed(path: Path) -> Any:
    with path.open("rb") as file:
        start = file.read(_HEAD_BYTES)
    if re.search(rb"^format +ascii", start, re.MULTILINE):
        # As text the coordinates may have more digits than the type that the header gives them.
        header, end, body = path.read_bytes().partition(b"end_header")
        header = re.sub(rb"property +(float|float32) +([xyzXYZ]\s)", rb"property double \2", header)
        return plyfile.PlyData.read(io.BytesIO(header + end + body))
    try:
        # Triangles alone can be mapped like vertices; anything else is read face by face.
        triangles = {"vertex_indices": 3, "vertex_index": 3}
        return plyfile.PlyData.read(path, known_list_len={"face": triangles})
    except plyfile.PlyElementParseError:
        return plyfile.PlyData.read(path)


def _chunks(
    ply: Any, axes: tuple[str, str, str], size: int, attributes: bool, box: Box | None
) -> Iterator[Chunk]:
    del box  # there is no index to use it with
    vertex = ply["vertex"]
    lists = {p.name for p in vertex.properties if isinstance(p, plyfile.PlyListProperty)}
    records = vertex.data[[p.name for p in vertex.properties if p.name not in lists]]
    if attributes and "face" in ply and ply["face"].count:
        chunk = chunk_of_records(records, axes, attributes=True)
        yield chunk._replace(faces=_triangles(ply["face"], len(records)))
        return
    for start in range(0, len(records), size):
        yield chunk_of_records(records[start : start + size], axes, attributes=attributes)


def _triangles(face: Any, points: int) -> NDArray[np.int64]:
    """Return the faces as triangles, shape (m, 3); polygons become fans about a corner."""
    names = [p.name for p in face.properties if isinstance(p, plyfile.PlyListProperty)]
    name = next((n for n in ("vertex_indices", "vertex_index") if n in names), None)
    if name is None:
        message = f"the faces have {', '.join(names) or 'no lists'}: they need vertex_indices."
        raise CloudError(message)
    corners = face[name]
    if corners.dtype == object:
        fans = [
            np.column_stack([np.full(len(c) - 2, c[0]), c[1:-1], c[2:]])
            for c in corners
            if len(c) > 2
        ]
        corners = np.concatenate(fans) if fans else np.empty((0, 3))
    triangles = np.array(corners, np.int64)
    if len(triangles) and (triangles.min() < 0 or triangles.max() >= points):
        message = (
            f"the faces name vertices {triangles.min()} to {triangles.max()}, and there are "
            f"{points:,}: the file is damaged."
        )
        raise CloudError(message)
    return triangles


def _columns(attributes: Attributes, cautions: dict[str, Caution]) -> Attributes:
    columns: Attributes = {}
    for name, values in columns_of(attributes).items():
        kind = values.dtype.str[1:]
        reason = ""
        if values.dtype.kind not in "biuf" or len(name.split()) != 1:
            reason = "it is not a number" if len(name.split()) == 1 else "of the blank in its name"
        elif values.dtype.kind == "b":
            columns[name] = values.astype(np.uint8)
        elif kind in _TYPES:
            columns[name] = values
        else:
            columns[name] = values.astype(np.float32 if kind == "f2" else np.float64)
            if values.dtype.kind in "iu" and (np.abs(columns[name]) > _EXACT).any():
                reason = "whole numbers above 2^53 lose their last digits"
        if reason:
            message = f"PLY can't hold {name!r} as it is: {reason}."
            cautions.setdefault(name, Caution("attribute_dropped", message))
    return columns


def _write_header(
    file: BinaryIO, record: np.dtype[np.void], points: int, faces: int | None
) -> None:
    # The counts are known only at the end: a comment of varying width keeps the length fixed.
    vertex = f"element vertex {points}\n"
    face = (
        "" if faces is None else f"element face {faces}\nproperty list uchar int vertex_indices\n"
    )
    properties = [f"property {_TYPES[record[n].str[1:]]} {n}\n" for n in record.names or ()]
    lines = [
        "ply\nformat binary_little_endian 1.0\n",
        "comment trigpoint" + " " * (120 - len(vertex) - len(face)) + "\n",
        vertex,
        *properties,
        face,
        "end_header\n",
    ]
    file.write("".join(lines).encode())
