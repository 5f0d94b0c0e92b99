"""The desk: where clouds, sessions, picks and projects come from and go to."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from qtpy.QtCore import QObject

from trigpoint.errors import CrsError, TrigpointError
from trigpoint.files import carry
from trigpoint_panel.advice import advised
from trigpoint_panel.camera import Camera, kept_camera
from trigpoint_panel.exchange import export_picks, import_picks, import_points
from trigpoint_panel.foot import Foot
from trigpoint_panel.host import Action, Host
from trigpoint_panel.jobs import CancelledError, Job, Tick, told
from trigpoint_panel.model import Model
from trigpoint_panel.opening import MOST, Opened, open_cloud
from trigpoint_panel.pairs import CALLED, SIDES, Side
from trigpoint_panel.session import SUFFIX, Session, read_session
from trigpoint_panel.views import TwoViews

CLOUDS = "Point clouds (*.las *.laz *.ply *.xyz *.txt *.csv *.e57 *.pcd);;All files (*)"
SESSIONS = f"Sessions and projects (*{SUFFIX} project.toml *.toml);;All files (*)"
# Places of the reference among which the next picks are sought.
PLACES = 3000


class Desk(QObject):
    """Opens and saves what a panel works on; whatever fails is told, and nothing else changes.

    Parameters
    ----------
    host : Host
    model : Model
    session : Session
    views : TwoViews
    foot : Foot
        Runs the jobs.
    """

    def __init__(
        self, host: Host, model: Model, session: Session, views: TwoViews, foot: Foot
    ) -> None:
        super().__init__(foot)
        self._host = host
        self._model = model
        self._session = session
        self._views = views
        self._foot = foot
        self._sessions = 0  # opened so far: what was begun for one changes no other

    # Clouds ------------------------------------------------------------------------------------

    def ask_cloud(self, side: Side) -> None:
        """Let the user choose the cloud of one side."""
        path = self._host.open_file(f"Open the {CALLED[side]}", CLOUDS)
        if path is not None:
            self.open_cloud(side, path)

    def open_cloud(self, side: Side, path: Path) -> Job:
        """Open a cloud on one side, and name it in the session once it is there."""
        return self._load(side, path, named=True)

    def open_dropped(self, path: Path, side: Side | None = None) -> None:
        """Open whatever was dropped: a session, a project, picks, or a cloud."""
        name = path.name.lower()
        if name.endswith((SUFFIX, ".toml", f"{SUFFIX}~")):
            self.open_session(path)
        elif name.endswith(".csv"):
            self.import_picks(path)
        else:
            first: Side = "source" if self._model.state.source_path is None else "target"
            self.open_cloud(side or first, path)

    def load_clouds(self) -> None:
        """Open the clouds that the session names."""
        state = self._model.state
        for side, path in (("source", state.source_path), ("target", state.target_path)):
            self._views.set_cloud("source" if side == "source" else "target", None)
            if path is not None:
                self._load("source" if side == "source" else "target", path)

    def choose_crs(self, path: Path | None = None) -> None:
        """Let the user assign a CRS to the reference, and read it, or `path` as it, with that."""
        self._host.choose_crs(self._model.state.crs, lambda crs: self.assign_crs(crs, path))

    def assign_crs(self, crs: str, path: Path | None = None) -> None:
        """Assign a CRS to the reference, and read it again with that.

        Where `path` is another file than the reference, it becomes the reference with that CRS,
        and what was the reference keeps its own until the other is there.
        """
        current = self._model.state.target_path
        if path is not None and current not in (None, path):
            self._host.clear_messages()
            self._load("target", path, named=True, assigned=crs)
        elif self._changed(self._model.set_reference, crs=crs):
            self._host.clear_messages()
            if current is not None:
                self._load("target", current)

    def are_as_opened(self) -> bool:
        """Whether the clouds on disk are the ones shown; if not, say so, and offer those."""
        replaced = [
            (side, opened.path)
            for side in SIDES
            if (opened := self._views.opened[side]) is not None and opened.has_changed
        ]
        for side, path in replaced:
            self._host.message(
                "warning",
                f"{path.name} has changed since it was opened: open it again.",
                "",
                (("Open it again", partial(self._load, side, path)),),
            )
        return not replaced

    def save_aligned(self, path: Path | None = None) -> None:
        """Carry the whole source into the reference's frame, and write it."""
        state, similarity = self._model.state, self._model.similarity
        how = "the fit" if state.adopted is None else "the fit with ICP adopted"
        source = state.source_path
        if source is None or similarity is None or not self.are_as_opened():
            return
        suggestion = f"{source.stem}-aligned{source.suffix}"
        target = path or self._host.save_file("Save the aligned cloud", CLOUDS, suggestion)
        if target is None:
            return
        opened = self._views.opened["target"]
        crs = state.crs or (None if opened is None else opened.info.crs)

        def work(tick: Tick) -> Any:
            tick(None, f"Carrying {source.name} to {target.name}")
            return carry(source, target, similarity, crs=crs)

        job = self._begin(f"Writing {target.name}", work)
        job.done.connect(lambda found: self._carried(target, found, how))

    # Sessions ----------------------------------------------------------------------------------

    def ask_session(self) -> None:
        """Let the user choose a session or a project."""
        path = self._host.open_file("Open a session or a project", SESSIONS)
        if path is not None:
            self.open_session(path)

    def open_session(self, path: Path) -> Job:
        """Open a session or a project.toml, and the clouds it names."""

        def work(tick: Tick) -> Any:
            tick(None, f"Opening {path.name}")
            return read_session(path)

        job = self._begin(f"Opening {path.name}", work)
        job.done.connect(lambda opened: self._take(opened, path))
        return job

    def save(self, *, elsewhere: bool = False) -> bool:
        """Save the session, and tell whether it is saved."""
        path = self._session.path
        if path is None or elsewhere:
            name = f"{self._model.state.about.id}{SUFFIX}"
            path = self._host.save_file("Save the session", f"Sessions (*{SUFFIX})", name)
        if path is None:
            return False
        if not path.name.endswith(SUFFIX):
            path = path.with_name(path.name.removesuffix(".json") + SUFFIX)
        self._session.cameras = {side: _kept(self._views.view(side).camera) for side in SIDES}
        try:
            self._session.save(path, anew=elsewhere)
        except (TrigpointError, OSError) as error:
            ways = (("Save as…", partial(self.save, elsewhere=True)),)
            self._host.message("error", told(error), "", ways)
            return False
        self._host.message("success", f"Saved to {path}.")
        self.are_as_opened()  # the file names those that were picked on
        return True

    def autosave(self) -> None:
        """Keep what would be lost in a crash."""
        said = self._session.autosave()
        if said:
            self._host.message("warning", said)

    def offer_recovery(self, path: Path | None = None) -> None:
        """Offer what a crash has left, if it has."""
        found = [each for each in self._session.recoverable(path) if each != self._session.left]
        for autosave in found[:1]:
            self._host.message(
                "warning",
                "Unsaved changes were left behind by a window that did not close.",
                str(autosave),
                self._ways_with(autosave),
            )

    def ask_project(self) -> None:
        """Let the user choose where project.toml goes, and write it."""
        path = self._host.save_file("Write project.toml", "Projects (*.toml)", "project.toml")
        if path is not None and self._changed(self._session.write_project, path):
            self._host.message("success", f"{path} is written, with its picks.csv beside it.")

    def project_written(self) -> bool:
        """Write the project.toml that an audit takes, and tell whether it is there."""
        path: Path | None = None
        if self._session.name == "untitled":
            path = self._host.save_file(
                "Where does the project go?", "Projects (*.toml)", "project.toml"
            )
            if path is None:
                return False
        return self._changed(self._session.write_project, path)

    # Picks -------------------------------------------------------------------------------------

    def ask_picks(self) -> None:
        """Let the user choose a picks.csv."""
        path = self._host.open_file("Import picks", "Picks (*.csv);;All files (*)")
        if path is not None:
            self.import_picks(path)

    def import_picks(self, path: Path, *, replacing: bool = False) -> None:
        """Add the pairs of a picks.csv, or take them in place of the current ones."""
        try:
            doubts = import_picks(self._model, path, replacing=replacing)
        except (TrigpointError, OSError) as error:
            instead: tuple[Action, ...] = ()
            if self._model.pairs and not replacing:
                instead = (("Replace the pairs", partial(self.import_picks, path, replacing=True)),)
            self._host.message("error", told(error), "", instead)
            return
        for doubt in doubts:
            self._host.message("warning", doubt)

    def ask_points(self, side: Side) -> None:
        """Let the user choose a list of points of one side."""
        path = self._host.open_file("Import points", "Point lists (*.txt *.csv);;All files (*)")
        if path is not None:
            self._changed(import_points, self._model, path, side)

    def ask_export(self) -> None:
        """Let the user choose where the picks go; the ending says in which form."""
        filters = "Picks (*.csv);;QGIS, plan only (*.points);;CloudCompare, two lists (*.txt)"
        path = self._host.save_file("Export picks", filters, "picks.csv")
        if path is None:
            return
        try:
            written = export_picks(self._model, path)
        except (TrigpointError, OSError) as error:
            self._host.message("error", told(error))
            return
        names = " and ".join(each.name for each in written)
        shown = [each for each in self._views.opened.values() if each is not None]
        thinned = [each for each in shown if each.is_thinned]
        also = "".join(
            f" {each.path.name} was picked on {len(each.cloud):,} of {each.total:,} points."
            for each in thinned
        )
        plan = " It holds the plan only." if path.suffix == ".points" else ""
        self._host.message("success", f"{names}: written.{plan}{also}")

    # How it is done ----------------------------------------------------------------------------

    def _load(
        self, side: Side, path: Path, *, named: bool = False, assigned: str | None = None
    ) -> Job:
        crs = assigned or self._model.state.crs or None
        most = int(self._host.setting("view/most", MOST))
        asked = self._sessions

        def is_wanted() -> bool:
            """Whether the session is still the one that names it; what is to be named, always."""
            state = self._model.state
            now = state.source_path if side == "source" else state.target_path
            return named or (asked == self._sessions and now == path)

        def work(tick: Tick) -> Opened:
            if not is_wanted():
                raise CancelledError
            return open_cloud(
                path,
                crs=crs if side == "target" else None,
                needs_crs=side == "target",
                most=most,
                progress=tick,
            )

        def take(opened: Opened) -> None:
            if not is_wanted():
                return
            if named:  # first: another file's survey would go with it
                self._model.open_cloud(side, path)
            if assigned is not None:
                self._changed(self._model.set_reference, crs=assigned)
            self._show(side, opened)

        # A source needs no CRS, and the reference's has nothing to do with it.
        ways = self._ways_to_a_crs(path) if side == "target" else ()
        job = self._begin(
            f"Opening {path.name}", work, lambda error: ways if isinstance(error, CrsError) else ()
        )
        job.done.connect(take)
        return job

    def _show(self, side: Side, opened: Opened) -> None:
        if opened.fingerprint is not None:
            self._session.keep_fingerprint(opened.fingerprint)
        if side == "target":
            rng = np.random.default_rng(0)
            rows = rng.permutation(len(opened.cloud))[:PLACES]
            places = opened.cloud.xyz[np.sort(rows)] + opened.cloud.origin
            self._model.set_survey([opened.info.low, opened.info.high], places)
        self._views.set_cloud(side, opened)
        camera = kept_camera(self._session.cameras.get(side))
        if camera is not None:
            self._views.view(side).set_camera(camera)
        for caution in opened.info.cautions:
            of_crs = caution.code.startswith("crs_")
            if of_crs and side == "source":
                continue  # the fit carries it from whatever frame it is in
            text = f"{opened.path.name}: {advised(caution.code, caution.message)}"
            self._host.message(
                "warning", text, "", self._ways_to_a_crs(opened.path) if of_crs else ()
            )

    def _take(self, opened: Any, path: Path) -> None:
        left = self._session.name
        if not self._changed(self._session.take, opened, path):
            return
        self._sessions += 1
        for doubt in opened.doubts:
            self._host.message("warning", doubt)
        self.load_clouds()
        self.offer_recovery(path)
        self._tell_of_what_was_left(left)

    def _recover(self, autosave: Path) -> None:
        left = self._session.name
        if self._changed(self._session.recover, autosave):
            self._sessions += 1
            self.load_clouds()
            self._tell_of_what_was_left(left)

    def _tell_of_what_was_left(self, name: str) -> None:
        kept = self._session.left
        if kept is not None:
            text = f"The changes to {name} were not saved, and are kept."
            self._host.message("info", text, str(kept), self._ways_with(kept))

    def _ways_with(self, autosave: Path) -> tuple[Action, ...]:
        return (
            ("Restore", partial(self._recover, autosave)),
            ("Delete them", partial(self._changed, self._session.give_up, autosave)),
        )

    def _carried(self, target: Path, found: Any, how: str) -> None:
        points, cautions = found
        self._host.message("success", f"{points:,} points, carried by {how}, written to {target}.")
        for caution in cautions:
            self._host.message("warning", caution.message)
        self._host.add_layer(target, "cloud")

    def _ways_to_a_crs(self, path: Path) -> tuple[Action, ...]:
        return (("Choose a CRS…", partial(self.choose_crs, path)),)

    def _begin(
        self,
        title: str,
        work: Callable[[Tick], Any],
        ways_out: Callable[[BaseException | None], tuple[Action, ...]] = lambda _: (),
    ) -> Job:
        job = Job(title, work)
        job.failed.connect(
            lambda text, details: self._host.message("error", text, details, ways_out(job.error))
        )
        self._foot.begin(job)
        return job

    def _changed(self, change: Callable[..., object], *given: object, **named: object) -> bool:
        try:
            change(*given, **named)
        except (TrigpointError, OSError) as error:
            self._host.message("error", told(error))
            return False
        return True


def _kept(camera: Camera) -> dict[str, Any]:
    """Return a camera as a session's file holds it."""
    return asdict(camera)
