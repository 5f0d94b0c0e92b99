"""PCD, the Point Cloud Library's format: ASCII, binary, and binary compressed."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from trigpoint.errors import CloudError
from trigpoint.formats.source import Box, Chunk, Source, axes_of, chunk_of_records, cut_short
from trigpoint.formats.text import EXACT

FAULTS = (OSError, ValueError, KeyError, IndexError, pd.errors.ParserError)

_PACKED_COLOUR = frozenset({"rgb", "rgba"})


def opened(path: Path) -> Source:
    """Read the header."""
    header: dict[str, list[str]] = {}
    with path.open("rb") as file:
        while "DATA" not in header:
            line = file.readline(HEADER_LINE)
            if not line:
                message = f"{path.name} ends within its header: it is no PCD, or cut short."
                raise CloudError(message)
            key, *values = line.decode("ascii", errors="replace").split("#")[0].split() or [""]
            header[key] = values
        start = file.tell()
    record = _record(header)
    names = tuple(record.names or ())
    axes = axes_of(names, path)
    if header["DATA"][0] == "ascii":
        record = _in_double(record, axes)
    points = (
        int(header["POINTS"][0])
        if "POINTS" in header
        else int(header["WIDTH"][0]) * int(header["HEIGHT"][0])
    )
    encoding = header["DATA"][0]
    readers = {"ascii": _ascii, "binary": _binary, "binary_compressed": _compressed}
    if encoding not in readers:
        message = f"{path.name} has DATA {encoding}: PCD knows ascii, binary and binary_compressed."
        raise CloudError(message)
    read = partial(readers[encoding], path, start, record, points)
    colours = ("red", "green", "blue") if _PACKED_COLOUR & set(names) else ()
    kept = [n for n in names if n not in axes and n not in _PACKED_COLOUR and not n.startswith("_")]
    # Older files write .7 for 0.7.
    version = "".join(header.get("VERSION", [])[:1]).removeprefix("0")
    return Source(
        format=f"PCD{f' 0{version}' if version else ''}, {encoding}, "
        f"{'double' if record[axes[0]].itemsize == 8 else 'float'}",
        chunks=partial(_chunks, read, axes),
        attributes=(*kept, *colours),
        points=points,
        is_single=record[axes[0]] == np.float32,
    )


HEADER_LINE = 65_536


def _record(header: dict[str, list[str]]) -> np.dtype[np.void]:
    counts = header.get("COUNT", ["1"] * len(header["FIELDS"]))
    kinds = {"F": "f", "I": "i", "U": "u"}
    columns = []
    rows = zip(header["FIELDS"], header["SIZE"], header["TYPE"], counts, strict=True)
    for k, (name, size, kind, count) in enumerate(rows):
        # Padding has the name "_", as often as there is any.
        free = f"_{k}" if name == "_" else name
        columns.append((free, f"<{kinds[kind]}{size}", (int(count),) if count != "1" else ()))
    return np.dtype(columns)


def _in_double(record: np.dtype[np.void], axes: tuple[str, str, str]) -> np.dtype[np.void]:
    """Give the coordinates double precision: as text they may have more digits than their type."""
    names = record.names or ()
    return np.dtype([(name, "<f8" if name in axes else record[name]) for name in names])


def _chunks(
    read: partial[NDArray[np.void]],
    axes: tuple[str, str, str],
    size: int,
    attributes: bool,
    box: Box | None,
) -> Iterator[Chunk]:
    del box  # there is no index to use it with
    records = read()
    for start in range(0, len(records), size):
        chunk = chunk_of_records(records[start : start + size], axes, attributes=attributes)
        for name in [n for n in chunk.attributes if n.startswith("_")]:
            del chunk.attributes[name]
        for name in _PACKED_COLOUR & set(chunk.attributes):
            # Blue, green, red, alpha in the four bytes of one number.
            packed = np.ascontiguousarray(chunk.attributes.pop(name)).view(np.uint8).reshape(-1, 4)
            chunk.attributes.update(
                red=packed[:, 2].copy(), green=packed[:, 1].copy(), blue=packed[:, 0].copy()
            )
        yield chunk


def _ascii(path: Path, start: int, record: np.dtype[np.void], points: int) -> NDArray[np.void]:
    with path.open("rb") as file:
        file.seek(start)
        table = pd.read_csv(file, sep=r"\s+", header=None, **EXACT)
    records = np.zeros(len(table), record)
    column = 0
    for name in record.names or ():
        shape = record[name].shape
        width = shape[0] if shape else 1
        values = table.iloc[:, column : column + width].to_numpy()
        if record[name].base.kind != "f" and not np.isfinite(values).all():
            message = f"{path.name} has rows without {name}: it is damaged, or cut short."
            raise CloudError(message)
        records[name] = values if shape else values[:, 0]
        column += width
    return _whole(path, records, points)


def _binary(path: Path, start: int, record: np.dtype[np.void], points: int) -> NDArray[np.void]:
    available = (path.stat().st_size - start) // record.itemsize
    count = min(points, available)
    records = np.memmap(path, record, "r", start, (count,)) if count else np.empty(0, record)
    return _whole(path, records, points)


def _compressed(path: Path, start: int, record: np.dtype[np.void], points: int) -> NDArray[np.void]:
    with path.open("rb") as file:
        file.seek(start)
        packed, unpacked = np.frombuffer(file.read(8), "<u4")
        data = _lzf(file.read(int(packed)), int(unpacked))
    records = np.empty(points, record)
    position = 0
    # One column after the other, unlike the other two encodings.
    for name in record.names or ():
        width = record[name].itemsize * points
        base = record[name].base
        records[name] = np.frombuffer(data[position : position + width], base).reshape(
            records[name].shape
        )
        position += width
    return records


def _whole(path: Path, records: NDArray[np.void], points: int) -> NDArray[np.void]:
    if len(records) != points:
        message = cut_short(path, len(records), points)
        raise CloudError(message)
    return records


def _lzf(packed: bytes, size: int) -> bytes:
    """Unpack LibLZF: runs of literals, and copies of what came before."""
    out = bytearray()
    at = 0
    while at < len(packed):
        control = packed[at]
        at += 1
        if control < 32:
            out += packed[at : at + control + 1]
            at += control + 1
            continue
        length = control >> 5
        if length == 7:
            length += packed[at]
            at += 1
        back = ((control & 31) << 8 | packed[at]) + 1
        at += 1
        length += 2
        begin = len(out) - back
        # A copy may run into what it is itself writing.
        seen = out[begin : begin + length]
        out += (seen * (length // len(seen) + 1))[:length]
    if len(out) != size:
        message = f"compressed data unpack to {len(out):,} bytes and should to {size:,}: damaged."
        raise CloudError(message)
    return bytes(out)
