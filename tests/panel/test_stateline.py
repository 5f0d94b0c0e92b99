from dataclasses import replace

import numpy as np
import pytest

from trigpoint.similarity import Similarity
from trigpoint_panel.model import Model
from trigpoint_panel.operators import begin_second_operator
from trigpoint_panel.stateline import Running, state_line

CORNERS = np.array([[x, y, z] for z in (0, 12) for y in (0, 6) for x in (0, 8)], float)


def picked(model, count, noise=0.02):
    rng = np.random.default_rng(4)
    for corner in CORNERS[len(model.pairs) : count]:
        model.place("source", corner)
        model.place("target", 3 * corner + rng.normal(scale=noise, size=3))


@pytest.fixture
def model(tmp_path):
    model = Model()
    model.open_cloud("source", tmp_path / "nerf.ply")
    model.open_cloud("target", tmp_path / "lidar.laz")
    return model


def test_an_empty_panel_asks_for_clouds_one_after_the_other(tmp_path):
    model = Model()
    line = state_line(model)
    assert line.text == "Open a source cloud and a reference cloud."
    assert line.enabled == {"open"}
    model.open_cloud("source", tmp_path / "nerf.ply")
    assert state_line(model).text == "Now open the reference (LiDAR)."
    other = Model()
    other.open_cloud("target", tmp_path / "lidar.laz")
    assert state_line(other).text == "Now open the source (the reconstruction)."


def test_two_clouds_ask_for_picks(model):
    line = state_line(model)
    assert line.text == "Press P, then click the same corner in both views."
    assert line.enabled == {"open", "pick"}


@pytest.mark.parametrize(("side", "other"), [("source", "reference"), ("target", "source")])
def test_an_open_half_asks_for_the_other(model, side, other):
    picked(model, 3)
    model.place(side, [1, 1, 1])
    line = state_line(model)
    assert line.text == f"P4: now click the same corner in the {other} view. (Esc drops it)"
    assert {"drop", "pick", "align"} <= line.enabled


def test_one_and_two_pairs_are_counted(model):
    for count in (1, 2):
        picked(model, count)
        line = state_line(model)
        assert line.text == (f"{count} of 3 pairs. Spread them over height and around the object.")
        assert "align" not in line.enabled


def test_what_has_no_fit_says_why(model):
    for i in range(4):
        model.place("source", [i, 0, 0])
        model.place("target", [0, i, 0])
    line = state_line(model)
    assert line.text == "The control points lie on one line: add one off the line."
    assert (line.level, line.word) == ("red", "No fit")
    assert line.enabled == {"open", "pick"}


def test_a_fit_is_summed_up(model):
    picked(model, 8)
    model.set_role({"P8"}, "check")
    fit, line = model.fit, state_line(model)
    assert line.text == (f"scale {fit.similarity.scale:.3f} · 7 control, 1 check")
    assert (line.level, line.word) == ("good", "Fitted")
    assert {"align", "errors", "report", "link", "overlay", "export"} <= line.enabled


def test_three_pairs_fit_and_test_nothing(model):
    picked(model, 3)
    line = state_line(model)
    assert line.word == "Untested"
    assert line.text.endswith("· no pick can be tested yet: add a fourth")
    assert line.level == "amber"


def test_a_suspect_is_named(model):
    picked(model, 8)
    model.move("P3", "target", np.add(model.pairs[2].target, 0.4))
    line = state_line(model)
    assert line.text.startswith("P3 does not fit the others · scale ")
    assert (line.level, line.word) == ("red", "Suspect")


def test_what_was_left_out_is_counted_and_named(model):
    picked(model, 8)
    model.move("P3", "target", np.add(model.pairs[2].target, 4))
    line = state_line(model)
    assert line.text.startswith("P3 left out, the others agree · scale ")
    assert line.text.endswith("· 7 of 8 control, 0 check")
    assert (line.level, line.word) == ("red", "Rejected")


def test_a_check_pair_that_lies_far_off_is_named(model):
    picked(model, 8)
    model.set_role({"P8"}, "check")
    model.move("P8", "target", np.add(model.pairs[7].target, 4))
    line = state_line(model)
    assert line.text.startswith("P8, a check pair, lies beyond 0.5 m · scale ")
    assert (line.level, line.word) == ("red", "Far")


def test_pairs_that_are_no_control_pairs_are_told_from_those_that_are_missing(model):
    picked(model, 4)
    model.set_role({"P1", "P2", "P3", "P4"}, "off")
    assert state_line(model).text == (
        "0 of 3 control pairs, which make the fit. 4 other pairs are check or off: Space changes "
        "that."
    )


def test_an_adopted_refinement_is_told_with_what_has_it(model):
    picked(model, 8)
    model.adopt(Similarity(3.1, np.eye(3), np.zeros(3)))
    assert state_line(model).text == (
        "scale 3.100 · ICP adopted: the views and the saved cloud have it, the report does not · "
        "8 control, 0 check"
    )


def test_a_name_from_right_to_left_is_set_apart(model):
    picked(model, 8)
    model.rename("P3", "דגל 3")
    model.move("דגל 3", "target", np.add(model.pairs[2].target, 0.4))
    line = state_line(model)
    assert line.text.startswith("\u200e\u2068דגל 3\u2069 does not fit the others · scale ")


def test_a_weak_layout_is_amber_and_says_why(model):
    picked(model, 8)
    model.set_survey([[-5, -5, 0], [30, 25, 400]], np.zeros((0, 3)))
    line = state_line(model)
    assert line.text.endswith("all pairs in the lower third: heights above are extrapolated")
    assert line.level == "amber"


def test_a_changed_pair_makes_the_report_stale(model):
    picked(model, 6)
    model.mark_reported()
    assert state_line(model).level == "good"
    model.cycle_role({"P1"})
    line = state_line(model)
    assert line.word == "Outdated"
    assert line.text == "Pairs changed since the report: run again."
    assert "report" in line.enabled


def test_a_job_leaves_picking_on_and_can_be_cancelled(model):
    picked(model, 6)
    line = state_line(model, running=Running("C2C", 0.41))
    assert line.text == "C2C: 41 % (Esc cancels)"
    assert line.enabled == {"cancel", "pick"}
    assert state_line(model, running=Running("Reading nerf.ply")).text == (
        "Reading nerf.ply (Esc cancels)"
    )


def test_a_failure_is_told_and_nothing_is_locked(model):
    picked(model, 6)
    line = state_line(model, failure="lidar.laz has no CRS.")
    assert (line.text, line.level, line.word) == ("lidar.laz has no CRS.", "red", "Failed")
    assert line.enabled == state_line(model).enabled


def test_pairs_without_clouds_can_be_fitted_and_not_audited():
    model = Model()
    picked(model, 6)
    line = state_line(model)
    assert line.text.startswith("scale 3.0")
    assert "align" in line.enabled
    assert not {"errors", "report"} & line.enabled


def test_a_second_operator_is_led_from_pair_to_pair(model):
    picked(model, 4)
    begin_second_operator(model)
    assert state_line(model).text == "Second operator: 0 of 4 pairs picked again. Next: P1."
    model.place("source", [0, 0, 0])
    assert state_line(model).text.startswith("P1: now click the same corner in the reference view.")
    model.place("target", [0, 0, 0.01])
    line = state_line(model)
    assert line.text == "Second operator: 1 of 4 pairs picked again. Next: P2."
    assert not {"errors", "report"} & line.enabled


def test_the_line_does_not_change_the_model(model):
    picked(model, 5)
    before = replace(model.state)
    state_line(model)
    assert model.state == before
