"""A session's files: saved, autosaved, recovered after a crash, and its project.toml."""

from __future__ import annotations

import uuid
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

from trigpoint.canonical import write_text
from trigpoint_panel.documents import (
    Opened,
    SessionError,
    document_text,
    read_document,
)
from trigpoint_panel.fingerprints import Fingerprint, Fingerprints, content_of
from trigpoint_panel.model import Model
from trigpoint_panel.ownership import Ownership, is_owned, own
from trigpoint_panel.projects import contents, state_from_project, write_project
from trigpoint_panel.state import NOWHERE, State, with_given

SUFFIX = ".trig.json"


def read_session(path: Path | str, *, reconstruction: str = "") -> Opened:
    """Read a session, its autosave, or a project.toml; inputs are hashed, which can take seconds.

    Parameters
    ----------
    path : path
    reconstruction : str
        Of a project.toml: which is the source; by default the first with picks.

    Raises
    ------
    TrigpointError
        In one sentence, if it can't be used.
    """
    path = Path(path).absolute()
    if path.suffix.lower() != ".toml":
        return read_document(path)
    read = content_of(path)
    state, doubts = state_from_project(path, reconstruction=reconstruction)
    return Opened(state, {}, doubts, None, Fingerprints(), {**contents(state), path: read}, None)


class Session:
    """Where a model is kept: its file, its autosave beside it (``<session>~``), its cameras.

    Attributes
    ----------
    model : Model
    path : Path or None
        Of the session's file; None until it is saved.
    cameras : dict
        Of each view, as JSON can hold it: saved, and given back.
    left : Path or None
        Where the changes are kept that were not saved when another session was opened.
    """

    def __init__(self, model: Model, *, scratch: Path) -> None:
        """Keep a model; what has no writable file yet is autosaved in the folder `scratch`."""
        self.model = model
        self.path: Path | None = None
        self.cameras: dict[str, Any] = {}
        self.left: Path | None = None
        self._scratch = scratch
        self._unsaved = _unsaved(scratch)
        self._file: str | None = None  # SHA-256 of the session's file as it was read or written
        self._known = Fingerprints()
        self._read: dict[Path, str | None] = {}
        self._saved: State | None = _content(model.state)
        self._autosaved: dict[Path, Ownership] = {}

    @property
    def is_modified(self) -> bool:
        """Whether there is something to save."""
        return _content(self.model.state) != self._saved

    @property
    def name(self) -> str:
        """What to call it in a title: its file's name, its project's, or untitled."""
        if self.path is not None:
            return self.path.name
        path = self.model.state.project.path
        return "untitled" if path == NOWHERE else path.name

    def open(self, path: Path | str) -> tuple[str, ...]:
        """Open a session or a project.toml into the model; return doubts, a sentence each.

        Raises
        ------
        TrigpointError
            If it can't be used; the model is as it was.
        """
        return self.take(read_session(path), path)

    def take(self, opened: Opened, path: Path | str) -> tuple[str, ...]:
        """Take over what `read_session` read, in a worker perhaps, from `path`.

        What is not saved stays autosaved, in `left`.

        Raises
        ------
        SessionError
            If it can't be kept; the model is as it was.
        """
        self._set_aside()
        path = Path(path).absolute()
        self.path = None if path.suffix.lower() == ".toml" else path
        self._file = opened.sha256
        self._take(opened)
        self._saved = _content(self.model.state)
        return opened.doubts

    def keep_fingerprint(self, fingerprint: Fingerprint) -> None:
        """Have the session's file name a cloud as it was opened, not as it is on disk by then."""
        self._known.keep(fingerprint)

    def save(self, path: Path | str | None = None, *, anew: bool = False) -> None:
        """Save to `path`, by default where it was saved before; the autosave goes.

        Parameters
        ----------
        path : path, optional
        anew : bool
            Also over what somebody else has written there since it was read.

        Raises
        ------
        SessionError
            If there is no path yet, it can't be written, or another window has written it.
        """
        to = self.path if path is None else Path(path).absolute()
        if to is None:
            message = "This session has no file yet: give it one."
            raise SessionError(message)
        if not anew and self._is_anothers(to):
            message = (
                f"{to.name} has changed since it was read, in another window perhaps: "
                "save under another name, or open it again."
            )
            raise SessionError(message)
        self._write(to, self.model.state)
        self.path, self._file = to, content_of(to)
        self._saved = _content(self.model.state)
        # What a crash left there and nobody wanted back is older now than what was saved.
        self._own(_beside(to))
        self.discard_autosave()

    def autosave(self) -> str:
        """Write ``<session>~``, or into the scratch folder where that can't be; never raises.

        Files are not hashed anew, so that it takes milliseconds after every change.

        Returns
        -------
        str
            Why nothing could be kept, in one sentence; empty if it was.
        """
        if not self.is_modified:
            self.discard_autosave()
            return ""
        said = ""
        places = [self._unsaved]
        # What a crash left there stays until it is recovered or given up.
        if self.path is not None and not self.recoverable(self.path):
            places.insert(0, _beside(self.path))
        for place in places:
            try:
                if place == self._unsaved:
                    place.parent.mkdir(parents=True, exist_ok=True)
                if not self._own(place):
                    continue  # another window has the session open, and changed it first
                self._write(place, self.model.state, autosaving=True)
            except (OSError, SessionError) as error:
                said = f"Changes are not autosaved: {error}"
                continue
            self._discard(but=place)
            return ""
        return said

    def discard_autosave(self) -> None:
        """Remove what was autosaved: the session is saved, or given up."""
        self._discard()

    def leave(self) -> None:
        """Keep what was autosaved for another window to find: this one is gone."""
        for owned in self._autosaved.values():
            owned.release()
        self._autosaved.clear()

    def recoverable(self, path: Path | str | None = None) -> tuple[Path, ...]:
        """Return autosaves that a crash left, newest first: of the session at `path`, or unsaved.

        Those of this session itself, and of windows that are still open, are not among them.
        """
        if path is not None:
            places = [_beside(Path(path).absolute())]
        else:
            places = sorted(self._scratch.glob(f"*{SUFFIX}~"))
        found = [
            (place.stat().st_mtime, place)
            for place in places
            if place.is_file() and place not in self._autosaved and not is_owned(place)
        ]
        return tuple(place for _, place in sorted(found, reverse=True))

    def recover(self, autosave: Path) -> tuple[str, ...]:
        """Take an autosave over, as unsaved changes of the session that it was made of.

        Raises
        ------
        SessionError
            If it can't be used; the model is as it was.
        """
        self._take_over(autosave)
        try:
            opened = read_document(autosave)
        except SessionError:
            self._autosaved.pop(autosave).release()
            raise
        owned = self._autosaved.pop(autosave)  # lest it is put aside as well
        try:
            self._set_aside()
        except SessionError:
            owned.release()
            raise
        self._autosaved[autosave] = owned
        self.path = opened.saved_as
        self._file = None if self.path is None else content_of(self.path)
        self._take(opened)
        self._saved = None
        return opened.doubts

    def give_up(self, autosave: Path) -> None:
        """Remove an autosave that nobody wants back.

        Raises
        ------
        SessionError
            If another window has taken it over.
        OSError
            If it can't be removed.
        """
        self._take_over(autosave)
        try:
            autosave.unlink(missing_ok=True)
        finally:
            self._autosaved.pop(autosave).release()

    def write_project(self, path: Path | str | None = None) -> Path:
        """Write the project.toml and picks.csv that `trigpoint audit` takes; return project.toml.

        Parameters
        ----------
        path : path, optional
            By default the session's project.toml, else the one beside its file.

        Raises
        ------
        TrigpointError
            See `trigpoint_panel.projects.write_project`, also for what was changed outside; and
            if no place is known.
        """
        known = self.model.state.project.path
        if path is None and known != NOWHERE:
            path = known
        elif path is None and self.path is not None:
            path = self.path.with_name(f"{self.path.name.removesuffix(SUFFIX)}.toml")
        if path is None:
            message = "This session has no file yet: save it first, the project goes beside it."
            raise SessionError(message)
        unchanged = not self.is_modified
        project = write_project(self.model.state, path, read=self._read)
        self.model.set_project(project)
        self._read = contents(self.model.state)
        self._remember_project(self.model.state if unchanged else self._saved)
        return project.path

    def _remember_project(self, saved: State | None) -> None:
        """Have the session's file name the project that was written, and change nothing else."""
        now = self.model.state
        if saved is None or saved.reconstruction != now.reconstruction:
            return
        given = replace(saved.given, picks=now.given.picks)
        saved = replace(saved, project=replace(with_given(saved, given), path=now.project.path))
        if self.path is not None and _content(saved) != self._saved:
            if self._is_anothers(self.path):
                return  # there is something left to save
            try:
                self._write(self.path, saved)
            except SessionError:
                return
            self._file = content_of(self.path)
        self._saved = _content(saved)

    def _is_anothers(self, path: Path) -> bool:
        """Whether somebody has written the session's file since it was read or written here."""
        return path == self.path and content_of(path) not in (None, self._file)

    def _set_aside(self) -> None:
        """Keep what is not saved for whoever wants it back, and let go of it."""
        self.left = None
        if not self.is_modified:
            self.discard_autosave()
            return
        said = self.autosave()
        if said:
            message = f"{self.name} has changes that are not saved, and can't be kept: {said}"
            raise SessionError(message)
        (self.left,) = self._autosaved
        self.leave()
        self._unsaved = _unsaved(self._scratch)

    def _own(self, autosave: Path) -> bool:
        """Take hold of an autosave; False: another window has it."""
        if autosave not in self._autosaved and (owned := own(autosave)) is not None:
            self._autosaved[autosave] = owned
        return autosave in self._autosaved

    def _take_over(self, autosave: Path) -> None:
        if not self._own(autosave):
            message = f"Another window that is still open keeps {autosave.name}: go on there."
            raise SessionError(message)

    def _discard(self, *, but: Path | None = None) -> None:
        """Remove what was autosaved, and let go of it."""
        for place in [each for each in self._autosaved if each != but]:
            with suppress(OSError):  # a folder that has become read-only keeps it
                place.unlink(missing_ok=True)
            self._autosaved.pop(place).release()

    def _take(self, opened: Opened) -> None:
        self.cameras = opened.cameras
        self._known = opened.fingerprints
        self._read = opened.read
        self.model.load(opened.state)

    def _write(self, to: Path, state: State, *, autosaving: bool = False) -> None:
        text = document_text(
            state,
            to.parent,
            cameras=self.cameras,
            similarity=(self.model if state == self.model.state else Model(state)).similarity,
            fingerprints=self._known,
            read=self._read,
            hashing=not autosaving,
            saved_as=self.path if autosaving else None,
        )
        try:
            write_text(to, text)
        except OSError as error:
            message = f"{to.name} can't be written: {error.strerror or error}."
            raise SessionError(message) from error


def _unsaved(scratch: Path) -> Path:
    """Return where to autosave what has no file: no two windows share a place."""
    return scratch / f"unsaved-{uuid.uuid4().hex[:8]}{SUFFIX}~"


def _beside(path: Path) -> Path:
    return path.with_name(f"{path.name}~")


def _content(state: State) -> State:
    """Return what of a state is worth a question on closing: selecting is not."""
    return replace(state, selected=None)
