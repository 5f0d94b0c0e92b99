"""Files that lie beside clouds and are none are called by their names."""

import json

import pytest

from trigpoint.errors import CloudError
from trigpoint.files import read

FILES = {
    "matrix.txt": ("1 0 0 5\n0 1 0 6\n0 0 1 7\n0 0 0 1\n", "a 4x4 transformation matrix"),
    "helmert.txt": ("1 0 0\n0 1 0\n0 0 1\n5 6 7\n2\n", "the parameters of a similarity"),
    "run.tum": ("1.5 1 2 3 0 0 0 1\n2.5 1 2 3 0 0 0.6 0.8\n", "a trajectory"),
    "run.log": ("0 0 0\n1 0 0 5\n0 1 0 6\n0 0 1 7\n0 0 0 1\n1 1 0\n", "a camera trajectory"),
    "gcp_list.txt": (
        "EPSG:32615\n741000 4279000 150 10 20 a.jpg\n741001 4279000 150 11 20 a.jpg\n",
        "a list of ground control points",
    ),
    "map.points": ("#CRS: EPSG:3857\nmapX,mapY,sourceX,sourceY\n1,2,3,4\n", "two-dimensional"),
    "picks.csv": ("id,source_x,source_y,source_z,target_x,target_y,target_z\n", "a file of picks"),
    "transforms.json": (
        json.dumps({"frames": [{"transform_matrix": [[1]]}]}),
        "a nerfstudio or instant-ngp camera file",
    ),
    "reconstruction.json": (
        json.dumps([{"cameras": {}, "shots": {}}]),
        "an OpenSfM reconstruction",
    ),
    "gcps.json": (json.dumps({"points": [{"observations": []}]}), "OpenSfM's ground control"),
    "fit.json": (json.dumps({"scale": 1, "rotation": [], "translation": []}), "a similarity"),
    "broken.json": ("{", "JSON that can't be parsed"),
    "list.json": ("[]", "JSON of an unknown kind"),
    "points3D.bin": ("", "part of a COLMAP model"),
}


@pytest.mark.parametrize("name", FILES)
def test_a_file_that_is_no_cloud_is_called_what_it_is(tmp_path, name):
    content, words = FILES[name]
    (tmp_path / name).write_text(content)
    with pytest.raises(CloudError, match=rf"{name} is not a point cloud: it is .*{words}"):
        read(tmp_path / name)


def test_a_folder_is_called_what_it_is(tmp_path):
    with pytest.raises(CloudError, match="it is a folder"):
        read(tmp_path)
    (tmp_path / "cameras.bin").write_bytes(b"")
    with pytest.raises(CloudError, match="it is a COLMAP model folder"):
        read(tmp_path)


@pytest.mark.parametrize(
    "rows",
    [
        "0 0 0 1\n1 0 0 1\n0 1 0 1\n0 0 1 1\n",  # four points with a fourth column
        "1 2 3\n4 5 6\n7 8 9\n",
        "1.5 1 2 3 0 0 0 7\n2.5 1 2 3 0 0 0.6 0.8\n",  # eight columns, no quaternion
    ],
)
def test_a_small_cloud_is_no_matrix_and_no_trajectory(tmp_path, rows):
    (tmp_path / "a.txt").write_text(rows)
    assert len(read(tmp_path / "a.txt")) == rows.count("\n")
