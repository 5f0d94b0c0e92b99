"""Exact nearest neighbours: against brute force, with either tree, in any order."""

import sys

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from trigpoint.nearest import Tree, lattice_order, nearest

ROOM = sys.modules["trigpoint.nearest"]
CLOUDS = arrays(
    np.float64,
    st.tuples(st.integers(1, 40), st.just(3)),
    elements=st.floats(-1e3, 1e3, allow_subnormal=False).map(lambda value: round(value, 3)),
)


@pytest.fixture(params=["pykdtree", "scipy"])
def either_tree(request, monkeypatch):
    """With pykdtree, and as where it is not installed."""
    if request.param == "scipy":
        monkeypatch.setattr(ROOM, "KDTree", None)
    elif ROOM.KDTree is None:
        pytest.skip("pykdtree is not installed")


def brute(source, target):
    return np.sqrt(((source[:, None, :] - target[None, :, :]) ** 2).sum(axis=2))


def walls(n, seed):
    rng = np.random.default_rng(seed)
    points = rng.uniform(0, 40, (n, 3))
    points[: n // 2, 0] = 0
    return points + rng.normal(0, 0.02, (n, 3))


@pytest.mark.usefixtures("either_tree")
def test_every_distance_is_the_smallest(offset):
    source, target = walls(3_000, 1) + offset, walls(2_000, 2) + offset
    distances, indices = Tree(target).query(source)
    everything = brute(source - offset, target - offset)
    np.testing.assert_allclose(distances, everything.min(axis=1), atol=1e-8)
    np.testing.assert_allclose(
        np.linalg.norm(source - target[indices], axis=1), distances, rtol=1e-15
    )


@given(CLOUDS, CLOUDS)
def test_any_clouds_agree_with_brute_force(source, target):
    np.testing.assert_allclose(nearest(source, target), brute(source, target).min(axis=1))


def test_both_trees_give_the_same_bits(monkeypatch):
    source, target = walls(20_000, 3), walls(20_000, 4)
    fast = nearest(source, target)
    monkeypatch.setattr(ROOM, "KDTree", None)
    assert nearest(source, target).tobytes() == fast.tobytes()


@pytest.mark.usefixtures("either_tree")
def test_the_order_of_the_points_changes_no_bit():
    source, target = walls(30_000, 5), walls(30_000, 6)
    rng = np.random.default_rng(7)
    mixed = rng.permutation(len(source))
    np.testing.assert_array_equal(
        nearest(source[mixed], target[rng.permutation(len(target))]), nearest(source, target)[mixed]
    )


def test_shuffled_points_are_put_in_order_and_ordered_ones_left_alone():
    points = walls(50_000, 8)
    order = lattice_order(points)
    assert sorted(order) == list(range(len(points)))
    assert lattice_order(points[order]) is None
    step = np.linalg.norm(np.diff(points[order], axis=0), axis=1)
    assert np.median(step) < 0.2 * np.median(np.linalg.norm(np.diff(points, axis=0), axis=1))


def test_one_stray_point_does_not_spoil_the_order():
    points = np.vstack([walls(50_000, 9), [[1e7, 1e7, 1e7]]])
    step = np.linalg.norm(np.diff(points[lattice_order(points)], axis=0), axis=1)
    assert np.median(step) < 10


@pytest.mark.usefixtures("either_tree")
def test_a_pile_of_equal_points_is_no_trap():
    # 100,000 in one place, as scanners write for pulses that never came back: against themselves
    # they cost a tree ten thousand million distances.
    target = np.vstack([walls(100_000, 10), np.zeros((100_000, 3))])
    source = np.vstack([walls(1_000, 11), np.zeros((100_000, 3))])
    distances, indices = Tree(target).query(source)
    np.testing.assert_allclose(np.linalg.norm(source - target[indices], axis=1), distances)
    assert (distances[1_000:] == 0).all()


@pytest.mark.usefixtures("either_tree")
def test_an_empty_target_is_infinitely_far():
    distances, indices = Tree(np.empty((0, 3))).query(walls(5, 12))
    assert np.isposinf(distances).all()
    assert (indices == -1).all()
    assert nearest(np.empty((0, 3)), walls(5, 12)).shape == (0,)


def test_what_is_no_cloud_is_refused():
    with pytest.raises(ValueError, match=r"source has shape \(4, 2\)"):
        nearest(np.zeros((4, 2)), np.zeros((4, 3)))
    with pytest.raises(ValueError, match="1 of 4 target points are NaN or infinite"):
        nearest(np.zeros((4, 3)), np.array([[0, 0, np.nan], *np.zeros((3, 3))]))


def test_arguments_are_left_as_they_were():
    source, target = walls(5_000, 13), walls(5_000, 14)
    before = source.copy(), target.copy()
    nearest(source, target)
    np.testing.assert_array_equal(source, before[0])
    np.testing.assert_array_equal(target, before[1])


def test_trap_1_distances_at_utm_equal_those_near_the_origin():
    source, target = walls(5_000, 15), walls(5_000, 16)
    shift = np.array([741_000.0, 4_279_000.0, 150.0])
    np.testing.assert_allclose(
        nearest(source + shift, target + shift), nearest(source, target), atol=2e-9
    )
