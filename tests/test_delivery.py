import hashlib
import signal
import subprocess
import sys

import pytest

from trigpoint import delivery
from trigpoint.delivery import (
    archive_of,
    check_writable,
    clear_draft,
    sha256,
    whole_folder,
    write_csv,
)
from trigpoint.errors import ProjectError


def contents(folder):
    return {
        path.relative_to(folder).as_posix(): path.read_text()
        for path in folder.rglob("*")
        if path.is_file()
    }


def test_a_folder_is_replaced_by_a_whole_one(tmp_path):
    for text in ("first", "second"):
        with whole_folder(tmp_path / "out" / "tower-r1") as draft:
            (draft / "data").mkdir()
            (draft / "data" / "a.txt").write_text(text)
    assert contents(tmp_path) == {"out/tower-r1/data/a.txt": "second"}


def test_a_failure_leaves_the_previous_folder_and_nothing_else(tmp_path):
    with whole_folder(tmp_path / "r1") as draft:
        (draft / "a.txt").write_text("first")
    with pytest.raises(KeyboardInterrupt), whole_folder(tmp_path / "r1") as draft:
        (draft / "a.txt").write_text("half")
        raise KeyboardInterrupt
    assert contents(tmp_path) == {"r1/a.txt": "first"}


def test_a_kill_leaves_the_previous_folder_whole_and_the_next_run_cleans_up(tmp_path):
    with whole_folder(tmp_path / "r1") as draft:
        (draft / "a.txt").write_text("first")
    code = (
        "import pathlib, sys, time\n"
        "from trigpoint.delivery import whole_folder\n"
        "with whole_folder(pathlib.Path(sys.argv[1])) as draft:\n"
        "    (draft / 'a.txt').write_text('half')\n"
        "    print('writing', flush=True)\n"
        "    time.sleep(60)\n"
    )
    with subprocess.Popen(
        [sys.executable, "-c", code, str(tmp_path / "r1")], stdout=subprocess.PIPE, text=True
    ) as process:
        assert process.stdout.readline() == "writing\n"
        process.send_signal(signal.SIGKILL)
    assert contents(tmp_path / "r1") == {"a.txt": "first"}
    with whole_folder(tmp_path / "r1") as draft:
        (draft / "a.txt").write_text("second")
    assert contents(tmp_path) == {"r1/a.txt": "second"}


def test_the_draft_of_a_killed_run_is_cleared_away_and_that_of_another_run_stays(tmp_path):
    clear_draft(tmp_path / "nowhere" / "r1")
    (tmp_path / ".r1.draft" / "data").mkdir(parents=True)
    clear_draft(tmp_path / "r1")
    assert list(tmp_path.iterdir()) == []
    with whole_folder(tmp_path / "r1") as draft:
        (draft / "a.txt").write_text("first")
        clear_draft(tmp_path / "r1")
        assert draft.is_dir()
    assert contents(tmp_path) == {"r1/a.txt": "first"}


def test_a_kill_between_the_two_renames_is_undone(tmp_path):
    (tmp_path / ".r1.previous").mkdir()
    (tmp_path / ".r1.previous" / "a.txt").write_text("first")
    with pytest.raises(ValueError, match="no"), whole_folder(tmp_path / "r1"):
        raise ValueError("no")
    assert contents(tmp_path) == {"r1/a.txt": "first"}


@pytest.mark.parametrize("moment", ["rename", "rmtree"])
def test_a_kill_never_leaves_the_zip_of_another_run_beside_a_folder(tmp_path, monkeypatch, moment):
    with whole_folder(tmp_path / "r1") as draft:
        (draft / "a.txt").write_text("first")
    archive_of(tmp_path / "r1").write_text("of first")
    killed = {"rename": "pathlib.Path.rename", "rmtree": "shutil.rmtree"}[moment]
    if moment == "rename":  # where the system can't swap two folders
        monkeypatch.setattr(delivery, "_exchanged", lambda *_: False)
    with pytest.raises(KeyboardInterrupt), whole_folder(tmp_path / "r1") as draft:
        (draft / "a.txt").write_text("second")

        def kill(*_, **__):
            raise KeyboardInterrupt

        monkeypatch.setattr(killed, kill)
    monkeypatch.undo()
    assert (tmp_path / "r1" / "a.txt").read_text() == {"rename": "first", "rmtree": "second"}[
        moment
    ]
    assert not archive_of(tmp_path / "r1").exists()


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux swaps two folders in one step")
def test_no_moment_is_without_a_whole_folder(tmp_path, monkeypatch):
    with whole_folder(tmp_path / "r1") as draft:
        (draft / "a.txt").write_text("first")
    moved = []
    monkeypatch.setattr(delivery.Path, "rename", lambda *paths: moved.append(paths))
    with whole_folder(tmp_path / "r1") as draft:
        (draft / "a.txt").write_text("second")
    assert (contents(tmp_path), moved) == ({"r1/a.txt": "second"}, [])


def test_a_claim_lasts_until_everything_is_in_its_place(tmp_path, monkeypatch):
    with whole_folder(tmp_path / "r1") as draft:
        (draft / "a.txt").write_text("first")

    def put(*_):
        with (
            pytest.raises(ProjectError, match="Another run is writing"),
            whole_folder(tmp_path / "r1"),
        ):
            pass

    monkeypatch.setattr(delivery, "_put", put)
    with whole_folder(tmp_path / "r1"):
        pass


def test_a_failure_keeps_the_zip_of_the_folder_that_stays(tmp_path):
    with whole_folder(tmp_path / "r1") as draft:
        (draft / "a.txt").write_text("first")
    archive_of(tmp_path / "r1").write_text("of first")
    with pytest.raises(ValueError, match="no"), whole_folder(tmp_path / "r1"):
        raise ValueError("no")
    assert contents(tmp_path) == {"r1/a.txt": "first", "r1.zip": "of first"}


def test_two_runs_do_not_write_one_folder_at_once(tmp_path):
    with whole_folder(tmp_path / "r1") as draft:
        (draft / "a.txt").write_text("first")
        with (
            pytest.raises(ProjectError, match=r"Another run is writing .*r1 now"),
            whole_folder(tmp_path / "r1"),
        ):
            pass
    assert contents(tmp_path) == {"r1/a.txt": "first"}


def test_csv_holds_what_results_hold(tmp_path):
    write_csv(
        tmp_path / "a.csv", [{"id": 'a,"b"', "d_m": 0.1234567891234, "p": float("nan"), "ok": True}]
    )
    assert (tmp_path / "a.csv").read_bytes() == b'id,d_m,p,ok\n"a,""b""",0.123456789,,True\n'


def test_a_hash_is_that_of_the_bytes(tmp_path):
    (tmp_path / "a").write_bytes(b"trig")
    assert sha256(tmp_path / "a") == hashlib.sha256(b"trig").hexdigest()


def test_where_a_folder_can_be_written_is_found_out_beforehand_and_leaves_nothing(
    tmp_path, monkeypatch
):
    check_writable(tmp_path / "a" / "b" / "r1")
    assert not list(tmp_path.iterdir())
    (tmp_path / "file").write_text("no folder")
    with pytest.raises(ProjectError, match=r"Nothing can be written to .*file.out: Not a dir"):
        check_writable(tmp_path / "file" / "out" / "r1")

    def refuse(*_, **__):
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(delivery, "TemporaryDirectory", refuse)
    with pytest.raises(ProjectError, match=r"Permission denied\. Choose another folder \(--out\)"):
        check_writable(tmp_path / "a" / "r1")
    assert [each.name for each in tmp_path.iterdir()] == ["file"]
