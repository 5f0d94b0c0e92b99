"""The foot of the panel: where things stand, what runs, and the way to stop it."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable

from qtpy.QtCore import Qt, Signal
from qtpy.QtWidgets import QHBoxLayout, QLabel, QProgressBar, QPushButton, QWidget

from trigpoint_panel.elided import ElidedLabel
from trigpoint_panel.forms import say
from trigpoint_panel.jobs import Job
from trigpoint_panel.stateline import Running, StateLine

LEVELS = {"info": "", "good": "success", "amber": "warning", "red": "error"}


class Foot(QWidget):
    """The state line, and the jobs: one runs, the others wait for it.

    Attributes
    ----------
    running : Running or None
        As the state line tells it.
    changed : Signal()
        A job began or ended.
    went_on : Signal()
        A job has told how far it is.
    """

    changed = Signal()
    went_on = Signal()

    def __init__(self, run: Callable[[Job], object], parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._run = run
        self._waiting: deque[Job] = deque()
        self.job: Job | None = None
        self.running: Running | None = None
        row = QHBoxLayout(self)
        row.setContentsMargins(8, 3, 8, 3)
        row.setSpacing(8)
        self.word = QLabel(self)
        self.word.setObjectName("word")
        row.addWidget(self.word)
        self.line = ElidedLabel(self)
        self.line.setTextInteractionFlags(Qt.TextInteractionFlag.TextSelectableByMouse)
        self.line.setMinimumHeight(self.fontMetrics().height() + 8)
        row.addWidget(self.line, 1)
        self.where = QLabel(self)
        self.where.setProperty("role", "faint")
        row.addWidget(self.where)
        self.bar = QProgressBar(self)
        self.bar.setFixedWidth(180)
        self.bar.setTextVisible(False)
        self.bar.hide()
        row.addWidget(self.bar)
        self.stop = QPushButton("Cancel", self)
        self.stop.clicked.connect(lambda *_: self.cancel())
        self.stop.hide()
        row.addWidget(self.stop)

    def show_line(self, line: StateLine) -> None:
        """Show where things stand."""
        word = f"{line.word}:" if line.word else ""
        say(self.word, word, LEVELS[line.level])
        self.line.setText(line.text)
        self.line.setToolTip(line.text)
        self.setAccessibleDescription(f"{word} {line.text}".lstrip())

    def begin(self, job: Job) -> Job:
        """Run a job, after those that are there already."""
        self._waiting.append(job)
        self._next()
        return job

    def cancel(self) -> bool:
        """Give up on what runs, and on what waits; tell whether there was anything."""
        was = self.job is not None
        waiting, self._waiting = self._waiting, deque()
        if self.job is not None:
            self.job.cancel()
        for job in waiting:
            job.cancel()
        return was

    def _next(self) -> None:
        if self.job is not None or not self._waiting:
            return
        job = self.job = self._waiting.popleft()
        self.running = Running(job.title)
        self.bar.setRange(0, 0)
        self.bar.show()
        self.stop.show()
        job.progress.connect(self._progress)
        job.ended.connect(self._ended)
        self.changed.emit()
        self._run(job)

    def _progress(self, share: float, text: str) -> None:
        if self.job is None:
            return
        known = share >= 0
        self.bar.setRange(0, 1000 if known else 0)
        self.bar.setValue(int(1000 * share) if known else 0)
        self.running = Running(text or self.job.title, share if known else None)
        self.went_on.emit()

    def _ended(self) -> None:
        self.job, self.running = None, None
        self.bar.hide()
        self.stop.hide()
        self.changed.emit()
        self._next()
