import threading
import time

import pytest

pytest.importorskip("qtpy", reason="the panel's packages are not installed", exc_type=ImportError)

from trigpoint.errors import PicksError
from trigpoint_panel import jobs
from trigpoint_panel.foot import Foot
from trigpoint_panel.jobs import Job, Pool


@pytest.fixture
def pool(qapp):
    assert qapp is not None
    made = Pool()
    yield made
    assert made.wait(5000)


def outcome(job):
    """Note every signal of a job, and the thread that it arrives in."""
    heard = []

    def note(name):
        return lambda *given: heard.append((name, given, threading.current_thread()))

    for name in ("progress", "done", "failed", "cancelled", "ended"):
        getattr(job, name).connect(note(name))
    return heard


def names(heard):
    return [name for name, _, _ in heard]


def test_work_runs_elsewhere_and_is_told_of_here(qtbot, pool):
    def work(tick):
        tick(0.5, "half")
        tick(None, "who knows")
        return threading.current_thread()

    job = Job("Sums", work)
    heard = outcome(job)
    pool.run(job)
    qtbot.waitUntil(lambda: "ended" in names(heard), timeout=5000)
    assert names(heard) == ["progress", "progress", "done", "ended"]
    assert heard[0][1] == (0.5, "half")
    assert heard[1][1][0] < 0
    assert heard[2][1][0] is not threading.main_thread()
    assert {thread for _, _, thread in heard} == {threading.main_thread()}


def test_a_foreseen_failure_is_one_sentence(qtbot, pool):
    def work(_tick):
        message = "Two picks\n are one."
        raise PicksError(message)

    job = Job("Sums", work)
    heard = outcome(job)
    pool.run(job)
    qtbot.waitUntil(lambda: "ended" in names(heard), timeout=5000)
    assert heard[0][:2] == ("failed", ("Two picks are one.", ""))
    assert isinstance(job.error, PicksError)


def test_an_unforeseen_failure_says_what_was_being_done_and_keeps_its_trace(qtbot, pool):
    job = Job("Sums", lambda _: 1 / 0)
    heard = outcome(job)
    pool.run(job)
    qtbot.waitUntil(lambda: "ended" in names(heard), timeout=5000)
    text, details = heard[0][1]
    assert text == "Something went wrong while doing this: Sums (division by zero)."
    assert "ZeroDivisionError" in details


@pytest.mark.parametrize("kind", [SystemExit, KeyboardInterrupt, GeneratorExit])
def test_work_that_leaves_its_thread_has_failed_and_keeps_nothing_busy(qtbot, pool, kind):
    def work(_tick):
        raise kind(3)

    foot = Foot(pool.run)
    qtbot.addWidget(foot)
    job = foot.begin(Job("Sums", work))
    heard = outcome(job)
    qtbot.waitUntil(lambda: "ended" in names(heard), timeout=5000)
    assert heard[0][1][0] == "Something went wrong while doing this: Sums (3)."
    assert job.settled
    assert foot.running is None
    assert foot.stop.isHidden()


def test_jobs_that_are_stuck_make_room_for_the_next_once_they_are_cancelled(
    qtbot, pool, monkeypatch
):
    monkeypatch.setattr(jobs, "GRACE", 0.1)
    go_on, foot = threading.Event(), Foot(pool.run)
    qtbot.addWidget(foot)
    stuck = []
    for _ in range(3):  # more than the pool has threads
        stuck.append(foot.begin(Job("Stuck", lambda _: go_on.wait(20))))
        qtbot.waitUntil(lambda: stuck[-1].working, timeout=5000)
        assert foot.cancel()
        assert foot.running is None
    job = foot.begin(Job("Sums", lambda _: 7))
    heard = outcome(job)
    qtbot.waitUntil(lambda: "ended" in names(heard), timeout=5000)
    assert heard[0][1] == (7,)
    assert not pool.wait(1000)  # three are still at it
    go_on.set()
    qtbot.waitUntil(lambda: all(each.settled for each in stuck), timeout=5000)


def test_a_job_cancelled_before_its_turn_does_nothing(qtbot):
    done = []
    job = Job("Sums", done.append)
    job.cancel()
    job.run()
    qtbot.waitUntil(lambda: job.settled, timeout=2000)
    assert done == []


def test_a_missing_file_is_named(qtbot, pool, tmp_path):
    job = Job("Sums", lambda _: (tmp_path / "gone").read_text())
    heard = outcome(job)
    pool.run(job)
    qtbot.waitUntil(lambda: "ended" in names(heard), timeout=5000)
    assert heard[0][1][0] == f"No such file or directory: {tmp_path / 'gone'}"


def test_a_cancel_is_told_at_once_and_stops_the_work_at_its_next_tick(qtbot, pool):
    stopped = threading.Event()

    def work(tick):
        try:
            for k in range(1000):
                tick(k / 1000)
                time.sleep(0.01)
        finally:
            stopped.set()

    job = Job("Sums", work)
    heard = outcome(job)
    pool.run(job)
    qtbot.waitUntil(lambda: "progress" in names(heard), timeout=5000)
    job.cancel()
    assert names(heard)[-2:] == ["cancelled", "ended"]
    assert stopped.wait(2)
    qtbot.waitUntil(lambda: job.settled, timeout=2000)
    assert names(heard).count("ended") == 1


def test_work_that_never_ticks_is_given_up_all_the_same(qtbot, pool):
    go_on = threading.Event()
    job = Job("Sums", lambda _: go_on.wait(5))
    heard = outcome(job)
    pool.run(job)
    job.cancel()
    go_on.set()
    qtbot.waitUntil(lambda: job.settled, timeout=5000)
    assert names(heard) == ["cancelled", "ended"]


def test_trap_projections_survive_threads_that_come_and_go(qtbot, pool):
    import pyproj

    kept = []
    for _ in range(4):
        job = Job("CRS", lambda _: kept.append(pyproj.CRS("EPSG:32615")))
        pool.run(job)
        qtbot.waitUntil(lambda job=job: job.settled, timeout=5000)
        assert job.error is None
    assert {crs.to_epsg() for crs in kept} == {32615}


def test_jobs_wait_for_each_other_and_one_cancel_ends_them_all(qtbot, pool):
    foot = Foot(pool.run)
    qtbot.addWidget(foot)
    begun = []

    def work(tick, name):
        begun.append(name)
        while True:
            tick(0.4, name)
            time.sleep(0.01)

    both = [foot.begin(Job(name, lambda tick, name=name: work(tick, name))) for name in "ab"]
    heard = [outcome(job) for job in both]
    qtbot.waitUntil(lambda: foot.running is not None and foot.running.share == 0.4, timeout=5000)
    assert foot.running.what == "a"
    assert not foot.bar.isHidden()
    assert foot.cancel()
    assert [names(each)[-1] for each in heard] == ["ended", "ended"]
    assert begun == ["a"]
    assert foot.job is None
    assert foot.bar.isHidden()
    assert not foot.cancel()
