"""Work off the GUI thread: a job that tells its progress, can be cancelled, and may fail."""

from __future__ import annotations

import threading
import traceback
from collections.abc import Callable
from typing import Any, Protocol

from qtpy.QtCore import QObject, QRunnable, QThreadPool, Signal

from trigpoint.errors import TrigpointError
from trigpoint_panel.advice import advised

# Seconds that cancelled work gets to hear of it before its thread goes on without it.
GRACE = 2.0


class CancelledError(Exception):
    """Raised inside a job's work when its user has cancelled it."""


class Tick(Protocol):
    """What a job's work calls as it goes: to tell how far it is, and to learn of a cancel."""

    def __call__(self, fraction: float | None, text: str = "") -> None:
        """Tell the share done, None where nobody knows, and what is being done."""
        ...


Work = Callable[[Tick], Any]


class Job(QObject):
    """One piece of work.

    It lives in the GUI thread; only its work runs elsewhere, so its signals arrive in the GUI
    thread. Whoever runs it calls `run` in a thread of its own. A cancelled job says so at once:
    work that hears of it late, or never, changes nothing any more.

    Attributes
    ----------
    title : str
        What is being done, as in "C2C: 41 %".
    error : BaseException or None
        What it failed of.
    progress : Signal(float, str)
        Share done, below zero where nobody knows, and what is being done.
    done : Signal(object)
        What the work returned.
    failed : Signal(str, str)
        What went wrong in one sentence, and the traceback where it was nobody's intention.
    cancelled, ended : Signal()
        The last comes once, after any of the three before it.
    """

    progress = Signal(float, str)
    done = Signal(object)
    failed = Signal(str, str)
    cancelled = Signal()
    ended = Signal()
    _told = Signal(float, str)
    _returned = Signal(object)
    _raised = Signal(str, str)
    _stopped = Signal()

    def __init__(self, title: str, work: Work) -> None:
        super().__init__()
        self.title = title
        self.settled = False  # the thread has said its last word
        self.error: BaseException | None = None  # what it failed of
        self._work: Work | None = work
        self._worker: threading.Thread | None = None
        self._asked_to_stop = False
        self._over = False
        self._told.connect(self._tell)
        self._returned.connect(self._return)
        self._raised.connect(self._fail)
        self._stopped.connect(self._stop)

    @property
    def running(self) -> bool:
        """Whether its outcome is still awaited."""
        return not self._over

    @property
    def working(self) -> bool:
        """Whether a thread is busy with it, awaited or not."""
        return self._worker is not None and self._worker.is_alive()

    def cancel(self) -> None:
        """Give up on it; to be called in the GUI thread."""
        self._asked_to_stop = True
        self._give_up()

    def tick(self, fraction: float | None, text: str = "") -> None:
        """Tell how far the work is; called by the work.

        Raises
        ------
        CancelledError
            If nobody waits for it any more.
        """
        if self._asked_to_stop:
            raise CancelledError
        self._told.emit(-1.0 if fraction is None else float(fraction), text)

    def run(self) -> None:
        """Do the work, in whatever thread this is called, and return when it is done.

        Work that was cancelled and hears nothing of it is left to itself after a while: the thread
        is needed for the next job.
        """
        # Not in this thread itself: Python forgets a thread of Qt's as soon as it leaves Python,
        # and with it pyproj's context, which the thread's next job would then find freed.
        self._worker = threading.Thread(target=self._do, name=self.title, daemon=True)
        self._worker.start()
        while self._worker.is_alive() and not self._asked_to_stop:
            self._worker.join(0.1)
        self._worker.join(GRACE)

    def _do(self) -> None:
        work, self._work = self._work, None  # what it holds goes with it
        assert work is not None
        try:
            if self._asked_to_stop:
                raise CancelledError
            found = work(self.tick)
        except CancelledError:
            self._stopped.emit()
        except (TrigpointError, OSError) as error:
            self.error = error
            self._raised.emit(told(error), "")
        except MemoryError as error:
            self.error = error
            self._raised.emit(f"{self.title}: there is not enough memory.", traceback.format_exc())
        except BaseException as error:  # SystemExit too, or its thread would end without a word
            self.error = error
            message = f"Something went wrong while doing this: {self.title} ({told(error)})."
            self._raised.emit(message, traceback.format_exc())
        else:
            self._returned.emit(found)

    def _tell(self, share: float, text: str) -> None:
        if self.running:
            self.progress.emit(share, text)

    def _return(self, found: object) -> None:
        self.settled = True
        if self._first():
            self.done.emit(found)
            self.ended.emit()

    def _fail(self, message: str, details: str) -> None:
        self.settled = True
        if self._first():
            self.failed.emit(message, details)
            self.ended.emit()

    def _stop(self) -> None:
        self.settled = True
        self._give_up()

    def _give_up(self) -> None:
        if self._first():
            self.cancelled.emit()
            self.ended.emit()

    def _first(self) -> bool:
        first, self._over = not self._over, True
        return first


class Pool:
    """Runs jobs in a few threads of its own."""

    def __init__(self, threads: int = 2) -> None:
        self._pool = QThreadPool()
        self._pool.setMaxThreadCount(threads)
        self._jobs: list[Job] = []

    def run(self, job: Job) -> None:
        """Start a job as soon as a thread is free."""
        # Held until its thread's last signal has arrived, however early its outcome stopped
        # mattering: a QObject must not die in, or under, the thread that signals through it.
        self._jobs = [each for each in self._jobs if not each.settled]
        self._jobs.append(job)
        self._pool.start(_Runnable(job))

    def wait(self, milliseconds: int) -> bool:
        """Cancel what runs, wait for the threads to end, and tell whether they have."""
        for job in self._jobs:
            job.cancel()
        ended = self._pool.waitForDone(milliseconds)
        return bool(ended) and not any(job.working for job in self._jobs)


class _Runnable(QRunnable):
    def __init__(self, job: Job) -> None:
        super().__init__()
        self._job = job

    def run(self) -> None:
        self._job.run()


def told(error: BaseException) -> str:
    """Return what an error says, as one sentence on one line."""
    if isinstance(error, OSError) and error.strerror:
        where = f": {error.filename}" if error.filename else ""
        return f"{error.strerror}{where}"
    said = " ".join(str(error).split())
    if isinstance(error, TrigpointError):
        said = advised(error.code, said)
    return said or type(error).__name__
