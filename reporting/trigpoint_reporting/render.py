"""Blocks as escaped HTML, and as plain text for a reader without a browser."""

from __future__ import annotations

import base64
import re
import struct
from collections.abc import Sequence
from dataclasses import dataclass
from html import escape
from itertools import pairwise, takewhile

from trigpoint_reporting.blocks import Block, Cell, Entry, Passage, Picture, Table, Value

TYPES = {"svg": "image/svg+xml", "png": "image/png"}
# Tables up to so many rows stay on one page; ones of more columns, or of more letters across where
# each column is as wide as its longest text up to some, are set smaller.
SHORT_ROWS = 10
WIDE_COLUMNS, WIDE_LETTERS, WIDE_TEXT = 7, 120, 36
# Two tables stand side by side where each needs no more than so many letters across, of which a
# column of words takes so many at most before it is wrapped; a text that would fill more than a few
# such lines wants the whole width.
HALF_LETTERS, HALF_WORDS, HALF_TEXT, HALF_ROWS = 58, 26, 75, 20
# Characters that no document may hold, and those that turn the direction of what follows them.
UNPRINTABLE = re.compile(
    "[\x00-\x08\x0b\x0c\x0e-\x1f\x7f-\x9f\u200e\u200f\u202a-\u202e\u2066-\u2069"
    "\ud800-\udfff\ufffe\uffff]"
)
NUMERIC = re.compile(
    r"[<>≤≥≈±+\u2212-]?\s?\d[\d\s,.\u202f\u2009%:+\u2212\u2013-]*(\s?(m|mm|%|°))?",
)
MISSING = frozenset({"", "\u2013", "\u2014", "-", "not available", "not computed"})
# A word longer than this is given places to break: after its own joints, else every so often. An
# escaped character counts as one.
LONG_WORD = 20
WORD = re.compile(rf"(?:&[#\w]+;|[^\s&]){{{LONG_WORD + 1},}}")
JOINT = re.compile(r"([_/\\.-])(?=[^<>]{4})")
PIECE = re.compile(r"((?:&[#\w]+;|[^&<>]){16})(?=[^<>]{4})")
# Pixels per metre, across and down.
DENSITY = struct.Struct(">II")


@dataclass(frozen=True, slots=True)
class Shown:
    """Blocks as a notebook shows them: HTML where there is a browser, else plain text."""

    html: str
    text: str

    def _repr_html_(self) -> str:
        return self.html

    def __repr__(self) -> str:  # noqa: D105
        return self.text


def show(*blocks: Block) -> Shown:
    """Return blocks in a form that a notebook displays.

    Parameters
    ----------
    *blocks : Passage, Table or Picture

    Examples
    --------
    >>> show(Passage(["RMSE ", Value("0.137", "rmse_m"), " m, by <us>"]))
    RMSE 0.137 m, by <us>
    """
    first = side_by_side(blocks)
    halves = first | {position + 1 for position in first}
    html = [to_html(block, half=position in halves) for position, block in enumerate(blocks)]
    for start, position in _around_pictures(blocks):
        html[start] = f'<div class="beside"><div>{html[start]}'
        html[position] = f"</div>{html[position]}</div>"
    return Shown("\n".join(html), "\n\n".join(map(to_text, blocks)))


def heading(text: str) -> Shown:
    """Return a heading below a section's own, such as a reconstruction's name."""
    return Shown(f"<h3>{_escaped(text)}</h3>", text)


def embed(html: str) -> Shown:
    """Return a piece of a page, such as the viewer, as it is: only what escapes its own texts."""
    return Shown(html, "[to be seen in a browser]" if html else "")


def printable(text: str) -> str:
    """Return text with a mark in place of each character that can't or must not be printed."""
    return UNPRINTABLE.sub("\ufffd", text)


def side_by_side(blocks: Sequence[Block]) -> set[int]:
    """Return the positions of tables that are narrow enough to stand beside the one after them."""
    found: set[int] = set()
    for position, pair in enumerate(pairwise(blocks)):
        if position - 1 not in found and all(
            isinstance(each, Table) and _narrow(each) for each in pair
        ):
            found.add(position)
    return found


def _around_pictures(blocks: Sequence[Block]) -> list[tuple[int, int]]:
    """Return where the text beside each small picture begins, and where the picture stands."""
    found = []
    for position, block in enumerate(blocks):
        if isinstance(block, Picture) and block.small:
            before = takewhile(_is_plain, reversed(blocks[:position]))
            found.append((position - sum(1 for _ in before), position))
    return found


def _is_plain(block: Block) -> bool:
    return isinstance(block, Passage) and block.tone == "plain"


def to_html(block: Block, *, half: bool = False) -> str:
    """Return a block as HTML in which every text is escaped; a table, perhaps half as wide.

    A `Value` becomes ``<data value="0.137" data-path="reconstructions...">``, so that what is
    printed can be compared with what is stored.

    Raises
    ------
    ValueError
        If a picture says nothing to who can't see it.
    """
    if isinstance(block, Passage):
        return f'<p class="passage {block.tone}">{_cells(block.parts)}</p>'
    return _table(block, half=half) if isinstance(block, Table) else _picture(block)


def to_text(block: Block) -> str:
    """Return a block as plain text."""
    if isinstance(block, Passage):
        return _joined(block.parts)
    if isinstance(block, Picture):
        return f"[{block.caption}] {block.alt}"
    rows = [[_spoken(entry) for entry in row] for row in (block.columns, *block.rows)]
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    numeric = _numeric(block)
    lines = [
        "  ".join(
            cell.rjust(width) if right else cell.ljust(width)
            for cell, width, right in zip(row, widths, numeric, strict=True)
        ).rstrip()
        for row in rows
    ]
    lines.insert(1, "  ".join("-" * width for width in widths))
    return "\n".join([block.caption, *lines, *([_joined(block.note)] if block.note else [])])


def _table(table: Table, *, half: bool) -> str:
    numeric = ['class="number"' if right else "" for right in _numeric(table)]
    head = "".join(
        f'<th scope="col" {kind}>{_escaped(column)}</th>'
        for column, kind in zip(table.columns, numeric, strict=True)
    )
    body = "\n".join(
        f'<tr><th scope="row" {numeric[0]}>{_entry(row[0])}</th>'
        + "".join(
            f"<td {kind}>{_entry(cell)}</td>"
            for cell, kind in zip(row[1:], numeric[1:], strict=True)
        )
        + "</tr>"
        for row in table.rows
    )
    kinds = ["table"]
    kinds += ["short"] if len(table.rows) <= SHORT_ROWS else []
    kinds += ["wide"] if _wide(table) else []
    kinds += ["half"] if half else []
    note = f'<p class="table-note">{_cells(table.note)}</p>' if table.note else ""
    return (
        f'<div class="{" ".join(kinds)}">'
        # Who has no mouse must be able to move a table that is wider than the screen.
        f'<div class="scroll" tabindex="0" role="group" aria-label="{_escaped(table.caption)}">'
        f"<table><caption>{_escaped(table.caption)}</caption>\n"
        f"<thead><tr>{head}</tr></thead>\n<tbody>{body}</tbody></table></div>{note}</div>"
    ).replace(" >", ">")


def _picture(picture: Picture) -> str:
    if not picture.alt.strip():
        message = f"The picture {picture.name!r} has no alternative text: state what it shows."
        raise ValueError(message)
    width = _printed_width(picture)
    style = f' style="width: {width:.2f}mm"' if width else ""
    encoded = base64.b64encode(picture.content).decode("ascii")
    # As an image and not inline: scripts in an SVG don't run, and its ids meet no others.
    return (
        f'<figure class="{"small" if picture.small else "picture"}">'
        f'<div class="scroll" tabindex="0" role="group" '
        f'aria-label="{_escaped(picture.caption)}"><img alt="{_escaped(picture.alt)}" '
        f'data-file="{_escaped(picture.name)}.{picture.kind}"{style} '
        f'src="data:{TYPES[picture.kind]};base64,{encoded}"></div>'
        f"<figcaption>{_escaped(picture.caption)}</figcaption></figure>"
    )


def _printed_width(picture: Picture) -> float | None:
    """Width in mm that a PNG states (its pHYs chunk): a drawing to scale keeps its scale."""
    where = picture.content.find(b"pHYs", 0, 200) if picture.kind == "png" else -1
    if where < 0:
        return None
    columns = int.from_bytes(picture.content[16:20], "big")
    per_metre, _ = DENSITY.unpack_from(picture.content, where + 4)
    return 1000 * columns / per_metre if per_metre else None


def _wide(table: Table) -> bool:
    columns = zip(*table.rows, strict=True)
    longest = [max(len(_spoken(entry)) for entry in column) for column in columns]
    letters = sum(min(each, WIDE_TEXT) + 2 for each in longest)
    return len(table.columns) > WIDE_COLUMNS or letters > WIDE_LETTERS


def _narrow(table: Table) -> bool:
    columns = zip(table.columns, *table.rows, strict=True)
    needed = 0.0
    for numeric, (head, *entries) in zip(_numeric(table), columns, strict=True):
        longest = max((len(_spoken(entry)) for entry in entries), default=0)
        if longest > HALF_TEXT:
            return False
        words = max(map(len, _spoken(head).split()), default=0)
        # Digits are wider than letters, and no number is broken.
        needed += 2 + max(words, 1.2 * longest if numeric else min(longest, HALF_WORDS))
    return len(table.rows) <= HALF_ROWS and needed <= HALF_LETTERS


def _numeric(table: Table) -> list[bool]:
    columns = zip(*table.rows, strict=True) if table.rows else [()] * len(table.columns)
    return [_is_numeric([_leading(entry) for entry in column]) for column in columns]


def _is_numeric(column: Sequence[str]) -> bool:
    given = [cell for cell in column if cell not in MISSING]
    return bool(given) and all(NUMERIC.fullmatch(cell) for cell in given)


def _entry(entry: Entry) -> str:
    """Return a table's field, in which a long word, such as a hash, may be broken."""
    if isinstance(entry, str):
        return WORD.sub(_breakable, _cell(entry))
    return _cells(entry) if isinstance(entry, tuple) else _cell(entry)


def _breakable(word: re.Match[str]) -> str:
    pieces = JOINT.sub(r"\1<wbr>", word[0]).split("<wbr>")
    return "<wbr>".join(PIECE.sub(r"\1<wbr>", piece) for piece in pieces)


def _cells(parts: Sequence[Cell]) -> str:
    return "".join(map(_cell, parts))


def _cell(part: Cell) -> str:
    if isinstance(part, str):
        return _escaped(part)
    if not part.path:
        return _escaped(part.text)
    number = part.text.replace("\u2212", "-").replace(",", "")
    return (
        f'<data value="{_escaped(number)}" data-path="{_escaped(part.path)}">'
        f"{_escaped(part.text)}</data>"
    )


def _joined(parts: Sequence[Cell]) -> str:
    return "".join(map(_plain, parts))


def _leading(entry: Entry) -> str:
    """Return a field's first cell: a number stays one with an interval behind it."""
    return _plain(entry[0]) if isinstance(entry, tuple) else _plain(entry)


def _spoken(entry: Entry) -> str:
    return _joined(entry) if isinstance(entry, tuple) else _plain(entry)


def _plain(part: Cell) -> str:
    return part.text if isinstance(part, Value) else part


def _escaped(text: str) -> str:
    return escape(printable(text))
