import numpy as np
import pytest
from numpy.testing import assert_allclose

from trigpoint.placement import next_picks
from trigpoint.reliability import assess
from trigpoint.similarity import umeyama

LOW = np.array([[0, 0, 0], [9, 0, 1], [9, 8, 0], [0, 8, 1.5]])  # four picks about a tower's foot
TOWER = np.array([[x, y, z] for x in (0, 9) for y in (0, 8) for z in (0, 40.0)])


def worth_of(source, offset=0.0, sigma=0.05):
    target = source + offset
    stated = np.full(len(source), sigma)
    return assess(source, target, umeyama(source, target), sigma_target=stated)


def largest(worth, region):
    return np.sqrt(np.trace(worth.covariance_at(region), axis1=1, axis2=2).max())


def test_each_gain_is_that_of_picking_there(offset):
    worth = worth_of(LOW, offset)
    candidates = np.random.default_rng(1).uniform([0, 0, 0], [9, 8, 40], (30, 3)) + offset
    region = TOWER + offset
    table = next_picks(worth, candidates, region, count=30)
    assert len(table) == 30
    assert (np.diff(table["gain_m"]) <= 0).all()
    for place in table.to_numpy():
        picked = worth_of(np.vstack([LOW, place[:3] - offset]), offset)
        gain = largest(worth, region) - largest(picked, region)
        assert_allclose(place[3], gain, rtol=1e-6, atol=1e-9)


def test_a_tower_picked_at_its_foot_wants_its_top(offset):
    worth = worth_of(LOW, offset)
    grid = np.stack(np.meshgrid([0, 4, 9], [0, 4, 8], np.linspace(0, 40, 11)), axis=-1)
    table = next_picks(worth, grid.reshape(-1, 3) + offset, TOWER + offset, apart=5.0)
    assert (table["z"] - offset[2] > 30).all()
    assert table["gain_m"][0] > 0.5 * largest(worth, TOWER + offset)


def test_places_apart_are_apart():
    candidates = np.random.default_rng(2).uniform([0, 0, 0], [9, 8, 40], (300, 3))
    table = next_picks(worth_of(LOW), candidates, TOWER, count=5, apart=6.0)
    places = table[["x", "y", "z"]].to_numpy()
    gaps = np.linalg.norm(places[:, None] - places, axis=2)[np.triu_indices(len(places), 1)]
    assert len(places) == 5
    assert (gaps >= 6).all()
    best = next_picks(worth_of(LOW), candidates, TOWER, count=1)
    assert_allclose(places[0], best[["x", "y", "z"]].to_numpy()[0])


def test_the_order_of_candidates_changes_nothing():
    rng = np.random.default_rng(3)
    candidates = rng.uniform([0, 0, 0], [9, 8, 40], (50, 3))
    one = next_picks(worth_of(LOW), candidates, TOWER)
    assert one.equals(next_picks(worth_of(LOW), rng.permutation(candidates), TOWER))


def test_an_exact_fit_gains_nothing():
    worth = assess(LOW, LOW, umeyama(LOW, LOW))
    assert_allclose(next_picks(worth, TOWER, TOWER)["gain_m"], 0, atol=1e-12)


def test_nowhere_to_pick_is_refused():
    with pytest.raises(ValueError, match="0 candidates"):
        next_picks(worth_of(LOW), np.empty((0, 3)), TOWER)
