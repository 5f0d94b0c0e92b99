import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation
from towers import TOWER

from trigpoint.geometry import axis_words, rotation_axes
from trigpoint.reliability import assess
from trigpoint.similarity import Similarity, umeyama

UTM = np.array([741_000.0, 4_279_000.0, 150.0])
RNG = np.random.default_rng(0)
EDGE = np.column_stack([RNG.normal(0, 0.003, (6, 2)), np.linspace(0, 15, 6)])
FACADE = np.array([[0, 0, 0], [8, 0, 0], [8, 0, 6], [0, 0, 6], [3, 0, 2], [5, 0, 5]], float)
ONE_FAR = np.vstack([RNG.normal(0, 0.3, (5, 3)), [[20.0, 5, 0]]])
CLUSTER = RNG.normal(0, 0.03, (6, 3))
NARROW = np.column_stack([RNG.normal(0, 0.2, (8, 2)), np.linspace(0, 30, 8)])
TWICE = TOWER[[0, 1, 2, 3, 4, 5, 2]]
# picks, how they come out, and the words that say why
SETS = {
    "tower": (TOWER, "sound", "pin the similarity down"),
    "coplanar": (FACADE, "sound", "pin the similarity down"),
    "near-collinear": (EDGE, "refused", "does not show it"),
    "clustered": (CLUSTER, "refused", "is known to"),
    "one far": (ONE_FAR, "weak", "pick 5 decides alone"),
    "narrow": (NARROW, "weak", "lie along"),
    "twice": (TWICE, "weak", "a copy is no second measurement"),
    "mirrored": (TOWER, "refused", "mirror image"),
}


def scene(name, *, offset=0.0, units=1.0, metre=1.0, sigma=0.05):
    source = SETS[name][0]
    turn = Rotation.from_rotvec([0.3, -1.1, 2.0]).as_matrix()
    noise = np.random.default_rng(1).normal(0, sigma, source.shape)
    if name == "twice":
        noise[6] = noise[2]
    target = Similarity(3.26, turn, np.zeros(3))(source) + noise + offset
    if name == "mirrored":
        target = target * [1, 1, -1]
    return source * units, target * metre


def verdict(source, target, **settings):
    worth = assess(source, target, umeyama(source, target), **settings)
    return worth.geometry, worth.statement


@pytest.mark.parametrize("name", SETS)
def test_each_layout_has_its_verdict(name, offset):
    _, expected, words = SETS[name]
    found, statement = verdict(*scene(name, offset=offset))
    assert found == expected
    assert words in statement


@pytest.mark.parametrize("name", SETS)
@pytest.mark.parametrize(("units", "metre"), [(1e3, 1.0), (1.0, 1e3), (1e-3, 1e-3), (3.28, 1.0)])
def test_no_verdict_depends_on_the_units(name, units, metre):
    assert verdict(*scene(name, units=units, metre=metre))[0] == SETS[name][1]


@given(st.sampled_from(list(SETS)), st.permutations(range(8)))
@settings(max_examples=60, deadline=None)
def test_no_verdict_depends_on_the_order(name, order):
    source, target = scene(name, offset=UTM)
    order = [i for i in order if i < len(source)]
    names = [str(i) for i in order]
    shuffled = verdict(source[order], target[order], names=names)
    assert shuffled == verdict(source, target)


@pytest.mark.parametrize("seed", range(20))
def test_trap_4_a_tower_edge_is_refused_although_its_rmse_is_small(seed, offset):
    rng = np.random.default_rng(seed)
    source = np.column_stack([rng.normal(0, 0.003, (6, 2)), np.linspace(0, 15, 6)])
    turn = Rotation.from_rotvec([0.3, -1.1, 2.0]).as_matrix()
    target = Similarity(3.26, turn, offset)(source) + rng.normal(0, 0.05, (6, 3))
    fit = umeyama(source, target)
    assert np.sqrt(((target - fit(source)) ** 2).sum(axis=1).mean()) < 0.15
    for sigma in (None, np.full(6, 0.05)):
        worth = assess(source, target, fit, sigma_target=sigma)
        assert worth.geometry == "refused"
        assert worth.rotation_sigma_deg[0] > 5
        assert "weak_geometry" in [caution.code for caution in worth.cautions]


def test_trap_4_a_boastful_sigma_does_not_talk_a_tower_edge_sound(offset):
    source, target = scene("near-collinear", offset=offset)
    worth = assess(source, target, umeyama(source, target), sigma_target=np.full(6, 1e-4))
    assert worth.geometry == "refused"
    assert "sigmas_doubtful" in [caution.code for caution in worth.cautions]


def test_trap_4_the_sigma_about_a_short_lever_is_that_of_draws():
    rng = np.random.default_rng(3)
    source = np.column_stack([rng.normal(0, 0.1, (6, 2)), np.linspace(0, 15, 6)])
    truth = Similarity(3.26, Rotation.from_rotvec([0.3, -1.1, 2.0]).as_matrix(), np.zeros(3))
    target = truth(source)
    worth = assess(source, target, truth, sigma_target=np.full(6, 0.05))
    assert 1 < worth.rotation_sigma_deg[0] < 5
    turns = []
    for _ in range(4000):
        fit = umeyama(source, target + rng.normal(0, 0.05, target.shape))
        turns.append(Rotation.from_matrix(fit.rotation @ truth.rotation.T).as_rotvec())
    found = np.degrees(np.std(np.array(turns) @ worth.rotation_axes.T, axis=0))
    np.testing.assert_allclose(found, worth.rotation_sigma_deg, rtol=0.05)


@pytest.mark.parametrize("count", [6, 30, 200, 2000])
def test_a_pole_picked_with_noise_in_both_frames_is_refused_however_many_picks(count):
    # The noise itself spreads the source across the pole, so the covariance alone grows confident.
    rng = np.random.default_rng(count)
    pole = np.column_stack([np.zeros((count, 2)), np.linspace(0, 15, count)])
    source = pole + rng.normal(0, 0.05, pole.shape)
    target = pole + rng.normal(0, 0.05, pole.shape)
    assert verdict(source, target)[0] == "refused"


@pytest.mark.parametrize("count", [6, 30, 200, 2000])
def test_a_pole_with_a_real_lever_is_not_refused_for_its_noise(count):
    rng = np.random.default_rng(count)
    pole = np.column_stack([rng.uniform(-1, 1, (count, 2)), np.linspace(0, 15, count)])
    source = pole + rng.normal(0, 0.02, pole.shape)
    target = pole + rng.normal(0, 0.02, pole.shape)
    assert verdict(source, target)[0] != "refused"


def test_three_picks_that_fit_by_luck_are_not_called_sound_about_a_short_lever():
    source = np.array([[0, 0, 0], [0, 0, 15], [0.8, 0, 7]])
    target = source + np.array([[0, 0, 0], [0, 0, 0.04], [0, 0, 0]])
    found, statement = verdict(source, target)
    assert found == "weak"
    assert "may be known to" in statement


def test_a_reference_far_beyond_the_picks_is_weak():
    source, target = scene("tower")
    near = np.array([target.min(axis=0), target.max(axis=0)])
    assert verdict(source, target, extent=near)[0] == "sound"
    far = np.array([[-1, -1, 0], [1, 1, 0]])
    found, statement = verdict(source, target, extent=near + 400 * far)
    assert found == "weak"
    assert "farthest corner" in statement


def test_a_copy_among_a_hundred_picks_changes_nothing():
    source = np.random.default_rng(4).normal(size=(100, 3)) * 10
    target = source + np.random.default_rng(5).normal(0, 0.05, source.shape)
    source[1], target[1] = source[0], target[0]
    assert verdict(source, target)[0] == "sound"


def test_the_weak_axis_is_named(offset):
    rng = np.random.default_rng(2)
    source = np.column_stack([rng.normal(0, 0.5, (6, 2)), np.linspace(0, 30, 6)])
    target = source + offset + rng.normal(0, 0.05, source.shape)
    found, statement = verdict(source, target)
    assert found == "weak"
    assert "the rotation about the vertical is known to" in statement


def test_axes_are_named_as_a_surveyor_would():
    assert axis_words(np.array([0.0, 0, -1])) == "the vertical"
    assert axis_words(np.array([1.0, 0, 0])) == "a horizontal axis bearing 90° from grid north"
    assert axis_words(np.array([0.0, -1, 0])) == "a horizontal axis bearing 0° from grid north"
    tilted = axis_words(np.array([0.0, -1, -1]) / np.sqrt(2))
    assert tilted == "an axis 45° above the horizon, bearing 0° from grid north"


def test_axes_are_principal_and_worst_first():
    turn = Rotation.random(random_state=1).as_matrix()
    sigmas, axes = rotation_axes(turn.T @ np.diag([1.0, 9.0, 4.0]) @ turn)
    np.testing.assert_allclose(sigmas, [3, 2, 1])
    np.testing.assert_allclose(np.abs((axes * turn[[1, 2, 0]]).sum(axis=1)), 1)
    assert (axes[:, 2] > 0).all()
