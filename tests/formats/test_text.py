"""Plain tables in the many ways that people write them."""

import numpy as np
import pytest

from trigpoint.cloud import PointCloud
from trigpoint.errors import CloudError
from trigpoint.files import describe, read, stream, write

ROWS = np.array([[741_000.125, 4_279_000.25, 150.5], [741_001.0, 4_279_002.0, 151.0]])
TABLES = {
    "blanks": "741000.125 4279000.25 150.5\n741001 4279002 151\n",
    "indented blanks": "  741000.125   4279000.25\t150.5\n  741001   4279002  151\n",
    "tabs": "741000.125\t4279000.25\t150.5\n741001\t4279002\t151\n",
    "commas": "741000.125,4279000.25,150.5\n741001,4279002,151\n",
    "commas and blanks": "741000.125 , 4279000.25 , 150.5\n741001 , 4279002 , 151\n",
    "semicolons": "741000.125;4279000.25;150.5\n741001;4279002;151\n",
    "decimal commas": "741000,125;4279000,25;150,5\n741001,0;4279002;151\n",
    "header": "x,y,z\n741000.125,4279000.25,150.5\n741001,4279002,151\n",
    "capital header": "X Y Z\n741000.125 4279000.25 150.5\n741001 4279002 151\n",
    "another order": "z,y,x\n150.5,4279000.25,741000.125\n151,4279002,741001\n",
    "CloudCompare": "//X Y Z\n741000.125 4279000.25 150.5\n741001 4279002 151\n",
    "comments": "# made by hand\n\n741000.125 4279000.25 150.5\n# more\n741001 4279002 151\n",
    "byte order mark": "\ufeffx,y,z\n741000.125,4279000.25,150.5\n741001,4279002,151\n",
    "Windows": "x,y,z\r\n741000.125,4279000.25,150.5\r\n741001,4279002,151\r\n",
    "no last newline": "741000.125 4279000.25 150.5\n741001 4279002 151",
    "exponents": "7.41000125e5 4.27900025e6 1.505e2\n7.41001e5 4.279002e6 151\n",
}


@pytest.mark.parametrize("kind", TABLES)
def test_every_kind_of_table_is_read(tmp_path, kind):
    (tmp_path / "a.txt").write_bytes(TABLES[kind].encode())
    cloud = read(tmp_path / "a.txt")
    np.testing.assert_allclose(cloud.coordinates, ROWS, rtol=0, atol=2e-9)
    assert cloud.attributes == {}
    assert len(list(stream(tmp_path / "a.txt", chunk=1))) == 2


def test_further_columns_are_attributes(tmp_path):
    (tmp_path / "a.xyz").write_text("1 2 3 200 7\n4 5 6 201 8\n")
    assert {n: v.tolist() for n, v in read(tmp_path / "a.xyz").attributes.items()} == {
        "c3": [200, 201],
        "c4": [7, 8],
    }
    (tmp_path / "a.csv").write_text(
        'id,x,y,z,"a note",red\np1,1,2,3,"roof, high",200\np2,4,5,6,,\n'
    )
    found = read(tmp_path / "a.csv").attributes
    assert found["id"].tolist() == ["p1", "p2"]
    assert found["a note"].tolist() == ["roof, high", ""]
    np.testing.assert_array_equal(found["red"], [200, np.nan])
    assert describe(tmp_path / "a.csv").attributes == ("id", "a note", "red")


def test_words_survive_a_table(tmp_path):
    cloud = PointCloud(np.eye(3), np.zeros(3), {"label": np.array(["a b", 'c "d" #1', "=e()"])})
    for suffix in (".csv", ".txt"):
        assert write(tmp_path / f"a{suffix}", cloud) == ()
        back = read(tmp_path / f"a{suffix}")
        assert back.attributes["label"].tolist() == ["a b", 'c "d" #1', "=e()"]


def test_without_attributes_xyz_has_no_header(tmp_path):
    cloud = PointCloud(np.eye(3), np.zeros(3))
    write(tmp_path / "a.xyz", cloud)
    write(tmp_path / "a.csv", cloud)
    assert (tmp_path / "a.xyz").read_text() == "1.0 0.0 0.0\n0.0 1.0 0.0\n0.0 0.0 1.0\n"
    assert (tmp_path / "a.csv").read_text().startswith("x,y,z\n")


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ("1 2\n3 4\n", "2 columns in line 1"),
        ("x,y,z\n", "nothing below it"),
        ("x,y,z\n1,2\n", "2 columns in line 2 below 3 names: .* needs x, y and z in each line"),
        ("dense\n1 2 3\n", "3 columns in line 2 below 1 name: .* a name for each column or none"),
        ("hello world\nthis is not\n", "no numbers in line 2: a point cloud has x, y and z of one"),
        ("a,b,c\n1,2,3\n", "has a, b, c: a point cloud needs x, y and z"),
        ("x,y,z,x\n1,2,3,4\n", "two columns of the same name"),
        ("# only this\n", "no rows of numbers"),
        ("1 2 3\n4 five 6\n", "can't be read as TXT"),
    ],
)
def test_what_is_no_table_of_points_is_refused(tmp_path, content, words):
    (tmp_path / "a.txt").write_text(content)
    with pytest.raises(CloudError, match=words):
        read(tmp_path / "a.txt")
