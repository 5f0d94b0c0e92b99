import json
import re
from dataclasses import replace

import numpy as np
import pytest
from typer.testing import CliRunner

from trigpoint.picks import write_picks
from trigpoint.project import AlignmentSettings
from trigpoint.similarity import Similarity
from trigpoint.synthetic import clock_tower
from trigpoint_panel.pairs import Pair, from_picks, to_picks
from trigpoint_panel.state import adopted_of
from trigpoint_panel.statistics import COLUMNS, Survey, first_sentence, fit_pairs
from trigpoint_reporting.cli import app

CORNERS = np.array([[x, y, z] for z in (0, 6, 12) for y in (0, 6) for x in (0, 8)], float)


@pytest.fixture
def picked(similarity_from, offset):
    """Make pairs of a building's corners, with noise, and the truth."""

    def make(count=8, *, seed=1, noise=0.03, corners=CORNERS):
        truth = similarity_from(seed, offset)
        target = truth(corners) + np.random.default_rng(seed).normal(
            scale=noise, size=corners.shape
        )
        pairs = tuple(
            Pair(f"P{i + 1}", source=tuple(a), target=tuple(b))
            for i, (a, b) in enumerate(zip(corners.tolist(), target.tolist(), strict=True))
        )
        return pairs[:count], truth

    return make


def moved(pairs, name, by):
    return tuple(
        replace(pair, target=tuple((np.array(pair.target) + by).tolist()))
        if pair.id == name
        else pair
        for pair in pairs
    )


def test_the_numbers_are_those_of_the_command_line(picked, tmp_path):
    pairs, _ = picked(10)
    pairs = tuple(
        replace(pair, role="check") if pair.id in ("P2", "P9") else pair for pair in pairs
    )
    pairs = moved(pairs, "P5", [0, 0, 1.0])
    write_picks(tmp_path / "picks.csv", to_picks(pairs))
    said = CliRunner().invoke(app, ["align", str(tmp_path / "picks.csv"), "--json"])
    found = json.loads(said.stdout)
    fit = fit_pairs((*pairs, Pair("P11", source=(1.0, 2.0, 3.0))))
    table = fit.table.set_index("id")

    close = {"rel": 0, "abs": 1e-9}
    assert fit.similarity.scale == pytest.approx(found["alignment"]["scale"], rel=1e-12)
    assert fit.rmse_m == pytest.approx(found["alignment"]["rmse_m"], **close)
    assert fit.check_rmse_m == pytest.approx(found["checks"]["rmse_m"], **close)
    assert fit.loocv_rmse_m == pytest.approx(found["loocv"]["rmse_m"], **close)
    assert fit.statement == found["reliability"]["statement"]
    for row in (*found["alignment"]["residuals"], *found["checks"]["residuals"]):
        for name in ("dx_m", "dy_m", "dz_m", "d_m"):
            assert table.loc[row["id"], name] == pytest.approx(row[name], **close)
    for fold in found["loocv"]["folds"]:
        assert table.loc[fold["id"], "loo_m"] == pytest.approx(fold["d_m"], **close)
    for row in found["reliability"]["picks"]:
        for name in ("redundancy", "standardised", "p_value", "detectable_blunder_m"):
            assert table.loc[row["id"], name] == pytest.approx(row[name], rel=1e-6, abs=1e-9)
        assert table.loc[row["id"], "suspected"] == row["suspected"]
    assert table.index[table["used"]].tolist() == found["alignment"]["inliers"]
    assert found["alignment"]["outliers"] == ["P5"]
    assert table.loc["P5", "flag"] == "rejected"
    assert np.isnan(table.loc["P11", "d_m"])


def test_a_note_is_written_without_asking_the_engine_again(picked):
    pairs, _ = picked()
    noted = (replace(pairs[0], note="wet plaster"), *pairs[1:])
    assert fit_pairs(noted).alignment is fit_pairs(pairs).alignment is not None


def test_residuals_are_target_minus_transformed_source(picked):
    pairs, _ = picked()
    fit = fit_pairs(pairs)
    errors = np.array([pair.target for pair in pairs]) - fit.similarity(
        np.array([pair.source for pair in pairs])
    )
    assert np.array_equal(fit.table[["dx_m", "dy_m", "dz_m"]].to_numpy(), errors)


def test_a_pair_spoiled_by_70_cm_is_named(picked):
    for seed in range(5):
        pairs, _ = picked(10, seed=seed)
        for name in ("P2", "P7"):
            fit = fit_pairs(moved(pairs, name, np.array([0.4, 0.4, 0.4])))
            assert fit.suspects[:1] == (name,), (seed, name)
            row = fit.table.set_index("id").loc[name]
            assert row["level"] == "red"
            assert row["flag"] in ("rejected", "suspect")
            assert row["why"]


def test_a_suspect_below_the_threshold_is_named_by_the_outlier_test(picked):
    pairs, _ = picked(12)
    fit = fit_pairs(moved(pairs, "P7", [0.3, 0, 0.3]))
    assert fit.table.set_index("id").loc["P7", "flag"] == "suspect"
    assert fit.suspects == ("P7",)


def test_one_spoiled_pick_makes_one_suspect_and_the_others_only_deserve_a_look():
    scene = clock_tower(density=0.01)
    pairs = from_picks(scene.picks)
    named = spoiled_is_worst = 0
    for name in [pair.id for pair in pairs if pair.role == "control"]:
        for by in 0.7 * np.eye(3):
            fit = fit_pairs(moved(pairs, name, by))
            tested, table = fit.reliability.picks, fit.table.set_index("id")
            flags = table["flag"]
            accused = fit.flagged("suspect") or fit.flagged("rejected")
            worst = fit.alignment.inliers.ids[int(tested["p_value"].argmin())]
            if tested["suspected"].any():
                assert fit.flagged("suspect") == (worst,)
            others = flags[(flags != "") & (flags.index != accused[0])].index
            assert (table.loc[others, "level"] == "amber").all()
            assert all(f"because of {accused[0]}" in why for why in table.loc[others, "why"])
            assert table.loc[accused[0], "role"] == "control"
            assert fit.suspects == accused
            assert fit.doubt
            spoiled_is_worst += name in (worst if tested["suspected"].any() else accused)
            named += accused == (name,)
    assert named == spoiled_is_worst == 18


def test_check_pairs_are_named_after_control_pairs(picked):
    pairs, _ = picked(10)
    pairs = moved(moved(pairs, "P3", [0, 0, 2.0]), "P8", [0, 0, 4.0])
    fit = fit_pairs((*pairs[:7], replace(pairs[7], role="check"), *pairs[8:]))
    assert fit.suspects == ("P3", "P8")


def test_after_icp_the_numbers_are_those_of_what_is_shown_and_saved(picked):
    pairs, _ = picked(8)
    pairs = (*pairs[:6], replace(pairs[6], role="check"), pairs[7], Pair("P9", source=(1.0,) * 3))
    fit = fit_pairs(pairs)
    shifted = Similarity(
        fit.similarity.scale, fit.similarity.rotation, fit.similarity.translation + 0.6
    )
    after = fit_pairs(pairs, adopted=adopted_of(shifted))
    whole = [pair for pair in pairs if pair.is_complete]
    errors = np.array([pair.target for pair in whole]) - shifted(
        np.array([pair.source for pair in whole])
    )
    lengths = np.linalg.norm(errors, axis=1)
    control = np.arange(len(whole)) != 6
    assert np.array_equal(after.table[["dx_m", "dy_m", "dz_m"]].to_numpy()[:-1], errors)
    assert np.isnan(after.table["d_m"].iloc[-1])
    assert after.rmse_m == pytest.approx(np.sqrt((lengths[control] ** 2).mean()), rel=1e-12)
    assert after.check_rmse_m == pytest.approx(lengths[6], rel=1e-12)
    assert after.table["flag"].iloc[6] == "far"
    assert np.array_equal(after.similarity.matrix, shifted.matrix)
    # What is known of the fit alone is not shown beside them; the summary says which it is of.
    assert after.alignment is fit.alignment
    assert after.loocv_rmse_m == fit.loocv_rmse_m
    assert (
        after.table[["loo_m", "p_value", "redundancy", "detectable_blunder_m"]]
        .isna()
        .to_numpy()
        .all()
    )


def test_what_was_doubted_before_icp_is_doubted_after_it(picked):
    pairs, _ = picked(12)
    pairs = moved(pairs, "P7", [0.3, 0, 0.3])
    fit = fit_pairs(pairs)
    after = fit_pairs(pairs, adopted=adopted_of(fit.similarity))
    assert after.suspects == fit.suspects == ("P7",)
    assert re.search(r"\(p [\de.-]+, before ICP\)", after.table["why"][6])


def test_a_name_from_right_to_left_is_set_apart_in_what_is_said(picked):
    pairs, _ = picked(3)
    pairs = (replace(pairs[0], id="דגל"), pairs[1], pairs[2].placed("source", pairs[0].source))
    assert fit_pairs(pairs).refusal.startswith("\u200e\u2068דגל\u2069 and P3 are the same")


def test_sound_pairs_have_no_flag_most_of_the_time(picked):
    red = [fit_pairs(picked(10, seed=seed)[0]).suspects for seed in range(20)]
    assert sum(bool(names) for names in red) <= 3  # each at 5 %


def test_check_pairs_enter_nothing_and_have_their_own_rmse(picked):
    pairs, _ = picked(8)
    without = fit_pairs(pairs[:7])
    checked = (*pairs[:7], replace(moved(pairs, "P8", [0, 0, 3.0])[7], role="check"))
    fit = fit_pairs(checked)
    assert fit.rmse_m == without.rmse_m
    assert (fit.controls, fit.checks) == (7, 1)
    assert fit.check_rmse_m == pytest.approx(3.0, abs=0.3)
    assert np.isnan(without.check_rmse_m)
    row = fit.table.iloc[7]
    assert (row["flag"], row["level"], bool(row["used"])) == ("far", "red", False)


def test_pairs_that_are_off_show_their_residual_and_no_flag(picked):
    pairs, _ = picked(8)
    off = (*pairs[:7], replace(moved(pairs, "P8", [0, 0, 3.0])[7], role="off"))
    row = fit_pairs(off).table.iloc[7]
    assert row["d_m"] == pytest.approx(3.0, abs=0.3)
    assert (row["flag"], row["level"]) == ("", "")


@pytest.mark.parametrize("count", [0, 1, 2])
def test_fewer_than_three_control_pairs_are_counted(picked, count):
    pairs, _ = picked(8)
    pairs = (*pairs[:count], replace(pairs[7], role="check"), Pair("P9", source=(1.0, 1.0, 1.0)))
    fit = fit_pairs(pairs)
    assert fit.refusal == f"{count} of 3 control pairs."
    assert fit.alignment is fit.similarity is None
    assert (fit.geometry, fit.cautions, fit.suspects) == ("", (), ())
    assert list(fit.table.columns) == list(COLUMNS)
    assert len(fit.table) == count + 2
    assert np.isnan([fit.rmse_m, fit.check_rmse_m, fit.loocv_rmse_m]).all()


def test_no_pairs_at_all_are_no_error():
    fit = fit_pairs(())
    assert list(fit.table.columns) == list(COLUMNS)
    assert len(fit.next_picks) == 0


def test_pairs_on_a_line_are_refused_in_one_sentence(picked):
    line = np.column_stack([np.arange(5.0), 2 * np.arange(5.0), np.zeros(5)])
    fit = fit_pairs(picked(5, corners=line, noise=0)[0])
    assert fit.refusal == "The control points lie on one line: add one off the line."
    assert fit.geometry == "refused"


def test_pairs_within_their_noise_of_a_line_are_refused_in_one_sentence(picked):
    line = np.column_stack([np.zeros(6), np.zeros(6), 5 * np.arange(6.0)])
    line[:, 0] = 0.02 * (-1.0) ** np.arange(6)
    fit = fit_pairs(picked(6, corners=line, noise=0.05)[0])
    known = r"known to .* \(one sigma\)|not known at all"
    said = rf"The rotation about .* is ({known}): add a pick well off that axis\."
    assert re.fullmatch(said, fit.refusal)


@pytest.mark.parametrize("side", ["source", "target"])
def test_two_pairs_that_are_the_same_point_are_refused_by_name(picked, side):
    pairs, _ = picked(3)
    pairs = (pairs[0], pairs[1], pairs[2].placed(side, pairs[0].at(side)))
    assert (
        fit_pairs(pairs).refusal == f"P1 and P3 are the same point in the {side}: pick one again."
    )


def test_pairs_that_do_not_agree_are_refused_in_one_sentence():
    rng = np.random.default_rng(0)
    pairs = tuple(
        Pair(f"P{i}", source=tuple(rng.uniform(0, 10, 3)), target=tuple(rng.uniform(0, 50, 3)))
        for i in range(5)
    )
    fit = fit_pairs(pairs)
    assert fit.refusal.endswith(".")
    assert first_sentence(fit.refusal) == fit.refusal
    assert (fit.table["flag"] == "").all()


def test_a_mirrored_frame_is_refused_in_one_sentence(picked):
    pairs, _ = picked(8)
    mirrored = tuple(replace(pair, source=(-pair.source[0], *pair.source[1:])) for pair in pairs)
    assert "mirror" in fit_pairs(mirrored).refusal


def test_weighted_without_sigmas_is_refused_in_one_sentence(picked):
    fit = fit_pairs(picked(6)[0], AlignmentSettings(weighted=True))
    assert "needs a sigma" in fit.refusal


def test_the_same_pairs_are_worked_out_once(picked):
    pairs, _ = picked(8)
    fit = fit_pairs(pairs)
    assert fit_pairs(tuple(replace(pair) for pair in pairs)) is fit
    opened = fit_pairs((*pairs, Pair("P9", source=(1.0, 1.0, 1.0))))
    assert opened.alignment is fit.alignment
    assert len(opened.table) == 9


def test_next_picks_need_the_reference_and_lie_on_it(picked):
    pairs, truth = picked(4)
    ends = truth(CORNERS)
    extent = np.array([ends.min(axis=0), ends.max(axis=0)])
    assert len(fit_pairs(pairs).next_picks) == 0
    survey = Survey(extent, np.repeat(ends, 200, axis=0))
    found = fit_pairs(pairs, None, survey).next_picks
    assert 1 <= len(found) <= 3
    assert (found["gain_m"] > 0).all()
    nearest = np.linalg.norm(ends[None] - found[["x", "y", "z"]].to_numpy()[:, None], axis=2)
    assert nearest.min(axis=1).max() == 0


def test_pairs_in_the_lower_third_are_weak_in_words(offset):
    source = CORNERS.copy()
    pairs = tuple(
        Pair(f"P{i}", source=tuple(a), target=tuple(b))
        for i, (a, b) in enumerate(zip(source.tolist(), (source + offset).tolist(), strict=True))
    )
    survey = Survey(np.array([[-1, -1, 0], [9, 7, 60.0]]) + offset, np.zeros((0, 3)))
    fit = fit_pairs(pairs, None, survey)
    assert fit.weakness == "all pairs in the lower third: heights above are extrapolated"
    assert fit.geometry == "weak"
    top = Survey(np.array([[-1, -1, -60], [9, 7, 12.0]]) + offset, np.zeros((0, 3)))
    assert fit_pairs(pairs, None, top).weakness.startswith("all pairs in the upper third")


def test_a_weak_layout_is_said_in_one_clause(picked):
    pole = CORNERS[:8] * [0.06, 0.06, 8]
    fit = fit_pairs(picked(8, corners=pole, noise=0.003)[0])
    assert fit.reliability.geometry == fit.geometry == "weak"
    assert fit.weakness in fit.statement
    assert fit.weakness.startswith("the ")
    assert not fit.weakness.endswith((".", ")"))


def test_pairs_of_the_engine_fit_alike(picked):
    pairs, _ = picked(7)
    assert fit_pairs(from_picks(to_picks(pairs))).rmse_m == fit_pairs(pairs).rmse_m
