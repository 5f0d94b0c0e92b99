import pandas as pd
import pytest

from trigpoint_reporting.content.scope import purpose
from trigpoint_reporting.render import to_text
from trigpoint_reporting.standards import (
    WORDING_CHECKED_ON,
    WORDING_SOURCE,
    accuracy_statement,
    agreement,
    asprs_sentence,
    combined,
    twice_rule,
)

# Table 7.4 of the standard: a fit of 1.00, 1.50 ... 10.00 cm against check points good to 2.0 cm.
COMBINED = [2.24, 2.50, 2.83, 3.20, 3.61, 4.03, 4.47, 4.92, 5.39, 5.85, 6.32]
COMBINED += [6.80, 7.28, 7.76, 8.25, 8.73, 9.22, 9.71, 10.20]


def told(evidence, name="nerf"):
    return " ".join(map(to_text, accuracy_statement(evidence, name)))


@pytest.mark.parametrize(("row", "expected"), list(enumerate(COMBINED)))
def test_the_error_of_check_points_is_added_as_the_standards_table_has_it(row, expected):
    assert round(combined(1.0 + 0.5 * row, 2.0), 2) == expected


def test_thirty_check_points_were_tested_to_meet():
    sentence = asprs_sentence(30, class_cm=20.0, tested_cm=15.25)
    assert sentence == (
        "This data set was tested to meet ASPRS Positional Accuracy Standards for Digital "
        "Geospatial Data, Edition 2, Version 2 (2024) for a 20.0(cm) RMSE_3D Three-Dimensional "
        "Positional Accuracy Class. The tested three-dimensional accuracy was found to be "
        "RMSE_3D = 15.2(cm) within the NVA tested area and RMSE_3D = ___(cm) within the VVA "
        "tested area."
    )


def test_twenty_nine_were_only_twenty_nine():
    sentence = asprs_sentence(29, class_cm=20.0, tested_cm=15.0)
    assert "tested to meet" not in sentence
    assert sentence.startswith("This data set was tested as required by ASPRS Positional")
    assert "minimum of thirty (30) checkpoints" in sentence
    assert "using ONLY 29 checkpoints. This data set was produced to meet a 20.0(cm)" in sentence
    assert sentence.endswith("using the reduced number of checkpoints.")


def test_without_check_points_only_produced_to_meet_may_be_said():
    sentence = asprs_sentence(0, class_cm=20.0, tested_cm=None)
    assert sentence.startswith("This data set was produced to meet")
    assert sentence.endswith("for a 20.0(cm) RMSE_H Horizontal Positional Accuracy Class.")
    assert "tested" not in sentence


@pytest.mark.parametrize("count", [2, 29, 30, 120])
@pytest.mark.parametrize("accuracy", [None, 0.2])
def test_check_picks_on_a_reference_that_is_not_twice_as_good_test_nothing(
    with_limits, count, accuracy
):
    evidence = with_limits(verdict="NOT TESTED", checks=count, accuracy=accuracy)
    words = told(evidence)
    assert "tested to meet" not in words
    assert "ONLY" not in words
    assert "can't stand for check points" in words


def test_the_class_is_the_users_own_limit_on_check_picks(with_limits):
    asked = ("checks.total_m", 0.25, 0.16)
    evidence = with_limits(asked, verdict="PASS", checks=30, accuracy=0.03)
    assert "for a 25.0(cm) RMSE_3D" in told(evidence)
    assert twice_rule(evidence, "nerf").basis == "the accuracy class asked for"


def test_the_reference_is_held_to_twice_the_class_in_space(with_limits):
    asked = ("checks.total_m", 0.25, 0.16)
    at = 0.125 / 3**0.5
    for accuracy, holds in ((0.999 * at, True), (1.001 * at, False)):
        evidence = with_limits(asked, verdict="PASS", checks=30, accuracy=accuracy)
        assert twice_rule(evidence, "nerf").holds is holds


@pytest.mark.parametrize(("checks", "accuracy"), [(0, None), (4, None), (4, 0.03), (30, 0.03)])
def test_where_nobody_asks_for_a_class_the_standard_is_not_quoted(with_limits, checks, accuracy):
    other = ("loocv.rmse_m", 0.25, 0.205)
    words = told(with_limits(other, verdict="PASS", checks=checks, accuracy=accuracy))
    assert "no limit on the RMSE at the check picks asks for an accuracy class" in words
    assert "This data set" not in words
    assert not set("“”_") & set(words.replace("total_m", "").replace("rmse_m", ""))


def test_a_limit_on_either_error_of_the_check_picks_asks_for_a_class(with_limits):
    for quantity in ("checks.total_m", "checks.rmse_m"):
        evidence = with_limits((quantity, 0.25, 0.16), verdict="PASS", checks=4, accuracy=0.03)
        assert "ONLY 4 checkpoints" in told(evidence)
        assert "no limit" not in told(evidence)


def test_what_the_check_picks_were_read_with_is_part_of_what_they_are_good_to(with_limits):
    asked = ("checks.rmse_m", 0.25, 0.15)
    evidence = with_limits(asked, verdict="PASS", checks=4, accuracy=0.05)
    alone = twice_rule(evidence, "nerf")
    assert (alone.picking_m, alone.holds) == (None, True)
    assert "RMSE_3D = 17.3(cm)" in told(evidence)
    assert "the picks state no sigma of their own" in told(evidence)
    table = pd.DataFrame({"id": ["p0", "c0"], "role": ["control", "check"]})
    for sigma, holds in ((0.02, True), (0.07, False)):
        table.assign(sigma_source=0.02, sigma_target=[0.5, sigma]).to_csv(
            evidence.folder / "data" / "correspondences-nerf.csv", index=False
        )
        rule = twice_rule(evidence, "nerf")
        assert rule.reference_m == pytest.approx((3 * (0.05**2 + sigma**2)) ** 0.5)
        assert rule.holds is holds
        assert f"per axis 0.05 m of the reference and {sigma:.3f} m of picking" in told(evidence)
        assert ("RMSE_3D = 17.7(cm)" in told(evidence)) is holds
    assert "0.149 m in space" in told(evidence)
    assert "has a horizontal form only; the class asked for is one in space" in told(evidence)
    assert "produced to meet" in told(evidence)
    shown = " ".join(map(to_text, purpose(evidence)))
    assert "1.7" in shown
    assert "does not hold" in shown


def test_leave_one_out_is_never_called_a_test(with_limits):
    words = told(with_limits(("checks.rmse_m", 0.25, None), verdict="FAIL"))
    assert "produced to meet" in words
    assert "tested to meet" not in words
    assert "nor is leave-one-out" in words


def test_where_the_wording_comes_from_is_printed_and_whether_someone_checked(with_limits):
    evidence = with_limits(("checks.rmse_m", 0.25, None), verdict="FAIL")
    assert "Source of the wording: section 2." in told(evidence)
    words = " ".join(map(to_text, purpose(evidence)))
    assert WORDING_SOURCE in words
    assert WORDING_CHECKED_ON in words
    assert "2026-11-22" in WORDING_CHECKED_ON


def test_a_cloud_without_picks_has_no_accuracy_sentence(make_evidence):
    assert accuracy_statement(make_evidence("paper"), "sfm") == []
    assert "relative to ALS" in to_text(agreement(make_evidence("paper")))
