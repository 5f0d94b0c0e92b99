import datetime as dt
import tomllib
from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from trigpoint.errors import ProjectError, TrigpointError
from trigpoint.project import (
    CameraPositions,
    Limit,
    ReconstructionInput,
    ScaleBar,
    UpDirection,
    project_from,
    read_project,
)
from trigpoint.starter import PICKS, PROJECT
from trigpoint_panel import projects
from trigpoint_panel.exchange import import_picks
from trigpoint_panel.model import Model
from trigpoint_panel.pairs import Pair
from trigpoint_panel.projects import (
    checked,
    project_toml,
    reference_crs,
    state_from_project,
    write_project,
)
from trigpoint_panel.state import BLANK, NOWHERE, State, with_given


def whole(folder):
    """A project that uses every key."""
    return replace(
        BLANK,
        path=folder / "project.toml",
        about=replace(BLANK.about, id="t", title='a "b" \\ \n #', date=dt.date(2026, 9, 21)),
        reference=replace(
            BLANK.reference,
            path=folder / "in" / "lidar.laz",
            crs="EPSG:32615",
            accuracy_m=0.05,
            region=folder / "plan.geojson",
        ),
        reconstructions=(
            ReconstructionInput("sfm", Path("/data/sfm.laz"), "photogrammetry"),
            ReconstructionInput("nerf", folder / "nerf.ply", "neural", folder / "picks.csv"),
        ),
        comparison=replace(BLANK.comparison, margin_m=None, within_m=(0.1, 1e-7), icp=False),
        cross_checks=(
            ScaleBar((0.0, 0.0, 0.0), (1.0, 0.0, 1e-9), 3.2, 0.005, "nerf"),
            UpDirection((0.0, 0.1, 1.0), 0.5),
            CameraPositions(((0.0, 0.0, 1.0),) * 2, ((7.0, 8.0, 9.0),) * 2, (0.1, 0.1, 0.2)),
        ),
        limits=(Limit("loocv.rmse_m", "nerf", "brief, clause 4", max=0.25),),
    )


def test_a_project_is_written_as_it_is_read(tmp_path):
    project = whole(tmp_path)
    project.path.write_text(project_toml(project))
    assert read_project(project.path) == project


@settings(max_examples=80, deadline=None)
@given(st.text(alphabet=st.characters(exclude_categories=["Cs"]), max_size=40))
def test_any_text_survives_the_project_file(title):
    folder = Path("/somewhere")
    project = replace(whole(folder), about=replace(BLANK.about, title=title, client=title))
    assert project_from(tomllib.loads(project_toml(project)), project.path) == project


def test_lines_are_changed_where_they_stand_and_comments_stay(tmp_path):
    path = tmp_path / "project.toml"
    path.write_text(PROJECT)
    (tmp_path / "picks.csv").write_text(PICKS)
    state, doubts = state_from_project(path)
    assert [doubt.split()[0] for doubt in doubts] == ["reference.laz", "nerf.ply"]
    project = replace(
        state.project,
        about=replace(state.about, id="tower", date=dt.date(2026, 9, 21), title="#1"),
        alignment=replace(state.alignment, threshold_m=0.75),
        comparison=replace(state.comparison, margin_m=None),
    )
    write_project(replace(state, project=project), path)
    assert read_project(path) == project
    lines = path.read_text().splitlines()
    assert len(lines) == len(PROJECT.splitlines()) + 1
    assert 'id = "tower"                  # becomes the name of the bundle' in lines
    assert 'title = "#1"' in lines
    assert "date = 2026-09-21" in lines
    assert "threshold_m = 0.75            # a pick is an inlier within this distance" in lines


def test_a_file_too_free_for_lines_is_written_anew(tmp_path):
    path = tmp_path / "project.toml"
    path.write_text(
        '[project]\nid = "t"\n[reference]\npath = "a.laz"\n[[reconstruction]]\nname = "nerf"\n'
        'path = "b.ply"\n[comparison]\nzones = [\n  0.3,\n  0.6,\n]\n'
    )
    state, _ = state_from_project(path)
    project = replace(state.project, comparison=replace(state.comparison, zones=(0.5,)))
    write_project(replace(state, project=project), path)
    assert read_project(path) == project


def test_a_new_project_begins_with_the_commented_one(tmp_path):
    state = State(
        replace(
            with_given(State(), replace(State().given, path=tmp_path / "n.ply")),
            reference=replace(BLANK.reference, path=Path("/far/away/lidar.laz")),
        ),
        pairs=(Pair("P1", source=(0.0, 1.0, 2.0), target=(3.0, 4.0, 5.0)), Pair("P2")),
    )
    project = write_project(state, tmp_path / "new" / "project.toml")
    text = project.path.read_text()
    assert 'path = "/far/away/lidar.laz"' in text
    assert "# ransac, exhaustive (every set of three picks), or all (no consensus)" in text
    assert project.reconstructions[0].picks == tmp_path / "new" / "picks.csv"
    again, _ = state_from_project(project.path)
    assert again.pairs == state.pairs[:1]


def test_the_second_operators_picks_are_not_the_projects(tmp_path):
    state = State(
        replace(
            with_given(State(), replace(State().given, path=tmp_path / "n.ply")),
            reference=replace(BLANK.reference, path=tmp_path / "l.laz"),
        ),
        pairs=(Pair("P1"),),
        first=(Pair("P1", source=(0.0, 1.0, 2.0), target=(3.0, 4.0, 5.0)),),
    )
    write_project(state, tmp_path / "project.toml")
    assert "P1,0.0,1.0,2.0,3.0,4.0,5.0" in (tmp_path / "picks.csv").read_text()


def test_nothing_of_another_is_overwritten(tmp_path):
    state = State(
        replace(
            with_given(State(), replace(State().given, path=tmp_path / "n.ply")),
            reference=replace(BLANK.reference, path=tmp_path / "l.laz"),
        ),
        pairs=(Pair("P1", source=(0.0, 1.0, 2.0), target=(3.0, 4.0, 5.0)),),
    )
    (tmp_path / "picks.csv").write_text("mine")
    (tmp_path / "project-picks.csv").write_text("mine")
    with pytest.raises(ProjectError, match="another session's"):
        write_project(state, tmp_path / "project.toml")
    assert not (tmp_path / "project.toml").exists()
    (tmp_path / "project.toml").write_text("mine")
    with pytest.raises(ProjectError, match="another project's"):
        write_project(state, tmp_path / "project.toml")
    (tmp_path / "file").write_text("")
    with pytest.raises(ProjectError, match="can't be written"):
        write_project(state, tmp_path / "file" / "project.toml")


def test_picks_that_were_imported_from_beside_it_serve_the_project(tmp_path):
    text = "target_x,target_y,target_z,id,source_x,source_y,source_z\n3,4,5,P1,0.0,1,2.50\n"
    (tmp_path / "picks.csv").write_text(text)
    model = Model()
    model.open_cloud("source", tmp_path / "n.ply")
    model.open_cloud("target", tmp_path / "l.laz")
    import_picks(model, tmp_path / "picks.csv")
    project = write_project(model.state, tmp_path / "project.toml")
    assert project.reconstructions[0].picks == tmp_path / "picks.csv"
    assert (tmp_path / "picks.csv").read_text() == text

    model.move("P1", "source", [9, 9, 9])
    project = write_project(model.state, tmp_path / "other.toml")
    assert project.reconstructions[0].picks == tmp_path / "other-picks.csv"
    assert (tmp_path / "picks.csv").read_text() == text


def test_a_project_needs_both_clouds(tmp_path):
    with pytest.raises(ProjectError, match="open the source and the reference"):
        write_project(State(), tmp_path / "project.toml")


def test_one_of_several_reconstructions_is_the_source(tmp_path):
    project = whole(tmp_path)
    project.path.write_text(project_toml(project))
    state, doubts = state_from_project(project.path)
    assert (state.reconstruction, state.given.kind) == ("nerf", "neural")
    assert len(doubts) == 3
    assert state_from_project(project.path, reconstruction="sfm")[0].reconstruction == "sfm"
    with pytest.raises(ProjectError, match="no reconstruction 'x'"):
        state_from_project(project.path, reconstruction="x")


def test_a_project_with_picks_that_can_not_be_read_is_refused(small_project):
    project, _ = small_project()
    (project.parent / "picks.csv").write_text("roof,1,2,3\nsill,4,5,6\n")
    with pytest.raises(TrigpointError, match="CloudCompare picking list"):
        state_from_project(project)


def test_the_crs_is_the_one_that_the_audit_takes(small_project):
    project = read_project(small_project()[0])
    assert "EPSG:5703" in reference_crs(project).to_wkt() or "NAVD88" in reference_crs(project).name
    assigned = replace(project, reference=replace(project.reference, crs="EPSG:32616"))
    assert "16N" in reference_crs(assigned).name
    assert reference_crs(BLANK) is None


def test_a_checked_project_keeps_its_paths_and_tuples(tmp_path):
    project = whole(tmp_path)
    assert checked(project) == project
    assert checked(BLANK) == BLANK
    assert BLANK.path == NOWHERE
    loose = replace(project, comparison=replace(project.comparison, zones=[0.5]))
    assert checked(loose).comparison.zones == (0.5,)
    with pytest.raises(ProjectError, match="zones"):
        checked(replace(project, comparison=replace(project.comparison, zones=(0.6, 0.3))))


@pytest.mark.parametrize("encoding", ["cp1252", "utf-16"])
def test_a_project_saved_in_another_encoding_is_refused_in_one_sentence(small_project, encoding):
    path, _ = small_project()
    state, _ = state_from_project(path)
    path.write_bytes(("# größer\n" + path.read_text("utf-8")).encode(encoding))
    before = path.read_bytes()
    with pytest.raises(ProjectError, match=r"^project.toml is not UTF-8 text any more: "):
        write_project(replace(state, pairs=state.pairs[1:]), path)
    assert path.read_bytes() == before


def test_a_project_whose_picks_can_not_be_written_stays_as_it_was(small_project, monkeypatch):
    path, _ = small_project()
    state, _ = state_from_project(path)
    before = path.read_bytes()

    def refuse(*_, **__):
        message = "picks.csv can't be written: No space left on device."
        raise TrigpointError(message)

    monkeypatch.setattr(projects, "write_picks", refuse)
    changed = replace(state.project, comparison=replace(state.comparison, voxel_m=0.7))
    with pytest.raises(TrigpointError, match="No space left"):
        write_project(replace(state, project=changed, pairs=state.pairs[1:]), path)
    assert path.read_bytes() == before


def test_a_project_is_written_again_after_each_undo(tmp_path):
    (tmp_path / "picks.csv").write_text("mine")
    model = Model()
    model.open_cloud("source", tmp_path / "n.ply")
    model.open_cloud("target", tmp_path / "l.laz")
    for k in range(3):
        model.place("source", [k, 0, 0])
        model.place("target", [k, 1, 0])
    for _ in range(3):
        model.set_project(write_project(model.state, tmp_path / "project.toml"))
        assert model.state.given.picks == tmp_path / "project-picks.csv"
        model.undo()
