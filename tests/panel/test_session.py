import json
import os
import shutil
import subprocess
import sys
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from trigpoint.cloud import cloud_from
from trigpoint.errors import TrigpointError
from trigpoint.files import write
from trigpoint_panel.camera import Camera
from trigpoint_panel.documents import SessionError
from trigpoint_panel.model import Model
from trigpoint_panel.operators import begin_second_operator
from trigpoint_panel.session import Session, read_session
from trigpoint_reporting import bundling, cli

# What only takes time here: the question is whether the same things are asked.
QUICK = "icp = false\nintervals = false\n"


@pytest.fixture
def started(tmp_path):
    """A session of two small clouds and four pairs, one of them half open."""
    rng = np.random.default_rng(0)
    for name in ("nerf.ply", "lidar.ply"):
        write(tmp_path / name, cloud_from(rng.uniform(size=(50, 3))))
    model = Model()
    session = Session(model, scratch=tmp_path / "scratch")
    model.open_cloud("source", tmp_path / "nerf.ply")
    model.open_cloud("target", tmp_path / "lidar.ply")
    for place in [(0, 0, 0), (1.1, 0, 0), (0, 4 / 3, 0)]:
        model.place("source", place, sigma=0.013, note="corner")
        model.place("target", np.multiply(place, 3.3) + 741_000.123456789)
    model.place("source", [5, 5, 5])
    model.edit("P2", "note", 'a "sill" \u2028 <b>& {x} %s')
    return session


def again(session, path=None):
    other = Session(Model(), scratch=session.model.state.source_path.parent / "scratch")
    return other, other.open(path or session.path)


def test_a_session_comes_back_to_the_bit(started, tmp_path):
    camera = Camera((1.0, 2.0, 3.0), (0.0, 0.0, 0.1))
    started.cameras = {"source": json.loads(json.dumps(asdict(camera)))}
    started.model.set_about(title="Tower", date=None)
    started.model.set_comparison(margin_m=None, zones=(0.2, 0.7))
    started.model.set_reference(crs="EPSG:32615")
    started.model.adopt(started.model.fit.similarity)
    assert started.is_modified
    started.save(tmp_path / "tower.trig.json")
    assert not started.is_modified
    other, doubts = again(started)
    assert doubts == ()
    assert other.model.state == started.model.state
    assert other.cameras == started.cameras
    assert not other.is_modified
    assert other.name == "tower.trig.json"
    other.save()
    assert (tmp_path / "tower.trig.json").read_text() == _text(started)


def _text(session):
    session.save()
    return session.path.read_text()


def test_an_empty_session_is_kept_as_well(tmp_path):
    session = Session(Model(), scratch=tmp_path)
    assert not session.is_modified
    assert session.name == "untitled"
    session.save(tmp_path / "empty.trig.json")
    other, doubts = Session(Model(), scratch=tmp_path), ()
    assert other.open(tmp_path / "empty.trig.json") == doubts
    assert other.model.state == session.model.state


def test_selecting_is_nothing_to_save(started, tmp_path):
    started.save(tmp_path / "a.trig.json")
    started.model.select("P1")
    assert not started.is_modified
    started.model.cycle_role({"P1"})
    assert started.is_modified
    started.model.undo()
    assert not started.is_modified


def test_paths_are_relative_so_that_a_folder_can_move(started, tmp_path):
    folder = tmp_path / "work"
    folder.mkdir()
    started.save(folder / "a.trig.json")
    assert str(tmp_path) not in (folder / "a.trig.json").read_text()
    moved = tmp_path / "elsewhere"
    (moved / "work").mkdir(parents=True)
    for name in ("nerf.ply", "lidar.ply", "work/a.trig.json"):
        shutil.move(tmp_path / name, moved / name)
    opened = read_session(moved / "work" / "a.trig.json")
    assert opened.doubts == ()
    assert opened.state.source_path == moved / "nerf.ply"


def test_files_that_moved_or_changed_are_named_in_one_sentence_each(started, tmp_path):
    started.save(tmp_path / "a.trig.json")
    (tmp_path / "nerf.ply").unlink()
    lidar = bytearray((tmp_path / "lidar.ply").read_bytes())
    lidar[-1] ^= 1  # the same size, and a date that says nothing
    (tmp_path / "lidar.ply").write_bytes(lidar)
    other, doubts = again(started)
    assert doubts == (
        "lidar.ply has changed since the session was saved: its picks may not fit it.",
        f"nerf.ply is not where the session left it ({tmp_path}): open it again.",
    )
    assert len(other.model.pairs) == 4
    assert other.model.fit.alignment is not None


def test_a_path_that_moved_is_still_known_after_saving_again(started, tmp_path):
    started.save(tmp_path / "a.trig.json")
    (tmp_path / "nerf.ply").unlink()
    other, _ = again(started)
    other.save()
    assert read_session(other.path).state.source_path == tmp_path / "nerf.ply"


def test_every_change_is_autosaved_beside_the_session_and_found_after_a_crash(started, tmp_path):
    started.save(tmp_path / "a.trig.json")
    started.model.cycle_role({"P1"})
    assert started.autosave() == ""
    left = tmp_path / "a.trig.json~"
    assert left.exists()
    assert started.recoverable(tmp_path / "a.trig.json") == ()  # its own is no crash's

    started.leave()
    other = Session(Model(), scratch=tmp_path / "scratch")
    assert other.recoverable(tmp_path / "a.trig.json") == (left,)
    assert other.recover(left) == ()
    assert other.model.pairs == started.model.pairs
    assert other.path == tmp_path / "a.trig.json"
    assert other.is_modified
    other.save()
    assert not left.exists()


def test_what_was_never_saved_is_found_after_a_crash(started, tmp_path):
    assert started.autosave() == ""
    started.leave()
    other = Session(Model(), scratch=tmp_path / "scratch")
    (left,) = other.recoverable()
    other.recover(left)
    assert other.model.pairs == started.model.pairs
    assert other.model.state.source_path == tmp_path / "nerf.ply"
    assert other.path is None
    other.save(tmp_path / "b.trig.json")
    assert other.recoverable() == ()


def test_two_unsaved_sessions_keep_an_autosave_each(started, tmp_path):
    other = Session(Model(), scratch=tmp_path / "scratch")
    other.model.place("source", [1, 2, 3])
    assert (started.autosave(), other.autosave()) == ("", "")
    started.leave()
    other.leave()
    assert len(Session(Model(), scratch=tmp_path / "scratch").recoverable()) == 2


def test_an_autosave_goes_when_nothing_is_left_to_save_or_it_is_given_up(started, tmp_path):
    started.save(tmp_path / "a.trig.json")
    started.model.cycle_role({"P1"})
    started.autosave()
    started.model.undo()
    started.autosave()
    assert not (tmp_path / "a.trig.json~").exists()
    started.model.cycle_role({"P1"})
    started.autosave()
    started.leave()
    other = Session(Model(), scratch=tmp_path / "scratch")
    other.give_up(tmp_path / "a.trig.json~")
    assert other.recoverable(tmp_path / "a.trig.json") == ()
    assert not list(tmp_path.glob("*~*"))


def test_what_a_crash_left_is_kept_until_someone_decides(started, tmp_path):
    started.save(tmp_path / "a.trig.json")
    left = tmp_path / "a.trig.json~"
    started.model.cycle_role({"P1"})
    started.autosave()
    started.leave()
    crashed = left.read_text()
    other = Session(Model(), scratch=tmp_path / "scratch")
    other.open(tmp_path / "a.trig.json")
    other.model.cycle_role({"P2"})
    assert other.autosave() == ""
    assert left.read_text() == crashed
    assert len(list((tmp_path / "scratch").glob("*~"))) == 1
    other.give_up(left)
    other.autosave()
    assert left.exists()
    assert Session(Model(), scratch=tmp_path / "scratch").recoverable() == ()
    other.save()
    assert not left.exists()


def test_saving_over_what_a_crash_left_settles_it(started, tmp_path):
    started.save(tmp_path / "a.trig.json")
    started.model.cycle_role({"P1"})
    started.autosave()
    started.leave()
    other = Session(Model(), scratch=tmp_path / "scratch")
    other.open(tmp_path / "a.trig.json")
    other.save()
    assert other.recoverable(tmp_path / "a.trig.json") == ()


def test_a_second_window_does_not_offer_the_autosave_of_an_open_one(started, tmp_path):
    started.save(tmp_path / "a.trig.json")
    unsaved = Session(Model(), scratch=tmp_path / "scratch")
    started.model.cycle_role({"P1"})
    unsaved.model.place("source", [1, 2, 3])
    assert (started.autosave(), unsaved.autosave()) == ("", "")
    other = Session(Model(), scratch=tmp_path / "scratch")
    assert other.recoverable() == other.recoverable(tmp_path / "a.trig.json") == ()
    kept = [tmp_path / "a.trig.json~", *(tmp_path / "scratch").glob("*~")]
    assert len(kept) == 2
    for autosave in kept:
        for change in (other.recover, other.give_up):
            with pytest.raises(SessionError, match=r"^Another window that is still open keeps"):
                change(autosave)
        assert autosave.exists()
    assert other.model.state == Model().state


def test_two_windows_of_one_session_do_not_take_each_others_autosave(started, tmp_path):
    started.save(tmp_path / "a.trig.json")
    left = tmp_path / "a.trig.json~"
    started.model.cycle_role({"P1"})
    started.autosave()
    mine = left.read_text()
    other, _ = again(started)
    other.model.cycle_role({"P2"})
    assert other.autosave() == ""
    assert left.read_text() == mine
    (others,) = (tmp_path / "scratch").glob("*~")
    other.save()
    assert left.read_text() == mine
    assert not others.exists()
    started.discard_autosave()
    assert not list(tmp_path.glob("**/*~*"))


def test_the_system_gives_back_the_autosave_of_a_window_that_was_killed(started, tmp_path):
    started.save(tmp_path / "a.trig.json")
    code = (
        "import sys; from pathlib import Path;"
        "from trigpoint_panel.model import Model; from trigpoint_panel.session import Session;"
        "path = Path(sys.argv[1]); session = Session(Model(), scratch=path.parent / 'scratch');"
        "session.open(path); session.model.cycle_role({'P1'}); session.autosave();"
        "print('kept', flush=True); sys.stdin.read()"
    )
    with subprocess.Popen(
        [sys.executable, "-c", code, started.path],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    ) as window:
        assert window.stdout.readline() == "kept\n"
        assert started.recoverable(started.path) == ()
        window.kill()
    (left,) = started.recoverable(started.path)
    started.recover(left)
    assert started.is_modified


def test_a_folder_that_can_not_be_written_is_told_in_one_sentence(started, tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(SessionError, match=r"^a.trig.json can't be written: [A-Z][^.]*\.$"):
        started.save(tmp_path / "file" / "a.trig.json")
    assert started.path is None
    stuck = Session(started.model, scratch=tmp_path / "file")
    assert stuck.autosave() == ""  # nothing changed since it began
    stuck.model.cycle_role({"P1"})
    assert stuck.autosave().startswith("Changes are not autosaved: ")


def test_changes_are_autosaved_elsewhere_where_the_session_can_not_be_written(
    started, tmp_path, monkeypatch
):
    started.save(tmp_path / "a.trig.json")
    from trigpoint_panel import session as room

    def write_text(path, text, write=room.write_text):
        if path.parent == tmp_path:
            raise PermissionError(13, "Permission denied", str(path))
        write(path, text)

    monkeypatch.setattr(room, "write_text", write_text)
    started.model.cycle_role({"P1"})
    assert started.autosave() == ""
    started.leave()
    other = Session(Model(), scratch=tmp_path / "scratch")
    (left,) = other.recoverable()
    other.recover(left)
    assert other.path == tmp_path / "a.trig.json"


def test_autosaving_hashes_no_file(started, tmp_path, monkeypatch):
    from trigpoint_panel import fingerprints

    def refuse(path):
        raise AssertionError(path)

    monkeypatch.setattr(fingerprints, "sha256", refuse)
    assert started.autosave() == ""
    (left,) = (tmp_path / "scratch").glob("*~")
    assert read_session(left).doubts == ()


def test_a_session_without_a_file_asks_for_one(started):
    with pytest.raises(SessionError, match="no file yet"):
        started.save()
    with pytest.raises(SessionError, match="save it first"):
        started.write_project()


@pytest.mark.parametrize(
    ("spoil", "words"),
    [
        (lambda text: text[:300], "cut off"),
        ("", "cut off"),
        ("[" * 100_000, "cut off"),
        ('{"format": ' + "9" * 5000 + "}", "cut off"),
        ("[]", "format is None"),
        (lambda text: text.replace("session/1", "session/9"), "format is 'trigpoint-session/9'"),
        (lambda text: text.replace('"id": "P2"', '"id": "P1"'), "two of its pairs"),
        (lambda text: text.replace('"id": "P2"', '"id": 7'), "no id"),
        (lambda text: text.replace('"role": "control"', '"role": "boss"', 1), "role 'boss'"),
        (lambda text: text.replace("1.1,", "NaN,"), "for a place"),
        (lambda text: text.replace("1.1,", '"x",'), "for a place"),
        (lambda text: text.replace("1.1,", "1" * 400 + ","), "for a place"),
        (lambda text: text.replace("0.013,", "-0.013,"), "for a sigma"),
        (lambda text: text.replace('"seed": 42', '"seed": -1'), "seed"),
        (lambda text: text.replace('"seed": 42', '"sead": 1'), "sead"),
        (lambda text: text.replace('"pairs"', '"pears"'), "'pairs' is missing"),
        (lambda text: text.replace('"reconstruction": "nerf"', '"reconstruction": []'), "\\[\\]"),
    ],
)
def test_what_is_no_session_is_refused_in_one_line(started, tmp_path, spoil, words):
    path = tmp_path / "a.trig.json"
    started.save(path)
    path.write_text(spoil if isinstance(spoil, str) else spoil(path.read_text()))
    before = started.model.state
    with pytest.raises(SessionError, match=words) as caught:
        started.open(path)
    said = str(caught.value)
    assert said.startswith("a.trig.json is no session: ")
    assert "\n" not in said
    assert len(said) < 400
    assert started.model.state == before


def test_a_file_that_is_not_there_is_told_in_one_sentence(tmp_path):
    with pytest.raises(SessionError, match=r"^gone.trig.json can't be read: No such file"):
        read_session(tmp_path / "gone.trig.json")


def test_a_second_operators_round_survives_a_crash(started, tmp_path):
    started.model.drop_open_half()
    begin_second_operator(started.model)
    started.model.place("source", [0, 0, 0.01])
    started.autosave()
    started.leave()
    other = Session(Model(), scratch=tmp_path / "scratch")
    other.recover(other.recoverable()[0])
    assert other.model.state == started.model.state
    assert other.model.state.is_second_operator


def test_a_project_opens_as_a_session_and_stays_as_it_is(small_project):
    project, _ = small_project()
    files = {path: path.read_bytes() for path in project.parent.iterdir()}
    session = Session(Model(), scratch=project.parent / "scratch")
    assert session.open(project) == ()
    assert session.name == "project.toml"
    assert [pair.role for pair in session.model.pairs] == ["control"] * 6 + ["check"] * 2
    assert not session.is_modified
    assert session.write_project() == project
    assert {path: path.read_bytes() for path in files} == files
    assert not session.is_modified


def _audited(project, out, monkeypatch):
    # What the report needs is tested elsewhere; here it would only take its time.
    monkeypatch.setattr(bundling, "report", lambda *_, **__: ())
    said = CliRunner().invoke(cli.app, ["audit", str(project), "--out", str(out)])
    assert said.exit_code == 0, said.output
    (folder,) = (path for path in out.iterdir() if path.is_dir())
    return (folder / "data" / "results.json").read_bytes()


def test_the_same_session_gives_the_same_results_as_the_command_line(
    small_project, tmp_path, monkeypatch
):
    project, _ = small_project(extra=QUICK)
    first = _audited(project, tmp_path / "one", monkeypatch)

    session = Session(Model(), scratch=tmp_path / "scratch")
    session.open(project)
    # Saved as a session and opened again, with a detour that is undone.
    session.save(project.with_name("small.trig.json"))
    other = Session(Model(), scratch=tmp_path / "scratch")
    other.open(project.with_name("small.trig.json"))
    other.model.delete({"c1", "c2"})
    other.model.place("source", [1, 2, 3])
    other.model.undo()
    other.model.undo()
    assert _audited(other.write_project(), tmp_path / "two", monkeypatch) == first
    found = json.loads(first)["reconstructions"]["nerf"]
    fit = other.model.fit
    assert found["alignment"]["rmse_m"] == round(fit.rmse_m, 9)
    assert found["loocv"]["rmse_m"] == round(fit.loocv_rmse_m, 9)
    assert found["checks"]["rmse_m"] == round(fit.check_rmse_m, 9)


def test_a_session_picked_by_hand_gives_the_results_of_its_project(
    small_project, tmp_path, monkeypatch
):
    """Two folders, one written by the panel from clicks: the bytes are the same."""
    project, _ = small_project(tmp_path / "given", extra=QUICK)
    opened = Session(Model(), scratch=tmp_path / "scratch")
    opened.open(project)
    folder = tmp_path / "picked"
    folder.mkdir()
    for name in ("lidar.laz", "nerf.ply", "sfm.laz"):
        shutil.copy(project.parent / name, folder / name)
    model = Model(replace(opened.model.state, pairs=()))
    model.load(replace(model.state, project=replace(model.state.project, path=Path())))
    session = Session(model, scratch=tmp_path / "scratch")
    model.open_cloud("source", folder / "nerf.ply")
    model.open_cloud("target", folder / "lidar.laz")
    sfm = replace(model.state.project.reconstructions[1], path=folder / "sfm.laz")
    nerf = replace(model.state.given, picks=None)
    model.load(
        replace(model.state, project=replace(model.state.project, reconstructions=(nerf, sfm)))
    )
    for pair in opened.model.pairs:
        model.place("source", pair.source)
        name = model.place("target", pair.target).id
        model.rename(name, pair.id)
        model.set_role({pair.id}, pair.role)
    session.save(folder / "project.trig.json")
    written = session.write_project()
    assert written == folder / "project.toml"
    assert _audited(written, tmp_path / "one", monkeypatch) == _audited(
        project, tmp_path / "two", monkeypatch
    )


def test_a_changed_session_gives_other_results_and_keeps_the_comments(small_project):
    project, _ = small_project()
    project.write_text(project.read_text() + "icp = true   # on trial\n")
    session = Session(Model(), scratch=project.parent / "scratch")
    session.open(project)
    session.model.set_comparison(voxel_m=0.25, icp=False)
    session.model.set_role({"c1"}, "off")
    assert session.is_modified
    session.write_project()
    text = project.read_text()
    assert "voxel_m = 0.25" in text
    assert "icp = false  # on trial" in text
    assert "c1" in (project.parent / "picks.csv").read_text()
    assert read_session(project).state == replace(session.model.state, selected=None)


@pytest.mark.parametrize("saved", [False, True])
def test_what_was_edited_outside_is_not_overwritten(small_project, tmp_path, saved):
    project, _ = small_project()
    picks = project.with_name("picks.csv")
    session = Session(Model(), scratch=tmp_path / "scratch")
    session.open(project)
    if saved:
        session.save(tmp_path / "a.trig.json")
        session, _ = again(session)
    session.model.set_role({"c1"}, "off")
    for path, old, new in (
        (picks, "c2", "sill"),
        (project, "accuracy_m = 0.02", "accuracy_m = 0.05"),
    ):
        before = path.read_text()
        path.write_text(before.replace(old, new))
        edited = {each: each.read_bytes() for each in (project, picks)}
        with pytest.raises(TrigpointError, match=f"^{path.name} has changed since it was read: "):
            session.write_project()
        assert {each: each.read_bytes() for each in edited} == edited
        path.write_text(before)
    session.write_project()  # both are again as they were read
    picks.write_text(picks.read_text().replace("c2", "sill"))
    session.model.set_role({"c1"}, "check")
    there = session.write_project(tmp_path / "elsewhere" / "project.toml")
    assert "c2" in there.with_name("picks.csv").read_text()
    assert "sill" in picks.read_text()
    session.model.set_role({"c1"}, "off")
    session.write_project()


def test_picks_that_the_session_itself_wrote_are_not_changed_outside(small_project, tmp_path):
    session = Session(Model(), scratch=tmp_path / "scratch")
    session.open(small_project()[0])
    session.model.set_role({"c1"}, "off")
    session.save(tmp_path / "a.trig.json")
    session.write_project()
    session, _ = again(session)
    session.model.set_role({"c2"}, "off")
    session.write_project()


@pytest.mark.parametrize("when", ["before saving", "after saving"])
def test_a_project_changed_outside_is_named_when_its_session_opens(small_project, tmp_path, when):
    project, _ = small_project()
    session = Session(Model(), scratch=tmp_path / "scratch")
    session.open(project)
    before = project.read_text()
    edited = before.replace("accuracy_m = 0.02", "accuracy_m = 0.05")
    if when == "before saving":
        project.write_text(edited)
    session.save(tmp_path / "a.trig.json")
    project.write_text(edited)
    doubt = (
        "project.toml has changed since the session was saved: the session keeps its own settings."
    )
    for _ in range(2):
        session, doubts = again(session)
        assert doubts == (doubt,)
        session.save()  # settles nothing
    with pytest.raises(TrigpointError, match=r"^project.toml has changed since it was read"):
        session.write_project()
    assert project.read_text() == edited
    project.write_text(before)
    assert again(session)[1] == ()
    project.unlink()
    assert again(session)[1][0].startswith("project.toml is not where the session left it")


def test_comments_in_a_project_are_no_change_of_it(small_project, tmp_path):
    session = Session(Model(), scratch=tmp_path / "scratch")
    session.open(small_project()[0])
    session.save(tmp_path / "a.trig.json")
    project = session.model.state.project.path
    project.write_text(f"# Mine.\n{project.read_text()}")
    other, doubts = again(session)
    assert doubts == ()
    other.model.set_role({"c1"}, "off")
    other.model.set_comparison(voxel_m=0.3)
    other.write_project()
    assert project.read_text().startswith("# Mine.\n")


@pytest.mark.parametrize("changed", [False, True])
def test_a_session_knows_the_project_that_it_wrote_after_it_was_saved(started, tmp_path, changed):
    started.model.set_reference(crs="EPSG:32615")
    started.save(tmp_path / "a.trig.json")
    if changed:
        started.model.cycle_role({"P1"})
    assert started.write_project() == tmp_path / "a.toml"
    assert started.is_modified is changed
    other, doubts = again(started)  # closed without saving
    assert doubts == ()
    assert other.model.state.project.path == tmp_path / "a.toml"
    assert other.model.pairs[0].role == "control"
    other.model.set_comparison(voxel_m=0.3)
    other.write_project()
    assert "0.3" in (tmp_path / "a.toml").read_text()


def test_a_project_is_not_written_into_a_folder_that_has_gone(small_project, tmp_path):
    project, _ = small_project(tmp_path / "work")
    session = Session(Model(), scratch=tmp_path / "scratch")
    session.open(project)
    session.save(tmp_path / "work" / "a.trig.json")
    session.model.set_comparison(voxel_m=0.3)
    shutil.rmtree(tmp_path / "work")
    with pytest.raises(TrigpointError, match=r"^The folder of project.toml has gone \("):
        session.write_project()
    with pytest.raises(SessionError, match=r"^a.trig.json can't be written: No such file"):
        session.save()
    assert session.autosave() == ""
    assert not (tmp_path / "work").exists()
    assert len(list((tmp_path / "scratch").glob("*~"))) == 1
    session.discard_autosave()


def test_the_project_of_another_is_not_overwritten(small_project, started):
    project, _ = small_project()
    before = project.read_bytes()
    with pytest.raises(TrigpointError, match="another project's"):
        started.write_project(project)
    assert project.read_bytes() == before


@pytest.mark.skipif(not hasattr(os, "getuid") or os.getuid() == 0, reason="root writes anywhere")
def test_a_read_only_folder_is_told_in_one_sentence(started, tmp_path):
    folder = tmp_path / "locked"
    folder.mkdir(mode=0o500)
    with pytest.raises(SessionError, match="Permission denied"):
        started.save(folder / "a.trig.json")
