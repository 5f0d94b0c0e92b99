import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from trigpoint.canonical import plain, to_json, write_text


def test_lengths_are_rounded_to_a_nanometre_and_others_further():
    rounded = plain(
        {"rmse_m": 0.1234567891234, "scale": 3.2601234567891234, "x": 741_000.1234567891}
    )
    assert rounded == {"rmse_m": 0.123456789, "scale": 3.260123456789, "x": 741_000.123456789}


def test_a_small_covariance_keeps_its_digits():
    assert plain({"covariance": [[1.23456789012345e-14]]}) == {"covariance": [[1.23456789012e-14]]}


def test_what_is_missing_is_null_and_never_nan():
    text = to_json(
        {"a": np.nan, "b": [np.inf, -np.inf], "c": None, "d": pd.DataFrame({"d_m": [np.nan]})}
    )
    assert json.loads(text) == {"a": None, "b": [None, None], "c": None, "d": [{"d_m": None}]}


def test_numpy_values_become_plain_ones():
    value = plain({"n": np.int64(3), "ok": np.bool_(True), "m": np.eye(2), "z": np.float64(-0.0)})
    assert json.dumps(value) == '{"n": 3, "ok": true, "m": [[1.0, 0.0], [0.0, 1.0]], "z": 0.0}'


def test_text_of_any_script_survives():
    text = to_json({"title": '"); import os\n<script>é塔'})
    assert json.loads(text)["title"] == '"); import os\n<script>é塔'


def test_a_failed_write_leaves_the_old_file_and_nothing_else(tmp_path, monkeypatch):
    path = tmp_path / "results.json"
    write_text(path, "old")

    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Path, "replace", full)
    with pytest.raises(OSError, match="No space"):
        write_text(path, "new")
    assert [each.name for each in tmp_path.iterdir()] == ["results.json"]
    assert path.read_text() == "old"
