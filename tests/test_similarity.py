import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from trigpoint.errors import DegeneratePicksError
from trigpoint.similarity import Similarity, are_coplanar, are_mirrored, umeyama

UTM = np.array([741_000.0, 4_279_000.0, 150.0])


def picks(seed, count=8, offset=0.0):
    return np.random.default_rng(seed).normal(scale=20, size=(count, 3)) + offset


def noisy(points, seed, scale=0.02):
    return points + np.random.default_rng(seed).normal(scale=scale, size=points.shape)


@pytest.mark.parametrize("seed", range(20))
def test_recovers_the_truth(seed, offset, similarity_from):
    truth, source = similarity_from(seed, offset), picks(seed)
    fit = umeyama(source, truth(source))
    assert_allclose(fit.scale, truth.scale, rtol=1e-9)
    assert_allclose(fit.rotation, truth.rotation, atol=1e-9)
    assert_allclose(fit(source), truth(source), atol=1e-8)


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("weighted", [False, True])
def test_no_nearby_similarity_fits_better(seed, weighted, similarity_from):
    rng = np.random.default_rng(seed)
    source = picks(seed)
    target = noisy(similarity_from(seed, UTM)(source), seed)
    weights = rng.uniform(0.1, 10, len(source)) if weighted else np.ones(len(source))
    fit = umeyama(source, target, weights=weights)

    def cost(similarity):
        return float((weights[:, None] * (similarity(source) - target) ** 2).sum())

    for _ in range(200):
        turn = Rotation.from_rotvec(rng.normal(scale=1e-4, size=3)).as_matrix()
        other = Similarity(
            fit.scale * (1 + rng.normal(scale=1e-4)), turn @ fit.rotation, np.zeros(3)
        )
        shift = (target - other(source)).mean(axis=0) + rng.normal(scale=1e-3, size=3)
        assert cost(Similarity(other.scale, other.rotation, shift)) >= cost(fit)


def test_agrees_with_scipy_on_rotation(similarity_from):
    source = picks(3)
    target = noisy(similarity_from(3)(source), 3)
    oracle, _ = Rotation.align_vectors(target - target.mean(0), source - source.mean(0))
    assert_allclose(umeyama(source, target).rotation, oracle.as_matrix(), atol=1e-9)


@given(st.permutations(range(8)), st.integers(0, 50))
def test_order_of_picks_changes_nothing_to_the_last_bit(order, seed):
    source = picks(seed)
    target = noisy(3.26 * source + UTM, seed)
    one, other = umeyama(source, target), umeyama(source[order], target[order])
    assert one.matrix.tobytes() == other.matrix.tobytes()


def test_a_weight_of_two_is_the_same_pick_twice(similarity_from):
    source = picks(5)
    target = noisy(similarity_from(5, UTM)(source), 5)
    twice = umeyama(np.vstack([source, source[:1]]), np.vstack([target, target[:1]]))
    weighted = umeyama(source, target, weights=np.array([2.0, 1, 1, 1, 1, 1, 1, 1]))
    assert_allclose(weighted.matrix, twice.matrix, rtol=1e-9)


def test_inverse_and_composition_undo_and_chain(similarity_from, offset):
    first, second, source = similarity_from(1), similarity_from(2, offset), picks(1)
    assert_allclose((second @ first)(source), second(first(source)), atol=1e-8)
    assert_allclose(second.inverse()(second(source)), source, atol=1e-8)


def test_the_matrix_acts_on_columns(similarity_from):
    similarity, source = similarity_from(4, UTM), picks(4)
    columns = np.vstack([source.T, np.ones(len(source))])
    assert_allclose((similarity.matrix @ columns)[:3].T, similarity(source), rtol=1e-12)


@pytest.mark.parametrize(
    "turn", [[0, 0, 0], [np.pi, 0, 0], [0.3, -1.1, 2.0]], ids=["same", "flipped", "turned"]
)
@pytest.mark.parametrize("height", [0.0, 7.0], ids=["plane through the origin", "plane above it"])
@pytest.mark.parametrize("count", [3, 4, 6])
def test_trap_3_coplanar_picks_are_turned_never_reflected(turn, height, count, offset):
    flat = np.random.default_rng(count).uniform(-8, 8, size=(count, 3)) * [1, 1, 0] + [0, 0, height]
    truth = Similarity(3.26, Rotation.from_rotvec(turn).as_matrix(), offset)
    fit = umeyama(flat, truth(flat))
    assert np.linalg.det(fit.rotation) == pytest.approx(1)
    assert_allclose(fit.rotation, truth.rotation, atol=1e-8)
    assert_allclose(fit(flat), truth(flat), atol=1e-8)
    assert_allclose(fit.translation, truth.translation, atol=1e-7)


@pytest.mark.parametrize("seed", range(200))
def test_trap_3_noise_on_a_plane_never_reflects(seed):
    flat = picks(seed, count=6) * [1, 1, 0]
    target = noisy(3.26 * flat, seed, scale=0.1)
    fit = umeyama(flat, target)
    assert np.linalg.det(fit.rotation) == pytest.approx(1)
    assert_allclose(fit.rotation, np.eye(3), atol=0.1)


def test_a_mirror_image_is_noticed_and_not_matched_by_a_reflection(similarity_from, offset):
    source = picks(5)
    target = similarity_from(5, offset)(source * [1, 1, -1])
    assert np.linalg.det(umeyama(source, target).rotation) == pytest.approx(1)
    assert are_mirrored(source, noisy(target, 5))
    assert not are_mirrored(source * [1, 1, -1], noisy(target, 5))


def test_coplanar_picks_are_flagged_and_never_called_mirrored(similarity_from, offset):
    flat = picks(6) * [1, 1, 0]
    target = similarity_from(6, offset)(flat)
    assert are_coplanar(flat)
    assert are_coplanar(target)
    assert not are_coplanar(picks(6))
    assert not are_mirrored(flat, target)


@pytest.mark.parametrize("frame", ["both", "source", "target"])
def test_picks_on_a_line_are_refused_with_their_spread(frame, offset):
    line = np.linspace(0, 30, 6)[:, None] * [0.4, 0.9, 0.2] + offset
    spread = picks(2, count=6, offset=offset)
    source = spread if frame == "target" else line
    target = spread if frame == "source" else line
    with pytest.raises(DegeneratePicksError, match=r"picks spread .* well off the line"):
        umeyama(source, target)


@pytest.mark.parametrize("factor", [1e-3, 1, 1e3])
def test_refusing_a_line_does_not_depend_on_units(factor):
    line = np.linspace(0, 30, 6)[:, None] * [0.4, 0.9, 0.2] * factor
    with pytest.raises(DegeneratePicksError):
        umeyama(line, line)
    bent = line + np.array([[0, 0, 0]] * 5 + [[0.01 * factor, 0, 0]])
    assert umeyama(bent, bent).scale == pytest.approx(1)


@pytest.mark.parametrize("count", [0, 1, 2])
def test_fewer_than_three_picks_are_refused(count):
    with pytest.raises(DegeneratePicksError, match="at least three"):
        umeyama(picks(1)[:count], picks(1)[:count])


def test_bad_arrays_are_named():
    good = picks(1)
    with pytest.raises(ValueError, match=r"\(8, 3\) and target \(7, 3\)"):
        umeyama(good, good[:7])
    with pytest.raises(ValueError, match=r"pairs \[2\] hold NaN"):
        umeyama(np.where(np.arange(8)[:, None] == 2, np.nan, good), good)
    with pytest.raises(ValueError, match="above zero"):
        umeyama(good, good, weights=np.zeros(8))
