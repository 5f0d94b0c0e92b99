import numpy as np
import pytest
from numpy.testing import assert_allclose

from trigpoint import trial as trial_room
from trigpoint.errors import RefinementError
from trigpoint.refinement import icp
from trigpoint.similarity import Similarity, umeyama
from trigpoint.surface import Surface
from trigpoint.trial import judge

UTM = np.array([741_000.0, 4_279_000.0, 150.0])
STILL = Similarity(1.0, np.eye(3), np.zeros(3))
CORNERS = np.array([[0, 0, 0], [8, 0, 10], [8, 8, 20], [0, 8, 30], [4, 4, 30], [8, 0, 30.0]])
CHECKS = np.array([[0, 8, 5], [8, 8, 12], [0, 0, 22], [8, 8, 30.0]])


def tower(rng, count=6_000, fog=(0, 0, 0, 0, 0), noise=0.02):
    """Walls of 8 x 8 x 30 m and a roof, each pushed outwards by its fog."""
    rng = np.random.default_rng(rng)
    area = np.array([240, 240, 240, 240, 64])
    face = rng.choice(5, count, p=area / area.sum())
    along = rng.uniform(size=(count, 2))
    points = np.zeros((count, 3))
    for number, (axis, value) in enumerate([(1, 0), (1, 8), (0, 0), (0, 8), (2, 30)]):
        others = [other for other in range(3) if other != axis]
        on_face = face == number
        points[np.ix_(on_face, others)] = along[on_face] * np.array([8, 8, 30])[others]
        points[on_face, axis] = value + (fog[number] if value else -fog[number])
    return points + rng.normal(scale=noise, size=points.shape)


def picked(points, seed, sigma):
    return points + np.random.default_rng(seed).normal(scale=sigma, size=points.shape)


def delivered(seed, offset, *, sigma, fog=(0, 0, 0, 0, 0)):
    """A reconstruction in its own frame, and what noisy picks make of it.

    Returns the judge's arguments: the cloud under the fit, the reference, the fit and both sets of
    picks. The picks' noise is in the source only, so the reference is the truth.
    """
    truth = Similarity(3.26, np.eye(3), offset)
    back = truth.inverse()
    local = back(tower(seed, fog=fog, noise=0.04) + offset)
    controls = back(picked(CORNERS, seed, sigma) + offset), CORNERS + offset
    fit = umeyama(*controls)
    checks = back(CHECKS + offset), CHECKS + offset
    return (fit(local), tower(seed + 1) + offset), fit, controls, checks


def test_trap_7_a_better_surface_with_worse_picks_is_reported_and_not_retained(monkeypatch):
    # Fog in front of two facades and on the roof drags the cloud off its true place.
    monkeypatch.setattr(trial_room, "MOST_FOLDS", 3)  # half the time
    rng = np.random.default_rng(2)
    reference = tower(rng, 60_000) + UTM
    cloud = tower(rng, 60_000, fog=(0.3, 0, 0.3, 0, 0.15), noise=0.04) + UTM
    controls = CORNERS + rng.normal(scale=0.08, size=CORNERS.shape) + UTM, CORNERS + UTM
    trial = judge(
        cloud,
        reference,
        similarity=STILL,
        controls=controls,
        method="point",
        max_distance=1.0,
        trim=0,
        iterations=60,
    )
    refinement = trial.refinement
    assert refinement.surface_rmse_before_m == pytest.approx(0.217, abs=0.001)
    assert refinement.surface_rmse_after_m == pytest.approx(0.163, abs=0.001)
    assert_allclose(refinement.translation_m, [0.147, 0.146, -0.138], atol=0.002)
    assert trial.control_rmse_before_m == pytest.approx(0.143, abs=0.001)
    assert trial.control_rmse_after_m == pytest.approx(0.278, abs=0.001)
    assert trial.loocv_rmse_after_m > trial.loocv_rmse_before_m
    assert trial.check_rmse_before_m is None
    assert not trial.retained
    assert "icp_not_retained" in [caution.code for caution in trial.cautions]
    assert "leave-one-out" in trial.rule


def test_trap_7_where_icp_helps_it_is_retained(offset):
    clouds, fit, controls, checks = delivered(5, offset, sigma=0.15)
    by_folds = judge(*clouds, similarity=fit, controls=controls)
    assert by_folds.loocv_rmse_after_m < by_folds.loocv_rmse_before_m
    assert by_folds.retained
    assert not by_folds.cautions
    # The picks that were fitted to get worse all the same: they can say nothing else.
    assert by_folds.control_rmse_after_m > by_folds.control_rmse_before_m
    by_checks = judge(*clouds, similarity=fit, controls=controls, checks=checks)
    assert by_checks.check_rmse_after_m < 0.7 * by_checks.check_rmse_before_m
    assert by_checks.retained


def test_check_picks_decide_over_leave_one_out():
    clouds, fit, controls, checks = delivered(5, UTM, sigma=0.15)
    # Check picks that lie exactly where the fit puts them: nothing can bring them nearer.
    settled = checks[0], fit(checks[0])
    trial = judge(*clouds, similarity=fit, controls=controls, checks=settled)
    assert trial.loocv_rmse_after_m < trial.loocv_rmse_before_m
    assert trial.check_rmse_before_m < 1e-8 < trial.check_rmse_after_m
    assert not trial.retained
    assert "check picks" in trial.rule
    assert "held-out error from 0.000 m" in trial.cautions[-1].message


def test_check_picks_enter_nothing_else():
    clouds, fit, controls, checks = delivered(6, UTM, sigma=0.1)
    without = judge(*clouds, similarity=fit, controls=controls)
    with_them = judge(*clouds, similarity=fit, controls=controls, checks=checks)
    assert with_them.loocv_rmse_after_m == without.loocv_rmse_after_m
    one, other = (trial.refinement.similarity.matrix.tobytes() for trial in (without, with_them))
    assert one == other


def test_the_folds_are_fit_move_refine_predict(offset):
    clouds, fit, controls, _ = delivered(7, offset, sigma=0.1)
    trial = judge(*clouds, similarity=fit, controls=controls)
    source, target = controls
    local = fit.inverse()(clouds[0])
    errors = {"before": [], "after": []}
    for fold in range(6):
        others = np.arange(6) != fold
        refit = umeyama(source[others], target[others])
        refined = icp(refit(local), clouds[1]).similarity @ refit
        errors["before"].append(target[fold] - refit(source[[fold]])[0])
        errors["after"].append(target[fold] - refined(source[[fold]])[0])
    before, after = (np.sqrt((np.array(e) ** 2).sum(axis=1).mean()) for e in errors.values())
    assert trial.loocv_rmse_before_m == pytest.approx(before, abs=1e-7)
    # Rounding may hand a pair or two to another partner.
    assert trial.loocv_rmse_after_m == pytest.approx(after, abs=1e-4)


def test_order_of_picks_changes_nothing_to_the_last_bit():
    clouds, fit, controls, checks = delivered(8, UTM, sigma=0.1)
    turned = [tuple(points[::-1] for points in pairs) for pairs in (controls, checks)]
    surface = Surface(clouds[1])
    one = judge(clouds[0], surface, similarity=fit, controls=controls, checks=checks)
    other = judge(clouds[0], surface, similarity=fit, controls=turned[0], checks=turned[1])
    for name in ("control", "loocv", "check"):
        for when in ("before", "after"):
            field = f"{name}_rmse_{when}_m"
            assert getattr(one, field) == getattr(other, field), field


def test_weights_enter_the_folds():
    clouds, _, controls, _ = delivered(9, UTM, sigma=0.1)
    weights = np.array([1.0, 4, 1, 4, 9, 1])
    fit = umeyama(*controls, weights=weights)
    surface = Surface(clouds[1])
    plain, weighted = (
        judge(clouds[0], surface, similarity=fit, controls=controls, weights=given)
        for given in (None, weights)
    )
    assert plain.loocv_rmse_before_m != weighted.loocv_rmse_before_m


def test_without_picks_only_the_shift_is_told(offset):
    trial = judge(tower(10) + np.array([0.1, 0, 0]) + offset, tower(11) + offset)
    assert trial.refinement.shift_m == pytest.approx(0.1, abs=0.01)
    errors = [getattr(trial, name) for name in trial.__slots__ if "rmse" in name]
    assert errors == [None] * 6
    assert not trial.retained
    assert not trial.cautions
    assert "not judged" in trial.rule


def test_three_picks_leave_nothing_to_hold_out():
    clouds, fit, controls, _ = delivered(12, UTM, sigma=0.1)
    three = tuple(points[:3] for points in controls)
    trial = judge(*clouds, similarity=fit, controls=three)
    assert trial.loocv_rmse_before_m is None
    assert trial.loocv_rmse_after_m is None
    assert not trial.retained
    assert "too few control picks" in trial.cautions[-1].message


def test_a_fold_whose_clouds_part_does_not_retain(monkeypatch):
    clouds, fit, controls, _ = delivered(5, UTM, sigma=0.15)
    assert judge(*clouds, similarity=fit, controls=controls).retained
    calls = []

    def parts_in_the_third_fold(*arguments, **settings):
        calls.append(1)
        if len(calls) == 4:
            message = "the clouds do not overlap"
            raise RefinementError(message)
        return icp(*arguments, **settings)

    monkeypatch.setattr(trial_room, "icp", parts_in_the_third_fold)
    trial = judge(*clouds, similarity=fit, controls=controls)
    assert trial.loocv_rmse_before_m > 0
    assert trial.loocv_rmse_after_m is None
    assert not trial.retained
    assert "no longer overlap" in trial.cautions[-1].message


def test_of_many_picks_only_some_are_withheld(monkeypatch):
    monkeypatch.setattr(trial_room, "MOST_FOLDS", 4)
    clouds, fit, controls, _ = delivered(14, UTM, sigma=0.1)
    calls = []

    def counted(*arguments, **settings):
        calls.append(1)
        return icp(*arguments, **settings)

    monkeypatch.setattr(trial_room, "icp", counted)
    trial = judge(*clouds, similarity=fit, controls=controls)
    assert len(calls) == 1 + 4
    assert trial.loocv_rmse_after_m > 0


def test_picks_without_their_similarity_are_refused():
    with pytest.raises(ValueError, match="without the similarity"):
        judge(tower(1), tower(2), controls=(CORNERS, CORNERS))


def test_a_cloud_that_is_nowhere_near_is_an_error():
    with pytest.raises(RefinementError, match="do not overlap"):
        judge(tower(1) + np.array([500, 0, 0]), tower(2))
