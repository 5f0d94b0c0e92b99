import json
import os
import sys
import time
from dataclasses import replace

import pytest

pytest.importorskip("qtpy", reason="the panel's packages are not installed", exc_type=ImportError)

from trigpoint_panel import auditing
from trigpoint_panel.auditing import AuditError, audit
from trigpoint_panel.jobs import CancelledError
from trigpoint_panel.state import BLANK

DONE = {"audits": [{"path": "/a/b", "zip": "/a/b.zip", "results": {"verdict": "PASS"}}]}


@pytest.fixture
def stand_in(tmp_path):
    """Make a command that stands in for the interpreter, and does what a script says."""

    def make(script):
        path = tmp_path / "stand_in.py"
        path.write_text(f"import os, sys, time\n{script}", "utf-8")
        return (sys.executable, str(path))

    return make


def test_steps_are_passed_on_and_never_go_back(stand_in):
    steps = ["reference: reading", "nerf: reading", "executing the notebook", "writing report.pdf"]
    script = f"for s in {steps}: print(s, file=sys.stderr, flush=True)\nprint({json.dumps(DONE)!r})"
    told = []
    found = audit(lambda share, text: told.append((share, text)), stand_in(script), BLANK)
    assert found.verdict == "PASS"
    assert found.documents == ()
    shares = [share for share, _ in told]
    assert shares == sorted(shares)
    assert shares[-1] == 0.9
    assert list(dict.fromkeys(text for _, text in told)) == ["Starting the audit", *steps]


def test_the_command_line_s_own_sentence_comes_through(stand_in):
    said = json.dumps({"error": {"code": "crs", "message": "lidar.laz has no CRS."}})
    with pytest.raises(AuditError, match=r"^lidar\.laz has no CRS\.$"):
        audit(lambda *_: None, stand_in(f"print({said!r}); sys.exit(2)"), BLANK)


def test_a_process_that_breaks_down_is_told_with_its_last_words(stand_in):
    with pytest.raises(AuditError, match=r"broke down \(exit code 3\): no more memory\."):
        audit(lambda *_: None, stand_in("sys.stderr.write('no more memory'); sys.exit(3)"), BLANK)


@pytest.mark.skipif(os.name != "posix", reason="process groups are POSIX's")
def test_a_cancel_ends_the_process_and_its_own_children(stand_in, tmp_path):
    script = (
        "import subprocess\n"
        "child = subprocess.Popen([sys.executable, '-c', 'import time; time.sleep(60)'])\n"
        f"open({str(tmp_path / 'pids')!r}, 'w').write(f'{{os.getpid()}} {{child.pid}}')\n"
        "print('reading', file=sys.stderr, flush=True)\n"
        "time.sleep(60)\n"
    )

    def tick(_share, text):
        if text == "reading":
            raise CancelledError

    begun = time.monotonic()
    with pytest.raises(CancelledError):
        audit(tick, stand_in(script), BLANK)
    assert time.monotonic() - begun < 20
    for pid in map(int, (tmp_path / "pids").read_text().split()):
        end = time.monotonic() + 5
        while _runs(pid) and time.monotonic() < end:
            time.sleep(0.05)
        assert not _runs(pid)


@pytest.mark.skipif(os.name != "posix", reason="signals are POSIX's")
def test_a_process_too_busy_to_clear_up_leaves_nothing_half_written(
    stand_in, tmp_path, monkeypatch
):
    monkeypatch.setattr(auditing, "GRACE", 0.2)
    draft = tmp_path / "audit" / f".{BLANK.about.id}-r{BLANK.about.revision}.draft"
    script = (
        "import signal\n"
        "signal.signal(signal.SIGINT, signal.SIG_IGN)\n"
        f"os.makedirs({str(draft / 'data')!r})\n"
        "print('writing', file=sys.stderr, flush=True)\n"
        "time.sleep(60)\n"
    )

    def tick(_share, text):
        if text == "writing":
            assert draft.is_dir()
            raise CancelledError

    with pytest.raises(CancelledError):
        audit(tick, stand_in(script), replace(BLANK, path=tmp_path / "project.toml"))
    assert list((tmp_path / "audit").iterdir()) == []


def test_the_host_s_own_settings_of_python_stay_behind(stand_in, monkeypatch):
    monkeypatch.setenv("PYTHONHOME", "/nowhere")
    script = f"assert 'PYTHONHOME' not in os.environ\nprint({json.dumps(DONE)!r})"
    assert audit(lambda *_: None, stand_in(script), BLANK).verdict == "PASS"


def _runs(pid):
    try:
        with open(f"/proc/{pid}/stat") as file:  # noqa: PTH123
            return file.read().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False
