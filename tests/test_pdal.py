"""Formats that only PDAL reads, on a real PDAL; the pipeline and its absence need none."""

import json
import os
import shutil
import subprocess
import sys
import types
from pathlib import Path

import laspy
import numpy as np
import pytest

from trigpoint.crs import parse_crs
from trigpoint.errors import CloudError, MissingPackageError
from trigpoint.files import carry, describe, read, stream
from trigpoint.formats import pdal
from trigpoint.formats.source import Box
from trigpoint.similarity import Similarity

UTM = np.array([741_000.0, 4_279_000.0, 150.0])
COMMAND = os.environ.get("TRIGPOINT_PDAL") or shutil.which("pdal")


@pytest.fixture
def command():
    if not COMMAND:
        pytest.skip("no pdal command: TRIGPOINT_PDAL is not set and PATH has none (.ci/pdal.sh)")
    return COMMAND


@pytest.fixture
def points():
    return np.random.default_rng(5).uniform(0, 64, (800, 3)).round(3)


def las_file(path, points, *, crs="EPSG:32615+5703"):
    header = laspy.LasHeader(version="1.4", point_format=7)
    header.scales, header.offsets = np.full(3, 0.001), UTM
    header.add_crs(parse_crs(crs))
    las = laspy.LasData(header)
    las.x, las.y, las.z = (points + UTM).T
    las.intensity = np.arange(len(points))
    las.red = np.arange(len(points)) * 7
    las.write(path)


@pytest.fixture
def bpf(tmp_path, command, points):
    """A file of a format that only PDAL reads, written by PDAL."""
    las_file(tmp_path / "source.laz", points)
    writer = {"type": "writers.bpf", "filename": str(tmp_path / "a.bpf"), "coord_id": 15}
    # BPF holds single precision about an offset.
    writer |= {f"offset_{axis}": shift for axis, shift in zip("xyz", UTM, strict=True)}
    writer["output_dims"] = "X,Y,Z,Intensity,Red,Green,Blue"
    stages = json.dumps({"pipeline": [str(tmp_path / "source.laz"), writer]})
    subprocess.run([command, "pipeline", "--stdin"], input=stages, text=True, check=True)
    return tmp_path / "a.bpf"


@pytest.fixture
def ept(tmp_path, points):
    """An EPT data set of a root and eight tiles, as its specification has them."""
    folder = tmp_path / "site"
    for name in ("ept-data", "ept-hierarchy"):
        (folder / name).mkdir(parents=True)
    nodes = {"0-0-0-0": points[:100]}
    rest = points[100:]
    octant = (rest >= 32).astype(int)
    for k in range(8):
        key = np.array([k & 1, k >> 1 & 1, k >> 2])
        nodes["1-" + "-".join(map(str, key))] = rest[(octant == key).all(axis=1)]
    for name, part in nodes.items():
        las_file(folder / "ept-data" / f"{name}.laz", part)
    counts = {name: len(part) for name, part in nodes.items()}
    (folder / "ept-hierarchy" / "0-0-0-0.json").write_text(json.dumps(counts))
    axes = [
        {"name": a, "type": "signed", "size": 4, "scale": 0.001, "offset": o}
        for a, o in zip("XYZ", UTM, strict=True)
    ]
    others = [
        {"name": n, "type": "unsigned", "size": 2} for n in ("Intensity", "Red", "Green", "Blue")
    ]
    low, high = points.min(axis=0) + UTM, points.max(axis=0) + UTM
    description = {
        "bounds": [*UTM, *(UTM + 64)],
        "boundsConforming": [*low, *high],
        "dataType": "laszip",
        "hierarchyType": "json",
        "points": len(points),
        "schema": axes + others,
        "span": 128,
        "srs": {
            "authority": "EPSG",
            "horizontal": "32615",
            "wkt": parse_crs("EPSG:32615").to_wkt("WKT1_GDAL"),
        },
        "version": "1.0.0",
    }
    (folder / "ept.json").write_text(json.dumps(description))
    return folder / "ept.json"


def ordered(points):
    return points[np.lexsort(points.T)]


def test_a_format_of_pdal_is_read_with_what_it_holds(bpf, points):
    cloud = read(bpf)
    np.testing.assert_allclose(cloud.coordinates, points + UTM, rtol=0, atol=1e-5)
    np.testing.assert_array_equal(cloud.attributes["intensity"], np.arange(800))
    np.testing.assert_array_equal(cloud.attributes["red"], np.arange(800) * 7)
    found = describe(bpf)
    assert found.format == "BPF, through PDAL"
    assert found.points == 800
    assert found.crs.to_epsg() == 32615
    assert "red" in found.attributes
    assert [len(piece) for piece in stream(bpf, chunk=300)] == [300, 300, 200]


def test_bounds_are_kept_whoever_reads(bpf, points):
    found = read(bpf, bounds=(UTM + 10, UTM + 40))
    inside = ((points >= 10) & (points <= 40)).all(axis=1)
    assert len(found) == inside.sum()


def test_a_format_of_pdal_is_carried(bpf, tmp_path, points):
    fit = Similarity(2.0, np.eye(3), np.zeros(3))
    count, _ = carry(bpf, tmp_path / "out.laz", fit, crs="EPSG:32615")
    assert count == 800
    np.testing.assert_allclose(
        read(tmp_path / "out.laz").coordinates, 2 * (points + UTM), rtol=0, atol=1e-4
    )


def test_nothing_stays_in_the_temporary_folder(bpf, tmp_path, monkeypatch):
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path / "scratch"))
    (tmp_path / "scratch").mkdir()
    read(bpf)
    assert list((tmp_path / "scratch").iterdir()) == []


def test_ept_is_described_without_reading_a_point(ept, points):
    found = describe(ept)
    assert found.points == 800
    assert found.crs.to_epsg() == 32615
    assert found.attributes == ("intensity", "red", "green", "blue")
    np.testing.assert_allclose(found.low, points.min(axis=0) + UTM, atol=1e-6)


@pytest.mark.usefixtures("command")
def test_ept_is_read_whole(ept, points):
    for path in (ept, ept.parent):
        cloud = read(path)
        np.testing.assert_allclose(
            ordered(cloud.coordinates), ordered(points + UTM), rtol=0, atol=1e-6
        )
    assert cloud.crs.to_epsg() == 32615
    assert "red" in cloud.attributes


@pytest.mark.usefixtures("command")
def test_a_bounds_query_of_ept_opens_only_the_tiles_it_needs(ept, points):
    low, high = np.array([40.0, 2, 3]), np.array([60.0, 30, 31])
    # The query lies in the root and in one tile: the others may as well not be there.
    for tile in (ept.parent / "ept-data").glob("1-*.laz"):
        if tile.stem != "1-1-0-0":
            tile.unlink()
    cloud = read(ept, bounds=(low + UTM, high + UTM))
    inside = points[((points >= low) & (points <= high)).all(axis=1)]
    assert len(inside) > 10
    np.testing.assert_allclose(ordered(cloud.coordinates), ordered(inside + UTM), rtol=0, atol=1e-6)


@pytest.mark.usefixtures("command")
def test_a_bounds_query_in_plan_takes_every_height(ept, points):
    cloud = read(ept, bounds=((UTM + 5)[:2], (UTM + 20)[:2]))
    inside = ((points[:, :2] >= 5) & (points[:, :2] <= 20)).all(axis=1)
    assert len(cloud) == inside.sum()


@pytest.mark.usefixtures("command")
def test_what_pdal_says_is_passed_on(ept):
    (ept.parent / "ept-data" / "0-0-0-0.laz").unlink()
    with pytest.raises(CloudError, match=r"ept\.json: PDAL: .*0-0-0-0") as caught:
        read(ept)
    assert "\n" not in str(caught.value)


def test_the_module_is_used_where_there_is_one(bpf, monkeypatch, points):
    ran = []

    class Pipeline:
        def __init__(self, stages):
            self.stages = stages

        def execute(self):
            ran.append(self.stages)
            subprocess.run(
                [COMMAND, "pipeline", "--stdin"], input=self.stages, text=True, check=True
            )

    monkeypatch.delenv("TRIGPOINT_PDAL", raising=False)
    monkeypatch.setitem(sys.modules, "pdal", types.SimpleNamespace(Pipeline=Pipeline))
    assert len(read(bpf)) == len(points)
    assert len(ran) == 1


def test_without_pdal_the_error_says_where_to_get_it(tmp_path, monkeypatch):
    monkeypatch.delenv("TRIGPOINT_PDAL", raising=False)
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.setitem(sys.modules, "pdal", None)
    (tmp_path / "a.bpf").write_bytes(b"BPF")
    with pytest.raises(MissingPackageError, match=r"a\.bpf.*PyPI has only its source.*conda-forge"):
        read(tmp_path / "a.bpf")


def test_a_command_that_is_not_there_is_named(tmp_path, monkeypatch):
    monkeypatch.setenv("TRIGPOINT_PDAL", str(tmp_path / "nowhere" / "pdal"))
    monkeypatch.setitem(sys.modules, "pdal", None)
    (tmp_path / "a.bpf").write_bytes(b"BPF")
    with pytest.raises(CloudError, match="nowhere"):
        read(tmp_path / "a.bpf")


def test_the_pipeline_is_plain_json_with_every_dimension_kept():
    box = Box(np.array([1.0, 2, -np.inf]), np.array([3.5, 4, np.inf]))
    reader, writer = json.loads(
        pdal.pipeline(Path("ept.json"), "readers.ept", Path("out.las"), box=box)
    )["pipeline"]
    assert reader["bounds"] == "([1.0, 3.5], [2.0, 4.0])"
    assert writer["extra_dims"] == "all"
    assert writer["minor_version"] == 4
