"""Tables on a terminal of any width: one too wide goes on below, and no number is shortened."""

from __future__ import annotations

from collections.abc import Sequence

from rich import box
from rich.console import Console
from rich.measure import Measurement
from rich.table import Table
from rich.text import Text

# Wider than any table: what one needs is measured on it.
UNBOUNDED = 100_000
# Of the width, the column that names the rows takes so much at most.
NAMES = 0.4
# Narrower than this, beside names and values, remarks are not worth reading.
REMARK = 36


def show_table(
    console: Console,
    title: str,
    columns: Sequence[str],
    rows: Sequence[Sequence[str]],
    *,
    note: str = "",
) -> None:
    """Print one table; the first column is text, the rest are numbers.

    Columns that the console has no room for follow in a table below, beside the first again.
    """
    while True:
        count = len(columns)
        while count > 2 and not _fits(console, _table(console, "", columns[:count], rows)):
            count -= 1
        console.print(_table(console, title, columns[:count], rows))
        if count == len(columns):
            break
        title = ""
        columns = [columns[0], *columns[count:]]
        rows = [[row[0], *row[count:]] for row in rows]
    if note:
        console.print(Text(note), style="dim")
        console.print()


def show_pairs(console: Console, title: str, rows: Sequence[tuple[str, str, str]]) -> None:
    """Print a name, a value and a remark in each row; a narrow console has remarks below."""
    names, values = (max(len(row[column]) for row in rows) for column in (0, 1))
    table = _empty(title)
    table.show_header = False
    beside = console.width - names - values >= REMARK
    for _ in range(3 if beside else 2):
        table.add_column()
    for name, value, remark in rows:
        if beside:
            table.add_row(Text(name), Text(value), Text(remark))
        else:
            table.add_row(Text(name), Text("\n".join(filter(None, (value, remark)))))
    console.print(table)


def _table(
    console: Console, title: str, columns: Sequence[str], rows: Sequence[Sequence[str]]
) -> Table:
    table = _empty(title)
    names = max(1, int(NAMES * console.width))
    table.add_column(columns[0], max_width=names, overflow="fold")
    for column in columns[1:]:
        table.add_column(column, justify="right", no_wrap=True)
    for row in rows:
        # Ids come from the user's files: as Text they are data, not console markup.
        table.add_row(*(Text(cell) for cell in row[: len(columns)]))
    return table


def _empty(title: str) -> Table:
    return Table(title=title or None, title_justify="left", title_style="bold", box=box.SIMPLE_HEAD)


def _fits(console: Console, table: Table) -> bool:
    options = console.options.update(width=UNBOUNDED)
    return Measurement.get(console, options, table).maximum <= console.width
