import os

import numpy as np
import pandas as pd
import pyproj
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_array_equal

from trigpoint.crs import parse_crs
from trigpoint.errors import CrsError, PicksError
from trigpoint.picks import examine, picks_from, read_picks, require_control, write_picks
from trigpoint.similarity import Similarity

HEADER = "id,source_x,source_y,source_z,target_x,target_y,target_z"
ROWS = [
    "low1,3.53,1.42,4.5,456527.174,5421291.59,129.124",
    "low2,-3.72,0.42,3.9,456512.795,5421307.268,131.327",
    "mid1,0.18,-0.88,4.09,456519.147,5421297.894,135.262",
    "up1,-2.49,-2,4.04,456513.814,5421303.685,138.34",
]


@pytest.fixture
def read(tmp_path):
    """Write text to a file and read it as picks."""

    def make(text, **settings):
        path = tmp_path / "picks.csv"
        path.write_bytes(text if isinstance(text, bytes) else text.encode())
        return read_picks(path, **settings)

    return make


def lines(*rows, header=HEADER):
    return "\n".join([header, *rows]) + "\n"


def changed(column, cell, row=1, *, rows=ROWS):
    """The rows with one cell replaced."""
    table = [line.split(",") for line in rows]
    table[row][HEADER.split(",").index(column)] = cell
    return lines(*(",".join(cells) for cells in table))


def codes(picks):
    return [caution.code for caution in examine(picks)]


def assert_same(one, other):
    assert one.ids == other.ids
    assert one.notes == other.notes
    assert one.roles.tolist() == other.roles.tolist()
    for name in ("source", "target", "sigma_source", "sigma_target"):
        assert getattr(one, name).tobytes() == getattr(other, name).tobytes(), name
    pd.testing.assert_frame_equal(one.extra, other.extra)


# Reading


def test_seven_columns_are_enough(read):
    picks = read(lines(*ROWS))
    assert picks.ids == ("low1", "low2", "mid1", "up1")
    assert picks.source[3].tolist() == [-2.49, -2, 4.04]
    assert picks.target[0].tolist() == [456527.174, 5421291.59, 129.124]
    assert set(picks.roles.tolist()) == {"control"}
    assert np.isnan([picks.sigma_source, picks.sigma_target]).all()
    assert picks.notes == ("",) * 4
    assert picks.extra.shape == (4, 0)
    assert picks.cautions == ()
    assert len(picks) == 4


def test_columns_may_come_in_any_order_and_others_are_kept(read):
    picks = read(
        "photo,target_z,target_y,target_x,note,ROLE, Id ,source_z,source_y,source_x,sigma_target,"
        "sigma_source\n"
        "0012,3,2,1,wet,Check,a,6,5,4,0.02,\n"
        ",30,20,10,,,b,60,50,40,,0.004\n"
        "x,31,21,11,, off ,c,61,51,41,,\n"
    )
    assert picks.ids == ("a", "b", "c")
    assert picks.source[:2].tolist() == [[4, 5, 6], [40, 50, 60]]
    assert picks.target[:2].tolist() == [[1, 2, 3], [10, 20, 30]]
    assert picks.roles.tolist() == ["check", "control", "off"]
    assert_array_equal(picks.sigma_target, [0.02, np.nan, np.nan])
    assert_array_equal(picks.sigma_source, [np.nan, 0.004, np.nan])
    assert picks.notes == ("wet", "", "")
    assert picks.extra["photo"].tolist() == ["0012", "", "x"]


def test_control_and_check_are_apart_and_off_is_neither(read):
    header = HEADER + ",role,mark"
    roles = ["control,p", "check,q", "off,r", ",s"]
    picks = read(
        lines(*(f"{row},{role}" for row, role in zip(ROWS, roles, strict=True)), header=header)
    )
    assert picks.control.ids == ("low1", "up1")
    assert picks.check.ids == ("low2",)
    assert picks.control.extra["mark"].tolist() == ["p", "s"]
    assert picks.take(np.array([2, 0])).ids == ("mid1", "low1")


@pytest.mark.parametrize(
    "text",
    [
        "\ufeff" + lines(*ROWS),
        lines(*ROWS).replace("\n", "\r\n"),
        lines(*ROWS).replace("\n", "\r"),
        lines(*ROWS).replace(",", ";"),
        lines(*ROWS).replace(",", ";").replace(".", ","),
        lines(*ROWS).replace(",", "\t"),
        lines(*ROWS).replace(",", "\t").replace(".", ","),
        lines(*ROWS, "", ",,,,,,", "  "),
        "\n".join(line + ",," for line in [HEADER, *ROWS]),
        lines(*ROWS).replace("source_x", " Source_X "),
        lines(*ROWS).replace("456527.174", '"4.56527174e5"').replace(",3.53", ", +3.53 "),
    ],
    ids=[
        "byte order mark",
        "CRLF",
        "CR",
        "semicolons",
        "semicolons and decimal commas",
        "tabs",
        "tabs and decimal commas",
        "blank rows",
        "empty columns at the end",
        "blanks and capitals in a name",
        "an exponent in quotes",
    ],
)
def test_how_spreadsheets_write_it_makes_no_difference(text, read):
    assert_same(read(text), read(lines(*ROWS)))


@pytest.mark.parametrize(
    ("cell", "reason"),
    [
        ("nan", "'nan' is not a finite number"),
        ("-INF", "'-INF' is not a finite number"),
        ("", "the cell is empty"),
        ("abc", "'abc' is not a number"),
        ("1_000", "'1_000' is not a number"),
        ("1 000", "'1 000' is not a number"),
        ("1'000.5", "is not a number"),
        ('"456,512.795"', "no thousands separators"),
        ('"456,512"', "no thousands separators"),
        ("١٢", "is not a number"),
        ("0x1F", "is not a number"),
        ("456512.795m", "is not a number"),
    ],
)
def test_a_cell_that_is_no_number_is_refused_with_its_row_and_column(cell, reason, read):
    table = changed("target_x", "@").replace("@", cell)
    with pytest.raises(
        PicksError, match=rf"picks.csv: row 3 \('low2'\), column target_x: .*{reason}"
    ):
        read(table)


def test_rows_are_counted_as_a_spreadsheet_does(read):
    rows = [ROWS[0].replace("low1", '"two\nlines"'), "", changed("target_x", "x").split("\n")[2]]
    with pytest.raises(PicksError, match="row 4"):
        read(lines(*rows))


@pytest.mark.parametrize("cell", ["1e999", "-1e13"])
def test_a_number_too_large_to_be_a_coordinate_is_refused(cell, read):
    with pytest.raises(PicksError, match=r"'low2': source_y is .*no coordinate"):
        read(changed("source_y", cell))


def test_points_and_commas_for_decimals_do_not_mix(read):
    text = lines(*ROWS).replace(",", ";").replace("129.124", "129,124")
    with pytest.raises(PicksError, match=r"row 2.*target_z.*one decimal sign"):
        read(text)
    with pytest.raises(PicksError, match=r"row 2.*source_x.*not a number"):
        read(lines(*ROWS).replace(",", ";").replace(".", ",").replace("3,53", "1,003,53"))


def test_decimal_commas_between_commas_are_refused_with_what_would_do(read):
    with pytest.raises(PicksError, match=r"row 2 has 13 cells and the header 7.*semicolons"):
        read(lines("low1,3,53,1,42,4,5,456527,174,5421291,59,129,124"))


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("", "it is empty"),
        (" \n\n", "no column id"),
        (lines(ROWS[0], ROWS[1], ROWS[0]), "picks 1 and 3 share the id 'low1'"),
        (lines(ROWS[0], ROWS[1].replace("low2", " low1 ")), "picks 1 and 2 share the id 'low1'"),
        (changed("id", " "), "pick 2 has no id"),
        (lines("low1,1,2,3,4,5"), "row 2 has 6 cells and the header 7"),
        (lines(*ROWS).replace("source_x", "src_x"), "no column source_x. 'src_x' comes near it"),
        (lines(*ROWS).replace(",target_z", ",height"), "no column target_z. It needs"),
        (lines(*ROWS).replace("source_y", "source_x"), "no column source_y"),
        (lines(header=HEADER + ",a,a"), "'a' is there twice"),
        (lines(header=HEADER + ",ID"), "'id' is there twice"),
        (lines(header=HEADER + ",,a"), "column 8 has no name"),
        (lines(header=HEADER + ",roles"), "'roles' comes near role"),
        (lines(header=HEADER + ",sigma_src"), "'sigma_src' comes near sigma_source"),
        (lines(ROWS[0] + ",controll", header=HEADER + ",role"), "unknown role 'controll'.*check"),
        (lines(ROWS[0] + ",0", header=HEADER + ",sigma_source"), "sigma_source is 0.*above zero"),
        (lines(ROWS[0] + ",-1", header=HEADER + ",sigma_target"), "sigma_target is -1"),
        (lines(ROWS[0] + ",1e308", header=HEADER + ",sigma_target"), "1e-09 to 1,000,000"),
        (lines(ROWS[0] + ",1e-300", header=HEADER + ",sigma_source"), "sigma_source is 1e-300"),
        (lines(ROWS[0] + ",nan", header=HEADER + ",sigma_target"), "row 2.*sigma_target.*finite"),
        (lines(*ROWS).encode("utf-16"), "not UTF-8 text .at byte 0."),
        (lines(*ROWS).replace("low1", "tür").encode("cp1252"), "not UTF-8 text"),
        (lines(*ROWS).replace("low1", '"' + 200_000 * "x"), "it is no CSV"),
    ],
)
def test_a_file_that_is_wrong_is_refused_in_one_clear_line(text, reason, read):
    with pytest.raises(PicksError, match=reason) as caught:
        read(text)
    assert str(caught.value).startswith("picks.csv")
    assert "\n" not in str(caught.value)


def test_a_file_that_is_not_there_or_is_a_folder_is_refused(tmp_path):
    with pytest.raises(PicksError, match=r"none.csv can't be read: No such file"):
        read_picks(tmp_path / "none.csv")
    with pytest.raises(PicksError, match="can't be read"):
        read_picks(tmp_path)


def test_a_header_alone_reads_as_no_picks_and_a_fit_is_refused(read):
    picks = read(HEADER)
    assert len(picks) == 0
    assert picks.source.shape == picks.target.shape == (0, 3)
    assert examine(picks) == ()
    with pytest.raises(PicksError, match=r"0 control picks .*at least 3"):
        require_control(picks)


def test_fewer_than_three_control_picks_are_refused_whatever_else_there_is(read):
    roles = ["control", "check", "off", "control"]
    rows = [f"{row},{role}" for row, role in zip(ROWS, roles, strict=True)]
    with pytest.raises(PicksError, match=r"2 control picks \(1 check, 1 off\)"):
        require_control(read(lines(*rows, header=HEADER + ",role")))
    require_control(read(lines(*ROWS[:3])))


# Files of other programs


@pytest.mark.parametrize(
    ("text", "what"),
    [
        ("#CRS: EPSG:3857\nmapX,mapY,sourceX,sourceY,enable\n1,2,3,4,1\n", "QGIS.*two-dimensional"),
        ("mapX,mapY,pixelX,pixelY,enable\n1,2,3,4,1\n", "QGIS.*two-dimensional"),
        ("1,12.5,3.25,8.0\n2,1.5,3.0,2.0\n", "CloudCompare picking list.*both clouds"),
        ("roof,12.5,3.25,8.0\nsill,1.5,3.0,2.0\n", "CloudCompare picking list"),
        ("12.5,3.25,8.0\n1.5,3.0,2.0\n", "CloudCompare picking list"),
        ("index,x,y,z\n1,12.5,3.25,8.0\n", "CloudCompare picking list"),
        ("Label, X, Y, Z\nroof,12.5,3.25,8.0\n", "CloudCompare picking list"),
        ("Final RMS: 0.12\n---\nTransformation matrix\n1 0 0 0\n", "CloudCompare registration"),
        ("1 0 0 5\n0 1 0 6\n0 0 1 7\n0 0 0 1\n", "4 x 4 matrix"),
        ("WGS84 UTM 17N\n441024.1 4564001.8 345.1 2648 2147 IMG_1.jpg\n", "OpenDroneMap.*images"),
        ("EPSG:32617\n441024.1 4564001.8 345.1 2648 2147 a.jpg gcp1\n", "OpenDroneMap.*images"),
    ],
)
def test_files_of_other_programs_are_told_apart_with_why_they_can_not_serve(text, what, read):
    with pytest.raises(PicksError, match=f"picks.csv: it is an? {what}") as caught:
        read(text)
    assert "target_z" in str(caught.value)
    assert "\n" not in str(caught.value)


# Units


def test_targets_in_feet_become_metres_and_sigmas_stay(read):
    crs = parse_crs("EPSG:2992+5703")
    picks = read(
        lines(ROWS[0] + ",0.02,0.5", header=HEADER + ",sigma_target,sigma_source"), crs=crs
    )
    assert picks.target[0].tolist() == [456527.174 * 0.3048, 5421291.59 * 0.3048, 129.124]
    assert (picks.sigma_target[0], picks.sigma_source[0]) == (0.02, 0.5)
    assert [caution.code for caution in picks.cautions] == ["units_converted"]
    assert read(lines(*ROWS), crs=parse_crs("EPSG:32615")).cautions == ()


def test_a_crs_in_degrees_is_refused(read):
    with pytest.raises(CrsError, match="refused for metric work"):
        read(lines(*ROWS), crs=pyproj.CRS(4326))


def test_feet_go_back_as_they_came(read, tmp_path):
    crs = parse_crs("ESRI:102696", vertical="EPSG:6360")
    picks = read(lines(*ROWS), crs=crs)
    write_picks(tmp_path / "again.csv", picks, crs=crs)
    text = (tmp_path / "again.csv").read_text()
    assert "456527.174,5421291.59,129.124" in text
    assert_same(read_picks(tmp_path / "again.csv", crs=crs), picks)


# Writing

COORDINATES = st.floats(-1e12, 1e12)
TEXTS = st.text(max_size=12)
IDS = TEXTS.filter(str.strip)
TRICKY = st.sampled_from(
    ['roof, "north"', "=cmd()", "+1", "two\nlines", "\r", " padded ", "a;b\tc", "\x00", "Ü 屋", "'"]
)


@st.composite
def any_picks(draw):
    ids = draw(st.lists(IDS | TRICKY.filter(str.strip), max_size=5, unique_by=str.strip))
    n = len(ids)

    def column(values):
        return draw(st.lists(values, min_size=n, max_size=n))

    sigmas = st.none() | st.floats(1e-9, 1e6)
    return picks_from(
        ids,
        np.reshape(column(st.tuples(*[COORDINATES] * 3)), (n, 3)),
        np.reshape(column(st.tuples(*[COORDINATES] * 3)), (n, 3)),
        roles=column(st.sampled_from(["control", "check", "off"])),
        sigma_source=np.array(column(sigmas), np.float64),
        sigma_target=np.array(column(sigmas), np.float64),
        notes=column(TEXTS | TRICKY),
        extra=pd.DataFrame({"photo, left": column(TEXTS | TRICKY)}, dtype=object),
    )


@settings(deadline=None)
@given(any_picks())
def test_what_is_written_reads_back_the_same_to_the_last_bit(tmp_path_factory, picks):
    path = tmp_path_factory.mktemp("picks") / "picks.csv"
    write_picks(path, picks)
    assert_same(read_picks(path), picks)


def test_columns_that_hold_nothing_are_not_written(read, tmp_path):
    picks = read(lines(*ROWS))
    write_picks(tmp_path / "again.csv", picks)
    assert (tmp_path / "again.csv").read_text().splitlines()[0] == HEADER


def test_a_cell_that_looks_like_a_formula_is_kept_as_text(read, tmp_path):
    picks = read(changed("id", "=cmd|' /C calc'!A0"))
    write_picks(tmp_path / "again.csv", picks)
    assert read_picks(tmp_path / "again.csv").ids[1] == "=cmd|' /C calc'!A0"


def test_a_failed_write_leaves_the_old_file_and_nothing_beside_it(read, tmp_path, monkeypatch):
    picks = read(lines(*ROWS))
    path = tmp_path / "kept.csv"
    path.write_text("old")

    def fail(*_):
        raise OSError(28, os.strerror(28))

    monkeypatch.setattr(type(path), "replace", fail)
    with pytest.raises(PicksError, match=r"kept.csv can't be written: No space"):
        write_picks(path, picks)
    assert path.read_text() == "old"
    assert sorted(p.name for p in tmp_path.iterdir()) == ["kept.csv", "picks.csv"]


# Building


@pytest.mark.parametrize(
    ("settings", "reason"),
    [
        ({"roles": ["control", "check"]}, "they must match"),
        ({"notes": ["wet"]}, "they must match"),
        ({"target": np.zeros((3, 2))}, "they must match"),
        ({"source": np.full((3, 3), np.nan)}, "'a': source_x is nan, no coordinate"),
        ({"roles": ["control", "checks", "off"]}, "'b' has the unknown role 'checks'"),
        ({"sigma_target": [0.1, 0, np.nan]}, "'b': sigma_target is 0"),
        ({"extra": pd.DataFrame({"role": ["x"] * 3})}, "can't be called 'role'"),
        ({"extra": pd.DataFrame({" x": ["x"] * 3})}, "can't be called ' x'"),
    ],
)
def test_arrays_that_make_no_picks_are_refused(settings, reason):
    arguments = {"source": np.eye(3), "target": np.eye(3)} | settings
    with pytest.raises(PicksError, match=reason):
        picks_from(["a", "b", "c"], **arguments)


def test_one_sigma_serves_all_and_arguments_are_copied():
    source = np.eye(3)
    picks = picks_from(["a", "b", "c"], source, source, sigma_target=0.02)
    assert picks.sigma_target.tolist() == [0.02] * 3
    source[0, 0] = 7
    assert picks.source[0, 0] == picks.target[0, 0] == 1


# Doubts


def scattered(seed, count=6):
    return np.random.default_rng(seed).uniform(-5, 5, (count, 3))


def named(source, target, **settings):
    return picks_from([f"p{i}" for i in range(len(source))], source, target, **settings)


def test_sound_picks_raise_no_doubt(similarity_from, offset):
    source = scattered(1)
    assert codes(named(source, similarity_from(1, offset)(source))) == []


def test_equal_rows_are_warned_of_by_name(similarity_from, offset):
    source = scattered(2)
    target = similarity_from(2, offset)(source)
    source[3] = source[1]
    (caution,) = examine(named(source, target))
    assert caution.code == "picks_equal"
    assert "'p1' and 'p3' have the same source" in caution.message
    source, target = scattered(2), target.copy()
    target[3] = target[1]
    assert "same target" in examine(named(source, target))[0].message
    assert codes(named(source, target, roles=["control"] * 3 + ["off"] + ["control"] * 2)) == []


def test_sources_that_look_georeferenced_while_targets_do_not_are_warned_of(similarity_from):
    model = scattered(3)
    ground = similarity_from(3, np.array([741_000, 4_279_000, 150.0]))(model)
    assert codes(named(ground, model)) == ["picks_swapped"]
    assert codes(named(ground, ground)) == codes(named(model, ground)) == []


def test_coplanar_control_picks_are_flagged_even_where_a_check_is_off_the_plane(offset):
    flat = scattered(4) * [1, 1, 0]
    flat[5, 2] = 3
    roles = ["control"] * 5 + ["check"]
    target = Similarity(3.26, np.eye(3), offset)(flat)
    assert codes(named(flat, target, roles=roles)) == ["picks_coplanar"]
    assert codes(named(flat, target)) == []


def test_mirrored_picks_are_flagged(similarity_from, offset):
    source = scattered(5)
    target = similarity_from(5, offset)(source * [1, 1, -1])
    assert codes(named(source, target)) == ["picks_mirrored"]


@pytest.mark.parametrize("count", [1, 2, 3, 5])
@pytest.mark.parametrize("shape", ["one place", "a line", "zeros"])
def test_degenerate_picks_are_examined_without_an_error(count, shape, offset):
    steps = np.arange(count)[:, None] * {"one place": 0.0, "a line": 1.0, "zeros": 0.0}[shape]
    points = steps * [1.0, 2, 3] + (0 if shape == "zeros" else offset)
    assert set(codes(named(points, points))) <= {"picks_equal", "picks_coplanar"}


@settings(deadline=None)
@given(any_picks())
def test_examining_never_raises(picks):
    examine(picks)


def test_a_folder_that_is_none_is_said_to_be_unwritable(read, tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(PicksError, match=r"picks.csv can't be written: "):
        write_picks(tmp_path / "file" / "picks.csv", read(lines(*ROWS)))
