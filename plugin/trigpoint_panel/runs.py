"""The long work that the panel begins, and what becomes of it: comparison, ICP, report, demo."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path

from qtpy.QtCore import QObject, Signal
from qtpy.QtWidgets import QWidget

from trigpoint_panel.align_tab import AlignTab
from trigpoint_panel.auditing import Audited, audit
from trigpoint_panel.desk import Desk
from trigpoint_panel.errors_tab import ErrorsTab, question
from trigpoint_panel.foot import Foot
from trigpoint_panel.host import Host
from trigpoint_panel.jobs import Job, Tick
from trigpoint_panel.measuring import Bench, Findings
from trigpoint_panel.model import Model
from trigpoint_panel.opening import Opened
from trigpoint_panel.pairs import SIDES, Side
from trigpoint_panel.report_tab import LEVELS, ReportTab, told, warnings_of
from trigpoint_panel.state import State
from trigpoint_panel.views import TwoViews

Tabs = tuple[AlignTab, ErrorsTab, ReportTab]


class Runs(QObject):
    """Begins what takes long, and shows its outcome in its tab and in the views.

    Parameters
    ----------
    host : Host
    model : Model
    desk : Desk
        Opens the demo, and writes the project that is audited.
    views : TwoViews
    foot : Foot
        Runs the jobs.
    tabs : tuple of AlignTab, ErrorsTab, ReportTab
    show : callable
        Brings one of the tabs to the front.

    Attributes
    ----------
    failed : Signal(str)
        What went wrong, in one sentence that the user has been told.
    """

    failed = Signal(str)

    def __init__(
        self,
        host: Host,
        model: Model,
        desk: Desk,
        views: TwoViews,
        foot: Foot,
        tabs: Tabs,
        show: Callable[[QWidget], object],
    ) -> None:
        super().__init__(foot)
        self._host = host
        self._model = model
        self._desk = desk
        self._views = views
        self._foot = foot
        self._align_tab, self._errors_tab, self._report_tab = tabs
        self._show = show
        self._bench = Bench()

    def open_demo(self, folder: Path) -> Job:
        """Make the clock tower in a folder, unless it is there, and open it."""
        project = folder / "project.toml"

        def work(tick: Tick) -> Path:
            if not project.is_file():
                from trigpoint.synthetic import clock_tower, write_project

                tick(None, "Building the clock tower and its three sensors")
                write_project(folder, clock_tower())
            return project

        job = self.begin(Job("Making the clock tower", work))
        job.done.connect(self._desk.open_session)
        return job

    def compare(self) -> Job | None:
        """Measure accuracy and completeness of the source as the views show it."""
        source, target = self._views.opened["source"], self._views.opened["target"]
        similarity, state = self._model.similarity, self._model.state
        if source is None or target is None or similarity is None or not self._desk.are_as_opened():
            return None
        asked = question(self._model)
        job = Job(
            "Comparing",
            lambda tick: self._bench.compare(tick, state, similarity, source.cloud, target.cloud),
        )
        job.done.connect(
            lambda findings: self._compared(findings, asked, {"source": source, "target": target})
        )
        self._show(self._errors_tab)
        return self.begin(job)

    def try_icp(self) -> Job | None:
        """Put ICP on trial on the fit."""
        alignment, state = self._model.fit.alignment, self._model.state
        if alignment is None or not self._desk.are_as_opened():
            return None
        job = Job("ICP", lambda tick: self._bench.try_icp(tick, state, alignment))
        job.done.connect(lambda trial: self._align_tab.set_trial(trial, alignment))
        self._show(self._align_tab)
        return self.begin(job)

    def make_report(self) -> Job | None:
        """Write the project, and run the audit on it in a process of its own."""
        self._report_tab.take_limitations()
        self._show(self._report_tab)
        if not (self._desk.are_as_opened() and self._desk.project_written()):
            return None
        project, python = self._model.state.project, self._host.python()
        asked = self._model.state
        job = Job("Audit", lambda tick: audit(tick, python, project))
        job.done.connect(lambda audited: self._audited(audited, asked))
        return self.begin(job)

    def begin(self, job: Job) -> Job:
        """Begin a job, and tell of it where it fails."""
        job.failed.connect(self._tell)
        return self._foot.begin(job)

    def drop_findings(self) -> None:
        """Forget distances and zones: they were one for each point of a cloud that has gone."""
        if self._errors_tab.findings is None:
            return
        self._errors_tab.set_findings(None)
        self._views.set_findings(None)
        for side in SIDES:
            self._views.view(side).isolate(None)

    def isolate(self, zone: str | None) -> None:
        """Show one zone alone in both views; None shows all."""
        findings = self._errors_tab.findings
        if findings is not None:
            self._views.isolate(findings, zone)

    def _tell(self, text: str, details: str) -> None:
        self._host.message("error", text, details)
        self.failed.emit(text)

    def _compared(
        self, findings: Findings, asked: object, measured: dict[Side, Opened | None]
    ) -> None:
        if any(measured[side] is not self._views.opened[side] for side in SIDES):
            self._host.message("info", "Another cloud was opened meanwhile: compare again.")
            return
        self._views.set_findings(findings)
        self._errors_tab.set_findings(findings, asked)

    def _audited(self, audited: Audited, asked: State) -> None:
        self._model.mark_reported(asked)
        self._report_tab.set_audited(audited)
        documents = audited.documents
        ways: list[tuple[str, Callable[[], object]]] = [
            (f"Open {path.suffix[1:].upper()}", partial(self._host.open_document, path))
            for path in documents
        ]
        text = f"The report is done. {told(audited)} It is in {audited.folder}."
        level = LEVELS.get(audited.verdict, "info")
        self._host.message(level, text, "\n".join(warnings_of(audited)), ways)
        self._host.add_layer(audited.folder, "bundle")
        if documents and self._report_tab.opens.isChecked():
            self._host.open_document(documents[0])
