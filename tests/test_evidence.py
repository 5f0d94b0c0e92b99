import pandas as pd

from trigpoint_reporting.evidence import Evidence


def test_ids_stay_as_they_are_written_and_empty_numbers_are_missing(tmp_path):
    (tmp_path / "data").mkdir()
    rows = "id,d_m,used\nNA,,True\n007,1.5,False\nnull,2,True\n"
    (tmp_path / "data" / "picks-nerf.csv").write_text(rows)
    table = Evidence(tmp_path, {}).table("picks-nerf")
    assert table["id"].tolist() == ["NA", "007", "null"]
    assert table["used"].tolist() == [True, False, True]
    assert pd.isna(table["d_m"][0])
    assert table["d_m"][1:].tolist() == [1.5, 2.0]
