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
    sentence = asprs_sentence(29, class_cm=None, tested_cm=15.0)
    assert "tested to meet" not in sentence
    assert sentence.startswith("This data set was tested as required by ASPRS Positional")
    assert "minimum of thirty (30) checkpoints" in sentence
    assert "using ONLY 29 checkpoints. This data set was produced to meet a ___(cm)" in sentence
    assert sentence.endswith("using the reduced number of checkpoints.")


def test_without_check_points_only_produced_to_meet_may_be_said():
    sentence = asprs_sentence(0, class_cm=None, tested_cm=None)
    assert sentence.startswith("This data set was produced to meet")
    assert sentence.endswith("___(cm) RMSE_H Horizontal Positional Accuracy Class.")
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


def test_without_a_class_the_statement_says_what_it_was_judged_by(with_limits):
    evidence = with_limits(verdict="NOT TESTED", checks=4, accuracy=0.03)
    assert "ONLY 4 checkpoints" in told(evidence)
    assert "judged by the error found" in told(evidence)


def test_leave_one_out_is_never_called_a_test(make_evidence):
    words = told(make_evidence("paper"))
    assert "produced to meet" in words
    assert "tested to meet" not in words
    assert "nor is leave-one-out" in words


def test_where_the_wording_comes_from_is_printed_and_whether_someone_checked(make_evidence):
    evidence = make_evidence("paper")
    assert "Source of the wording: section 2." in told(evidence)
    words = " ".join(map(to_text, purpose(evidence)))
    assert WORDING_SOURCE in words
    assert WORDING_CHECKED_ON in words
    assert "2026-11-22" in WORDING_CHECKED_ON


def test_a_cloud_without_picks_has_no_accuracy_sentence(make_evidence):
    assert accuracy_statement(make_evidence("paper"), "sfm") == []
    assert "relative to ALS" in to_text(agreement(make_evidence("paper")))
