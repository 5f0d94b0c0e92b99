import hashlib
import os
import subprocess
import sys

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from trigpoint import surface as surface_room
from trigpoint.errors import RefinementError
from trigpoint.refinement import icp
from trigpoint.similarity import Similarity
from trigpoint.surface import Surface

UTM = np.array([741_000.0, 4_279_000.0, 150.0])
MIDDLE = np.array([4.0, 4.0, 15.0])


def tower(seed, count=8_000, noise=0.01):
    """Walls of 8 x 8 m, a roof at 30 m, ground about it at 0 m."""
    rng = np.random.default_rng(seed)
    points = rng.uniform(size=(count, 3)) * [8, 8, 30]
    face = rng.choice(6, count, p=[0.19, 0.19, 0.19, 0.19, 0.07, 0.17])
    for number, (axis, value) in enumerate([(0, 0), (0, 8), (1, 0), (1, 8), (2, 30), (2, 0)]):
        points[face == number, axis] = value
    points[face == 5, :2] = rng.uniform(-3, 11, size=((face == 5).sum(), 2))
    return points + rng.normal(scale=noise, size=points.shape)


def moved(points, shift, turn_deg, offset=0.0):
    """Carry points by a turn about the tower's middle and a shift: ICP has to undo it."""
    turn = Rotation.from_euler("xyz", turn_deg, degrees=True).as_matrix()
    return (points - MIDDLE) @ turn.T + MIDDLE + shift + offset


def error(refinement, start, truth, offset=0.0):
    """How far the points end from where they belong, RMS."""
    distances = refinement.similarity(start) - (truth + offset)
    return float(np.sqrt((distances**2).sum(axis=1).mean()))


@pytest.mark.parametrize("method", ["plane", "point"])
@pytest.mark.parametrize("seed", range(2))
def test_recovers_a_known_movement(method, seed, offset):
    source = tower(seed)
    start = moved(source, [0.2, -0.12, 0.1], [0.2, -0.2, 0.4], offset)
    refinement = icp(start, tower(seed + 100) + offset, method=method)
    # Points that do not coincide hold a cloud less firmly than planes do.
    assert error(refinement, start, source, offset) < (0.005 if method == "plane" else 0.02)
    assert refinement.similarity.scale == 1
    assert refinement.converged
    assert refinement.overlap_pct > 99
    assert refinement.surface_rmse_after_m < refinement.surface_rmse_before_m


@pytest.mark.parametrize("method", ["plane", "point"])
def test_a_cloud_moved_onto_itself_comes_back_exactly(method, offset):
    target = tower(1, noise=0.05) + offset
    start = moved(target - offset, [0.03, 0.02, -0.01], [0.02, 0.01, 0.05], offset)
    refinement = icp(start, target, method=method, trim=0)
    assert_allclose(refinement.similarity(start), target, atol=2e-8)
    assert refinement.surface_rmse_after_m < 1e-8


@pytest.mark.parametrize("method", ["plane", "point"])
def test_trap_6_utm_and_origin_give_the_same_transform(method):
    source, target = tower(3), tower(4)
    start = moved(source, [0.27, -0.17, 0.1], [0.3, 0.2, 0.6])
    assert np.sqrt(((start - source) ** 2).sum(axis=1).mean()) == pytest.approx(0.335, abs=0.01)
    near, far = (icp(start + at, target + at, method=method) for at in (0.0, UTM))
    assert_allclose(far.similarity(start + UTM) - UTM, near.similarity(start), atol=1e-6)
    assert_allclose(far.translation_m, near.translation_m, atol=1e-6)
    assert_allclose(far.similarity.rotation, near.similarity.rotation, atol=1e-7)
    assert far.iterations == near.iterations


def test_trap_6_a_third_of_a_metre_shrinks_below_a_centimetre(offset):
    source = tower(3)
    start = moved(source, [0.27, -0.17, 0.1], [0.3, 0.2, 0.6], offset)
    assert error(icp(start, tower(4) + offset), start, source, offset) < 0.01


@pytest.mark.parametrize("method", ["plane", "point"])
def test_trap_6_no_overlap_is_an_error_not_convergence(method, offset):
    with pytest.raises(
        RefinementError, match=r"0 of \d+ source points lie within 0.5 m .* at 11\d m"
    ):
        icp(tower(1) + np.array([130, 0, 0]) + offset, tower(2) + offset, method=method)


def test_trap_6_no_iterations_are_an_error_not_convergence():
    with pytest.raises(ValueError, match="iterations is 0"):
        icp(tower(1), tower(2), iterations=0)


def test_clouds_already_in_place_are_measured_and_not_refused(offset):
    target = tower(5) + offset
    refinement = icp(target, target)
    assert refinement.iterations == 1
    assert refinement.shift_m < 1e-9
    assert refinement.overlap_pct == 100


def test_the_shift_is_the_movement_of_the_targets_centroid(offset):
    target = tower(6) + offset
    refinement = icp(moved(tower(7), [0.1, 0.2, -0.1], [0, 0, 1], offset), target)
    centroid = offset + (target - offset).mean(axis=0)
    assert_allclose(refinement.centre, centroid, atol=1e-8)
    goes_to = refinement.similarity(centroid[None, :])[0]
    assert_allclose(refinement.translation_m, goes_to - centroid, atol=1e-8)
    assert refinement.shift_m == pytest.approx(np.linalg.norm(refinement.translation_m))
    assert refinement.rotation_deg == pytest.approx(1, abs=0.05)


def test_the_rmse_compares_the_same_points_before_and_after():
    source = np.concatenate([tower(8), tower(9)[:400] + np.array([0, 0, 100])])  # floaters, far off
    refinement = icp(source + np.array([0.2, 0, 0]), tower(10))
    assert refinement.overlap_pct == pytest.approx(100 * 8_000 / 8_400, abs=1)
    # On planes at 8 m of each other the shift shows across two walls out of four and the edges.
    assert 0.08 < refinement.surface_rmse_before_m < 0.25
    assert refinement.surface_rmse_after_m < refinement.surface_rmse_before_m


@pytest.mark.parametrize(("method", "allowed"), [("plane", 0.01), ("point", 0.03)])
def test_partial_overlap_does_not_drag(method, allowed, offset):
    source, target = tower(11, count=12_000), tower(12, count=12_000)
    source, target = source[source[:, 0] < 5.5], target[target[:, 1] > 2]
    start = moved(source, [0.15, -0.1, 0.05], [0.1, 0.1, 0.3], offset)
    assert error(icp(start, target + offset, method=method), start, source, offset) < allowed


def test_what_the_overlap_does_not_hold_is_left_and_said():
    source, target = tower(11), tower(12)
    source, target = source[source[:, 2] < 20], target[target[:, 2] > 8]  # they share walls only
    refinement = icp(source + np.array([0.2, -0.1, 0.1]), target)
    assert_allclose(refinement.similarity.rotation, np.eye(3), atol=1e-3)
    assert refinement.translation_m == pytest.approx([-0.2, 0.1, 0], abs=0.01)
    (caution,) = refinement.cautions
    assert "along (0.00, 0.00, 1.00)" in caution.message


def test_trimming_leaves_out_the_worst_pairs():
    source, target = tower(13), tower(14)
    annex = (source[:, 1] < 0.1) & (source[:, 2] < 8)
    source[annex] -= [0, 0.35, 0]  # something new in front of one wall, near enough to be paired
    trimmed, untrimmed = (icp(source, target, trim=trim) for trim in (0.15, 0))
    assert trimmed.pairs < untrimmed.pairs
    assert trimmed.shift_m < 0.5 * untrimmed.shift_m


@pytest.mark.parametrize("method", ["plane", "point"])
def test_scale_is_left_alone(method):
    source = (tower(15) - MIDDLE) * 1.003 + MIDDLE
    refinement = icp(source, tower(16), method=method)
    rotation = refinement.similarity.rotation
    assert refinement.similarity.scale == 1
    assert_allclose(rotation @ rotation.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(rotation) == pytest.approx(1)


@pytest.mark.parametrize("normal", [[0, 0, 1], [1, 1, 0]], ids=["ground", "oblique wall"])
def test_a_plane_moves_across_itself_only_and_says_so(normal, offset):
    normal = np.array(normal) / np.linalg.norm(normal)
    rng = np.random.default_rng(1)
    basis = np.linalg.svd(normal[None, :])[2][1:]

    def sheet():
        spread = rng.uniform(-10, 10, size=(10_000, 2)) @ basis
        return spread + rng.normal(scale=0.01, size=(10_000, 1)) * normal

    refinement = icp(sheet() + offset + 0.2 * normal + 0.1 * basis[0], sheet() + offset)
    assert_allclose(refinement.translation_m, -0.2 * normal, atol=0.005)
    (caution,) = refinement.cautions
    assert caution.code == "weak_geometry"
    assert "left as it was" in caution.message
    named = f"about ({normal[0]:.2f}, {normal[1]:.2f}, {normal[2]:.2f})"
    assert named in caution.message
    assert caution.message.count("along") == 2


def test_point_to_point_on_a_plane_says_that_it_may_have_drifted():
    rng = np.random.default_rng(2)
    sheets = rng.uniform(-10, 10, size=(2, 5_000, 3)) * [1, 1, 0]
    refinement = icp(sheets[0], sheets[1], method="point")
    assert [caution.code for caution in refinement.cautions] == ["weak_geometry"]
    assert "drifted" in refinement.cautions[0].message


def test_a_slender_tower_is_held_about_its_own_axis():
    source = tower(17) * [1, 1, 3]
    start = (source - MIDDLE) @ Rotation.from_euler("z", 1, degrees=True).as_matrix().T + MIDDLE
    refinement = icp(start, tower(18) * [1, 1, 3])
    assert not refinement.cautions
    assert refinement.rotation_deg == pytest.approx(1, abs=0.03)


def test_running_out_of_iterations_is_said():
    refinement = icp(tower(1) + np.array([0.2, 0.1, 0]), tower(2), method="point", iterations=3)
    assert not refinement.converged
    assert refinement.iterations == 3
    assert [caution.code for caution in refinement.cautions] == ["icp_not_converged"]


@settings(max_examples=5, deadline=None)
@given(st.randoms(use_true_random=False), st.sampled_from(["plane", "point"]))
def test_order_of_points_changes_nothing_to_the_last_bit(random, method):
    source, target = tower(19, count=3_000) + UTM + 0.05, tower(20, count=3_000) + UTM
    shuffle = np.random.default_rng(random.getrandbits(32)).permutation
    one = icp(source, target, method=method)
    other = icp(shuffle(source), shuffle(target), method=method)
    assert one.similarity.matrix.tobytes() == other.similarity.matrix.tobytes()
    assert one.surface_rmse_after_m == other.surface_rmse_after_m


def test_a_sample_moves_as_the_whole_cloud_does(monkeypatch):
    source, target = tower(21) + np.array([0.2, 0.1, -0.1]), tower(22)
    whole = icp(source, target)
    monkeypatch.setattr(surface_room, "SAMPLE", 3_000)
    sampled = icp(source, target)
    assert sampled.pairs <= 3_000 < whole.pairs
    assert_allclose(sampled.similarity(source), whole.similarity(source), atol=0.01)
    assert sampled.overlap_pct == pytest.approx(whole.overlap_pct, abs=0.1)


def test_a_surface_is_reused_and_changes_nothing():
    source, target = tower(23) + 0.1, tower(24)
    surface = Surface(target)
    first, second = icp(source, surface), icp(source, surface)
    assert first.similarity.matrix.tobytes() == second.similarity.matrix.tobytes()
    assert first.similarity.matrix.tobytes() == icp(source, target).similarity.matrix.tobytes()


def test_arguments_are_left_as_they_were():
    source, target = tower(25) + UTM, tower(26) + UTM
    before = source.copy(), target.copy()
    icp(source, target)
    assert_allclose(source, before[0], rtol=0)
    assert_allclose(target, before[1], rtol=0)


def test_large_turns_stay_rotations():
    source = tower(27)
    start = moved(source, [0, 0, 0], [0, 0, 12])
    refinement = icp(start, tower(28), max_distance=3.0)
    assert error(refinement, start, source) < 0.02
    assert refinement.rotation_deg == pytest.approx(12, abs=0.1)


@pytest.mark.parametrize("method", ["plane", "point"])
def test_a_line_is_refused(method):
    line = np.linspace(0, 30, 500)[:, None] * [0.4, 0.9, 0.2]
    with pytest.raises(RefinementError, match="on a line"):
        icp(line, line, method=method)


@pytest.mark.parametrize(
    ("source", "target", "words"),
    [
        (np.zeros((0, 3)), tower(1), "source has no points"),
        (tower(1), np.zeros((0, 3)), "target has 0 points"),
        (tower(1), tower(2)[:7], "target has 7 points"),
        (tower(1) * [1, np.nan, 1], tower(2), "hold NaN"),
        (tower(1), np.full((50, 3), np.inf), "50 of 50 points hold NaN or infinite"),
    ],
)
def test_clouds_without_usable_points_are_refused(source, target, words):
    with pytest.raises(RefinementError, match=words):
        icp(source, target)


@pytest.mark.parametrize(
    ("setting", "words"),
    [
        ({"method": "gicp"}, "must be one of plane, point"),
        ({"max_distance": 0}, "must be above zero"),
        ({"max_distance": np.nan}, "must be above zero"),
        ({"trim": 1.0}, "from 0 to below 1"),
        ({"trim": -0.1}, "from 0 to below 1"),
        ({"iterations": -1}, "has done nothing"),
    ],
)
def test_settings_out_of_range_are_refused(setting, words):
    with pytest.raises(ValueError, match=words):
        icp(tower(1), tower(2), **setting)


def test_points_of_another_shape_are_refused():
    with pytest.raises(ValueError, match=r"must have shape \(n, 3\)"):
        icp(tower(1)[:, :2], tower(2))


CHILD = """
import numpy as np
from trigpoint.refinement import icp
rng = np.random.default_rng(0)
walls = rng.uniform(size=(2, 15_000, 3)) * [8, 8, 30]
for axis in range(3):
    walls[:, axis::3, axis] = np.round(walls[:, axis::3, axis] / 8) * 8
walls += rng.normal(scale=0.03, size=walls.shape) + [741_000.0, 4_279_000.0, 150.0]
for method in ("plane", "point"):
    refinement = icp(walls[0] + 0.1, walls[1], method=method, iterations=8)
    print(refinement.similarity.matrix.tobytes().hex(), refinement.surface_rmse_after_m.hex())
"""


def test_threads_change_nothing_to_the_last_bit():
    answers = set()
    for threads in ("1", "2"):
        names = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
        environment = os.environ | dict.fromkeys(names, threads)
        child = subprocess.run(
            [sys.executable, "-c", CHILD], env=environment, capture_output=True, check=True
        )
        answers.add(hashlib.sha256(child.stdout).hexdigest())
    assert len(answers) == 1


def test_the_similarity_composes_with_the_fit(similarity_from):
    fit = similarity_from(3, UTM)
    local = fit.inverse()(tower(29) + UTM)
    refinement = icp(fit(local) + np.array([0.1, 0, 0]), tower(30) + UTM)
    shifted = Similarity(1.0, np.eye(3), np.array([0.1, 0, 0])) @ fit
    assert_allclose(
        (refinement.similarity @ shifted)(local), refinement.similarity(shifted(local)), atol=1e-7
    )
