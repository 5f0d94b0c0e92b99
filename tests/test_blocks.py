"""Blocks resampled as they are, because neighbours err together."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from trigpoint.blocks import MOST_BLOCKS, blocks_of, resampled, too_few
from trigpoint.tallies import measures, tally


def test_points_of_one_cube_share_a_block():
    points = np.array([[0.1, 0.1, 0.1], [1.9, 1.9, 1.9], [2.1, 0.1, 0.1], [-0.1, 0.1, 0.1]])
    blocks = blocks_of(points, np.zeros(3))
    assert blocks.edge_m == 2
    assert blocks.count == 3
    assert blocks.of[0] == blocks.of[1]
    assert len(set(blocks.of[1:])) == 3


@settings(max_examples=20, deadline=None)
@given(st.floats(10, 2000), st.integers(0, 1000))
def test_a_large_site_has_larger_blocks_not_more(side, seed):
    points = np.random.default_rng(seed).uniform(0, side, (5_000, 3))
    blocks = blocks_of(points, points.min(axis=0))
    assert blocks.count <= MOST_BLOCKS
    assert np.log2(blocks.edge_m) % 1 == 0
    assert_array_equal(np.unique(blocks.of), np.arange(blocks.count))
    spans = [np.ptp(points[blocks.of == k], axis=0).max() for k in range(0, blocks.count, 97)]
    assert max(spans) <= blocks.edge_m


def test_resampled_sums_vary_as_sums_of_independent_blocks_do():
    values = np.random.default_rng(1).normal(size=200)
    sums = resampled(values[:, None], draws=20_000, random=np.random.default_rng(2))[:, 0]
    assert sums.mean() == pytest.approx(values.sum(), abs=0.5)
    assert sums.std() == pytest.approx(np.sqrt(200) * values.std(), rel=0.03)


def test_neighbours_that_err_together_widen_the_spread():
    rng = np.random.default_rng(3)
    points = rng.uniform(0, 40, (20_000, 3)) * [1, 1, 0]
    missed = np.isin(blocks_of(points, np.zeros(3)).of % 7, [0, 1])
    distances, zones = np.where(missed, 1.0, 0.0), np.zeros(20_000, int)
    spreads = []
    for groups in (blocks_of(points, np.zeros(3)).of, rng.integers(0, 400, 20_000)):
        tallies = tally(distances, zones, groups, shape=(400, 1), within=[0.5])
        drawn = measures(resampled(tallies, draws=500, random=np.random.default_rng(4)))
        spreads.append(drawn[:, 0, 1].std())
    assert spreads[0] > 4 * spreads[1]


def test_fewer_than_ten_blocks_are_too_few():
    tallies = np.zeros((12, 2, 3))
    tallies[:, 0, 0], tallies[:9, 1, 0] = 1, 1
    assert_array_equal(too_few(tallies), [False, True])


def test_tallies_sum_points_squares_and_hits_by_group_and_zone():
    distances = np.array([0.1, 0.3, 0.5, 0.5])
    found = tally(
        distances, np.array([0, 1, 1, 0]), np.array([0, 0, 1, 1]), shape=(2, 2), within=[0.3, 0.5]
    )
    assert_allclose(found[0], [[2, 0.10, 2, 2], [1, 0.01, 1, 1], [1, 0.09, 1, 1]])
    assert_allclose(measures(found[1])[0], [0.25, 0, 100])
    doubled = tally(
        distances,
        np.zeros(4, int),
        np.zeros(4, int),
        shape=(1, 1),
        within=[0.3],
        weights=np.array([2.0, 1, 1, 1]),
    )
    assert_allclose(doubled[0, 0], [5, 0.61, 3])
