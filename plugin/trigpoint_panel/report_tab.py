"""The Report tab: who and what for, the audit in a process of its own, and what it left."""

from __future__ import annotations

import datetime as dt
from functools import partial

from qtpy.QtCore import Signal
from qtpy.QtWidgets import (
    QCheckBox,
    QComboBox,
    QLabel,
    QLineEdit,
    QPlainTextEdit,
    QSpinBox,
    QWidget,
)

from trigpoint_panel.auditing import Audited
from trigpoint_panel.forms import Tab, quietly, say, show_text
from trigpoint_panel.host import Level
from trigpoint_panel.model import Model

FIELDS = {
    "title": "Title",
    "site": "Site",
    "client": "Client",
    "surveyor": "Surveyor",
    "organisation": "Organisation",
    "purpose": "Purpose",
}
LEVELS: dict[str, Level] = {
    "PASS": "success",
    "CONDITIONAL": "warning",
    "FAIL": "error",
    "NOT TESTED": "info",
}


class ReportTab(Tab):
    """What the report says of the project, and the way to it.

    Attributes
    ----------
    report_wanted : Signal()
    document_wanted : Signal(object)
        The path of a document or folder that is to be opened.
    """

    report_wanted = Signal()
    document_wanted = Signal(object)

    def __init__(self, model: Model, parent: QWidget | None = None) -> None:
        super().__init__("report", parent)
        self._model = model
        self._audited: Audited | None = None

        self.heading("Audit and report")
        self.about = self.sentence(
            "The same audit as the command trigpoint audit: project.toml and picks.csv are "
            "written, and the report made of them.",
            faint=True,
        )
        (self.make,) = self.buttons(("Make the report", self.report_wanted.emit))
        self.icp = QCheckBox("Put rigid ICP on trial", self.inside)
        self.column.addWidget(self.icp)
        self.intervals = QCheckBox("Work out intervals", self.inside)
        self.column.addWidget(self.intervals)
        self.opens = QCheckBox("Open it when it is done", self.inside)
        self.opens.setChecked(True)
        self.column.addWidget(self.opens)
        self.verdict = self.sentence()
        self.warnings = self.sentence(faint=True)
        self.place = self.sentence(faint=True)
        self.html, self.pdf, self.folder = self.buttons(
            ("Report", partial(self._open, "report.html")),
            ("PDF", partial(self._open, "report.pdf")),
            ("Folder", partial(self._open, "")),
        )

        self.heading("What the report says")
        form = self.form()
        self.identity = QLineEdit(self.inside)
        self.identity.setToolTip("Names the bundle: letters, digits, '.', '_' and '-'.")
        form.addRow("Id", self.identity)
        self.fields = {key: QLineEdit(self.inside) for key in FIELDS}
        for key, label in FIELDS.items():
            form.addRow(label, self.fields[key])
        self.date = QLineEdit(self.inside)
        self.date.setPlaceholderText("YYYY-MM-DD")
        self.date.setToolTip("Of the report; an issued one needs it.")
        form.addRow("Date", self.date)
        self.status = QComboBox(self.inside)
        self.status.addItems(["draft", "issued"])
        self.status.setToolTip("What is issued is never overwritten.")
        form.addRow("Status", self.status)
        self.revision = QSpinBox(self.inside)
        self.revision.setRange(1, 9999)
        self.revision.setKeyboardTracking(False)
        form.addRow("Revision", self.revision)
        self.limitations = QPlainTextEdit(self.inside)
        self.limitations.setAccessibleName("Limitations")
        self.limitations.setPlaceholderText("In a person's words")
        self.limitations.setTabChangesFocus(True)
        self.limitations.setFixedHeight(4 * self.fontMetrics().height() + 10)
        above = QLabel("Limitations", self.inside)
        above.setBuddy(self.limitations)
        form.addRow(above)
        form.addRow(self.limitations)
        self.column.addStretch(1)

        for box, key in ((self.icp, "icp"), (self.intervals, "intervals")):
            box.toggled.connect(partial(self._set_comparison, key))
        self.identity.editingFinished.connect(partial(self._set, "id", self.identity))
        for key, field in self.fields.items():
            field.editingFinished.connect(partial(self._set, key, field))
        self.date.editingFinished.connect(self._set_date)
        self.status.currentTextChanged.connect(
            lambda text: self.change(model.set_about, status=str(text))
        )
        self.revision.valueChanged.connect(lambda n: self.change(model.set_about, revision=int(n)))
        self.refresh(can_run=False)

    def refresh(self, *, can_run: bool) -> None:
        """Take over what the model holds now; `can_run`: clouds are there, nothing runs."""
        about = self._model.state.about
        show_text(self.identity, about.id)
        for key, field in self.fields.items():
            show_text(field, getattr(about, key))
            field.setToolTip(field.text())  # whole, where the field is too short for it
        show_text(self.date, "" if about.date is None else about.date.isoformat())
        settings = self._model.state.comparison
        with quietly(self.icp, self.intervals):
            self.icp.setChecked(settings.icp)
            self.intervals.setChecked(settings.intervals)
        with quietly(self.status, self.revision):
            self.status.setCurrentText(about.status)
            self.revision.setValue(about.revision)
        if self.limitations.toPlainText() != about.limitations and not self.limitations.hasFocus():
            with quietly(self.limitations):
                self.limitations.setPlainText(about.limitations)
        self.make.setEnabled(can_run)
        self._show()

    def take_limitations(self) -> None:
        """Take what is typed of limitations; a plain field tells nobody when it is left."""
        text = self.limitations.toPlainText().strip()
        if text != self._model.state.about.limitations:
            self.change(self._model.set_about, limitations=text)

    def set_audited(self, audited: Audited | None) -> None:
        """Show what an audit left; None: there is nothing."""
        self._audited = audited
        self._show()

    @property
    def audited(self) -> Audited | None:
        """What the last audit left."""
        return self._audited

    def _show(self) -> None:
        audited = self._audited
        documents = () if audited is None else tuple(path.name for path in audited.documents)
        for button, name in ((self.html, "report.html"), (self.pdf, "report.pdf")):
            button.setVisible(audited is not None)
            button.setEnabled(name in documents)
        self.folder.setVisible(audited is not None)
        if audited is None:
            say(self.verdict, "")
            say(self.warnings, "")
            say(self.place, "")
            return
        stale = " Made before the pairs changed: run again." if self._model.is_stale else ""
        # Its colour stays: what failed has not become better by moving a pair.
        say(self.verdict, told(audited) + stale, LEVELS.get(audited.verdict, ""))
        say(self.warnings, _listed(audited))
        say(self.place, str(audited.folder))

    def _set(self, key: str, field: QLineEdit) -> None:
        field.setModified(False)
        if field.text() != getattr(self._model.state.about, key):
            self.change(self._model.set_about, **{key: field.text().strip()})
            self.refresh(can_run=self.make.isEnabled())  # what was refused goes back

    def _set_comparison(self, key: str, on: bool) -> None:
        self.change(self._model.set_comparison, **{key: on})

    def _set_date(self) -> None:
        self.date.setModified(False)
        text = self.date.text().strip()
        try:
            date = dt.date.fromisoformat(text) if text else None
        except ValueError:
            self.refused.emit(f"{text!r} is no date: write it as 2026-09-21.")
            return
        if date != self._model.state.about.date:
            self.change(self._model.set_about, date=date)

    def _open(self, name: str) -> None:
        if self._audited is not None:
            self.document_wanted.emit(self._audited.folder / name)


def told(audited: Audited) -> str:
    """Say what an audit found, in one sentence."""
    count = len(audited.results["warnings"])
    return f"Verdict: {audited.verdict}, with {count} warning{'' if count == 1 else 's'}."


def warnings_of(audited: Audited) -> list[str]:
    """Return what an audit warns of, each in its sentence."""
    return [str(each["message"]) for each in audited.results["warnings"]]


def _listed(audited: Audited) -> str:
    return "\n".join(f"• {each}" for each in warnings_of(audited))
