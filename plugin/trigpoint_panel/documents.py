"""The text of a session file, .trig.json: written whole, and read with suspicion."""

from __future__ import annotations

import datetime as dt
import hashlib
import json
import os
from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from pathlib import Path, PurePosixPath, PureWindowsPath
from typing import Any

from trigpoint.errors import ProjectError, TrigpointError
from trigpoint.project import Project, project_from
from trigpoint.similarity import Similarity
from trigpoint_panel.camera import kept_camera
from trigpoint_panel.fingerprints import Fingerprints
from trigpoint_panel.projects import contents, project_tables, settled, without_none
from trigpoint_panel.records import (
    NotSessionError,
    adopted_in,
    pair_table,
    pairs_in,
    refuse,
    shown,
    typed,
)
from trigpoint_panel.state import NOWHERE, State, with_given

FORMAT = "trigpoint-session/1"
# Stands for a file that is not named yet; never looked at.
_ABSENT = "/absent"
# What a session holds itself of files that may change beside it.
_KEPT = {
    "project": "the session keeps its own settings",
    "picks": "the session keeps its own pairs",
}


class SessionError(TrigpointError, ValueError):
    """A session can't be read or written."""

    code = "session"


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
    sha256 : str or None
        Of the session's file itself.
    """

    state: State
    cameras: dict[str, Any]
    doubts: tuple[str, ...]
    saved_as: Path | None
    fingerprints: Fingerprints
    read: dict[Path, str | None]
    sha256: str | None


def document_text(
    state: State,
    folder: Path,
    *,
    cameras: dict[str, Any],
    similarity: Similarity | None,
    fingerprints: Fingerprints,
    read: Mapping[Path, str | None],
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
    read : mapping of Path to str or None
        SHA-256 of the project.toml and its picks as the session read or wrote them: by it the
        session sees what was changed outside, before it was saved or after.
    hashing : bool
        Whether files that have no known hash are hashed.
    saved_as : Path, optional
        Of an autosave: the session that it is made of.
    """
    tables = project_tables(state.project, folder)
    files: dict[str, dict[str, Any]] = {}
    for name, path in _files(state.project).items():
        files[name] = {"path": _relative(path, folder)}
        if path in read:
            files[name] |= {"sha256": read[path]} if read[path] else {}
            continue
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
        "project_sha256": read.get(state.project.path),
        "files": files,
        "reconstruction": state.reconstruction,
        "selected": state.selected,
        "pairs": [pair_table(pair) for pair in state.pairs],
        "first_operator": None
        if state.first is None
        else [pair_table(pair) for pair in state.first],
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
    document, sha256 = _loaded(path)
    try:
        if document.get("format") != FORMAT:
            refuse(f"its format is {shown(document.get('format'))}, not {FORMAT}")
        files = typed(document, "files", dict)
        state = _state(document, files, folder)
        saved_as = document.get("saved_as")
        session = _found(saved_as, folder) if isinstance(saved_as, str) else None
    except (ProjectError, NotSessionError) as error:
        message = f"{path.name} is no session: {str(error).rstrip('.')}."
        raise SessionError(message) from error
    known = Fingerprints()
    read = contents(state)
    # What the session was saved beside: what has come into those files since is not in it.
    saved = {
        state.project.path: document.get("project_sha256"),
        state.given.picks: files.get(f"picks {state.reconstruction}", {}).get("sha256"),
    }
    same = settled(state)
    changed: dict[Path, str | None] = {
        path: said
        for path in read
        if path not in same and isinstance(said := saved[path], str) and said != read[path]
    }
    cameras = document.get("cameras")
    return Opened(
        state,
        {side: kept for side, kept in cameras.items() if kept_camera(kept) is not None}
        if isinstance(cameras, dict)
        else {},
        tuple(_doubts(state, document, known, same)),
        session,
        known,
        read | changed,
        sha256,
    )


def _loaded(path: Path) -> tuple[dict[str, Any], str]:
    try:
        content = path.read_bytes()
        document = json.loads(content.decode("utf-8-sig"))
        # An escape can stand for half a letter, which no file or path can hold.
        json.dumps(document, ensure_ascii=False).encode()
    except OSError as error:
        message = f"{path.name} can't be read: {error.strerror or error}."
        raise SessionError(message) from error
    except (ValueError, RecursionError) as error:
        message = f"{path.name} is no session: it is not JSON, or was cut off."
        raise SessionError(message) from error
    return document if isinstance(document, dict) else {}, hashlib.sha256(content).hexdigest()


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
    tables = typed(document, "project", dict)
    project_path = document.get("project_path")
    at = _found(project_path, folder) if isinstance(project_path, str) else NOWHERE
    project = _project(tables, files, folder)
    names = [each.name for each in project.reconstructions]
    reconstruction = document.get("reconstruction")
    if reconstruction not in names:
        refuse(f"its reconstruction is {shown(reconstruction)}, not one of {', '.join(names)}")
    pairs = pairs_in(document, "pairs")
    selected = document.get("selected")
    first = None if document.get("first_operator") is None else pairs_in(document, "first_operator")
    return State(
        replace(project, path=at),
        reconstruction,
        pairs,
        selected if selected in [pair.id for pair in pairs] else None,
        first,
        adopted_in(document.get("adopted")),
    )


def _project(tables: dict[str, Any], files: dict[str, Any], folder: Path) -> Project:
    """Check the project's tables as the engine does, with the files put back into them."""
    paths = {}
    for name, record in files.items():
        if not isinstance(record, dict) or not isinstance(record.get("path"), str):
            refuse(f"the path of its {name} is missing")
        paths[name] = _found(record["path"], folder)
    tables = without_none(tables)
    about, reference = typed(tables, "project", dict), typed(tables, "reference", dict)
    if isinstance(date := about.get("date"), str):
        try:
            about["date"] = dt.date.fromisoformat(date)
        except ValueError:
            refuse(f"its date is {shown(date)}")
    reference["path"] = str(paths.get("reference", _ABSENT))
    reference["region"] = str(paths.get("region", ""))
    for table in typed(tables, "reconstruction", list):
        if not isinstance(table, dict):
            refuse(f"one of its reconstructions is {shown(table)}")
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


def _doubts(
    state: State, document: dict[str, Any], known: Fingerprints, same: Collection[Path]
) -> list[str]:
    """Say what has become of the files; what says the same as the session is as it was."""
    files, project = document["files"], state.project.path
    kept = {name: (path, files[name]) for name, path in _files(state.project).items()}
    if isinstance(said := document.get("project_sha256"), str):
        kept["project"] = project, {"sha256": said}
    doubts = []
    for name, (path, record) in kept.items():
        if path in same:
            continue
        try:
            now = known.of(path, hashing="sha256" in record)
        except OSError:
            where = f"is not where the session left it ({path.parent}): open it again"
            doubts.append(f"{path.name} {where}.")
            continue
        if any(key in record and record[key] != now[key] for key in ("bytes", "sha256")):
            what = _KEPT.get(name.partition(" ")[0], "its picks may not fit it")
            doubts.append(f"{path.name} has changed since the session was saved: {what}.")
    return doubts


def _relative(path: Path, folder: Path) -> str:
    try:
        return Path(os.path.relpath(path, folder)).as_posix()
    except ValueError:  # another drive
        return path.as_posix()


def _found(text: str, folder: Path) -> Path:
    if "\0" in text or not text:
        refuse(f"{shown(text)} is no path")
    if PureWindowsPath(text).is_absolute() or PurePosixPath(text).is_absolute():
        return Path(text)
    return Path(os.path.normpath(folder / text.replace("\\", "/")))


def _iso(value: Any) -> str:
    if isinstance(value, dt.date):
        return value.isoformat()
    message = f"{type(value).__name__} is nothing that a session holds."
    raise TypeError(message)
