"""Poses drawn from a covariance, and what a comparison would be at each."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from trigpoint.nearest import Tree, nearest
from trigpoint.posing import SAMPLE, changes_at, draw_poses, parameters, samples
from trigpoint.reliability import assess
from trigpoint.similarity import umeyama
from trigpoint.tallies import measures, tally
from trigpoint.zones import height_zones

PICKS = np.array([[0, 0, 1], [6, 0, 3], [6, 6, 6], [0, 6, 9], [3, 3, 18], [3, 0, 14.0]])


def worth_of(offset=0.0, *, stated=True):
    target = PICKS + np.random.default_rng(1).normal(0, 0.05, PICKS.shape) + offset
    sigma = np.full(6, 0.05) if stated else None
    return assess(PICKS, target, umeyama(PICKS, target), sigma_target=sigma)


def test_errors_have_the_covariance_that_they_are_drawn_from():
    worth = worth_of()
    errors = parameters(worth, draws=40_000, random=np.random.default_rng(1))
    spread = np.sqrt(np.diag(worth.covariance))
    assert_allclose(
        np.cov(errors.T) / np.outer(spread, spread),
        worth.covariance / np.outer(spread, spread),
        atol=0.03,
    )


def test_where_sigma_comes_from_the_residuals_errors_have_heavier_tails():
    stated, found = (
        parameters(worth_of(stated=known), draws=40_000, random=np.random.default_rng(1))
        for known in (True, False)
    )
    kurtosis = [((e - e.mean(0)) ** 4).mean(0) / e.var(axis=0) ** 2 for e in (stated, found)]
    assert_allclose(kurtosis[0], 3.0, atol=0.2)
    assert (kurtosis[1] > 3.4).all()  # t with 11 degrees of freedom: 3.86


def test_going_back_undoes_going_forward(offset):
    poses = draw_poses(worth_of(offset), draws=5, random=np.random.default_rng(2))
    points = np.random.default_rng(3).uniform(0, 20, (5, 7, 3)) + offset
    assert_allclose(poses.back(poses.forward(points)), points, atol=1e-8)


def test_points_move_as_the_similarity_says_that_they_may(offset):
    worth = worth_of(offset)
    poses = draw_poses(worth, draws=20_000, random=np.random.default_rng(2))
    corner = np.array([[6.0, 6.0, 18.0]]) + offset
    moved = poses.forward(np.broadcast_to(corner, (20_000, 1, 3)))[:, 0]
    assert_allclose((moved - corner).std(axis=0), worth.sigma(corner)[0], rtol=0.03)


@pytest.mark.parametrize("moves", ["source", "target"])
@pytest.mark.parametrize("count", [400, 4])
def test_changes_are_those_of_measuring_again_at_every_pose(moves, count, offset):
    rng = np.random.default_rng(4)
    source, target = rng.uniform(0, [6, 6, 18], (2, count, 3))
    zones, within, base = height_zones(offset[2], 18.0 + offset[2]), (0.5, 1.0), offset[2]
    poses = draw_poses(worth_of(), draws=6, random=rng)

    def whole(points, distances):
        groups = np.zeros(len(points), int)
        own = zones.of(points[:, 2] + base)
        return measures(tally(distances, own, groups, shape=(1, 3), within=within))[0]

    before = nearest(source, target)
    changes = changes_at(
        poses,
        source,
        Tree(target),
        distances=before,
        zones=zones,
        base=base,
        within=within,
        moves=moves,
        random=rng,
    )
    for k, change in enumerate(changes):
        one = poses[k : k + 1]
        if moves == "source":
            moved = one.forward(source[None])[0]
            after = whole(moved, nearest(moved, target))
        else:
            after = whole(source, nearest(source, one.forward(target[None])[0]))
        assert_allclose(change, after - whole(source, before), atol=1e-9)


def test_a_sample_changes_the_spread_of_poses_hardly():
    rng = np.random.default_rng(5)
    wall = rng.uniform(0, 1, (30_000, 3)) * [6, 0, 18] + rng.normal(0, 0.03, (30_000, 3))
    other = rng.uniform(0, 1, (30_000, 3)) * [6, 0, 18] + rng.normal(0, 0.03, (30_000, 3))
    tree, before = Tree(other), nearest(wall, other)
    poses = draw_poses(worth_of(), draws=60, random=rng)
    settings = {"distances": before, "zones": height_zones(0.0, 18.0), "base": 0.0}
    sampled = changes_at(poses, wall, tree, **settings, within=(0.05,), moves="target", random=rng)
    exact = np.array(
        [
            100
            * (
                np.mean(tree.query(poses[k : k + 1].back(wall[None])[0])[0] <= 0.05)
                - np.mean(before <= 0.05)
            )
            for k in range(60)
        ]
    )
    assert_allclose(sampled[:, 0, 1].std(), exact.std(), rtol=0.08)
    assert_allclose(sampled[:, 0, 1].mean(), exact.mean(), atol=1)


def test_samples_stand_for_all_points_and_take_small_zones_whole():
    own = np.repeat([0, 2, 1], [50 * SAMPLE, 7, 3 * SAMPLE])
    for chosen, rows, weights in samples(3, own, random=np.random.default_rng(6)):
        assert chosen == slice(0, 3)
        assert weights.sum() == pytest.approx(len(own))
        for row in rows:
            assert len(np.unique(row)) == len(row) == 2 * SAMPLE + 7
            assert_allclose(np.bincount(own[row]), [SAMPLE, SAMPLE, 7])
