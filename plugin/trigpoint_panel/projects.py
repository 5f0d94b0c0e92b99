"""A project.toml from a state, and a state from a project.toml."""

from __future__ import annotations

import datetime as dt
import json
import re
import tomllib
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import MISSING, fields, replace
from pathlib import Path
from typing import Any

import pyproj

from trigpoint.canonical import write_text
from trigpoint.crs import parse_crs
from trigpoint.errors import PicksError, ProjectError, TrigpointError
from trigpoint.files import describe
from trigpoint.picks import examine, read_picks, write_picks
from trigpoint.project import (
    About,
    AlignmentSettings,
    ComparisonSettings,
    Project,
    ReconstructionInput,
    ReferenceInput,
    project_from,
    read_project,
)
from trigpoint.starter import PROJECT
from trigpoint_panel.fingerprints import content_of
from trigpoint_panel.pairs import Pairs, complete, from_picks, to_picks
from trigpoint_panel.state import NOWHERE, State, with_given

Table = dict[str, Any]

# What a key holds that a file leaves out.
_DEFAULTS = {
    field.name: list(field.default) if isinstance(field.default, tuple) else field.default
    for section in (
        About,
        ReferenceInput,
        ReconstructionInput,
        AlignmentSettings,
        ComparisonSettings,
    )
    for field in fields(section)
    if field.default is not MISSING
}

# The tables of a project, and the field of Project that each is.
TABLES = {
    "project": "about",
    "reference": "reference",
    "reconstruction": "reconstructions",
    "alignment": "alignment",
    "comparison": "comparison",
    "cross_check": "cross_checks",
    "limit": "limits",
}


def reference_crs(project: Project) -> pyproj.CRS | None:
    """Return the CRS of the reference as the audit takes it: assigned, else what the file says.

    None where neither is there.

    Raises
    ------
    CrsError, CloudError
        As the audit would.
    """
    given = project.reference
    if given.crs:
        return parse_crs(given.crs, vertical=given.vertical_crs or None)
    if given.path == NOWHERE or not given.path.exists():
        return None
    return parse_crs(describe(given.path).crs, vertical=given.vertical_crs or None)


def state_from_project(
    path: Path | str, *, reconstruction: str = ""
) -> tuple[State, tuple[str, ...]]:
    """Read a project.toml with the picks of one reconstruction.

    Parameters
    ----------
    path : path
    reconstruction : str
        By default the first that has picks, else the first.

    Returns
    -------
    State
    tuple of str
        A sentence for each file that is missing and each doubt about the picks.

    Raises
    ------
    TrigpointError
        As the audit would.
    """
    project = read_project(path)
    every = project.reconstructions
    named = [each for each in every if each.name == reconstruction]
    if reconstruction and not named:
        message = f"{project.path.name} has no reconstruction {reconstruction!r}."
        raise ProjectError(message)
    given = next((each for each in named or every if each.picks), (named or every)[0])
    doubts = [
        f"{file.name} is not where {project.path.name} says ({file.parent}): open it again."
        for file in (project.reference.path, given.path, given.picks)
        if file is not None and not file.exists()
    ]
    pairs: Pairs = ()
    if given.picks is not None and given.picks.exists():
        picks = read_picks(given.picks, crs=reference_crs(project))
        pairs = from_picks(picks)
        doubts += [caution.message for caution in (*picks.cautions, *examine(picks))]
    return State(project, given.name, pairs), tuple(doubts)


def contents(state: State) -> dict[Path, str | None]:
    """Return the SHA-256 of the files that `write_project` writes; None where one is not there."""
    files = (state.project.path, state.given.picks)
    return {path: content_of(path) for path in files if path is not None and path != NOWHERE}


def settled(state: State) -> frozenset[Path]:
    """Return which of those files hold already just what `write_project` would write there."""
    project, picks = state.project, state.given.picks
    held: set[Path] = set()
    with suppress(OSError, UnicodeDecodeError):  # what can't be read says something else
        if project.path != NOWHERE and _says(_text(project.path), project):
            held.add(project.path)
    with suppress(OSError, TrigpointError):  # nor does what stands in a CRS that can't be used
        pairs = complete(state.first or state.pairs)
        if picks is not None and _holds(picks, pairs, reference_crs(project)):
            held.add(picks)
    return frozenset(held)


def write_project(
    state: State, path: Path | str, *, read: Mapping[Path, str | None] | None = None
) -> Project:
    """Write a state as the project.toml and picks file that `trigpoint audit` takes.

    What is there already and says the same is left as it is, to the byte; where it says something
    else, comments and order stay as far as they can. Half-open pairs are left out, and while a
    second operator picks the first operator's pairs are written.

    Parameters
    ----------
    state : State
    path : path
        Of the project.toml.
    read : mapping of Path to str or None, optional
        What `contents` found when the state was read: what someone has written there since is
        not overwritten.

    Returns
    -------
    Project
        As read back.

    Raises
    ------
    TrigpointError
        If a cloud is not open yet, the file is another project's, or can't be written.
    """
    path = Path(path).absolute()
    if state.source_path is None or state.target_path is None:
        message = "A project needs both clouds: open the source and the reference first."
        raise ProjectError(message)
    if path.exists() and path != state.project.path:
        message = f"{path} is another project's: choose another folder or name."
        raise ProjectError(message)
    pairs = complete(state.first or state.pairs)
    crs, read = reference_crs(state.project), read or {}
    picks_path = state.given.picks
    if picks_path is not None and path != state.project.path and _changed(picks_path, read):
        picks_path = None  # elsewhere means the picks as well
    if picks_path is None and pairs:
        picks_path = _free(path, pairs, crs)
    project = with_given(state, replace(state.given, picks=picks_path))
    project = replace(project, path=path)
    if path == state.project.path and not path.parent.is_dir():
        message = f"The folder of {path.name} has gone ({path.parent}): save elsewhere."
        raise ProjectError(message)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        text = _text(path) if path.exists() else PROJECT
        says = _says(text, project)
        holds = picks_path is None or _holds(picks_path, pairs, crs)
        for file, is_same in ((path, says), (picks_path, holds)):
            if file is not None and not is_same and _changed(file, read):
                message = (
                    f"{file.name} has changed since it was read: open the project again, "
                    "or save elsewhere."
                )
                raise ProjectError(message)
        if not says:
            text = _edited(text, project)
            if not _says(text, project):
                text = project_toml(project)
            project_from(tomllib.loads(text), path)  # refused before anything is written
        if picks_path is not None and not holds:  # first: a project without its picks is none
            write_picks(picks_path, to_picks(pairs), crs=crs)
        if not says:
            write_text(path, text)
    except UnicodeDecodeError as error:
        message = f"{path.name} is not UTF-8 text any more: save it as UTF-8, or save elsewhere."
        raise ProjectError(message) from error
    except OSError as error:
        message = f"{path.name} can't be written: {error.strerror or error}."
        raise ProjectError(message) from error
    return read_project(path)


def checked(project: Project) -> Project:
    """Return a project as the engine reads it, its lists as tuples; paths need not be there.

    Raises
    ------
    ProjectError
        In one sentence, for a setting that a project file may not hold.
    """
    folder = Path(project.path.anchor or Path.cwd().anchor)
    tables = project_tables(project, folder)
    for table in (tables["reference"], *tables["reconstruction"]):
        table |= {key: "anywhere" for key in ("path", "picks", "region") if table.get(key)}
    read = project_from(without_none(tables), folder / "project.toml")
    reference, given = project.reference, project.reconstructions
    return replace(
        read,
        path=project.path,
        reference=replace(read.reference, path=reference.path, region=reference.region),
        reconstructions=tuple(
            replace(each, path=own.path, picks=own.picks)
            for each, own in zip(read.reconstructions, given, strict=True)
        ),
    )


def without_none(value: Any) -> Any:
    """Return tables as TOML can hold them, which knows no null: what is None is left out."""
    if isinstance(value, dict):
        return {key: without_none(item) for key, item in value.items() if item is not None}
    return [without_none(item) for item in value] if isinstance(value, list) else value


def project_tables(project: Project, folder: Path) -> Table:
    """Return a project as the tables of its file, whole; None where a key is left out.

    Paths are relative to `folder` where they lie in it, else absolute.
    """
    tables: Table = {}
    for name, field in TABLES.items():
        value = getattr(project, field)
        if isinstance(value, tuple):
            tables[name] = [_table(each, folder) for each in value]
        else:
            tables[name] = _table(value, folder)
    tables["cross_check"] = [check.table for check in project.cross_checks]
    margin = tables["comparison"]["margin_m"]
    tables["comparison"]["margin_m"] = "none" if margin is None else margin
    return tables


def project_toml(project: Project) -> str:
    """Return a project as the text of its file."""
    tables = project_tables(project, project.path.parent)
    return "\n".join(["# A trigpoint project.", *_toml_lines(tables)]) + "\n"


def _toml_lines(tables: Mapping[str, Any]) -> list[str]:
    lines = []
    for name, value in tables.items():
        for table in value if isinstance(value, list) else [value]:
            lines += ["", f"[[{name}]]" if isinstance(value, list) else f"[{name}]"]
            lines += [f"{key} = {_toml(item)}" for key, item in table.items() if item is not None]
    return lines


def _free(project: Path, pairs: Pairs, crs: pyproj.CRS | None) -> Path:
    """Return a picks file beside a project: one that is not there yet, or that says the same."""
    for name in ("picks.csv", f"{project.stem}-picks.csv"):
        path = project.with_name(name)
        if not path.exists() or _holds(path, pairs, crs):
            return path
    message = f"{path} is another session's: choose another folder or name."
    raise ProjectError(message)


def _changed(path: Path, read: Mapping[Path, str | None]) -> bool:
    """Whether a file that was read holds something else now; one that has gone holds nothing."""
    now = content_of(path)
    return path in read and now is not None and now != read[path]


def _holds(path: Path, pairs: Pairs, crs: pyproj.CRS | None) -> bool:
    """Whether a file holds exactly these pairs."""
    try:
        return from_picks(read_picks(path, crs=crs)) == pairs
    except PicksError:  # it is not there, or is something else
        return False


def _table(section: Any, folder: Path) -> Table:
    return {field.name: _plain(getattr(section, field.name), folder) for field in fields(section)}


def _plain(value: Any, folder: Path) -> Any:
    if isinstance(value, Path):
        inside = value.is_relative_to(folder) and ".." not in value.parts
        return (value.relative_to(folder) if inside else value).as_posix()
    return [_plain(item, folder) for item in value] if isinstance(value, tuple) else value


def _toml(value: Any) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        # A JSON string is a TOML string but for DEL, which TOML wants escaped as well.
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    if isinstance(value, list):
        return f"[{', '.join(_toml(item) for item in value)}]"
    return value.isoformat() if isinstance(value, dt.date) else repr(value)


def _text(path: Path) -> str:
    return path.read_text(encoding="utf-8-sig")


def _says(text: str, project: Project) -> bool:
    """Whether the text of a project file is read as this project."""
    try:
        return project_from(tomllib.loads(text), project.path) == project
    except (TrigpointError, tomllib.TOMLDecodeError):
        return False


def _edited(text: str, project: Project) -> str:
    """Return the text with the lines changed whose values differ, where a line holds a value.

    The caller reads the outcome back: where it does not say the project, it is not used.
    """
    tables = project_tables(project, project.path.parent)
    sections: list[tuple[str, list[str]]] = [("", [])]
    for line in text.splitlines():
        if header := re.match(r"\s*\[\[?\s*(\w+)\s*\]\]?", line):
            sections.append((header[1], []))
        sections[-1][1].append(line)
    kept: list[str] = []
    for name, lines in sections:
        value = tables.get(name)
        table = value.pop(0) if isinstance(value, list) and value else value
        kept += _edited_table(lines, table) if isinstance(table, dict) else lines
    rest = {name: value for name, value in tables.items() if isinstance(value, list)}
    return "\n".join([*kept, *_toml_lines(rest)]) + "\n"


def _edited_table(lines: list[str], table: Table) -> list[str]:
    """Return a table's lines, its header first, with the values wanted."""
    found, edited = set(), []
    for line in lines:
        key = re.match(r"\s*(\w+)\s*=", line)
        if key and key[1] in table:
            found.add(key[1])
            line = _with_value(line, key[1], table[key[1]])
        edited.append(line)
    added = [
        f"{key} = {_toml(value)}"
        for key, value in table.items()
        if key not in found and value is not None and value != _DEFAULTS.get(key)
    ]
    return [*edited[:1], *added, *edited[1:]]


def _with_value(line: str, key: str, wanted: Any) -> str:
    """Return a line that holds a key with another value; its comment keeps its column."""
    for end in [*(at for at, mark in enumerate(line) if mark == "#"), len(line)]:
        try:
            found = tomllib.loads(line[:end])
        except tomllib.TOMLDecodeError:
            continue
        if found == {key: wanted} or (wanted is None and found == {key: ""}):
            return line
        if wanted is None:
            return f"# {line}"
        text = f"{key} = {_toml(wanted)}"
        comment = line[end:]
        return f"{text:<{end - 1}} {comment}" if comment else text
    return line  # a value of several lines
