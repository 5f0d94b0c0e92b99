"""The project as it was run, as a TOML file without any path of the machine."""

from __future__ import annotations

import datetime as dt
import json
import shutil
from collections.abc import Iterator, Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

from trigpoint.canonical import write_text
from trigpoint.project import Project


def write_recipe(folder: Path, project: Project) -> None:
    """Write ``project.toml`` with every setting, and a copy of every pick file, into a folder.

    Paths are given as results.json states its inputs, so that the file says what was read and
    runs again where those inputs lie beside it.
    """
    write_text(folder / "project.toml", to_toml(tables_of(project)))
    for given in project.reconstructions:
        if given.picks is not None:
            shutil.copyfile(given.picks, folder / picks_name(given.name, given.picks))
        for number, path in enumerate(given.picks_repeated, start=1):
            shutil.copyfile(path, folder / f"repicks-{given.name}-{number}{path.suffix.lower()}")


def picks_name(name: str, picks: Path) -> str:
    """Return what the copy of a reconstruction's pick file is called."""
    return f"picks-{name}{picks.suffix.lower()}"


def stated_path(path: Path, folder: Path) -> str:
    """Return a path below the project's folder, or else only its name: what, and not where, it is.

    Examples
    --------
    >>> stated_path(Path("/site/scans/a.laz"), Path("/site")), stated_path(
    ...     Path("/home/b.laz"), Path("/site")
    ... )
    ('scans/a.laz', 'b.laz')
    """
    return (path.relative_to(folder) if path.is_relative_to(folder) else Path(path.name)).as_posix()


def tables_of(project: Project) -> dict[str, Any]:
    """Return a project as the tables of its file, complete, with the paths stated."""
    folder = project.path.parent

    def stated(table: Mapping[str, Any]) -> dict[str, Any]:
        # None is what a key that may be left out means; a margin of none has a word of its own.
        def plain(value: Any) -> Any:
            if isinstance(value, tuple):
                return [plain(item) for item in value]
            return stated_path(value, folder) if isinstance(value, Path) else value

        return {key: plain(value) for key, value in table.items() if value is not None}

    comparison = asdict(project.comparison)
    margin = comparison["margin_m"]
    return {
        "project": stated(asdict(project.about)),
        "reference": stated(asdict(project.reference)),
        "reconstruction": [stated(asdict(each)) for each in project.reconstructions],
        "alignment": asdict(project.alignment),
        "comparison": comparison | {"margin_m": "none" if margin is None else margin},
        "cross_check": [check.table for check in project.cross_checks],
        "limit": [stated(asdict(limit)) for limit in project.limits],
    }


def to_toml(tables: Mapping[str, Any]) -> str:
    r"""Write tables, and lists of tables, of plain values as TOML.

    Examples
    --------
    >>> print(to_toml({"a": {"title": 'the "old" mill', "n": 3}, "b": [{"x": [0.1, 2.0]}]}))
    [a]
    title = "the \"old\" mill"
    n = 3
    <BLANKLINE>
    [[b]]
    x = [0.1, 2.0]
    <BLANKLINE>
    """
    return "\n".join(_lines(tables)) + "\n"


def _lines(tables: Mapping[str, Any]) -> Iterator[str]:
    first = True
    for name, content in tables.items():
        several = isinstance(content, list)
        for table in content if several else [content]:
            if not first:
                yield ""
            first = False
            yield f"[[{name}]]" if several else f"[{name}]"
            for key, value in table.items():
                yield f"{key} = {_toml(value)}"


def _toml(value: object) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, dt.date):
        return value.isoformat()
    if isinstance(value, list | tuple):
        return f"[{', '.join(_toml(item) for item in value)}]"
    if isinstance(value, str):
        # A JSON string is a TOML string but for DEL, which TOML wants escaped too.
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    return repr(value)
