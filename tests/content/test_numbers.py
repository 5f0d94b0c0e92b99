import json
import re

import pytest
from hypothesis import given
from hypothesis import strategies as st

from trigpoint_reporting.numbers import (
    NOT_AVAILABLE,
    RULES,
    Numbers,
    declared_digits,
    derived,
    number_text,
    write_rounding,
)
from trigpoint_reporting.verifier import verify

PATHS = {
    "reconstructions.nerf.alignment.rmse_m": 3,
    "reconstructions.nerf.alignment.residuals[p.0].dx_m": 3,
    "reconstructions.nerf.alignment.mean_m.2": 3,
    "reconstructions.nerf.alignment.scale": 6,
    "reconstructions.nerf.alignment.rotation.0.2": 9,
    "reconstructions.nerf.alignment.matrix.0.2": 9,
    "reconstructions.nerf.alignment.matrix.0.3": 3,
    "reconstructions.nerf.alignment.translation.0": 3,
    "reconstructions.nerf.alignment.threshold_m": None,
    "reconstructions.nerf.loocv.folds[a\nb].scale_change_pct": 3,
    "reconstructions.nerf.reliability.rotation_sigma_deg.1": 3,
    "reconstructions.nerf.reliability.picks[p].p_value": 4,
    "reconstructions.nerf.comparison.delivered.accuracy.all.within[0.1].pct": 1,
    "reconstructions.nerf.comparison.delivered.accuracy.all.within[0.1].low_pct": 1,
    "project.settings.comparison.voxel_m": None,
    "crs.mm_over_100_m": 1,
    "crs.longitude_deg": 6,
    "paired.delivered.0.differences.3.difference_pct": 1,
}


@pytest.mark.parametrize(("path", "digits"), list(PATHS.items()))
def test_every_path_has_one_declared_rounding(path, digits):
    assert declared_digits(path) == digits


def test_the_declared_rounding_is_data_that_a_stranger_reads_the_same_way(tmp_path):
    write_rounding(tmp_path / "rounding.json")
    stored = json.loads((tmp_path / "rounding.json").read_text("utf-8"))
    assert len(stored["rules"]) == len(RULES)
    for path, digits in PATHS.items():
        assert verify.digits_for(stored, path, {}) == digits


def test_a_minus_is_a_minus_and_zero_has_none():
    assert number_text(-0.1374, 3) == "\N{MINUS SIGN}0.137"
    assert number_text(-0.0004, 3) == "0.000"


def test_counts_are_grouped_and_coordinates_are_not():
    assert number_text(4279060) == "4,279,060"
    assert number_text(4279060.7069, 3) == "4279060.707"


@pytest.mark.parametrize("value", [None, float("nan"), float("inf")])
def test_what_is_missing_is_not_available(value):
    assert number_text(value, 3) == NOT_AVAILABLE
    assert derived(value, 3).text == NOT_AVAILABLE


@given(st.floats(-1e9, 1e9, allow_subnormal=False), st.integers(0, 9))
def test_no_number_is_printed_with_an_exponent_or_further_off_than_its_rounding(value, digits):
    text = number_text(value, digits)
    assert re.fullmatch("\N{MINUS SIGN}?\\d+(\\.\\d+)?", text)
    assert verify.printed_right(text, value, digits)[0]


@given(st.floats(0, 1e6, allow_subnormal=False))
def test_a_setting_is_printed_as_it_was_set(value):
    text = number_text(value)
    assert "e" not in text
    assert float(text) == value


def test_a_pick_called_1_is_not_taken_for_row_1():
    stored = [{"id": "1", "d_m": 0.1}, {"id": "0", "d_m": 0.2}, {"id": "x]", "d_m": 0.3}]
    cells = [row.value("d_m") for row in Numbers({"picks": stored}).rows("picks")]
    for row, cell in zip(stored, cells, strict=True):
        assert verify.look_up({"picks": stored}, cell.path) == row["d_m"]


def test_a_row_that_no_path_can_name_is_printed_without_one():
    stored = [{"id": "1", "d_m": 0.1}, {"id": "a]", "d_m": 0.25}]
    cell = Numbers({"picks": stored}).rows("picks")[1].value("d_m")
    assert (cell.text, cell.path) == ("0.250", "")


def test_rows_of_thresholds_are_named_by_them():
    stored = {"within": [{"threshold_m": 1.0, "pct": 60.0}, {"threshold_m": 2.0, "pct": 80.0}]}
    paths = [row.value("pct").path for row in Numbers(stored).rows("within")]
    assert paths == ["within[1.0].pct", "within[2.0].pct"]


def test_names_may_hold_dots():
    stored = {"reconstructions": {"nerf": {"n": 1}, "nerf.v2": {"n": 2}}}
    cell = Numbers(stored).value("reconstructions", "nerf.v2", "n")
    assert verify.look_up(stored, cell.path) == 2


def test_what_is_not_there_is_not_available_and_has_no_path():
    numbers = Numbers({"a": {"b": None}})
    assert numbers.value("a", "c", "d").path == ""
    assert numbers.value("a", "c", "d").text == NOT_AVAILABLE
    assert numbers.value("a", "b").path == "a.b"
    assert numbers.rows("a", "b") == []
    assert list(numbers.items("a", "b")) == []


def test_text_that_can_not_be_printed_as_it_is_carries_no_path():
    numbers = Numbers({"plain": "EPSG:32615", "turned": "a\u202eb", "padded": " x"})
    assert numbers.value("plain").path == "plain"
    assert [numbers.value(key).path for key in ("turned", "padded")] == ["", ""]
