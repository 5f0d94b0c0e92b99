import io

import pytest
from rich.console import Console

from trigpoint_reporting import console as people
from trigpoint_reporting import wording
from trigpoint_reporting.render import to_text

CASES = ("paper", "few", "many", "rejected", "unpicked", "hollow", "full")


def test_the_papers_errors_support_these_plot_scales():
    assert wording.plot_scale_text(0.137).text == "1:761"
    assert wording.plot_scale_text(0.205).text == "1:1139"
    assert wording.plot_scale_text(None).text == "not available"


def test_the_papers_result_is_told_in_one_paragraph(make_evidence):
    told = to_text(wording.result(make_evidence("paper"), "nerf"))
    for words in (
        "EPSG:32615",
        "scale 3.260000",
        "6 of 6 control picks",
        "0.137 m RMSE",
        "0.175 m allowing for its seven parameters (95 % range 0.124 to 0.298 m)",
        "from the others gives 0.205 m",
        "ICP is not retained",
        "90.7 % of the reference",
        "1:1139 (leave-one-out)",
    ):
        assert words in told


@pytest.mark.parametrize("case", CASES)
def test_the_result_takes_at_most_ninety_words(make_evidence, case):
    evidence = make_evidence(case)
    for name in evidence.names:
        told = to_text(wording.result(evidence, name))
        assert len(told.split()) <= 90
        assert told.count("..") == told.count("  ") == 0


def test_icp_that_is_retained_is_said_not_to_be_delivered(make_evidence):
    evidence = make_evidence("full")
    icp = evidence.results["reconstructions"]["nerf"]["icp"]
    icp |= {"retained": True, "check_rmse_before_m": 0.15, "check_rmse_after_m": 0.11}
    told = to_text(wording.result(evidence, "nerf"))
    assert "ICP, not delivered, lowers the held-out error." in told
    assert len(told.split()) <= 90


def test_the_terminal_says_of_icp_what_the_report_says(make_evidence):
    found = make_evidence("full").results["reconstructions"]["nerf"]

    def told(name="nerf", **icp):
        console = Console(file=io.StringIO(), width=200)
        people.show_icp(console, found | {"icp": found["icp"] | icp}, name=name)
        return " ".join(console.file.getvalue().split())

    few = {"retained": True, "check_rmse_before_m": 0.174, "check_rmse_after_m": 0.173}
    assert "Rigid ICP of nerf: 4 picks can't tell whether ICP helps before m" in told(**few)
    assert "It is not delivered." in told(**few)
    many = "ICP, not delivered, lowers the held-out error before m"
    assert many in told(**few | {"check_rmse_after_m": 0.05})
    assert "Rigid ICP of nerf: ICP is not retained before m" in told(**few | {"retained": False})
    none = dict.fromkeys(("check_rmse_before_m", "loocv_rmse_before_m"))
    assert "Rigid ICP: ICP is not judged before m" in told("", retained=False, **none)
    assert "delivered" not in told("", retained=False, **none)


def test_a_change_by_icp_that_so_few_picks_cannot_show_is_said_to_be_one(make_evidence):
    evidence = make_evidence("full")
    icp = evidence.results["reconstructions"]["nerf"]["icp"]
    icp |= {"retained": True, "check_rmse_before_m": 0.174, "check_rmse_after_m": 0.173}
    told = to_text(wording.result(evidence, "nerf"))
    assert "4 picks can't tell whether ICP helps." in told
    assert "lowers" not in told
    assert len(told.split()) <= 90
    asked = wording.held_out_of_icp(evidence.results["reconstructions"]["nerf"])
    assert asked.known_to_m == pytest.approx(0.174 / 24**0.5)


def test_leave_one_out_decides_about_icp_where_there_are_no_check_picks(make_evidence):
    found = make_evidence("paper").results["reconstructions"]["nerf"]
    asked = wording.held_out_of_icp(found)
    assert (asked.n, asked.before_m, asked.after_m) == (6, 0.205, 0.22)
    found["icp"]["loocv_rmse_after_m"] = None
    assert wording.held_out_of_icp(found) is None


def test_check_picks_are_what_the_plot_scale_goes_by(make_evidence):
    told = to_text(wording.result(make_evidence("full"), "nerf"))
    assert "At 4 check picks it is 0.150 m." in told
    assert "1:833 (check picks)" in told


def test_one_pick_is_told_as_one(make_evidence):
    evidence = make_evidence("full")
    found = evidence.results["reconstructions"]["nerf"]
    found["checks"]["n"] = 1
    found["icp"] |= {"retained": True, "check_rmse_before_m": 0.174, "check_rmse_after_m": 0.173}
    told = to_text(wording.result(evidence, "nerf"))
    assert "At 1 check pick it is 0.150 m." in told
    assert "1 pick can't tell whether ICP helps." in told


def test_three_picks_say_that_none_could_be_left_out(make_evidence):
    told = to_text(wording.result(make_evidence("few"), "nerf"))
    assert "No pick could be left out." in told
    assert "plot scale" not in told


def test_a_cloud_without_a_crs_is_not_said_to_be_in_one(make_evidence):
    assert "a frame without a stated CRS" in to_text(
        wording.result(make_evidence("hollow"), "nerf")
    )


def test_each_verdict_has_its_own_word_sign_and_tone(with_limits):
    seen = set()
    for verdict in wording.VERDICTS:
        passage = wording.verdict(with_limits(("loocv.rmse_m", 0.25, 0.205), verdict=verdict))
        assert verdict in to_text(passage)
        seen.add((to_text(passage)[0], passage.tone))
    assert len(seen) == 4


def test_conditional_names_what_is_in_doubt(make_evidence):
    told = to_text(wording.verdict(make_evidence("full")))
    assert told.endswith("in doubt: vertical datum unknown.")


def test_fail_counts_the_limits_that_are_not_met(with_limits):
    limits = [("loocv.rmse_m", 0.1, 0.205), ("alignment.rmse_m", 0.2, 0.137)]
    told = to_text(wording.verdict(with_limits(*limits, verdict="FAIL")))
    assert "1 of 2 fails." in told


def test_quantities_are_called_by_name_and_unit():
    label = wording.quantity_label
    assert label("alignment.rmse_m") == "RMSE at the control picks, 3D (m)"
    assert label("comparison.after_icp.accuracy.all.p95_m") == (
        "Accuracy after ICP, all zones: 95th percentile (m)"
    )
    assert label("comparison.delivered.completeness.upper.within[0.10].raw_pct") == (
        "Completeness, upper zone: within 0.10 m, unthinned (%)"
    )
    assert label("reliability.sigma0_m") == "reliability.sigma0_m"
