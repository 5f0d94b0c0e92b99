import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy import stats
from scipy.spatial.transform import Rotation
from towers import APEX, DEMO, DEMO_APEX, DEMO_IDS, TOWER

from trigpoint.adjustment import linearise
from trigpoint.blunders import noncentrality, pick_table
from trigpoint.clocktower import build_tower
from trigpoint.consensus import exhaustive
from trigpoint.reliability import assess
from trigpoint.similarity import Similarity, umeyama
from trigpoint.synthetic import CONTROL

SIGMA = 0.10


def truth(offset=0.0):
    turn = Rotation.from_rotvec([0.3, -1.1, 2.0]).as_matrix()
    return Similarity(3.26, turn, np.zeros(3) + offset)


def draw(seed, *, blunder=0.0, offset=0.0, sigma=SIGMA, source=TOWER, apex=APEX):
    rng = np.random.default_rng(seed)
    target = truth(offset)(source) + rng.normal(0, sigma, source.shape)
    direction = rng.normal(size=3)
    target[apex] += blunder * direction / np.linalg.norm(direction)
    return target


def table(target, known=True, source=TOWER, sigma=SIGMA):
    stated = np.full(len(source), sigma) if known else None
    worth = assess(
        source,
        target,
        umeyama(source, target),
        sigma_source=None if stated is None else 0 * stated,
        sigma_target=stated,
    )
    return worth.picks


def pick_tests(target, known, source=TOWER):
    """Make the same table as `table` by the shortest way, for loops over many draws."""
    count = len(source)
    ours = linearise(source, target, umeyama(source, target), np.ones(count))
    misfit = ours.misfit(np.ones(count))
    sigma = SIGMA if known else np.sqrt(misfit / (3 * count - 7))
    return pick_table(ours, np.ones(count), sigma, misfit, known=known, exact=False)


def suspects(target, source):
    """Tell whether the consensus keeps all picks, and name those that it or the worst test does."""
    inliers = exhaustive(source, target, threshold=0.5).inliers
    if not inliers.all():
        return False, np.flatnonzero(~inliers).tolist()
    picks = pick_tests(target, known=True, source=source)
    return True, [picks["p_value"].idxmin()] if picks["suspected"].any() else []


@pytest.mark.parametrize(("source", "apex"), [(TOWER, APEX), (DEMO / 3.26, DEMO_APEX)])
def test_trap_5_a_blunder_that_the_consensus_keeps_is_named(source, apex):
    kept = named = false = 0
    for seed in range(500):
        is_kept, names = suspects(draw(seed, blunder=0.7, source=source, apex=apex), source)
        kept += is_kept
        named += names == [apex]
        false += suspects(draw(seed, source=source, apex=apex), source)[1] != []
    assert kept >= 0.65 * 500  # what "all picks were retained" is worth
    assert named >= 0.85 * 500
    assert false <= 0.06 * 500


def test_the_demo_picks_are_those_that_are_published():
    corners = build_tower().corners
    assert tuple(CONTROL) == DEMO_IDS
    assert_allclose([corners[name] for name in DEMO_IDS], DEMO, atol=0.0005)


@pytest.mark.parametrize("known", [True, False])
def test_the_tests_are_the_same_anywhere_on_earth(known, offset):
    for seed in range(10):
        here = table(draw(seed, blunder=0.7, offset=offset), known=known)
        assert_allclose(
            here["p_value"], pick_tests(draw(seed, blunder=0.7), known)["p_value"], rtol=1e-5
        )
        if known:
            assert here["suspected"][APEX] == (here["p_value"][APEX] < 0.05 / 6)


def test_without_a_stated_sigma_the_p_values_are_those_of_the_f_test():
    tables = [pick_tests(draw(seed), known=False) for seed in range(500)]
    for pick in np.array([picks["p_value"] for picks in tables]).T:
        assert stats.kstest(pick, "uniform").pvalue > 1e-3
    assert sum(picks["suspected"].any() for picks in tables) <= 0.06 * 500


def test_the_f_test_equals_a_fit_that_models_the_pick_as_shifted():
    # Leaving a pick out and letting it have a shift of its own are the same model.
    target = draw(1, blunder=0.4, sigma=0.01)
    fit = umeyama(TOWER, target)
    ours = linearise(TOWER, target, fit, np.ones(6))
    picks = table(target, known=False)
    design = ours.design.reshape(18, 7)
    for i in range(6):
        shifted = np.hstack([design, np.eye(18)[:, 3 * i : 3 * i + 3]])
        step = np.linalg.lstsq(shifted, ours.residuals.ravel(), rcond=None)[0]
        rest = ((ours.residuals.ravel() - shifted @ step) ** 2).sum()
        gain = (ours.residuals**2).sum() - rest
        assert_allclose(picks["p_value"][i], stats.f.sf(gain / 3 / (rest / 8), 3, 8), rtol=1e-6)


def test_published_numbers_of_a_tower_are_reproduced(offset):
    target = truth(offset)(TOWER)
    picks = table(target, sigma=0.101)
    ours = linearise(TOWER, target, truth(offset), np.ones(6))
    shown = np.diagonal(ours.redundancy, axis1=1, axis2=2)
    assert 0.465 < shown.min() < shown.max() < 0.775
    assert_allclose(picks["redundancy"].sum(), 11, atol=1e-9)
    assert_allclose(picks["detectable_blunder_m"].min(), 0.62, atol=0.005)
    assert_allclose(picks["detectable_blunder_m"].max(), 0.73, atol=0.005)


def test_the_detectable_blunder_equals_its_closed_form(offset):
    target = draw(2, offset=offset)
    p = truth(offset)(TOWER)
    p = p - p.mean(axis=0)
    fit = umeyama(TOWER, target)
    p = fit.scale * (TOWER - TOWER.mean(axis=0)) @ fit.rotation.T
    square = (p**2).sum()
    inertia = np.linalg.inv(square * np.eye(3) - p.T @ p)
    limit = noncentrality(0.001, 0.80, 3)
    expected = []
    for x, y, z in p:
        cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
        hat = np.eye(3) / 6 + cross @ inertia @ cross.T + np.outer([x, y, z], [x, y, z]) / square
        expected.append(SIGMA * np.sqrt(limit / np.linalg.eigvalsh(np.eye(3) - hat)[0]))
    assert_allclose(table(target)["detectable_blunder_m"], expected, rtol=1e-9)


def test_noncentrality_gives_the_power_it_promises():
    for dof, spare in ((1, None), (3, None), (3, 8), (3, 5), (3, 2)):
        limit = noncentrality(0.001, 0.80, dof, spare)
        if spare is None:
            power = stats.ncx2.sf(stats.chi2.isf(0.001, dof), dof, limit)
        else:
            power = stats.ncf.sf(stats.f.isf(0.001, dof, spare), dof, spare, limit)
        assert_allclose(power, 0.80, atol=1e-6)
    assert_allclose(noncentrality(0.001, 0.80, 3), 21.55, atol=0.005)


def test_the_detectable_blunder_is_detected_four_times_in_five():
    clean = truth()(TOWER)
    picks = table(clean)
    ours = linearise(TOWER, clean, truth(), np.ones(6))
    direction = np.linalg.eigh(ours.redundancy[APEX])[1][:, 0]
    size = picks["detectable_blunder_m"][APEX]
    hits = 0
    for seed in range(2000):
        target = clean + np.random.default_rng(seed).normal(0, SIGMA, clean.shape)
        target[APEX] += size * direction
        residuals = (target - umeyama(TOWER, target)(TOWER))[APEX]
        square = residuals @ np.linalg.solve(ours.redundancy[APEX], residuals) / SIGMA**2
        hits += stats.chi2.sf(square, 3) < 0.001
    assert_allclose(hits / 2000, 0.80, atol=0.03)


def test_unequal_sigmas_in_an_unweighted_fit_are_tested_at_their_own_size():
    sigma = np.array([0.02, 0.3, 0.1, 0.05, 0.2, 0.1])
    p = []
    for seed in range(300):
        noise = np.random.default_rng(seed).normal(size=TOWER.shape) * sigma[:, None]
        target = truth()(TOWER) + noise
        ours = linearise(TOWER, target, umeyama(TOWER, target), np.ones(6))
        misfit = ours.misfit(sigma**2)
        picks = pick_table(ours, sigma**2, 1.0, misfit, known=True, exact=False)
        p.append([*picks["p_value"], stats.chi2.sf(misfit, 11)])
    for values in np.array(p).T:
        assert stats.kstest(values, "uniform").pvalue > 1e-3


def test_source_errors_count_at_the_scale_of_the_similarity():
    target = draw(3)
    fit = umeyama(TOWER, target)
    source = assess(TOWER, target, fit, sigma_source=np.full(6, 0.1 / fit.scale))
    both = assess(
        TOWER,
        target,
        fit,
        sigma_source=np.full(6, 0.06 / fit.scale),
        sigma_target=np.full(6, 0.08),
    )
    assert_allclose(source.picks["p_value"], both.picks["p_value"])
    assert "source_noise_dominates" in [caution.code for caution in source.cautions]
    assert "source_noise_dominates" not in [caution.code for caution in both.cautions]


@pytest.mark.parametrize("known", [True, False])
def test_three_picks_can_not_be_tested(known):
    target = draw(4)[:3]
    source = TOWER[:3]
    fit = umeyama(source, target)
    worth = assess(source, target, fit, sigma_target=np.full(3, 0.1) if known else None)
    assert "2 redundant equations" in worth.statement
    assert "not assessable" in worth.statement
    assert worth.picks["p_value"].isna().all()
    assert np.isinf(worth.picks["detectable_blunder_m"]).all()
    assert not worth.picks["suspected"].any()
    assert "no pick can be tested" in {c.code: c.message for c in worth.cautions}["picks_few"]


@pytest.mark.parametrize("known", [True, False])
@pytest.mark.parametrize("count", [4, 5])
def test_four_and_five_picks_say_how_little_they_can_find(known, count):
    target = draw(5)[:count]
    source = TOWER[:count]
    fit = umeyama(source, target)
    worth = assess(source, target, fit, sigma_target=np.full(count, 0.1) if known else None)
    message = {c.code: c.message for c in worth.cautions}["picks_few"]
    assert f"{3 * count - 7} redundant equations" in message
    assert "80 % probability only if" in message


def test_a_pick_that_alone_fixes_the_rotation_is_blind_in_that_direction():
    # Without the fourth pick the others lie on a line.
    source = np.array([[0, 0, 0], [0, 0, 5], [0, 0, 10], [6, 0, 5.0]])
    target = source + np.random.default_rng(1).normal(0, 0.05, source.shape)
    for known in (True, False):
        picks = table(target, known=known, source=source)
        assert np.isinf(picks["detectable_blunder_m"][3])
        assert np.isfinite(picks["detectable_blunder_m"][:3]).all()
        assert picks["p_value"].between(0, 1).all()


def test_an_exact_fit_names_nobody(offset):
    target = truth(offset)(TOWER)
    worth = assess(TOWER, target, umeyama(TOWER, target))
    assert not worth.picks["suspected"].any()
    assert worth.picks["p_value"].isna().all()
    assert "fit exactly" in worth.statement


def test_one_wrong_pick_among_exact_ones_is_named(offset):
    target = truth(offset)(TOWER)
    target[APEX] += [0.3, 0, 0]
    worth = assess(TOWER, target, umeyama(TOWER, target), names=list("abcdef"))
    assert worth.picks["p_value"].idxmin() == APEX
    message = {c.code: c.message for c in worth.cautions}["blunder_suspected"]
    assert message.startswith("Pick e ")
