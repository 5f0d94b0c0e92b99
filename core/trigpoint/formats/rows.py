"""The rows of a text file, before anyone knows what they are."""

from __future__ import annotations

import csv
import re
from pathlib import Path

# Enough of a file to tell its layout from.
HEAD_BYTES = 65_536


def head(path: Path) -> list[str]:
    """Return the first lines of a text file; empty if it is not text."""
    with path.open("rb") as file:
        start = file.read(HEAD_BYTES)
    lines = start.decode("utf-8-sig", errors="replace").splitlines()
    if b"\0" in start:
        return []
    # The last line may be cut by the reading.
    return lines[:-1] if len(start) == HEAD_BYTES else lines


def fields(line: str) -> list[str]:
    """Split a line at the separator that it seems to use."""
    separator = separator_of(line)
    if separator == r"\s+":
        line, separator = re.sub(r"\s+", " ", line.strip()), " "
    return [field.strip() for field in next(csv.reader([line], delimiter=separator), [])]


def is_number(field: str) -> bool:
    """Tell whether a field is a number, with a point or a comma for its decimals."""
    try:
        float(field.replace(",", "."))
    except ValueError:
        return False
    return True


def separator_of(line: str) -> str:
    """Tell what separates the fields of a line; blanks as the expression that pandas knows."""
    mark = next((mark for mark in ";,\t" if mark in line), r"\s+")
    # Tabs may stand among blanks: then some fields between tabs hold several numbers.
    parts = [part.split() for part in line.strip().split("\t")]
    if mark == "\t" and any(len(p) > 1 and all(map(is_number, p)) for p in parts):
        return r"\s+"
    return mark
