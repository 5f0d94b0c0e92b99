"""The text of a pick file as named columns of cells, either way and exactly."""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from difflib import get_close_matches

import numpy as np
from numpy.typing import NDArray

from trigpoint.errors import PicksError

SOURCE, TARGET = ("source_x", "source_y", "source_z"), ("target_x", "target_y", "target_z")
SIGMAS = ("sigma_source", "sigma_target")
REQUIRED = ("id", *SOURCE, *TARGET)
# Left out of a fit without a word if misspelt, so a near miss is an error. A note is harmless.
TELLING = ("role", *SIGMAS)
COLUMNS = (*REQUIRED, *TELLING, "note")

_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?", re.ASCII)


@dataclass(frozen=True, slots=True, eq=False)
class PickTable:
    """Cells of a pick file, as they stand.

    Attributes
    ----------
    columns : dict of str to list of str
        In the file's order.
    rows : list of int
        The row of each cell as a spreadsheet counts, the header's being 1.
    delimiter : str
        Comma, semicolon or tab.
    """

    columns: Mapping[str, list[str]]
    rows: list[int]
    delimiter: str


def parse_table(text: str) -> PickTable:
    """Split the text of a pick file into columns of cells.

    Blank rows are skipped; names of known columns are taken whatever their case and the blanks
    about them.

    Raises
    ------
    PicksError
        If a column is missing, named twice or not named, or a row has too few or many cells.
    """
    delimiter = max(",;\t", key=lambda mark: _known(_records(text, mark, most=1)))
    records = _records(text, delimiter)
    if not records:
        message = "it is empty. It needs a header and a row for each pick."
        raise PicksError(message)
    names = [_name(cell) for cell in records[0]]
    while names and not names[-1]:
        names.pop()
    _refuse_names(names)
    rows, cells = [], []
    for row, record in enumerate(records[1:], start=2):
        if not any(cell.strip() for cell in record):
            continue
        if len(record) < len(names) or any(cell.strip() for cell in record[len(names) :]):
            message = (
                f"row {row} has {len(record)} cells and the header {len(names)}. Quote cells that "
                f"hold the separator; decimal commas need semicolons between the cells."
            )
            raise PicksError(message)
        rows.append(row)
        cells.append(record)
    columns = {name: [record[i] for record in cells] for i, name in enumerate(names)}
    return PickTable(columns, rows, delimiter)


def parse_numbers(table: PickTable) -> dict[str, NDArray[np.float64]]:
    """Read the coordinates and sigmas of a pick file as numbers, NaN for an empty sigma.

    Decimal commas are read where they do not separate cells and no number has a point.

    Raises
    ------
    PicksError
        If a cell is no finite number, with its row and column.
    """
    columns = table.columns
    wanted = [name for name in (*SOURCE, *TARGET, *SIGMAS) if name in columns]
    every = [cell for name in wanted for cell in columns[name]]
    commas = table.delimiter != "," and not any("." in cell for cell in every)
    numbers = {}
    for name in wanted:
        values = []
        for row, identity, cell in zip(table.rows, columns["id"], columns[name], strict=True):
            try:
                empty = name in SIGMAS and not cell.strip()
                values.append(np.nan if empty else _number(cell.strip(), commas))
            except ValueError as error:
                message = f"row {row} ({identity.strip()!r}), column {name}: {error}."
                raise PicksError(message) from None
        numbers[name] = np.array(values, np.float64)
    return numbers


def refuse_extra(names: Sequence[str]) -> None:
    """Raise PicksError for names of other columns that a pick file could not hold."""
    for name in names:
        if _name(name) != name or name in COLUMNS:
            message = f"another column can't be called {name!r}: the name is taken, or has blanks."
            raise PicksError(message)
    _refuse_names([*REQUIRED, *names])


def format_columns(columns: Mapping[str, Sequence[str]]) -> str:
    """Write columns of cells as CSV that `parse_table` reads back to the same cells.

    Examples
    --------
    >>> print(format_columns({"id": ["roof, north", "sill"], "note": ["", "wet"]}), end="")
    id,note
    "roof, north",
    sill,wet
    """
    lines = [list(columns), *zip(*columns.values(), strict=True)]
    return "".join(",".join(_quoted(cell) for cell in line) + "\n" for line in lines)


def _records(text: str, delimiter: str, most: int | None = None) -> list[list[str]]:
    try:
        reader = csv.reader(io.StringIO(text, newline=""), delimiter=delimiter)
        return [next(reader, [])] if most else list(reader)
    except csv.Error as error:
        message = f"it is no CSV: {error}."
        raise PicksError(message) from None


def _name(cell: str) -> str:
    name = cell.strip()
    return name.lower() if name.lower() in COLUMNS else name


def _known(records: list[list[str]]) -> int:
    return sum(_name(cell) in COLUMNS for cell in records[0])


def _refuse_names(names: list[str]) -> None:
    others = [name for name in names if name not in COLUMNS]
    for name in REQUIRED:
        if name not in names:
            near = get_close_matches(name, others, n=1)
            hint = f" {near[0]!r} comes near it." if near else ""
            message = f"there is no column {name}.{hint} It needs {', '.join(REQUIRED)}."
            raise PicksError(message)
    for name in others:
        near = get_close_matches(name.lower(), TELLING, n=1, cutoff=0.85)
        if near and near[0] not in names:
            message = f"the column {name!r} comes near {near[0]}: rename it, to that or to another."
            raise PicksError(message)
    for i, name in enumerate(names, start=1):
        if not name or names.count(name) > 1:
            fault = f"{name!r} is there twice" if name else f"{i} has no name"
            message = f"the column {fault}. Each needs a name of its own."
            raise PicksError(message)


def _number(text: str, commas: bool) -> float:
    plain = text.replace(",", ".") if commas else text
    if not text:
        fault = "the cell is empty; give a number"
    elif text.lower().lstrip("+-") in ("nan", "inf", "infinity"):
        fault = f"{text!r} is not a finite number"
    elif _NUMBER.fullmatch(plain):
        return float(plain)
    elif "," in text:
        fault = f"{text!r} is not a number (no thousands separators; one decimal sign in a file)"
    else:
        fault = f"{text!r} is not a number"
    raise ValueError(fault)


def _quoted(cell: str) -> str:
    plain = cell == cell.strip() and not any(mark in cell for mark in ',"\r\n')
    return cell if plain else '"' + cell.replace('"', '""') + '"'
