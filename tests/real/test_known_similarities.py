"""Picks whose similarity others have published, or that were made with a known one."""

import json

import numpy as np
import pandas as pd
import pytest
from numpy.testing import assert_allclose

from trigpoint.alignment import align
from trigpoint.consensus import exhaustive, no_consensus, ransac
from trigpoint.crossvalidation import leave_one_out
from trigpoint.picks import read_picks
from trigpoint.similarity import are_coplanar, umeyama


@pytest.fixture
def picks(real_data):
    """Read ids, source and target of a pick file."""

    def read(name):
        table = pd.read_csv(real_data(name), dtype={"id": str})
        return (
            table["id"].tolist(),
            table.filter(like="source_").to_numpy(np.float64),
            table.filter(like="target_").to_numpy(np.float64),
        )

    return read


@pytest.fixture
def expected(real_data):
    """Read the answers that come with a folder."""

    def read(folder):
        return json.loads(real_data(f"{folder}/expected.json").read_text())

    return read


def distances(found, source, target):
    return np.linalg.norm(found.residuals(source, target), axis=1)


def rmse(found, source, target):
    return np.sqrt((distances(found, source, target)[found.inliers] ** 2).mean())


def assert_same_map(similarity, answer, source):
    """Compare scale and rotation, then where the source goes: a translation alone says little."""
    carried = answer["scale"] * source @ np.array(answer["R"]).T + np.array(answer["t"])
    assert similarity.scale == pytest.approx(answer["scale"], rel=1e-9)
    assert_allclose(similarity.rotation, answer["R"], atol=1e-8)
    assert_allclose(similarity(source), carried, atol=2e-8)


@pytest.mark.parametrize("name", ["ghilani_4pt", "dewitt_6pt", "grafarend_awange_7pt"])
def test_textbook_sets(name, picks, expected):
    _, source, target = picks(f"textbook_helmert/{name}.csv")
    answer = expected("textbook_helmert")[name]
    found = no_consensus(source, target)
    assert_same_map(found.similarity, answer, source)
    assert_allclose(found.similarity.translation, answer["t"], atol=1e-6)
    assert rmse(found, source, target) == pytest.approx(answer["rmse_3d"], rel=1e-7)
    assert distances(found, source, target).max() == pytest.approx(answer["max"], rel=1e-7)
    withheld = leave_one_out(source, target)
    assert withheld.rmse_m == pytest.approx(answer["loocv_rmse"], rel=1e-7)
    change = answer["loo_max_abs_scale_change_pct"]
    assert withheld.max_scale_change_pct == pytest.approx(change, rel=1e-6)


def test_grafarend_and_awange_as_printed(picks, expected):
    _, source, target = picks("textbook_helmert/grafarend_awange_7pt.csv")
    printed = expected("textbook_helmert")["grafarend_awange_7pt"]["published"]
    found = no_consensus(source, target)
    assert f"{found.similarity.scale:.14f}" == f"{printed['scale']:.14f}"
    assert found.similarity.translation.round(4).tolist() == printed["t"]
    left = found.residuals(source, target)
    assert left.round(4).tolist() == printed["residuals_dst_minus_T(src)"]
    assert round(float(np.linalg.norm(left)), 3) == printed["frobenius_error_norm"]


def test_ghilani_and_wolf_as_printed(picks, expected):
    _, source, target = picks("textbook_helmert/ghilani_4pt.csv")
    printed = expected("textbook_helmert")["ghilani_4pt"]["published"]
    fit = umeyama(source, target)
    assert round(fit.scale, 5) == printed["scale_unweighted_5digits"]
    m = fit.rotation.T  # photogrammetry's omega, phi, kappa turn the other way
    angles = (
        np.arctan2(-m[2, 1], m[2, 2]),
        np.arcsin(m[2, 0]),
        np.arctan2(-m[1, 0], m[0, 0]) % (2 * np.pi),
    )
    for angle, text in zip(angles, printed["opk_unweighted_dms"], strict=True):
        degrees, minutes, seconds = text.lstrip("-").split("-")
        size = int(degrees) * 3600 + int(minutes) * 60 + float(seconds)
        sign = -1 if text.startswith("-") else 1
        assert np.degrees(angle) * 3600 == pytest.approx(sign * size, abs=0.0051)


def test_umeyamas_own_example_is_flat_and_turns_over_in_space(picks, expected):
    # Two-dimensional, it needs a mirror and leaves 0.5333; in space half a turn leaves nothing.
    _, source, target = picks("textbook_helmert/umeyama1991_2d.csv")
    answer = expected("textbook_helmert")["umeyama1991_2d"]
    found = no_consensus(source, target)
    assert found.similarity.scale == pytest.approx(answer["scale"], abs=1e-12)
    assert_allclose(found.similarity.rotation, answer["R"], atol=1e-12)
    assert rmse(found, source, target) < 1e-12
    assert are_coplanar(source)
    withheld = leave_one_out(source, target)
    assert withheld.rmse_m is None
    assert [caution.code for caution in withheld.cautions] == ["picks_few"]


def ply(path):
    rows = path.read_text().partition("end_header\n")[2].split()
    return np.array(rows, np.float64).reshape(-1, 3)


@pytest.mark.parametrize(("number", "sound"), [(1, 10), (3, 7), (5, 10)])
@pytest.mark.parametrize("seed", [42, 0, 1])
def test_teaser_sets_keep_exactly_the_true_inliers(number, sound, seed, real_data):
    # Set 5 has 10 sound picks in 100: 120 of 161,700 sets of three, seven of which are to be
    # expected in 10,000 draws.
    folder = real_data(f"teaser_outliers/benchmark_{number}")
    source, target = ply(folder / "src.ply"), ply(folder / "dst.ply")
    found = ransac(source, target, threshold=0.01, seed=seed)
    assert np.flatnonzero(found.inliers).tolist() == list(range(sound))
    truth = {
        name: np.loadtxt(folder / f"{name}_ref.csv", delimiter=",") for name in ("s", "R", "t")
    }
    assert found.similarity.scale == pytest.approx(float(truth["s"]), rel=1e-9)
    assert_allclose(found.similarity.rotation, truth["R"], atol=1e-9)
    assert_allclose(found.similarity.translation, truth["t"], atol=1e-9)
    assert found.rivals == 0
    if len(source) <= 40:
        assert exhaustive(source, target, threshold=0.01).inliers.tolist() == found.inliers.tolist()


def test_a_monocular_trajectory(picks, expected):
    _, source, target = picks("monocular_trajectories/tum_fr1_xyz_orb_mono.csv")
    answer = expected("monocular_trajectories")["tum_fr1_xyz_orb_mono"]
    for found in (ransac(source, target), exhaustive(source, target)):
        assert found.inliers.all()
        assert_same_map(found.similarity, answer, source)
        left = distances(found, source, target)
        assert rmse(found, source, target) == pytest.approx(answer["rmse"], rel=1e-7)
        assert left.mean() == pytest.approx(answer["mean"], rel=1e-7)
        assert np.median(left) == pytest.approx(answer["median"], rel=1e-7)
        assert left.max() == pytest.approx(answer["max"], rel=1e-7)


def test_a_scan_and_its_copy_scaled_by_1_04(real_data):
    folder = real_data("libpointmatcher_car_scale")
    source, target = (
        pd.read_csv(folder / name, skipinitialspace=True)[["x", "y", "z"]].to_numpy(np.float64)
        for name in ("car_cloud400.csv", "car_cloud400_scaled.csv")
    )
    for found in (no_consensus(source, target), ransac(source, target, trials=200)):
        assert found.inliers.all()
        assert found.similarity.scale == pytest.approx(1.04, rel=1e-9)
        turn = np.arccos((np.trace(found.similarity.rotation) - 1) / 2)
        assert turn == pytest.approx(0.2, abs=1e-7)
        assert_allclose(found.similarity.translation, [2, 2, 2], atol=1e-7)


def test_herz_jesu_six_picks(picks, expected):
    _, source, target = picks("herzjesu_even_vs_odd/picks6.csv")
    answer = expected("herzjesu_even_vs_odd")["picks6"]
    found = ransac(source, target)
    assert found.inliers.all()
    assert_same_map(found.similarity, answer, source)
    left = distances(found, source, target)
    assert left.round(5).tolist() == answer["residuals"]
    assert rmse(found, source, target) == pytest.approx(answer["rmse"], rel=1e-6)
    withheld = leave_one_out(source, target, found.inliers, procedure=ransac)
    assert withheld.folds["d_m"].round(5).tolist() == answer["loo_errors"]
    assert withheld.folds["scale_change_pct"].round(5).tolist() == answer["loo_scale_change_pct"]
    assert withheld.rmse_m == pytest.approx(answer["loocv_rmse"], rel=1e-7)
    assert withheld.rmse_procedure_m == withheld.rmse_m


@pytest.mark.parametrize("method", [ransac, exhaustive])
def test_herz_jesu_nine_picks_lose_their_three_outliers(method, picks, expected):
    ids, source, target = picks("herzjesu_even_vs_odd/picks9_three_outliers.csv")
    answers = expected("herzjesu_even_vs_odd")
    found = method(source, target)
    rejected = [name for name, kept in zip(ids, found.inliers, strict=True) if not kept]
    assert rejected == answers["picks9_three_outliers"]["expected_outliers"]
    assert_same_map(found.similarity, answers["picks6"], source)
    withheld = leave_one_out(source, target, found.inliers, procedure=method)
    assert withheld.rmse_m == pytest.approx(answers["picks6"]["loocv_rmse"], rel=1e-7)
    assert not withheld.folds["inliers_changed"].any()


@pytest.mark.parametrize("seed", [42, 1])
def test_herz_jesu_all_pairs(seed, picks, expected):
    _, source, target = picks("herzjesu_even_vs_odd/structural_all_with_outliers.csv")
    answer = expected("herzjesu_even_vs_odd")["structural_refined"]
    found = ransac(source, target, threshold=answer["threshold_m"], seed=seed)
    assert (len(source), found.inliers.sum()) == (answer["n_total"], answer["inliers"])
    assert_same_map(found.similarity, answer, source)
    assert rmse(found, source, target) == pytest.approx(answer["rmse"], rel=1e-6)
    left = distances(found, source, target)
    assert left[found.inliers].max() == pytest.approx(answer["max"], rel=1e-6)
    withheld = leave_one_out(source, target, found.inliers)
    assert withheld.closed_form
    assert 1 < withheld.rmse_m / rmse(found, source, target) < 1.001


def test_herz_jesu_camera_centres(picks, expected):
    _, source, target = picks("herzjesu_even_vs_odd/camera_centres.csv")
    answer = expected("herzjesu_even_vs_odd")["camera_centres_umeyama"]
    found = ransac(source, target)
    assert found.inliers.all()
    assert_same_map(found.similarity, answer, source)
    assert rmse(found, source, target) == pytest.approx(answer["rmse"], rel=1e-6)
    withheld = leave_one_out(source, target)
    assert withheld.rmse_m == pytest.approx(answer["loocv_rmse"], rel=1e-6)
    change = answer["loo_max_abs_scale_change_pct"]
    assert withheld.max_scale_change_pct == pytest.approx(change, rel=1e-6)


@pytest.mark.parametrize("method", [ransac, exhaustive])
def test_two_flight_lines_keep_nine_of_eleven_corners(method, picks, expected):
    ids, source, target = picks("lidar_ign_two_flightlines/correspondences.csv")
    answers = expected("lidar_ign_two_flightlines")
    answer = answers["umeyama_max_consensus_0p5"]
    found = method(source, target)
    rejected = [name for name, kept in zip(ids, found.inliers, strict=True) if not kept]
    assert rejected == answers["max_consensus_outliers"]
    assert_same_map(found.similarity, answer, source)
    left = dict(zip(ids, distances(found, source, target).round(4).tolist(), strict=True))
    assert left == answer["residuals"]
    assert rmse(found, source, target) == pytest.approx(answer["rmse"], rel=1e-7)
    withheld = leave_one_out(source, target, found.inliers, procedure=method)
    assert withheld.rmse_m == pytest.approx(answer["loocv_rmse"], rel=1e-7)
    change = answer["max_abs_scale_change_pct"]
    assert withheld.max_scale_change_pct == pytest.approx(change, rel=1e-6)
    # One corner had a say in its own company: without it, others are kept.
    assert withheld.rmse_procedure_m > withheld.rmse_m
    assert withheld.folds["inliers_changed"].sum() == 1


def test_two_flight_lines_with_all_corners(picks, expected):
    _, source, target = picks("lidar_ign_two_flightlines/correspondences.csv")
    answer = expected("lidar_ign_two_flightlines")["umeyama_all"]
    found = no_consensus(source, target)
    assert_same_map(found.similarity, answer, source)
    assert leave_one_out(source, target).rmse_m == pytest.approx(answer["loocv_rmse"], rel=1e-7)


def test_herz_jesu_nine_picks_without_a_consensus_come_out_wrong_and_say_so(real_data, expected):
    answers = expected("herzjesu_even_vs_odd")["picks9_three_outliers"]
    picks = read_picks(real_data("herzjesu_even_vs_odd/picks9_three_outliers.csv"))
    found = align(picks, method="all")
    assert found.similarity.scale == pytest.approx(answers["naive_scale_WRONG"], rel=1e-9)
    assert found.residuals(picks.control)["d_m"].pow(2).mean() ** 0.5 == pytest.approx(
        answers["naive_rmse_WRONG"], rel=1e-9
    )
    assert found.reliability.geometry == "weak"
    assert "3 of 9 disagree with the others by more than 0.5 m: x1, x2, x3." in (
        found.reliability.statement
    )
