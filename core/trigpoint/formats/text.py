"""Plain tables of coordinates: XYZ, CSV, TXT and ASC, with or without a header row."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from trigpoint.cautions import Caution
from trigpoint.errors import CloudError
from trigpoint.formats.rows import fields, head, is_number, separator_of
from trigpoint.formats.source import Box, Chunk, Plan, Source, axes_of, columns_of

FAULTS = (pd.errors.ParserError, OSError, ValueError)

# Before 3.1 pandas rounded the last digit unless asked not to, and since then it warns of asking.
_IS_OLD = tuple(map(int, pd.__version__.split(".")[:2])) < (3, 1)
EXACT: dict[str, Any] = {"float_precision": "round_trip"} if _IS_OLD else {}
_COMMENTS = ("#", "//", ";", "!")


@dataclass(frozen=True, slots=True)
class _Layout:
    """How a table is laid out."""

    names: tuple[str, ...]
    axes: tuple[str, str, str]
    separator: str
    decimal: str
    first_row: int
    words: frozenset[str]


def opened(path: Path) -> Source:
    """Tell the layout from the first rows."""
    layout = _layout(path)
    return Source(
        format={",": "CSV", ";": "CSV"}.get(layout.separator, "XYZ"),
        chunks=partial(_chunks, path, layout),
        attributes=tuple(name for name in layout.names if name not in layout.axes),
    )


def write(path: Path, chunks: Iterator[Chunk], plan: Plan) -> tuple[Caution, ...]:
    """Write full digits: .csv with commas and a header row, others with blanks.

    Without attributes .xyz and .txt have no header row, as other programs expect.
    """
    separator = "," if path.suffix.lower() == ".csv" else " "
    with path.open("w", encoding="utf-8", newline="") as file:
        for position, chunk in enumerate(chunks):
            columns: dict[str, Any] = dict(zip("xyz", chunk.xyz.T, strict=True))
            columns |= columns_of(chunk.attributes)
            named = separator == "," or len(columns) > 3
            pd.DataFrame(columns).to_csv(
                file,
                sep=separator,
                index=False,
                header=named and not position,
                lineterminator="\n",
            )
    if plan.crs is None:
        return ()
    message = f"a table holds no CRS: the coordinates written are in {plan.crs.name}."
    return (Caution("crs_missing", message),)


def _layout(path: Path) -> _Layout:
    lines = head(path)
    rows = [
        (number, line.strip())
        for number, line in enumerate(lines)
        if line.strip() and not line.strip().startswith(_COMMENTS)
    ]
    if not rows:
        message = f"{path.name} has no rows of numbers."
        raise CloudError(message)
    first, line = rows[0]
    title: list[str] | None = None
    if not all(is_number(field) for field in fields(line)[:3]):
        title = fields(line)
        rows = rows[1:]
        if not rows:
            message = f"{path.name} has a header row and nothing below it."
            raise CloudError(message)
        first, line = rows[0]
    elif first and lines[first - 1].strip().startswith(_COMMENTS):
        # CloudCompare and others put the names behind a comment mark.
        above = fields(lines[first - 1].strip().lstrip("#/;! "))
        title = above if len(above) == len(fields(line)) and not is_number(above[0]) else None
    values = fields(line)
    if title and not any(is_number(value) for value in values):
        message = (
            f"{path.name} holds no numbers in line {first + 1}: a point cloud has x, y and z of "
            f"one point in each line."
        )
        raise CloudError(message)
    if len(values) < 3 or (title is not None and len(title) != len(values)):
        below = f" below {len(title)} name{'' if len(title) == 1 else 's'}" if title else ""
        message = (
            f"{path.name} has {len(values)} columns in line {first + 1}"
            f"{below}: a point cloud needs x, y and z"
            f"{' in each line' if len(values) < 3 else ', and a name for each column or none'}."
        )
        raise CloudError(message)
    names = tuple(title or ["x", "y", "z", *(f"c{k}" for k in range(3, len(values)))])
    if len(set(names)) != len(names):
        message = f"{path.name} has two columns of the same name: {', '.join(names)}."
        raise CloudError(message)
    separator = separator_of(line)
    sample = [fields(row) for _, row in rows[:100]]
    words = {
        name
        for k, name in enumerate(names)
        if any(k < len(row) and row[k] and not is_number(row[k]) for row in sample)
    }
    commas = separator != "," and any("," in field for row in sample for field in row)
    axes = axes_of(names, path)
    return _Layout(
        names, axes, separator, "," if commas else ".", first, frozenset(words - set(axes))
    )


def _chunks(
    path: Path, layout: _Layout, size: int, attributes: bool, box: Box | None
) -> Iterator[Chunk]:
    del box  # there is no index to use it with
    axes = list(layout.axes)
    with pd.read_csv(
        path,
        sep=layout.separator,
        decimal=layout.decimal,
        names=list(layout.names),
        header=None,
        index_col=False,
        skiprows=layout.first_row,
        usecols=None if attributes else axes,
        dtype={n: str if n in layout.words else np.float64 for n in layout.names},
        skipinitialspace=True,
        # A word may hold the mark.
        comment=None if layout.words else "#",
        encoding="utf-8-sig",
        chunksize=size,
        **EXACT,
    ) as reader:
        for table in reader:
            xyz = np.ascontiguousarray(table[axes].to_numpy(np.float64))
            others = [n for n in table.columns if n not in axes]
            yield Chunk(xyz, {name: _values(table[name], layout) for name in others})


def _values(column: Any, layout: _Layout) -> Any:
    if column.name in layout.words:
        return column.fillna("").to_numpy(np.str_)
    return column.to_numpy(np.float64)
