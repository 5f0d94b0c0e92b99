"""PCD, made by hand in its three encodings."""

import numpy as np
import pytest

from trigpoint.errors import CloudError
from trigpoint.files import describe, read, stream

UTM = np.array([741_000.0, 4_279_000.0, 150.0])


def pack(data):
    """LZF in the plainest way: literals, and a back reference where the last 8 bytes repeat."""
    out, at = bytearray(), 0
    while at < len(data):
        if at >= 8 and data[at : at + 8] == data[at - 8 : at]:
            run = 8
            while run < 262 and at + run < len(data) and data[at + run] == data[at + run - 8]:
                run += 1
            out += bytes([(7 << 5) | 0, run - 9, 7]) if run >= 9 else bytes([((run - 2) << 5), 7])
            at += run
        else:
            piece = data[at : at + 4]
            out += bytes([len(piece) - 1]) + piece
            at += len(piece)
    return bytes(out)


def pcd_file(path, rows, encoding):
    fields = rows.dtype.names
    plain = [rows.dtype[n] for n in fields]
    lines = [
        "# .PCD v0.7",
        "VERSION 0.7",
        "FIELDS " + " ".join(fields),
        "SIZE " + " ".join(str(t.base.itemsize) for t in plain),
        "TYPE " + " ".join({"f": "F", "i": "I", "u": "U"}[t.base.kind] for t in plain),
        "COUNT " + " ".join(str(t.shape[0] if t.shape else 1) for t in plain),
        f"WIDTH {len(rows)}",
        "HEIGHT 1",
        "VIEWPOINT 0 0 0 1 0 0 0",
        f"POINTS {len(rows)}",
        f"DATA {encoding}",
    ]
    head = ("\n".join(lines) + "\n").encode()
    if encoding == "ascii":
        text = "\n".join(
            " ".join(repr(v) for c in row for v in np.atleast_1d(c).tolist())
            for row in rows.tolist()
        )
        path.write_bytes(head + text.encode() + b"\n")
    elif encoding == "binary":
        path.write_bytes(head + rows.tobytes())
    else:
        data = b"".join(np.ascontiguousarray(rows[n]).tobytes() for n in fields)
        packed = pack(data)
        path.write_bytes(head + np.array([len(packed), len(data)], "<u4").tobytes() + packed)


def rows_at(offset, dtype="<f8", n=50):
    rng = np.random.default_rng(2)
    rows = np.zeros(
        n,
        [
            ("x", dtype),
            ("y", dtype),
            ("z", dtype),
            ("rgb", "<u4"),
            ("intensity", "<f4"),
            ("histogram", "<f4", (3,)),
            ("same", "<i2"),
        ],
    )
    for axis, name in enumerate("xyz"):
        rows[name] = rng.uniform(-5, 5, n) + offset[axis]
    rows["rgb"], rows["intensity"], rows["same"] = 0x0A141E, np.arange(n), -3
    rows["histogram"] = rng.normal(size=(n, 3))
    return rows


@pytest.mark.parametrize("encoding", ["ascii", "binary", "binary_compressed"])
def test_every_encoding_is_read(tmp_path, encoding, offset):
    rows = rows_at(offset)
    pcd_file(tmp_path / "a.pcd", rows, encoding)
    cloud = read(tmp_path / "a.pcd")
    expected = np.column_stack([rows[n] for n in "xyz"])
    np.testing.assert_allclose(cloud.coordinates, expected, rtol=0, atol=2e-9)
    np.testing.assert_array_equal(cloud.attributes["intensity"], rows["intensity"])
    np.testing.assert_allclose(cloud.attributes["histogram"], rows["histogram"], rtol=1e-7)
    colour = [cloud.attributes[n][0] for n in ("red", "green", "blue")]
    assert colour == [10, 20, 30]
    assert len(list(stream(tmp_path / "a.pcd", chunk=20))) == 3
    assert describe(tmp_path / "a.pcd").attributes == (
        "intensity",
        "histogram",
        "same",
        "red",
        "green",
        "blue",
    )


def test_an_organised_cloud_has_holes_that_are_left_out(tmp_path):
    rows = rows_at(np.zeros(3), "<f4")
    rows["x"][5:9] = np.nan
    pcd_file(tmp_path / "a.pcd", rows, "binary")
    assert len(read(tmp_path / "a.pcd")) == 46
    found = describe(tmp_path / "a.pcd")
    assert found.points == 46
    assert found.format == "PCD 0.7, binary, float"
    text = (tmp_path / "a.pcd").read_bytes()
    for stated, told in ((b"VERSION .7\n", "PCD 0.7, binary, float"), (b"", "PCD, binary, float")):
        (tmp_path / "b.pcd").write_bytes(text.replace(b"VERSION 0.7\n", stated))
        assert describe(tmp_path / "b.pcd").format == told
    assert [c.code for c in found.cautions] == ["points_dropped"]


def test_trap_1_single_precision_in_utm_is_doubted(tmp_path):
    pcd_file(tmp_path / "a.pcd", rows_at(UTM, "<f4"), "binary")
    assert [c.code for c in describe(tmp_path / "a.pcd").cautions] == ["coordinates_coarse"]


def test_trap_1_text_keeps_the_digits_that_its_type_would_drop(tmp_path):
    rows = rows_at(UTM)
    pcd_file(tmp_path / "a.pcd", rows, "ascii")
    content = (tmp_path / "a.pcd").read_bytes()
    (tmp_path / "a.pcd").write_bytes(content.replace(b"SIZE 8 8 8", b"SIZE 4 4 4"))
    expected = np.column_stack([rows[n] for n in "xyz"])
    np.testing.assert_allclose(read(tmp_path / "a.pcd").coordinates, expected, rtol=0, atol=2e-9)


@pytest.mark.parametrize("encoding", ["ascii", "binary", "binary_compressed"])
def test_a_file_cut_short_is_refused(tmp_path, encoding):
    pcd_file(tmp_path / "a.pcd", rows_at(UTM), encoding)
    content = (tmp_path / "a.pcd").read_bytes()
    (tmp_path / "a.pcd").write_bytes(content[: -len(content) // 4])
    with pytest.raises(CloudError, match=r"a\.pcd"):
        read(tmp_path / "a.pcd")
