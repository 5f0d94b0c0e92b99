"""The zone tables of two real pairs of clouds, worked out by other means."""

import json

import numpy as np
import pytest

from trigpoint.comparison import compare
from trigpoint.files import read
from trigpoint.similarity import Similarity

STATISTICS = {
    "mean": "mean_m",
    "rmse": "rmse_m",
    "median": "median_m",
    "p95": "p95_m",
    "max": "max_m",
}
WITHIN = (0.05, 0.10, 0.20, 0.50)
PORTAL, STRIPS = "herzjesu_even_vs_odd", "lidar_ign_two_flightlines"
# Folder, reconstruction, reference, the similarity, its thirds, its 33 and 66 percent.
CASES = {
    "loose": (PORTAL, "src_dense_loose_local.ply", "ref_dense_metric.laz", "structural_refined"),
    "strict": (PORTAL, "src_dense_strict_local.ply", "ref_dense_metric.laz", "structural_refined"),
    "strip": (STRIPS, "src_strip707_local.ply", "ref_strip706.laz", "truth"),
}


@pytest.fixture(scope="module", params=list(CASES))
def case(request, real_data):
    """Name, expected values, both clouds, and the similarity between them."""
    folder, source, target, fit = CASES[request.param]
    expected = json.loads((real_data(f"{folder}/expected.json")).read_text())
    known = expected[fit]
    similarity = Similarity(known["scale"], np.array(known["R"]), np.array(known["t"]))
    clouds = [read(real_data(f"{folder}/{name}"), attributes=False) for name in (source, target)]
    return request.param, expected, *clouds, similarity


def compared(case, **settings):
    _, _, source, target, similarity = case
    return compare(source, target, similarity=similarity, margin=None, within=WITHIN, **settings)


def check_all(found, expected):
    for direction in ("accuracy", "completeness"):
        table = getattr(found, direction)
        for zone, values in expected[direction].items():
            row = table.loc[zone]
            assert row.n == values["n"], (direction, zone)
            for theirs, ours in STATISTICS.items():
                # Worked out about other origins, from coordinates in float32: 5 um apart.
                assert row[ours] == pytest.approx(values[theirs], abs=5e-6), (direction, zone, ours)


def shares(found, direction, zone):
    table = found.within
    return table[(table.direction == direction) & (table.zone == zone)].set_index("threshold_m").pct


def test_distances_in_thirds_of_the_height_equal_those_worked_out_elsewhere(case):
    name, expected, *_ = case
    block = expected["c2c_under_truth" if name == "strip" else f"c2c_{name}"]
    found = compared(case, voxel=0, zones=(1 / 3, 2 / 3))
    theirs = {
        "accuracy": block["accuracy_src_to_ref"]["scipy"],
        "completeness": block["completeness_ref_to_src"]["scipy"],
    }
    check_all(found, theirs)
    for direction, zones in theirs.items():
        for zone, values in zones.items():
            for threshold, pct in shares(found, direction, zone).items():
                fraction = values.get(f"frac_le_{threshold:g}")
                if fraction is not None:
                    assert pct == pytest.approx(100 * fraction, abs=0.1), (zone, threshold)


def test_raw_zones_at_33_and_66_percent_equal_those_worked_out_elsewhere(case):
    name, expected, *_ = case
    found = compared(case, voxel=0)
    check_all(found, expected["zones_33_66_percent"][name]["raw"])


def test_thinned_zones_agree_with_those_of_another_lattice(case):
    name, expected, *_ = case
    block = expected["zones_33_66_percent"][name]
    found = compared(case, voxel=block["voxel_m"])
    assert found.counts["reconstruction_voxels"] == pytest.approx(block["n_src_vox"], rel=0.005)
    assert found.counts["reference_voxels"] == pytest.approx(block["n_ref_vox"], rel=0.005)
    for direction in ("accuracy", "completeness"):
        table = getattr(found, direction)
        # That lattice starts at the origin but for an offset. Open3D's starts below each cloud's
        # lowest point, which alone moves the middle zone of one case by 6 %.
        for zone, values in block["voxel_floor_origin0"][direction].items():
            assert table.rmse_m[zone] == pytest.approx(values["rmse"], rel=0.01), zone
        assert table.rmse_m["all"] == pytest.approx(
            block["voxel_open3d"][direction]["all"]["rmse"], rel=0.03
        )
