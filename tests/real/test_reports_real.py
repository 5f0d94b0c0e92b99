"""Reports of real clouds: no accuracy stated, rejected picks, a zone that is nearly empty."""

import re
import shutil

import pytest
from bundles import sealed_bundle

from trigpoint_reporting.evidence import open_evidence
from trigpoint_reporting.render import show
from trigpoint_reporting.verification import verify

PROJECT = """[project]
id = "real"
[reference]
path = "{reference}"
[[reconstruction]]
name = "cloud"
kind = "photogrammetry"
path = "{cloud}"
picks = "{picks}"
[comparison]
voxel_m = {voxel}
within_m = {within}
zones = {zones}
icp = false
intervals = false
"""
SETS = {
    "herzjesu_even_vs_odd": {
        "reference": "ref_dense_metric.laz",
        "cloud": "src_dense_loose_local.ply",
        "picks": "picks9_three_outliers.csv",
        "voxel": 0.05,
        "within": [0.01, 0.02, 0.05],
        "zones": [0.33, 0.995],
        "rejected": ["x1", "x2", "x3"],
    },
    "lidar_ign_two_flightlines": {
        "reference": "ref_strip706.laz",
        "cloud": "src_strip707_local.ply",
        "picks": "correspondences.csv",
        "voxel": 0.5,
        # A threshold of one metre is not the second row.
        "within": [0.25, 0.5, 1.0],
        "zones": [0.33, 0.98],
        "rejected": ["L2_in_roof", "L2_in_ground"],
    },
}


@pytest.fixture(params=SETS)
def told(request, real_data, tmp_path):
    """The settings, the sealed bundle, and every section's blocks."""
    sections = pytest.importorskip(
        "trigpoint_reporting.outline", reason="figures need matplotlib"
    ).SECTIONS
    given = SETS[request.param]
    for key in ("reference", "cloud", "picks"):
        shutil.copyfile(real_data(f"{request.param}/{given[key]}"), tmp_path / given[key])
    path = tmp_path / "project.toml"
    path.write_text(PROJECT.format(**given), "utf-8")
    folder = sealed_bundle(path)
    evidence = open_evidence(folder)
    blocks = []
    for section in sections:
        names = evidence.names if section.per_reconstruction else [None]
        for name in names:
            blocks += section.function(evidence, *([name] if name else []))
    return given, folder, blocks


def test_a_real_project_is_told_whole_and_verifies(told):
    given, folder, blocks = told
    words = show(*blocks).text
    assert not re.search(r"\b(nan|None|inf)\b", words)
    for name in given["rejected"]:
        assert re.search(rf"^{name} +REJECTED", words, re.MULTILINE)
    assert "can't be told" in words  # whether the reference is twice as accurate
    assert "no word of testing" in words
    found = verify(folder)
    assert found.holds, found.text()
