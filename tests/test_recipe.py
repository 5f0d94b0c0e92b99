import dataclasses
import tomllib

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from trigpoint.project import read_project
from trigpoint_reporting.recipe import to_toml, write_recipe

TEXT = st.text(st.characters(exclude_categories=["Cs"]))
VALUES = st.one_of(
    TEXT,
    st.booleans(),
    st.integers(-(2**60), 2**60),
    st.floats(allow_nan=False, allow_infinity=False),
    st.dates(),
    st.lists(st.floats(allow_nan=False, allow_infinity=False)),
)


@given(st.dictionaries(st.sampled_from("abcdef"), VALUES), st.lists(TEXT))
def test_whatever_is_written_reads_back(table, texts):
    tables = {"one": table, "many": [{"text": text} for text in texts]}
    read = tomllib.loads(to_toml(tables))
    assert read["one"] == table
    assert read.get("many", []) == tables["many"]


def test_a_project_written_as_it_was_run_reads_back_the_same(small_project, tmp_path):
    extra = (
        'margin_m = "none"\n'
        '[[limit]]\nquantity = "loocv.rmse_m"\nof = "nerf"\nmax = 0.2\nsource = "a \\"b\\""\n'
        '[[cross_check]]\nkind = "scale_bar"\nfrom = [0, 0, 0]\nto = [1, 0, 0]\n'
        'length_m = 3.2\nsigma_m = 0.01\nof = "nerf"\n'
    )
    path, _ = small_project(extra=extra)
    project = read_project(path)
    folder = tmp_path / "config"
    folder.mkdir()
    write_recipe(folder, project)
    again = read_project(folder / "project.toml")
    for field in dataclasses.fields(project):
        if field.name not in ("path", "reference", "reconstructions"):
            assert getattr(again, field.name) == getattr(project, field.name), field.name
    assert again.reference.path == folder / "lidar.laz"
    assert again.reference.accuracy_m == project.reference.accuracy_m
    assert [each.name for each in again.reconstructions] == ["nerf", "sfm"]
    assert again.reconstructions[1].picks is None


def test_no_path_of_the_machine_is_written(small_project, tmp_path):
    path, _ = small_project()
    text = path.read_text("utf-8")
    other = tmp_path / "elsewhere"
    other.mkdir()
    (path.parent / "picks.csv").rename(other / "Picks.CSV")
    picks = (other / "Picks.CSV").as_posix()
    path.write_text(text.replace('"picks.csv"', f'"{picks}"'), "utf-8")
    folder = tmp_path / "config"
    folder.mkdir()
    write_recipe(folder, read_project(path))
    written = (folder / "project.toml").read_text("utf-8")
    assert str(tmp_path) not in written
    assert 'picks = "Picks.CSV"' in written
    copy = folder / "picks-nerf.csv"
    assert copy.read_bytes() == (other / "Picks.CSV").read_bytes()


def test_numbers_are_written_to_the_last_bit():
    value = float(np.nextafter(0.1, 1))
    assert tomllib.loads(to_toml({"a": {"x": value}}))["a"]["x"] == value
