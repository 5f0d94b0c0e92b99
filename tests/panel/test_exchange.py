import numpy as np
import pyproj
import pytest

from trigpoint.errors import CrsError, PicksError
from trigpoint.picks import read_picks
from trigpoint_panel.exchange import export_picks, import_picks, import_points, read_point_list
from trigpoint_panel.model import Model

HEADER = "id,source_x,source_y,source_z,target_x,target_y,target_z,role,photo\n"
ROWS = "a,1,2,3,741008.25,4279056.5,153.125,check,7\nb,0.1,0.2,0.3,741009,4279057,154,control,\n"


@pytest.fixture
def model():
    model = Model()
    for i in range(3):
        model.place("source", [i, i * i, 1 / 3])
        model.place("target", [i + 0.1, i * i, 741_000 + 1 / 3])
    model.place("source", [9, 9, 9])
    return model


def test_picks_are_imported_beside_or_in_place_of_the_pairs(model, tmp_path):
    (tmp_path / "picks.csv").write_text(HEADER + ROWS)
    assert import_picks(model, tmp_path / "picks.csv") == ()
    assert [pair.id for pair in model.pairs] == ["P1", "P2", "P3", "P4", "a", "b"]
    assert model.pairs[4].role == "check"
    assert model.pairs[4].target == (741008.25, 4279056.5, 153.125)
    assert model.undo_text == "Import picks.csv"
    with pytest.raises(PicksError, match=r"^a, b are there already: rename, or import in place"):
        import_picks(model, tmp_path / "picks.csv")
    import_picks(model, tmp_path / "picks.csv", replacing=True)
    assert [pair.id for pair in model.pairs] == ["a", "b"]
    model.undo()
    model.undo()
    assert len(model.pairs) == 4


def test_doubts_about_imported_picks_are_sentences(tmp_path):
    rows = "a,1,2,3,4,5,6,,\nb,1,2,3,7,8,9,,\n"
    (tmp_path / "picks.csv").write_text(HEADER + rows)
    (doubt,) = import_picks(Model(), tmp_path / "picks.csv")
    assert "same source coordinates" in doubt


def test_exported_picks_are_the_engines_with_other_columns_kept(tmp_path):
    model = Model()
    (tmp_path / "picks.csv").write_text(HEADER + ROWS)
    import_picks(model, tmp_path / "picks.csv")
    model.place("source", [9, 9, 9])
    assert export_picks(model, tmp_path / "out.csv") == (tmp_path / "out.csv",)
    picks = read_picks(tmp_path / "out.csv")
    assert picks.ids == ("a", "b")
    assert picks.extra["photo"].tolist() == ["7", ""]


def test_targets_in_feet_are_metres_inside_and_feet_in_the_file(tmp_path):
    model = Model()
    model.set_reference(crs="EPSG:2263")
    (tmp_path / "picks.csv").write_text(HEADER + "a,1,2,3,1000,2000,30,,\n")
    (doubt,) = import_picks(model, tmp_path / "picks.csv")
    assert "feet" in doubt or "foot" in doubt
    assert model.pairs[0].target[0] == pytest.approx(1000 * 1200 / 3937)
    export_picks(model, tmp_path / "out.csv")
    assert ",1000.0,2000.0," in (tmp_path / "out.csv").read_text()


def test_a_reference_in_degrees_is_refused_in_the_engines_words(tmp_path):
    model = Model()
    model.set_reference(crs="EPSG:4326")
    (tmp_path / "picks.csv").write_text(HEADER + ROWS)
    with pytest.raises(CrsError, match="degree"):
        import_picks(model, tmp_path / "picks.csv")


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("mapX,mapY,sourceX,sourceY,enable,dX,dY,residual\n1,2,3,-4,1,0,0,0\n", "QGIS"),
        ("roof,1,2,3\nsill,4,5,6\n", "CloudCompare picking list"),
        ("Final RMS: 0.1\nTransformation matrix\n", "CloudCompare registration report"),
        ("a picture", "no column"),
    ],
)
def test_lists_of_other_programs_are_recognised_and_explained(model, tmp_path, text, words):
    (tmp_path / "list.txt").write_text(text)
    before = model.state
    with pytest.raises(PicksError, match=words):
        import_picks(model, tmp_path / "list.txt")
    assert model.state == before


def test_a_cloudcompare_list_fills_one_side_by_name_else_in_order(model, tmp_path):
    (tmp_path / "targets.txt").write_text("P4,1.5,2.5,3.5\nroof,4,5,6\n")
    assert import_points(model, tmp_path / "targets.txt", "target") == ("P4", "roof")
    assert model.pairs[3].is_complete
    assert model.pairs[4].open_side == "source"
    assert model.pairs[3].note == "[target: from targets.txt]"
    (tmp_path / "sources.asc").write_text("//X Y Z\n0.5 0.25 7\n")
    assert import_points(model, tmp_path / "sources.asc", "source") == ("roof",)
    assert model.undo_text == "Import sources.asc as source"


@pytest.mark.parametrize(
    ("text", "names"),
    [
        ("a,1,2,3\nb,4,5,6\n", ["a", "b"]),
        ("1 2 3\n\n4 5 6\n", ["", ""]),
        ("Name;X;Y;Z\nroof, top;1;2;3\n", ["roof, top"]),
        ("# made by hand\n1\t2\t3\n", [""]),
    ],
)
def test_point_lists_are_read_as_programs_write_them(tmp_path, text, names):
    (tmp_path / "list.txt").write_text(text, encoding="utf-8-sig")
    points = read_point_list(tmp_path / "list.txt")
    assert [point.name for point in points] == names
    assert points[0].xyz == (1.0, 2.0, 3.0)


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"", "holds no points"),
        (b"a,1,2,3\nb,1,2\n", "line 2 is no point"),
        (b"1,2,3\n1,2,nan\n", "line 2 is no point"),
        (b"1,2,3\nx,y,z\n", "line 2 is no point"),
        (b"\xff\xfe1,2,3", "not UTF-8"),
        (HEADER.encode() + ROWS.encode(), "line 1 is no point"),
        (b"roof,1,2,3\nsill,4,5,6\n# again\nroof,7,8,9\n", "two points 'roof', in lines 1 and 4"),
    ],
)
def test_what_is_no_point_list_is_refused_with_its_line(model, tmp_path, content, words):
    (tmp_path / "list.txt").write_bytes(content)
    before = model.state
    with pytest.raises(PicksError, match=words):
        import_points(model, tmp_path / "list.txt", "source")
    assert model.state == before


def test_a_missing_list_is_told_in_one_sentence(model, tmp_path):
    with pytest.raises(PicksError, match=r"^gone.txt can't be read: No such file"):
        import_points(model, tmp_path / "gone.txt", "source")


def test_cloudcompare_lists_come_back_to_the_bit(model, tmp_path):
    model.rename("P2", "roof, top")
    written = export_picks(model, tmp_path / "picks.txt")
    assert [path.name for path in written] == ["picks-source.txt", "picks-target.txt"]
    points = read_point_list(written[1])
    assert [point.name for point in points] == ["P1", "roof_top", "P3"]
    assert [point.xyz for point in points] == [pair.target for pair in model.pairs[:3]]


def test_qgis_points_hold_the_plan_with_the_crs(model, tmp_path):
    model.set_reference(crs="EPSG:32615")
    model.set_role({"P2"}, "check")
    export_picks(model, tmp_path / "picks.points")
    lines = (tmp_path / "picks.points").read_text().splitlines()
    assert pyproj.CRS(lines[0].removeprefix("#CRS: ")).to_epsg() == 32615
    assert lines[1] == "mapX,mapY,sourceX,sourceY,enable,dX,dY,residual"
    assert lines[3] == "1.1,1.0,1.0,1.0,0,0,0,0"
    assert len(lines) == 5


def test_what_can_not_be_exported_is_refused_in_one_sentence(model, tmp_path):
    with pytest.raises(PicksError, match=r"not as .xlsx\.$"):
        export_picks(model, tmp_path / "picks.xlsx")
    (tmp_path / "file").write_text("")
    for name in ("picks.csv", "picks.txt", "picks.points"):
        with pytest.raises(PicksError, match="can't be written"):
            export_picks(model, tmp_path / "file" / name)
    with pytest.raises(PicksError, match="no complete pair"):
        export_picks(Model(), tmp_path / "picks.csv")


def test_imported_picks_fit_as_they_do_on_the_command_line(tmp_path):
    rng = np.random.default_rng(0)
    model = Model()
    for place in rng.uniform(0, 9, (5, 3)):
        model.place("source", place)
        model.place("target", 2 * place + rng.normal(scale=0.01, size=3))
    export_picks(model, tmp_path / "picks.csv")
    other = Model()
    import_picks(other, tmp_path / "picks.csv")
    assert other.pairs == model.pairs
    assert other.fit.rmse_m == model.fit.rmse_m


@pytest.mark.parametrize("replacing", [False, True])
def test_picks_of_a_header_alone_take_nothing_away(tmp_path, replacing):
    model = Model()
    model.place("source", [0, 0, 0])
    path = tmp_path / "p.csv"
    path.write_text("id,source_x,source_y,source_z,target_x,target_y,target_z\n")
    with pytest.raises(PicksError, match=r"^p.csv holds a header and no picks: "):
        import_picks(model, path, replacing=replacing)
    assert len(model.pairs) == 1
