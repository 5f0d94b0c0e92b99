"""The panel: two views, the pair table, three tabs, a toolbar and a foot, round one model."""

from __future__ import annotations

import math
import tempfile
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

from qtpy.QtCore import QEvent, QStandardPaths, Qt, QTimer, Signal
from qtpy.QtGui import QDragEnterEvent, QDropEvent, QKeyEvent
from qtpy.QtWidgets import (
    QAbstractSpinBox,
    QFrame,
    QHBoxLayout,
    QLabel,
    QLineEdit,
    QPlainTextEdit,
    QSplitter,
    QTabWidget,
    QVBoxLayout,
    QWidget,
)

from trigpoint.errors import TrigpointError
from trigpoint_panel.actions import COMMANDS, make_actions
from trigpoint_panel.align_tab import AlignTab
from trigpoint_panel.auditing import Audited, audit
from trigpoint_panel.bar import Bar
from trigpoint_panel.canvas import CanvasKind
from trigpoint_panel.desk import Desk
from trigpoint_panel.errors_tab import ErrorsTab, question
from trigpoint_panel.foot import Foot
from trigpoint_panel.forms import say
from trigpoint_panel.help import KeysWindow
from trigpoint_panel.host import Host
from trigpoint_panel.jobs import Job, Tick, told
from trigpoint_panel.measuring import Bench, Findings
from trigpoint_panel.model import Model
from trigpoint_panel.opening import Opened
from trigpoint_panel.pairs import SIDES, Side
from trigpoint_panel.report_tab import ReportTab
from trigpoint_panel.session import Session
from trigpoint_panel.state import State
from trigpoint_panel.stateline import StateLine, state_line
from trigpoint_panel.style import look_of, sheet, theme_of
from trigpoint_panel.table import PairTable
from trigpoint_panel.view import Picked
from trigpoint_panel.views import TwoViews

AUTOSAVE_MS = 400
NO_BREAK = "\N{NO-BREAK SPACE}"
OPACITY = 0.6  # of the overlay, at first
SIZES = (1.0, 2.0, 3.0, 4.0, 6.0, 8.0)  # of points, in pixels


class Panel(QWidget):
    """The whole thing: picks, fit, comparison and report, in whatever window holds it.

    Parameters
    ----------
    host : Host
        Who shows the panel: its settings, messages, files and threads.
    model : Model, optional
        By default an empty one.
    parent : QWidget, optional
    canvas : {"auto", "gl", "image"}
        What the views are drawn on.
    scratch : Path, optional
        Where changes that have no file yet are autosaved.

    Attributes
    ----------
    title_changed : Signal(str)
        What to write over the window; an asterisk where something is not saved.
    """

    title_changed = Signal(str)

    def __init__(
        self,
        host: Host,
        model: Model | None = None,
        parent: QWidget | None = None,
        *,
        canvas: CanvasKind = "auto",
        scratch: Path | None = None,
    ) -> None:
        super().__init__(parent)
        self.setObjectName("trigpoint-panel")
        self.host = host
        self.model = model or Model()
        self.session = Session(self.model, scratch=scratch or scratch_folder())
        self.failure = ""
        self._bench = Bench()
        self._theme = ""
        self._closed = False
        self._keys: KeysWindow | None = None
        self.actions_by_name = make_actions(self)

        self.bar = Bar(self.actions_by_name, self)
        self.views = TwoViews(self.model, self, canvas=canvas)
        self.table = PairTable(self.model, self)
        self.totals = Totals(self)
        self.align_tab = AlignTab(self.model, self)
        self.errors_tab = ErrorsTab(self.model, self)
        self.report_tab = ReportTab(self.model, self)
        self.foot = Foot(host.run, self)
        self.desk = Desk(host, self.model, self.session, self.views, self.foot)
        self._lay_out()

        self._autosave = QTimer(self)
        self._autosave.setSingleShot(True)
        self._autosave.setInterval(AUTOSAVE_MS)
        self._autosave.timeout.connect(self.desk.autosave)
        self._connect()
        # A theme arrives palette by palette: once they have all come is soon enough.
        self._restyle = QTimer(self)
        self._restyle.setSingleShot(True)
        self._restyle.timeout.connect(self.restyle)
        self.model.changed.append(self._model_changed)
        self.setAcceptDrops(True)
        self.restyle()
        self.refresh()

    # What can be done --------------------------------------------------------------------------

    @property
    def line(self) -> StateLine:
        """Where things stand."""
        return state_line(self.model, running=self.foot.running, failure=self.failure)

    def action(self, name: str) -> Any:
        """Return one of the actions of `trigpoint_panel.actions`."""
        return self.actions_by_name[name]

    def open_cloud(self, side: Side, path: Path | str) -> Job:
        """Open a cloud on one side."""
        return self.desk.open_cloud(side, Path(path).absolute())

    def open_session(self, path: Path | str) -> Job:
        """Open a session or a project.toml."""
        return self.desk.open_session(Path(path).absolute())

    def open_demo(self, folder: Path | None = None) -> Job:
        """Make the clock tower, unless it is there, and open it."""
        place = folder or demo_folder()
        project = place / "project.toml"

        def work(tick: Tick) -> Path:
            if not project.is_file():
                from trigpoint.synthetic import clock_tower, write_project

                tick(None, "Building the clock tower and its three sensors")
                write_project(place, clock_tower())
            return project

        job = self._begin(Job("Making the clock tower", work))
        job.done.connect(self.open_session)
        return job

    def compare(self) -> Job | None:
        """Measure accuracy and completeness of the source as the views show it."""
        source, target = self.views.opened["source"], self.views.opened["target"]
        similarity, state = self.model.similarity, self.model.state
        if source is None or target is None or similarity is None:
            return None
        asked = question(self.model)
        job = Job(
            "Comparing",
            lambda tick: self._bench.compare(tick, state, similarity, source.cloud, target.cloud),
        )
        job.done.connect(
            lambda findings: self._compared(findings, asked, {"source": source, "target": target})
        )
        self.tabs.setCurrentWidget(self.errors_tab)
        return self._begin(job)

    def try_icp(self) -> Job | None:
        """Put ICP on trial on the fit."""
        alignment, state = self.model.fit.alignment, self.model.state
        if alignment is None:
            return None
        job = Job("ICP", lambda tick: self._bench.try_icp(tick, state, alignment))
        job.done.connect(lambda trial: self.align_tab.set_trial(trial, alignment))
        self.tabs.setCurrentWidget(self.align_tab)
        return self._begin(job)

    def make_report(self) -> Job | None:
        """Write the project, and run the audit on it in a process of its own."""
        self.report_tab.take_limitations()
        self.tabs.setCurrentWidget(self.report_tab)
        if not self.desk.project_written():
            return None
        project, python = self.model.state.project, self.host.python()
        asked = self.model.state
        job = Job("Audit", lambda tick: audit(tick, python, project))
        job.done.connect(lambda audited: self._audited(audited, asked))
        return self._begin(job)

    def cancel(self) -> bool:
        """Give up on what runs; tell whether anything did."""
        return self.foot.cancel()

    def shutdown(self) -> None:
        """Stop everything and free what the views hold; may be called again."""
        if self._closed:
            return
        self._closed = True
        self._autosave.stop()
        self.session.leave()
        self.foot.cancel()
        self.model.changed.remove(self._model_changed)
        if self._keys is not None:
            self._keys.close()
        self.views.shutdown()

    def refresh(self) -> None:
        """Show what the model holds now."""
        self.table.refresh()
        self.totals.refresh(self.model)
        self.views.refresh()
        self._show_state()
        self.title_changed.emit(self.title)

    @property
    def title(self) -> str:
        """The session's name, with an asterisk where something is not saved."""
        return f"{self.session.name}{' *' if self.session.is_modified else ''}"

    def restyle(self) -> None:
        """Take over the colours of the theme that the panel is shown in."""
        theme = theme_of(self)
        if theme != self._theme:
            self._theme = theme
            self.setStyleSheet(sheet(look_of(self)))
            self.bar.restyle(look_of(self))

    # How it is laid out ------------------------------------------------------------------------

    def _lay_out(self) -> None:
        self.tabs = QTabWidget(self)
        self.tabs.setDocumentMode(True)
        for name, tab in (
            ("Align", self.align_tab),
            ("Errors", self.errors_tab),
            ("Report", self.report_tab),
        ):
            self.tabs.addTab(tab, name)
        widest = max(tab.needed for tab in (self.align_tab, self.errors_tab, self.report_tab))
        self.tabs.setMinimumWidth(widest)
        under = QWidget(self)
        column = QVBoxLayout(under)
        column.setContentsMargins(0, 0, 0, 0)
        column.setSpacing(0)
        column.addWidget(self.table, 1)
        column.addWidget(self.totals)
        self.upright = QSplitter(Qt.Orientation.Vertical, self)
        self.upright.addWidget(self.views)
        self.upright.addWidget(under)
        self.upright.setStretchFactor(0, 3)
        self.upright.setStretchFactor(1, 1)
        self.upright.setSizes([470, 200])
        self.upright.setChildrenCollapsible(False)
        self.across = QSplitter(Qt.Orientation.Horizontal, self)
        self.across.addWidget(self.upright)
        self.across.addWidget(self.tabs)
        self.across.setStretchFactor(0, 1)
        self.across.setStretchFactor(1, 0)
        self.across.setSizes([1030, max(336, widest)])
        self.across.setCollapsible(0, False)
        whole = QVBoxLayout(self)
        whole.setContentsMargins(0, 0, 0, 0)
        whole.setSpacing(0)
        whole.addWidget(self.bar)
        whole.addWidget(self.across, 1)
        line = QFrame(self)
        line.setObjectName("rule")
        line.setFixedHeight(1)
        whole.addWidget(line)
        whole.addWidget(self.foot)
        self.setMinimumSize(480, 320)

    def _connect(self) -> None:
        model, desk, views = self.model, self.desk, self.views
        does: dict[str, Callable[[], object]] = {
            "open_source": partial(desk.ask_cloud, "source"),
            "open_target": partial(desk.ask_cloud, "target"),
            "undo": model.undo,
            "redo": model.redo,
            "swap": views.target.swap,
            "escape": self._escape,
            "delete": lambda: model.delete(self.table.chosen()),
            "role": self._cycle_role,
            "new_pair": self._type_pair,
            "next_pair": partial(self._walk, 1),
            "previous_pair": partial(self._walk, -1),
            "ghost": self._fly_to_ghost,
            "fit_view": views.fit,
            "front": partial(views.look, "front"),
            "right": partial(views.look, "right"),
            "top": partial(views.look, "top"),
            "larger": partial(self._resize_points, 1),
            "smaller": partial(self._resize_points, -1),
            "open_session": desk.ask_session,
            "save": desk.save,
            "save_as": partial(desk.save, elsewhere=True),
            "write_project": desk.ask_project,
            "choose_crs": desk.choose_crs,
            "import_picks": desk.ask_picks,
            "import_source": partial(desk.ask_points, "source"),
            "import_target": partial(desk.ask_points, "target"),
            "export_picks": desk.ask_export,
            "save_aligned": desk.save_aligned,
            "second_begin": model.begin_second_operator,
            "second_adopt": partial(self._end_second, adopt=True),
            "second_keep": partial(self._end_second, adopt=False),
            "second_cancel": model.cancel_second_operator,
            "compare": self.compare,
            "icp": self.try_icp,
            "report": self.make_report,
            "demo": self.open_demo,
            "help": self._show_keys,
        }
        switches: dict[str, Callable[[bool], object]] = {
            "pick": views.set_picking,
            "link": views.set_linked,
            "overlay": views.set_overlaid,
            "next_places": views.show_next,
            "pane": self.tabs.setVisible,
            "eye_dome": self._set_eye_dome,
            "parallel": views.set_parallel,
        }
        for name, act in does.items():
            self.actions_by_name[name].triggered.connect(partial(self._do, name, act))
        for name, switch in switches.items():
            self.actions_by_name[name].toggled.connect(switch)
        assert {*does, *switches} == set(COMMANDS)
        for side in SIDES:
            view = views.view(side)
            view.picked.connect(partial(self._picked, side))
            view.refused.connect(partial(self.host.message, "info"))
            view.dropped.connect(lambda path, side=side: desk.open_dropped(Path(path), side))
        views.hovered.connect(self.foot.where.setText)
        views.clouds_changed.connect(self._drop_findings)
        self.bar.snap_changed.connect(views.set_snap)
        views.target.set_overlay_opacity(OPACITY)
        self.table.flown.connect(self._fly)
        self.table.refused.connect(partial(self.host.message, "error"))
        self.table.role_wanted.connect(self._cycle_role)
        self.align_tab.icp_wanted.connect(self.try_icp)
        self.align_tab.save_wanted.connect(desk.save_aligned)
        self.align_tab.place_wanted.connect(views.fly_to_target)
        self.errors_tab.compare_wanted.connect(self.compare)
        self.errors_tab.zone_chosen.connect(self._isolate)
        self.report_tab.report_wanted.connect(self.make_report)
        self.report_tab.document_wanted.connect(self.host.open_document)
        for tab in (self.align_tab, self.errors_tab, self.report_tab):
            tab.refused.connect(partial(self.host.message, "error"))
        self.action("overlay").toggled.connect(lambda _: self._show_state())
        self.foot.changed.connect(self._show_state)
        self.foot.went_on.connect(lambda: self.foot.show_line(self.line))

    # What happens ------------------------------------------------------------------------------

    def _model_changed(self) -> None:
        self.failure = ""
        self.refresh()
        self._autosave.start()

    def _show_state(self) -> None:
        """Show the state line, and enable what goes with it."""
        line, model = self.line, self.model
        self.foot.show_line(line)
        for name, command in COMMANDS.items():
            if command.needs:
                self.actions_by_name[name].setEnabled(command.needs in line.enabled)
        undo, redo = self.action("undo"), self.action("redo")
        for action, word, text in (
            (undo, "Undo", model.undo_text),
            (redo, "Redo", model.redo_text),
        ):
            action.setEnabled(bool(text) and self.foot.running is None)
            said = f"{word} {text[:1].lower()}{text[1:]}" if text else word
            action.setToolTip(f"{said} ({action.shortcut().toString()})")
            action.setStatusTip(said)
        second = model.state.is_second_operator
        self.action("second_begin").setEnabled(bool(model.pairs) and not second)
        for name in ("second_adopt", "second_keep", "second_cancel"):
            self.action(name).setEnabled(second)
        self.action("export_picks").setEnabled(bool(model.pairs))
        for name in ("link", "overlay"):
            action = self.action(name)
            if action.isChecked() and model.similarity is None:
                action.setChecked(False)  # there is nothing to tie or to carry it by
        self.action("swap").setEnabled(self.action("overlay").isChecked())
        both = all(each is not None for each in self.views.opened.values())
        self.align_tab.refresh(can_run="errors" in line.enabled and both)
        self.errors_tab.refresh(can_run="errors" in line.enabled and both)
        self.report_tab.refresh(can_run="report" in line.enabled)

    def _do(self, name: str, act: Callable[[], object], *_: object) -> None:
        try:
            act()
        except (TrigpointError, OSError) as error:
            self.host.message("error", f"{COMMANDS[name].text.rstrip('…')}: {told(error)}")

    def _begin(self, job: Job) -> Job:
        job.failed.connect(self._failed)
        return self.foot.begin(job)

    def _failed(self, text: str, details: str) -> None:
        self.failure = text
        self.host.message("error", text, details)
        self._show_state()

    def _picked(self, side: Side, picked: Picked) -> None:
        try:
            placed = self.model.place(side, picked.xyz, sigma=picked.sigma, note=picked.note)
        except TrigpointError as error:
            self.host.message("error", str(error))
            return
        if placed.warning:
            text = f"{placed.id} in the {side}: {placed.warning}"
            keep: tuple[str, Callable[[], object]] = ("Keep", lambda: None)
            self.host.message("warning", text, "", (keep, ("Undo", self.model.undo)))

    def _escape(self) -> None:
        if self.cancel() or self.model.drop_open_half() is not None:
            return
        self.action("pick").setChecked(False)

    def _cycle_role(self) -> None:
        names = self.table.chosen() or [p.id for p in (self.model.selected,) if p is not None]
        self.model.cycle_role(names)

    def _type_pair(self) -> None:
        name = self.model.new_pair()
        self.table.setFocus()
        index = self.table.index_of(name, "source_x")
        self.table.setCurrentIndex(index)
        self.table.edit(index)

    def _walk(self, step: int) -> None:
        self.model.select_next(step)
        if self.model.selected is not None:
            self.views.fly_to(self.model.selected)

    def _fly(self, name: str) -> None:
        self.model.select(name)
        if self.model.selected is not None:
            self.views.fly_to(self.model.selected)

    def _fly_to_ghost(self) -> None:
        ghost = self.model.ghost()
        if ghost is None:
            self.host.message(
                "info", "There is no ghost: it needs a fit, and a pair with one half open."
            )
        else:
            self.views.view(ghost.side).fly_to(ghost.xyz)

    def _resize_points(self, step: int) -> None:
        size = float(self.host.setting("view/point_size", 2.0))
        at = min(range(len(SIZES)), key=lambda i: abs(SIZES[i] - size))
        size = SIZES[min(max(at + step, 0), len(SIZES) - 1)]
        self.host.set_setting("view/point_size", size)
        for side in SIDES:
            self.views.view(side).set_point_size(size)

    def _set_eye_dome(self, on: bool) -> None:
        for side in SIDES:
            self.views.view(side).set_eye_dome(on)

    def _end_second(self, *, adopt: bool) -> None:
        found = self.model.end_second_operator(adopt=adopt)
        self.host.message("success", found.statement)

    def _compared(
        self, findings: Findings, asked: object, measured: dict[Side, Opened | None]
    ) -> None:
        if any(measured[side] is not self.views.opened[side] for side in SIDES):
            self.host.message("info", "Another cloud was opened meanwhile: compare again.")
            return
        self.views.set_findings(findings)
        self.errors_tab.set_findings(findings, asked)

    def _drop_findings(self) -> None:
        """Forget distances and zones: they were one for each point of a cloud that has gone."""
        if self.errors_tab.findings is None:
            return
        self.errors_tab.set_findings(None)
        self.views.set_findings(None)
        for side in SIDES:
            self.views.view(side).isolate(None)

    def _isolate(self, zone: str | None) -> None:
        findings = self.errors_tab.findings
        if findings is not None:
            self.views.isolate(findings, zone)

    def _audited(self, audited: Audited, asked: State) -> None:
        self.model.mark_reported(asked)
        self.report_tab.set_audited(audited)
        documents = audited.documents
        ways: list[tuple[str, Callable[[], object]]] = [
            (f"Open {path.suffix[1:].upper()}", partial(self.host.open_document, path))
            for path in documents
        ]
        text = f"The report is done: {audited.verdict}. It is in {audited.folder}."
        self.host.message("success", text, "", ways)
        self.host.add_layer(audited.folder, "bundle")
        if documents and self.report_tab.opens.isChecked():
            self.host.open_document(documents[0])

    def _show_keys(self) -> None:
        if self._keys is None:
            self._keys = KeysWindow(self)
        self._keys.show()
        self._keys.raise_()

    # What Qt asks ------------------------------------------------------------------------------

    def keyPressEvent(self, event: QKeyEvent) -> None:
        """Take the keys that are held or that buttons need too: Z and Space."""
        if event.key() == Qt.Key.Key_Z and not event.modifiers():
            if not event.isAutoRepeat():
                self.views.magnify(True)
            event.accept()
        elif event.key() == Qt.Key.Key_Space and not _is_typing(self.focusWidget()):
            self._cycle_role()
            event.accept()
        else:
            super().keyPressEvent(event)

    def keyReleaseEvent(self, event: QKeyEvent) -> None:
        """Let the magnifier go."""
        if event.key() == Qt.Key.Key_Z and not event.isAutoRepeat():
            self.views.magnify(False)
            event.accept()
        else:
            super().keyReleaseEvent(event)

    def changeEvent(self, event: QEvent) -> None:
        """Follow the theme, and let the magnifier go when another window comes to the front."""
        super().changeEvent(event)
        if event.type() == QEvent.Type.PaletteChange and hasattr(self, "_restyle"):
            self._restyle.start()
        elif event.type() == QEvent.Type.ActivationChange and not self._closed:
            self.views.magnify(False)

    def dragEnterEvent(self, event: QDragEnterEvent) -> None:
        """Take files."""
        if event.mimeData().hasUrls():
            event.acceptProposedAction()

    def dropEvent(self, event: QDropEvent) -> None:
        """Open the files that were dropped."""
        for url in event.mimeData().urls():
            if url.isLocalFile():
                self.desk.open_dropped(Path(url.toLocalFile()))
        event.acceptProposedAction()


class Totals(QWidget):
    """What stands under the table: the three errors that sum it up, and the layout's verdict."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        row = QHBoxLayout(self)
        row.setContentsMargins(8, 3, 8, 3)
        row.setSpacing(14)
        self.numbers, self.layout_verdict = QLabel(self), QLabel(self)
        self.numbers.setWordWrap(True)  # in a narrow dock they take two lines
        row.addWidget(self.numbers, 1)
        row.addWidget(self.layout_verdict)

    def refresh(self, model: Model) -> None:
        """Take over what the model holds now."""
        fit = model.fit
        used = int(fit.table["used"].sum())
        parts = (
            f"RMSE control {_metres(fit.rmse_m)} ({used} of {fit.controls})",
            f"check {_metres(fit.check_rmse_m)} ({fit.checks})",
            f"leave-one-out {_metres(fit.loocv_rmse_m)}",
        )
        self.numbers.setText("   ".join(part.replace(" ", NO_BREAK) for part in parts))
        words = {"sound": "Layout: sound", "weak": "Layout: weak", "refused": "Layout: refused"}
        levels = {"sound": "success", "weak": "warning", "refused": "error"}
        say(self.layout_verdict, words.get(fit.geometry, ""), levels.get(fit.geometry, ""))
        self.layout_verdict.setToolTip(fit.statement)


def scratch_folder() -> Path:
    """Return where changes that have no file yet are autosaved."""
    place = QStandardPaths.writableLocation(QStandardPaths.StandardLocation.GenericDataLocation)
    return Path(place or tempfile.gettempdir()) / "trigpoint" / "unsaved"


def demo_folder() -> Path:
    """Return where the clock tower is kept."""
    return scratch_folder().parent / "demo"


def _is_typing(widget: QWidget | None) -> bool:
    return isinstance(widget, QLineEdit | QPlainTextEdit | QAbstractSpinBox)


def _metres(value: float) -> str:
    return "n/a" if math.isnan(value) else f"{value:.3f} m"
