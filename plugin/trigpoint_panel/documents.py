"""The text of a session file, .trig.json: written whole, and read with suspicion."""

from __future__ import annotations

import datetime as dt
import json
import os
from dataclasses import dataclass, replace
from pathlib import Path, PurePosixPath, PureWindowsPath
from typing import Any, NoReturn

from trigpoint.errors import ProjectError, TrigpointError
from trigpoint.picks import FARTHEST, LARGEST_SIGMA, SMALLEST_SIGMA
from trigpoint.project import Project, project_from
from trigpoint.similarity import Similarity
from trigpoint_panel.camera import kept_camera
from trigpoint_panel.fingerprints import Fingerprints
from trigpoint_panel.pairs import ROLES, Pair, Pairs, Place
from trigpoint_panel.projects import contents, holds_pairs, project_tables, without_none
from trigpoint_panel.state import NOWHERE, Adopted, State, with_given

FORMAT = "trigpoint-session/1"
# Stands for a file that is not named yet; never looked at.
_ABSENT = "/absent"


class SessionError(TrigpointError, ValueError):
    """A session can't be read or written."""

    code = "session"


class _NotSessionError(ValueError):
    """What is wrong with a document, to be said with its file's name."""


@dataclass(frozen=True, slots=True, eq=False)
class Opened:
    """What a session file or a project.toml holds.

    Attributes
    ----------
    state : State
    cameras : dict
        Of each view, as it was saved; one that nothing can be seen from is left out.
    doubts : tuple of str
        A sentence for each file that has moved or changed since.
    saved_as : Path or None
        Of an autosave: the session that it was made of.
    fingerprints : Fingerprints
        Of the files that were looked at.
    read : dict of Path to str or None
        SHA-256 of the project.toml and its picks as they were read; None: it was not there.
    """

    state: State
    cameras: dict[str, Any]
    doubts: tuple[str, ...]
    saved_as: Path | None
    fingerprints: Fingerprints
    read: dict[Path, str | None]


def document_text(
    state: State,
    folder: Path,
    *,
    cameras: dict[str, Any],
    similarity: Similarity | None,
    fingerprints: Fingerprints,
    hashing: bool = True,
    saved_as: Path | None = None,
) -> str:
    """Return the text of a session file.

    Parameters
    ----------
    state : State
    folder : Path
        Where the file will be: paths are relative to it.
    cameras : dict
    similarity : Similarity or None
        Of the moment, for other programs; it is not read back.
    fingerprints : Fingerprints
    hashing : bool
        Whether files that have no known hash are hashed.
    saved_as : Path, optional
        Of an autosave: the session that it is made of.
    """
    tables = project_tables(state.project, folder)
    files = {}
    for name, path in _files(state.project).items():
        files[name] = {"path": _relative(path, folder)}
        try:
            files[name] |= fingerprints.of(path, hashing=hashing)
        except OSError:
            continue  # it has gone: its path alone is kept
    for table in (tables["reference"], *tables["reconstruction"]):
        for key in ("path", "picks", "region"):
            table.pop(key, None)  # they stand with the files
    adopted = state.adopted
    document = {
        "format": FORMAT,
        "saved_as": None if saved_as is None else _relative(saved_as, folder),
        "project_path": None
        if state.project.path == NOWHERE
        else _relative(state.project.path, folder),
        "files": files,
        "reconstruction": state.reconstruction,
        "selected": state.selected,
        "pairs": [_pair_table(pair) for pair in state.pairs],
        "first_operator": None
        if state.first is None
        else [_pair_table(pair) for pair in state.first],
        "adopted": None
        if adopted is None
        else {
            "scale": adopted.scale,
            "rotation": adopted.rotation,
            "translation": adopted.translation,
        },
        "similarity": None
        if similarity is None
        else {
            "scale": similarity.scale,
            "rotation": similarity.rotation.tolist(),
            "translation": similarity.translation.tolist(),
        },
        "project": tables,
        "cameras": cameras,
    }
    return json.dumps(document, indent=1, ensure_ascii=False, allow_nan=False, default=_iso) + "\n"


def read_document(path: Path) -> Opened:
    """Read a session file or its autosave, and look whether its files are there and the same.

    Raises
    ------
    SessionError
        In one sentence, if it can't be read or is no session.
    """
    folder = path.parent
    document = _loaded(path)
    try:
        if document.get("format") != FORMAT:
            _refuse(f"its format is {_shown(document.get('format'))}, not {FORMAT}")
        files = _typed(document, "files", dict)
        state = _state(document, files, folder)
        saved_as = document.get("saved_as")
        session = _found(saved_as, folder) if isinstance(saved_as, str) else None
    except (ProjectError, _NotSessionError) as error:
        message = f"{path.name} is no session: {str(error).rstrip('.')}."
        raise SessionError(message) from error
    known = Fingerprints()
    read = contents(state)
    # What the pairs were saved beside: what has come into that file since is not among them.
    said = files.get(f"picks {state.reconstruction}", {}).get("sha256")
    if state.given.picks is not None and isinstance(said, str) and not holds_pairs(state):
        read[state.given.picks] = said
    cameras = document.get("cameras")
    return Opened(
        state,
        {side: kept for side, kept in cameras.items() if kept_camera(kept) is not None}
        if isinstance(cameras, dict)
        else {},
        tuple(_doubts(state, files, known)),
        session,
        known,
        read,
    )


def _loaded(path: Path) -> dict[str, Any]:
    try:
        document = json.loads(path.read_text(encoding="utf-8-sig"))
        # An escape can stand for half a letter, which no file or path can hold.
        json.dumps(document, ensure_ascii=False).encode()
    except OSError as error:
        message = f"{path.name} can't be read: {error.strerror or error}."
        raise SessionError(message) from error
    except (ValueError, RecursionError) as error:
        message = f"{path.name} is no session: it is not JSON, or was cut off."
        raise SessionError(message) from error
    return document if isinstance(document, dict) else {}


def _files(project: Project) -> dict[str, Path]:
    """Name every input of a project, as the session file does."""
    files: dict[str, Path | None] = {
        "reference": project.reference.path,
        "region": project.reference.region,
    }
    for each in project.reconstructions:
        files |= {f"reconstruction {each.name}": each.path, f"picks {each.name}": each.picks}
    return {name: path for name, path in files.items() if path is not None and path != NOWHERE}


def _state(document: dict[str, Any], files: dict[str, Any], folder: Path) -> State:
    tables = _typed(document, "project", dict)
    project_path = document.get("project_path")
    at = _found(project_path, folder) if isinstance(project_path, str) else NOWHERE
    project = _project(tables, files, folder)
    names = [each.name for each in project.reconstructions]
    reconstruction = document.get("reconstruction")
    if reconstruction not in names:
        _refuse(f"its reconstruction is {_shown(reconstruction)}, not one of {', '.join(names)}")
    pairs = _pairs(document, "pairs")
    selected = document.get("selected")
    first = None if document.get("first_operator") is None else _pairs(document, "first_operator")
    return State(
        replace(project, path=at),
        reconstruction,
        pairs,
        selected if selected in [pair.id for pair in pairs] else None,
        first,
        _adopted(document.get("adopted")),
    )


def _project(tables: dict[str, Any], files: dict[str, Any], folder: Path) -> Project:
    """Check the project's tables as the engine does, with the files put back into them."""
    paths = {}
    for name, record in files.items():
        if not isinstance(record, dict) or not isinstance(record.get("path"), str):
            _refuse(f"the path of its {name} is missing")
        paths[name] = _found(record["path"], folder)
    tables = without_none(tables)
    about, reference = _typed(tables, "project", dict), _typed(tables, "reference", dict)
    if isinstance(date := about.get("date"), str):
        try:
            about["date"] = dt.date.fromisoformat(date)
        except ValueError:
            _refuse(f"its date is {_shown(date)}")
    reference["path"] = str(paths.get("reference", _ABSENT))
    reference["region"] = str(paths.get("region", ""))
    for table in _typed(tables, "reconstruction", list):
        if not isinstance(table, dict):
            _refuse(f"one of its reconstructions is {_shown(table)}")
        own = table.get("name")
        table["path"] = str(paths.get(f"reconstruction {own}", _ABSENT))
        table["picks"] = str(paths.get(f"picks {own}", ""))
    project = project_from(tables, folder / "project.toml")
    if "reference" not in paths:
        project = replace(project, reference=replace(project.reference, path=NOWHERE))
    for each in project.reconstructions:
        if f"reconstruction {each.name}" not in paths:
            nowhere = replace(each, path=NOWHERE)
            project = with_given(State(project, each.name), nowhere)
    return project


def _doubts(state: State, files: dict[str, Any], known: Fingerprints) -> list[str]:
    doubts = []
    for name, path in _files(state.project).items():
        record = files[name]
        try:
            now = known.of(path, hashing="sha256" in record)
        except OSError:
            where = f"is not where the session left it ({path.parent}): open it again"
            doubts.append(f"{path.name} {where}.")
            continue
        if any(key in record and record[key] != now[key] for key in ("bytes", "sha256")):
            is_picks = name.startswith("picks")
            what = "the session keeps its own pairs" if is_picks else "its picks may not fit it"
            doubts.append(f"{path.name} has changed since the session was saved: {what}.")
    return doubts


def _pair_table(pair: Pair) -> dict[str, Any]:
    return {
        "id": pair.id,
        "role": pair.role,
        "source": pair.source,
        "target": pair.target,
        "sigma_source": pair.sigma_source,
        "sigma_target": pair.sigma_target,
        "note": pair.note,
        "extra": pair.extra,
    }


def _pairs(document: dict[str, Any], key: str) -> Pairs:
    pairs = tuple(_pair(row) for row in _typed(document, key, list))
    names = [pair.id for pair in pairs]
    for name in names:
        if names.count(name) > 1:
            _refuse(f"two of its pairs are named {name!r}")
    return pairs


def _pair(row: Any) -> Pair:
    if not isinstance(row, dict) or not isinstance(name := row.get("id"), str) or not name.strip():
        _refuse("one of its pairs has no id")
    role = row.get("role", "control")
    if role not in ROLES:
        _refuse(f"pair {name!r} has the role {_shown(role)}")
    note, extra = row.get("note", ""), row.get("extra", [])
    if not isinstance(note, str):
        _refuse(f"pair {name!r} has a note that is no text")
    if not isinstance(extra, list) or not all(
        isinstance(cell, list) and len(cell) == 2 and all(isinstance(part, str) for part in cell)
        for cell in extra
    ):
        _refuse(f"pair {name!r} has columns that are no text")
    return Pair(
        name,
        role,
        _place(row.get("source"), name),
        _place(row.get("target"), name),
        _sigma(row.get("sigma_source"), name),
        _sigma(row.get("sigma_target"), name),
        note,
        tuple((column, cell) for column, cell in extra),
    )


def _place(value: Any, name: str) -> Place | None:
    if value is None:
        return None
    if not isinstance(value, list) or len(value) != 3 or not all(map(_is_number, value)):
        _refuse(f"pair {name!r} has {_shown(value)} for a place")
    x, y, z = (float(number) for number in value)
    return x, y, z


def _sigma(value: Any, name: str) -> float | None:
    if value is None:
        return None
    if not _is_number(value) or not SMALLEST_SIGMA <= value <= LARGEST_SIGMA:
        _refuse(f"pair {name!r} has {_shown(value)} for a sigma")
    return float(value)


def _adopted(value: Any) -> Adopted | None:
    if value is None:
        return None
    rotation, translation = _list(value, "rotation"), _list(value, "translation")
    numbers = [value.get("scale") if isinstance(value, dict) else None, *rotation, *translation]
    sizes = (len(rotation), len(translation))
    if sizes != (9, 3) or not all(map(_is_number, numbers)) or not numbers[0] > 0:
        _refuse("its adopted similarity is none")
    numbers = [float(number) for number in numbers]
    adopted = Adopted(numbers[0], tuple(numbers[1:10]), tuple(numbers[10:]))
    if not adopted.similarity.is_proper:
        _refuse("the rotation of its adopted similarity is none")
    return adopted


def _list(value: Any, key: str) -> list[Any]:
    found = value.get(key) if isinstance(value, dict) else None
    return found if isinstance(found, list) else []


def _is_number(value: Any) -> bool:
    is_one = isinstance(value, int | float) and not isinstance(value, bool)
    # NaN is not below anything either.
    return is_one and abs(value) <= FARTHEST


def _typed(document: dict[str, Any], key: str, kind: type) -> Any:
    value = document.get(key)
    if not isinstance(value, kind):
        _refuse(f"its '{key}' is missing or of the wrong kind")
    return value


def _relative(path: Path, folder: Path) -> str:
    try:
        return Path(os.path.relpath(path, folder)).as_posix()
    except ValueError:  # another drive
        return path.as_posix()


def _found(text: str, folder: Path) -> Path:
    if "\0" in text or not text:
        _refuse(f"{_shown(text)} is no path")
    if PureWindowsPath(text).is_absolute() or PurePosixPath(text).is_absolute():
        return Path(text)
    return Path(os.path.normpath(folder / text.replace("\\", "/")))


def _iso(value: Any) -> str:
    if isinstance(value, dt.date):
        return value.isoformat()
    message = f"{type(value).__name__} is nothing that a session holds."
    raise TypeError(message)


def _shown(value: Any) -> str:
    text = repr(value)
    return text if len(text) <= 40 else f"{text[:37]}..."


def _refuse(reason: str) -> NoReturn:
    raise _NotSessionError(reason)
