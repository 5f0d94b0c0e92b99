"""PLY in all its kinds, written by plyfile and by hand."""

import numpy as np
import plyfile
import pytest

from trigpoint.cloud import PointCloud
from trigpoint.errors import CloudError
from trigpoint.files import carry, describe, read, stream, write
from trigpoint.similarity import Similarity

UTM = np.array([741_000.0, 4_279_000.0, 150.0])
CUBE = np.array([[x, y, z] for x in (0.0, 1) for y in (0.0, 1) for z in (0.0, 1)])


def ply_file(path, points, *, dtype="f8", text=False, order="<", faces=None, **properties):
    columns = {**dict(zip("xyz", points.T, strict=True)), **properties}
    types = [(n, dtype if n in "xyz" else v.dtype) for n, v in columns.items()]
    rows = np.empty(len(points), types)
    for name, values in columns.items():
        rows[name] = values
    elements = [plyfile.PlyElement.describe(rows, "vertex")]
    if faces is not None:
        corners = np.empty(len(faces), [("vertex_indices", "O")])
        corners["vertex_indices"] = [np.array(face, "i4") for face in faces]
        elements.append(
            plyfile.PlyElement.describe(corners, "face", val_types={"vertex_indices": "i4"})
        )
    plyfile.PlyData(elements, text=text, byte_order="=" if text else order).write(path)


@pytest.mark.parametrize("dtype", ["f4", "f8"])
@pytest.mark.parametrize(("text", "order"), [(True, "="), (False, "<"), (False, ">")])
def test_every_kind_is_read(tmp_path, dtype, text, order):
    red = np.arange(8, dtype=np.uint8)
    count = np.arange(8, dtype=np.int16) - 4
    ply_file(tmp_path / "a.ply", CUBE, dtype=dtype, text=text, order=order, red=red, count=count)
    cloud = read(tmp_path / "a.ply")
    np.testing.assert_array_equal(cloud.coordinates, CUBE)
    np.testing.assert_array_equal(cloud.attributes["red"], red)
    np.testing.assert_array_equal(cloud.attributes["count"], count)
    assert cloud.attributes["count"].dtype == np.dtype("i2")
    assert [len(piece) for piece in stream(tmp_path / "a.ply", chunk=3)] == [3, 3, 2]


def test_trap_1_single_precision_in_utm_is_doubted(tmp_path):
    ply_file(tmp_path / "single.ply", CUBE + UTM, dtype="f4")
    ply_file(tmp_path / "double.ply", CUBE + UTM)
    ply_file(tmp_path / "local.ply", CUBE, dtype="f4")
    assert [c.code for c in describe(tmp_path / "single.ply").cautions] == ["coordinates_coarse"]
    assert "0.5 m" in describe(tmp_path / "single.ply").cautions[0].message
    assert describe(tmp_path / "double.ply").cautions == ()
    assert describe(tmp_path / "single.ply").format == "PLY 1.0, little endian, float"
    assert describe(tmp_path / "local.ply").cautions == ()
    np.testing.assert_array_equal(read(tmp_path / "double.ply").coordinates, CUBE + UTM)


def test_trap_1_text_keeps_the_digits_that_its_type_would_drop(tmp_path):
    ply_file(tmp_path / "a.ply", CUBE + UTM + 0.123, text=True)
    content = (tmp_path / "a.ply").read_bytes()
    (tmp_path / "a.ply").write_bytes(content.replace(b"property double", b"property float"))
    np.testing.assert_allclose(read(tmp_path / "a.ply").coordinates, CUBE + UTM + 0.123, atol=1e-9)
    assert describe(tmp_path / "a.ply").cautions == ()


@pytest.mark.parametrize("text", [True, False])
def test_a_mesh_is_carried_with_its_faces(tmp_path, text):
    triangles = [[0, 1, 2], [1, 3, 2], [4, 5, 6]]
    ply_file(tmp_path / "a.ply", CUBE, text=text, faces=triangles)
    fit = Similarity(2.0, np.eye(3), UTM)
    carry(tmp_path / "a.ply", tmp_path / "b.ply", fit)
    mesh = read(tmp_path / "b.ply")
    assert mesh.faces.tolist() == triangles
    np.testing.assert_array_equal(mesh.coordinates, 2 * CUBE + UTM)
    assert plyfile.PlyData.read(tmp_path / "b.ply")["face"]["vertex_indices"][1].tolist() == [
        1,
        3,
        2,
    ]
    assert read(tmp_path / "b.ply", attributes=False).faces is None


@pytest.mark.parametrize("text", [True, False])
def test_polygons_become_fans_of_triangles(tmp_path, text):
    ply_file(tmp_path / "a.ply", CUBE, text=text, faces=[[0, 1, 3, 2], [4, 5, 6], [0, 1, 2, 3, 4]])
    triangles = [[0, 1, 3], [0, 3, 2], [4, 5, 6], [0, 1, 2], [0, 2, 3], [0, 3, 4]]
    assert read(tmp_path / "a.ply").faces.tolist() == triangles


def test_faces_of_points_that_are_left_out_go_with_them(tmp_path):
    points = CUBE.copy()
    points[0, 0] = np.nan
    ply_file(tmp_path / "a.ply", points, faces=[[0, 1, 2], [1, 3, 2], [4, 5, 6]])
    mesh = read(tmp_path / "a.ply")
    assert mesh.faces.tolist() == [[0, 2, 1], [3, 4, 5]]
    np.testing.assert_array_equal(mesh.coordinates, CUBE[1:])


def test_faces_of_pieces_point_at_their_own_points(tmp_path):
    piece = PointCloud(CUBE, np.zeros(3), {}, None, np.array([[0, 1, 2]]))
    write(tmp_path / "a.ply", [piece, piece])
    assert read(tmp_path / "a.ply").faces.tolist() == [[0, 1, 2], [8, 9, 10]]


def test_a_face_of_points_that_are_not_there_is_refused(tmp_path):
    ply_file(tmp_path / "a.ply", CUBE, faces=[[0, 1, 8]])
    with pytest.raises(
        CloudError, match=r"a\.ply: the faces name vertices 0 to 8, and there are 8"
    ):
        read(tmp_path / "a.ply")


def test_a_gaussian_splat_is_refused_with_the_reason(tmp_path):
    names = ["f_dc_0", "opacity", "scale_0", "rot_0"]
    ply_file(tmp_path / "a.ply", CUBE, dtype="f4", **{n: np.zeros(8, "f4") for n in names})
    with pytest.raises(CloudError, match="it needs more than its positions moved"):
        read(tmp_path / "a.ply")


def test_what_is_not_read_is_named(tmp_path):
    text = (
        "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\n"
        "property float z\nproperty list uchar int seen_by\nelement edge 1\nproperty int a\n"
        "end_header\n1 2 3 2 7 8\n5\n"
    )
    (tmp_path / "a.ply").write_text(text)
    found = describe(tmp_path / "a.ply")
    assert [c.code for c in found.cautions] == ["attribute_dropped"]
    assert "seen_by, edge" in found.cautions[0].message
    assert read(tmp_path / "a.ply").coordinates.tolist() == [[1, 2, 3]]


def test_a_ply_without_coordinates_is_refused(tmp_path):
    ply_file(tmp_path / "a.ply", CUBE)
    content = (tmp_path / "a.ply").read_bytes()
    (tmp_path / "b.ply").write_bytes(content.replace(b"double z", b"double w"))
    with pytest.raises(CloudError, match=r"b\.ply has x, y, w: a point cloud needs x, y and z"):
        read(tmp_path / "b.ply")
    (tmp_path / "c.ply").write_bytes(content.replace(b"element vertex", b"element vortex"))
    with pytest.raises(CloudError, match=r"c\.ply has no vertices"):
        read(tmp_path / "c.ply")


def test_types_that_ply_has_not_become_ones_it_has(tmp_path):
    attributes = {
        "big": np.array([1, 2**40, -(2**40)]),
        "yes": np.array([True, False, True]),
        "half": np.array([0.5, 1, 2], np.float16),
        "pair": np.arange(6).reshape(3, 2).astype("u1"),
        "label": np.array(["a", "b", "c"]),
        "huge": np.array([0, 1, 2**63 + 1], np.uint64),
    }
    cautions = write(tmp_path / "a.ply", PointCloud(CUBE[:3], np.zeros(3), attributes))
    assert [c.message.split("'")[2] for c in cautions] == ["label", "huge"]
    back = read(tmp_path / "a.ply").attributes
    assert back["big"].tolist() == [1, 2**40, -(2**40)]
    assert back["yes"].tolist() == [1, 0, 1]
    assert (back["half"].dtype, back["pair_1"].tolist()) == (np.float32, [1, 3, 5])
