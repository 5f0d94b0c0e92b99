"""What a report is built of: passages, tables and pictures, as plain values without markup."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Literal


@dataclass(frozen=True, slots=True)
class Value:
    """A number as it is printed, and where in results.json it stands.

    Attributes
    ----------
    text : str
        As printed, without its unit.
    path : str
        Such as ``reconstructions.nerf.alignment.rmse_m``; empty where it stands nowhere.
    """

    text: str
    path: str = ""


Cell = str | Value
# What stands in one field of a table: a cell, or several in turn, as a value with its interval.
Entry = Cell | tuple[Cell, ...]


@dataclass(frozen=True, slots=True)
class Passage:
    """A paragraph: text and values in turn; `tone` marks a verdict or a warning, in words too."""

    parts: Sequence[Cell]
    tone: Literal["plain", "note", "warning", "pass", "fail", "conditional", "untested"] = "plain"


@dataclass(frozen=True, slots=True)
class Table:
    """A table: its caption stands above, its note (formula, n, units) below."""

    caption: str
    columns: Sequence[str]
    rows: Sequence[Sequence[Entry]]
    note: Sequence[Cell] = field(default_factory=tuple)


@dataclass(frozen=True, slots=True)
class Picture:
    """A picture: `alt` states the finding, `caption` says what is shown.

    One that is `small` is no numbered figure: it stands beside the plain passages before it.
    """

    name: str
    caption: str
    alt: str
    content: bytes
    kind: Literal["svg", "png"]
    small: bool = False


Block = Passage | Table | Picture
