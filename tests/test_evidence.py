import numpy as np
import pandas as pd

from trigpoint.cloud import PointCloud
from trigpoint.files import write
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


def test_a_thinned_cloud_is_read_once_and_one_without_points_is_none(tmp_path):
    folder = tmp_path / "clouds"
    folder.mkdir()
    cloud = PointCloud(np.arange(6.0).reshape(2, 3), np.zeros(3))
    write(folder / "nerf-accuracy.laz", cloud)
    evidence = Evidence(tmp_path, {})
    read = evidence.cloud("nerf", "accuracy")
    assert len(read) == 2
    assert evidence.cloud("nerf", "accuracy") is read
    assert evidence.cloud("sfm", "accuracy") is None
