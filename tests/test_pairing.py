"""Which of two reconstructions is more complete, and whether the data can tell."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from trigpoint import posing
from trigpoint.cloud import cloud_from
from trigpoint.comparison import measure
from trigpoint.intervals import estimate
from trigpoint.pairing import compare_pair
from trigpoint.preparation import prepare, thin
from trigpoint.reliability import assess
from trigpoint.similarity import umeyama

NAMES = ("nerf", "sfm")
WITHIN = (0.10, 0.20)
PICKS = np.array([[0, 0, 1], [20, 0, 3], [20, 1, 9], [0, 1, 6], [10, 3, 4], [5, 0, 0.0]])


def wall(seed, missing=0.0, shift=0.0):
    """A wall of 24 x 12 m, of whose 1.5 m panels a share is missing."""
    rng = np.random.default_rng(seed)
    points = rng.uniform(size=(12_000, 3)) * [24, 0, 12] + rng.normal(0, 0.01, (12_000, 3))
    panel = (points[:, 0] // 1.5).astype(int) + 16 * (points[:, 2] // 1.5).astype(int)
    gone = np.isin(panel, rng.choice(128, round(missing * 128), replace=False))
    return points[~gone] + [0, shift, 0]


@pytest.fixture(scope="module")
def reference():
    return prepare(cloud_from(wall(0)), voxel=0.0)


def compared(cloud, reference, similarity=None, within=WITHIN):
    return measure(
        thin(cloud_from(cloud), reference, similarity=similarity), reference, within=within
    )


def test_a_real_difference_is_found_with_its_sign(reference):
    one, other = compared(wall(1, 0.05), reference), compared(wall(2, 0.4), reference)
    paired = compare_pair(one, other, names=NAMES, draws=500)
    rows = paired.differences
    assert rows["zone"].tolist() == ["all"] * 2 + ["lower"] * 2 + ["middle"] * 2 + ["upper"] * 2
    completeness = [c.within[c.within["direction"] == "completeness"] for c in (one, other)]
    assert_allclose(rows["one_pct"], completeness[0]["pct"])
    assert_allclose(rows["other_pct"], completeness[1]["pct"])
    assert_allclose(rows["difference_pct"], rows["one_pct"] - rows["other_pct"])
    assert (rows["low_pct"] < rows["difference_pct"]).all()
    assert (rows["difference_pct"] < rows["high_pct"]).all()
    assert rows["verdict"][0] == "better"
    assert rows["sentence"][0].startswith(
        "nerf is more complete than sfm within 0.1 m in all zones together: "
    )
    assert paired.statement == (
        "Over all zones, nerf is more complete than sfm within 0.1 and 0.2 m (95 % intervals, the "
        "pose of nerf and sfm being taken as it is)."
    )
    turned = compare_pair(other, one, names=NAMES[::-1], draws=500).differences
    assert_allclose(turned["difference_pct"], -rows["difference_pct"])
    assert_allclose(turned["low_pct"], -rows["high_pct"])
    assert turned["verdict"][0] == "worse"


def test_a_reconstruction_is_not_distinguishable_from_itself(reference):
    one = compared(wall(1, 0.2), reference)
    paired = compare_pair(one, one, names=NAMES, draws=100)
    assert (paired.differences["verdict"] == "not distinguishable").all()
    assert (paired.differences[["low_pct", "high_pct"]] == 0).all(axis=None)
    assert "nerf and sfm are not distinguishable in completeness" in paired.statement


def test_reconstructions_of_one_quality_are_seldom_told_apart(reference):
    clouds = [compared(wall(seed, 0.2), reference) for seed in range(10, 22)]
    apart = 0
    for one in range(12):
        for other in range(one):
            paired = compare_pair(clouds[one], clouds[other], names=NAMES, draws=200)
            apart += paired.differences["verdict"][1] != "not distinguishable"
    assert apart / 66 < 0.12


def test_what_both_miss_falls_out_of_the_difference(reference):
    hidden = wall(1)
    hidden = hidden[(hidden[:, 0] // 3).astype(int) % 2 == 0]
    kept = np.random.default_rng(3).random(len(hidden)) < 0.9
    one, other = compared(hidden, reference), compared(hidden[kept], reference)
    rows = compare_pair(one, other, names=NAMES, draws=500).differences
    own = estimate(one, draws=500).shares
    own = own[own["direction"] == "completeness"]
    span = (own["sampling_high_pct"] - own["sampling_low_pct"]).to_numpy()
    assert (rows["sampling_high_pct"] - rows["sampling_low_pct"] < span / 4).all()


def posed(seed, cloud, reference):
    target = PICKS + np.random.default_rng(seed).normal(0, 0.08, PICKS.shape)
    fit = umeyama(PICKS, target)
    worth = assess(PICKS, target, fit, sigma_target=np.full(6, 0.08))
    comparison = compared(cloud, reference, fit)
    return comparison, estimate(comparison, reliability=worth, draws=200)


def test_picking_noise_is_not_taken_for_a_difference(reference, monkeypatch):
    monkeypatch.setattr(posing, "SAMPLE", 100)
    cloud = wall(1, 0.1)
    fooled = told = 0
    for seed in range(8):
        one, own = posed(seed, cloud, reference)
        other, others = posed(seed + 50, cloud, reference)
        blind = compare_pair(one, other, names=NAMES, draws=200)
        aware = compare_pair(one, other, names=NAMES, poses=(own, others), draws=200)
        assert aware.has_pose == (True, True)
        assert "taken as it is" not in aware.statement
        fooled += blind.differences["verdict"][0] != "not distinguishable"
        told += aware.differences["verdict"][0] != "not distinguishable"
    assert fooled >= 6
    assert told <= 1


def test_the_pose_of_one_alone_widens_the_interval_and_the_other_is_named(reference):
    one, own = posed(1, wall(1, 0.1), reference)
    other = compared(wall(2, 0.1), reference)
    paired = compare_pair(one, other, names=NAMES, poses=(own, None), draws=200)
    assert paired.has_pose == (True, False)
    assert "the pose of sfm being taken as it is" in paired.statement
    rows = paired.differences
    assert rows["pose_low_pct"].notna().all()
    alone = compare_pair(one, other, names=NAMES, draws=200).differences
    assert alone["pose_low_pct"].isna().all()
    assert_allclose(rows["sampling_low_pct"], alone["sampling_low_pct"])
    assert (rows["high_pct"] - rows["low_pct"] > alone["high_pct"] - alone["low_pct"])[0]


def test_nothing_at_all_is_worse_than_something(reference):
    something, nothing = compared(wall(1), reference), compared(np.full((2, 3), 900.0), reference)
    paired = compare_pair(something, nothing, names=NAMES, draws=50)
    assert (paired.differences["verdict"] == "better").all()
    assert (paired.differences["other_pct"] == 0).all()


def test_a_small_reference_leaves_it_unknown():
    points = np.array([[x, 0.0, z] for x in np.arange(0, 4, 0.2) for z in np.arange(0, 4, 0.2)])
    reference = prepare(cloud_from(points), voxel=0.0)
    one = compared(points, reference)
    paired = compare_pair(one, one, names=NAMES, draws=20)
    assert (paired.differences["verdict"] == "not known").all()
    assert "fewer than 10 blocks" in paired.differences["sentence"][0]
    assert "can't be compared" in paired.statement


def test_nothing_is_said_within_a_threshold_that_the_voxel_does_not_resolve():
    reference = prepare(cloud_from(wall(0)), voxel=0.1)
    one, other = (compared(wall(seed, gone), reference) for seed, gone in ((1, 0.05), (2, 0.4)))
    paired = compare_pair(one, other, names=NAMES, draws=200)
    assert paired.differences["verdict"].tolist()[:2] == ["not resolvable", "better"]
    assert "can't be resolved: that is not above the voxel" in paired.differences["sentence"][0]
    assert paired.statement.startswith(
        "Over all zones, nerf is more complete than sfm within 0.2 m; nothing is said within 0.1 "
        "m, not above the voxel (95 % intervals"
    )


@pytest.mark.parametrize(("away", "verdict"), [(60.0, "not told"), (0.0, "better")])
def test_what_lies_on_the_other_side_of_zero_than_its_interval_is_not_told(
    reference, away, verdict
):
    one, own = posed(1, wall(1, 0.1), reference)
    other = compared(wall(2, 0.4), reference)
    moved = replace(own, completeness_pose_pct=own.completeness_pose_pct - away)
    paired = compare_pair(one, other, names=NAMES, poses=(moved, None), draws=200)
    row = paired.differences.loc[1]
    assert row["difference_pct"] > 0
    assert row["verdict"] == verdict
    assert ("different sides of zero" in row["sentence"]) == (verdict == "not told")
    disagree = "0.2 m is not told, for what was measured and its interval disagree"
    assert (disagree in paired.statement) == (verdict == "not told")


def test_the_same_seed_gives_the_same_bits(reference):
    one, other = compared(wall(1, 0.1), reference), compared(wall(2, 0.2), reference)
    runs = [
        compare_pair(one, other, names=NAMES, draws=100, seed=seed).differences
        for seed in (1, 1, 2)
    ]
    assert runs[0].equals(runs[1])
    assert not runs[0].equals(runs[2])


def test_unlike_comparisons_are_refused(reference):
    one = compared(wall(1), reference)
    elsewhere = compared(wall(1), prepare(cloud_from(wall(5)), voxel=0.0))
    with pytest.raises(ValueError, match="different references"):
        compare_pair(one, elsewhere, names=NAMES)
    with pytest.raises(ValueError, match="different thresholds"):
        compare_pair(one, compared(wall(1), reference, within=[0.1]), names=NAMES)
    cloud, own = posed(1, wall(1), reference)
    with pytest.raises(ValueError, match=r"drawn \[100, 200\] times"):
        compare_pair(cloud, one, names=NAMES, poses=(own, None), draws=100)
