"""Accuracy and completeness: distances, zones, shares, floors, and the traps of all four."""

import sys

import numpy as np
import pytest
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from trigpoint import preparation
from trigpoint.cloud import PointCloud, cloud_from
from trigpoint.comparison import compare, measure
from trigpoint.errors import RegionError
from trigpoint.files import write
from trigpoint.preparation import prepare, thin
from trigpoint.similarity import Similarity

ROOM = sys.modules["trigpoint.comparison"]
ZONES = ["all", "lower", "middle", "upper"]
UTM = np.array([741_000.0, 4_279_000.0, 150.0])


def tower(n, seed, noise=0.0):
    """Four walls, 8 x 8 x 30 m, turned off the axes."""
    rng = np.random.default_rng(seed)
    across, height, wall = rng.uniform(-4, 4, n), rng.uniform(0, 30, n), rng.integers(0, 4, n)
    points = np.column_stack([across, np.full(n, 4.0), height])
    turns = Rotation.from_rotvec(np.outer(np.radians(90 * wall + 20), [0, 0, 1]))
    return turns.apply(points) + rng.normal(0, noise, (n, 3)) * (noise > 0)


def nowhere():
    return PointCloud(np.empty((0, 3)), np.zeros(3))


def codes(comparison):
    return {caution.code for caution in comparison.cautions}


def share(comparison, direction, threshold, zone="all", column="pct"):
    table = comparison.within
    chosen = (table.direction == direction) & (table.zone == zone)
    return table[chosen & np.isclose(table.threshold_m, threshold)][column].item()


def test_statistics_follow_their_definitions(offset):
    source, target = tower(4_000, 1, 0.05) + offset, tower(3_000, 2, 0.02) + offset
    found = compare(cloud_from(source), cloud_from(target), voxel=0, margin=None)
    low, high = target[:, 2].min(), target[:, 2].max()
    for direction, table, ours, one, other in (
        ("accuracy", found.accuracy, found.accuracy_m, source, target),
        ("completeness", found.completeness, found.completeness_m, target, source),
    ):
        distances = cKDTree(other).query(one)[0]
        np.testing.assert_allclose(ours, distances, atol=1e-9)
        zone = np.digitize(one[:, 2], low + (high - low) * np.array([0.33, 0.66]))
        assert table.index.tolist() == ZONES
        for name, d in zip(
            ZONES, [distances, *(distances[zone == k] for k in range(3))], strict=True
        ):
            median = np.median(d)
            expected = {
                "n": len(d),
                "mean_m": d.mean(),
                "median_m": median,
                "rmse_m": np.sqrt((d**2).mean()),
                "nmad_m": 1.4826 * np.median(np.abs(d - median)),
                "p95_m": np.percentile(d, 95),
                "max_m": d.max(),
            }
            for column, value in expected.items():
                assert table.loc[name, column] == pytest.approx(value, abs=1e-8), (name, column)
            for threshold in (0.05, 0.10, 0.20):
                pct = 100 * (d <= threshold).mean()
                assert share(found, direction, threshold, name) == pytest.approx(pct)
                assert share(found, direction, threshold, name, "raw_pct") == pytest.approx(pct)


def test_within_includes_the_threshold():
    # Sixteenths are exact in binary: a distance of the threshold itself.
    wall = np.array([[x, 0.0, z] for x in range(9) for z in range(9)])
    found = compare(
        cloud_from(wall + np.array([0, 0.0625, 0])), cloud_from(wall), voxel=0, within=(0.0625,)
    )
    assert found.within.pct.eq(100).all()


def test_every_step_is_counted():
    points = tower(9_000, 3)
    source = np.vstack([points[:5_000], points[5_000:6_000] + np.array([0, 0, 500])])
    found = compare(cloud_from(source), cloud_from(points))
    counts = found.counts
    assert counts["reference_points"] == 9_000
    assert counts["reconstruction_points"] == 6_000
    assert counts["reconstruction_outside_region"] == 1_000
    assert counts["reconstruction_in_region"] == 5_000
    assert counts["reconstruction_voxels"] == len(found.accuracy_m) == found.accuracy.n["all"]
    assert counts["reference_voxels"] == len(found.completeness_m) == found.completeness.n["all"]
    for table in (found.accuracy, found.completeness):
        assert table.n[ZONES[1:]].sum() == table.n["all"]


def test_far_points_are_misses_and_never_dropped():
    points = tower(4_000, 4)
    far = np.vstack([points, points[:1_000] + np.array([0, 0, 1e4])])
    found = compare(cloud_from(far), cloud_from(points), voxel=0, margin=None)
    assert found.accuracy.n["all"] == 5_000
    assert found.accuracy.max_m["all"] > 9_900
    assert share(found, "accuracy", 0.2) == pytest.approx(80)


def test_other_zones_and_thresholds_can_be_asked_for():
    cloud = cloud_from(tower(2_000, 5))
    found = compare(cloud, cloud, zones=(0.5,), within=(0.3,))
    assert found.accuracy.index.tolist() == ["all", "zone_1", "zone_2"]
    assert found.within.threshold_m.unique().tolist() == [0.3]
    assert compare(cloud, cloud, zones=()).accuracy.index.tolist() == ["all", "zone_1"]


def test_one_reference_serves_many_reconstructions_and_stages():
    target = cloud_from(tower(60_000, 6))
    source = cloud_from(tower(60_000, 7) + np.array([0.15, 0, 0]))
    reference = prepare(target)
    delivered = thin(source, reference)
    before = measure(delivered, reference)
    after = measure(delivered.moved(Similarity(1.0, np.eye(3), np.array([-0.15, 0, 0]))), reference)
    assert after.accuracy.rmse_m["all"] < 0.7 * before.accuracy.rmse_m["all"]
    np.testing.assert_array_equal(before.accuracy, compare(source, target).accuracy)


def test_raw_shares_are_of_the_unthinned_points():
    source, target = tower(20_000, 8, 0.03), tower(15_000, 9, 0.01)
    found = compare(cloud_from(source), cloud_from(target), margin=None, voxel=0.5)
    both = (cKDTree(target).query(source)[0], cKDTree(source).query(target)[0])
    for direction, distances in zip(("accuracy", "completeness"), both, strict=True):
        for threshold in (0.05, 0.1, 0.2):
            raw = share(found, direction, threshold, column="raw_pct")
            assert raw == pytest.approx(100 * (distances <= threshold).mean())
            assert raw != pytest.approx(share(found, direction, threshold), abs=1e-3)


def test_raw_shares_of_too_many_points_are_not_measured(monkeypatch):
    monkeypatch.setattr(preparation, "RAW_LIMIT", 2_999)
    for n in ((3_000, 1_000), (1_000, 3_000)):
        source, target = (cloud_from(tower(m, 10)) for m in n)
        found = compare(source, target)
        assert found.within.raw_pct.isna().all()
        assert "raw_not_measured" in codes(found)
    assert "raw_not_measured" not in codes(compare(source, source))


def test_a_threshold_not_above_the_voxel_is_a_caution():
    cloud = cloud_from(tower(1_000, 11))
    (caution,) = (c for c in compare(cloud, cloud).cautions if c.code == "threshold_below_voxel")
    assert "0.05, 0.1 m are not above the voxel of 0.1 m" in caution.message
    assert "threshold_below_voxel" not in codes(compare(cloud, cloud, within=(0.2,)))
    assert "threshold_below_voxel" not in codes(compare(cloud, cloud, voxel=0))


def test_an_empty_zone_is_a_caution_and_nan():
    target = tower(5_000, 12)
    found = compare(cloud_from(target[target[:, 2] < 15]), cloud_from(target))
    assert "zone_empty" in codes(found)
    assert found.accuracy.n["upper"] == 0
    assert found.accuracy.loc["upper"].drop(["n", "floor_rmse_m"]).isna().all()
    assert share(found, "accuracy", 0.2, "upper") == 0
    assert found.completeness.n["upper"] > 0
    assert share(found, "completeness", 0.2, "upper") == 0


def test_a_threshold_that_is_no_distance_is_refused():
    cloud = cloud_from(tower(10, 13))
    for bad in (0, -0.1, np.nan):
        with pytest.raises(RegionError, match="must be above zero"):
            compare(cloud, cloud, within=(0.1, bad))
    with pytest.raises(RegionError, match=r"thresholds 0\.1, 0\.2, 0\.1 hold one twice"):
        compare(cloud, cloud, within=(0.1, 0.2, 0.1))


def test_files_are_compared_as_clouds_in_memory_are(tmp_path):
    source, target = (np.round(tower(20_000, k, 0.03) + UTM, 4) for k in (14, 15))
    write(tmp_path / "source.laz", cloud_from(source))
    write(tmp_path / "target.ply", cloud_from(target))
    from_files = compare(tmp_path / "source.laz", tmp_path / "target.ply")
    in_memory = compare(cloud_from(source), cloud_from(target))
    np.testing.assert_allclose(from_files.accuracy, in_memory.accuracy, atol=1e-6)
    np.testing.assert_allclose(from_files.completeness, in_memory.completeness, atol=1e-6)


def test_the_same_clouds_twice_give_the_same_bits():
    source, target = cloud_from(tower(30_000, 16, 0.03)), cloud_from(tower(30_000, 17, 0.01))
    one, other = compare(source, target), compare(source, target)
    assert one.accuracy_m.tobytes() == other.accuracy_m.tobytes()
    assert one.completeness_m.tobytes() == other.completeness_m.tobytes()
    assert one.accuracy.to_csv() == other.accuracy.to_csv()


def test_the_order_of_the_points_changes_nothing_that_is_printed():
    source, target = tower(30_000, 18, 0.03), tower(30_000, 19, 0.01)
    rng = np.random.default_rng(20)
    one = compare(cloud_from(source), cloud_from(target))
    other = compare(cloud_from(rng.permutation(source)), cloud_from(rng.permutation(target)))
    # The halves of the floor are drawn in the order of the points: it alone is another sample.
    np.testing.assert_allclose(
        one.accuracy.drop(columns="floor_rmse_m"),
        other.accuracy.drop(columns="floor_rmse_m"),
        atol=1e-9,
    )
    np.testing.assert_allclose(one.within.pct, other.within.pct)


def test_trap_1_results_at_utm_equal_those_at_the_origin():
    source, target = tower(40_000, 21, 0.03), tower(40_000, 22, 0.01)
    near = compare(cloud_from(source), cloud_from(target))
    far = compare(cloud_from(source + UTM), cloud_from(target + UTM))
    np.testing.assert_allclose(near.accuracy, far.accuracy, atol=1e-6)
    np.testing.assert_allclose(near.completeness, far.completeness, atol=1e-6)
    np.testing.assert_allclose(near.within.pct, far.within.pct, atol=1e-2)
    assert near.counts == far.counts
    assert far.accuracy_m.dtype == far.reference.xyz.dtype == np.float64


def test_trap_9_two_samplings_of_one_truth_score_the_floor_and_not_perfection():
    truth = tower(60_000, 23)
    found = compare(cloud_from(truth[::2]), cloud_from(truth[1::2]))
    assert found.accuracy.rmse_m["all"] > 0.01
    ratio = found.accuracy.rmse_m / found.accuracy.floor_rmse_m
    # The halves of a half are twice as sparse, so the floor lies above, and not far.
    assert ((ratio > 0.5) & (ratio < 1.05)).all()
    np.testing.assert_array_equal(found.accuracy.floor_rmse_m, found.completeness.floor_rmse_m)


def test_trap_9_an_empty_reconstruction_is_no_perfect_score():
    cloud = cloud_from(tower(2_000, 24))
    for voxel in (0.1, 0):
        found = compare(nowhere(), cloud, voxel=voxel)
        assert found.accuracy.n.eq(0).all()
        assert found.completeness.n["all"] > 0
        for table in (found.accuracy, found.completeness):
            assert table.drop(columns=["n", "floor_rmse_m"]).isna().all(axis=None)
        assert found.within.pct.eq(0).all()
        assert found.within.raw_pct.eq(0).all()
        assert {"region_mostly_empty", "zone_empty"} <= codes(found)


def test_trap_9_a_reconstruction_six_centimetres_off_is_not_cropped_away():
    rng = np.random.default_rng(25)
    slab = np.column_stack([rng.uniform(0, 4, (8_000, 2)), np.zeros(8_000)])
    above = np.column_stack([rng.uniform(-0.9, 4.9, (60_000, 2)), np.full(60_000, 0.06)])
    found = compare(cloud_from(above), cloud_from(slab))
    assert found.counts["reconstruction_in_region"] == 60_000
    assert share(found, "completeness", 0.10) > 90


def test_trap_9_half_a_voxel_of_shift_hardly_changes_the_rmse():
    # Density and noise of a survey: 100 points a square metre, 2 and 3 cm.
    source, target = tower(384_000, 26, 0.03), tower(96_000, 27, 0.02)
    one = compare(cloud_from(source), cloud_from(target), margin=None)
    other = compare(cloud_from(source + 0.05), cloud_from(target + 0.05), margin=None)
    for direction in ("accuracy", "completeness"):
        a, b = (getattr(found, direction).rmse_m for found in (one, other))
        np.testing.assert_allclose(a, b, rtol=0.03)


def test_trap_9_half_a_tower_missing_is_half_a_tower_missed():
    target = tower(60_000, 28)
    source = tower(60_000, 29)
    found = compare(cloud_from(source[source[:, 0] > 0]), cloud_from(target))
    assert share(found, "completeness", 0.2) == pytest.approx(50, abs=3)
    assert share(found, "accuracy", 0.2) > 99
    assert found.completeness.n["all"] == found.counts["reference_voxels"]
    assert found.completeness.max_m["all"] > 3
