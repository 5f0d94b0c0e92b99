import pytest

from trigpoint.criteria import check_quantities, judge
from trigpoint.errors import ProjectError
from trigpoint.project import Limit, read_project

RESULTS = {
    "nerf": {
        "loocv": {"rmse_m": 0.2},
        "alignment": {"mean_m": [0.0, 0.1, 0.2]},
        "icp": None,
        "comparison": {
            "delivered": {
                "completeness": {
                    "upper": {
                        "within": [
                            {"threshold_m": 0.05, "pct": 50.0},
                            {"threshold_m": 0.1, "pct": 90.0},
                        ]
                    }
                }
            }
        },
    }
}


def limit(quantity, **bounds):
    return Limit(quantity, "nerf", "brief, clause 4", **bounds)


def test_no_limit_is_not_tested():
    assert judge([], RESULTS, []) == ([], "NOT TESTED")


def test_the_margin_is_the_room_to_spare_either_way():
    quantity = "comparison.delivered.completeness.upper.within[0.10].pct"
    criteria, verdict = judge(
        [limit("loocv.rmse_m", max=0.25), limit(quantity, min=85)], RESULTS, []
    )
    assert [each["margin"] for each in criteria] == pytest.approx([0.05, 5.0])
    assert [each["limit"] for each in criteria] == ["max 0.25", "min 85"]
    assert verdict == "PASS"


def test_a_limit_met_exactly_is_met():
    assert judge([limit("loocv.rmse_m", max=0.2)], RESULTS, [])[1] == "PASS"


def test_one_limit_that_fails_fails_all():
    criteria, verdict = judge(
        [limit("loocv.rmse_m", max=0.25), limit("alignment.mean_m.2", max=0.1)], RESULTS, []
    )
    assert [each["met"] for each in criteria] == [True, False]
    assert verdict == "FAIL"


def test_what_was_not_found_is_not_met():
    criteria, verdict = judge([limit("icp.shift_m", max=1)], RESULTS, [])
    assert (criteria[0]["found"], criteria[0]["met"], verdict) == (None, False, "FAIL")


def test_limits_met_on_a_doubtful_precondition_are_conditional():
    assert (
        judge([limit("loocv.rmse_m", max=0.25)], RESULTS, ["vertical_datum_unknown"])[1]
        == "CONDITIONAL"
    )
    assert judge([limit("loocv.rmse_m", max=0.25)], RESULTS, ["units_converted"])[1] == "PASS"


@pytest.fixture
def project_with(tmp_path):
    def make(quantity):
        path = tmp_path / "project.toml"
        path.write_text(
            '[project]\nid="a"\n[reference]\npath="r.laz"\n[[reconstruction]]\nname="nerf"\npath="n.ply"\n'
            f'[[limit]]\nquantity="{quantity}"\nof="nerf"\nmax=1\nsource="s"\n'
        )
        return read_project(path)

    return make


@pytest.mark.parametrize(
    "quantity",
    [
        "loocv.rmse_m",
        "alignment.mean_m.2",
        "alignment.rmse_dof_m",
        "icp.shift_m",
        "checks.rmse_m",
        "reliability.zones.upper.sigma_m",
        "comparison.delivered.accuracy.all.rmse_m",
        "comparison.after_icp.completeness.upper.within[0.10].pct",
    ],
)
def test_every_number_of_a_reconstruction_may_be_limited(quantity, project_with):
    check_quantities(project_with(quantity))


@pytest.mark.parametrize(
    ("quantity", "words"),
    [
        ("loocv.rsme_m", "mean 'rmse_m'"),
        ("loocv", "is no number"),
        ("alignment.method", "is no number"),
        ("alignment.mean_m.3", "has no '3'"),
        ("comparison.delivered.accuracy.upper.within[0.15].pct", r"within_m is \[0.05, 0.1, 0.2\]"),
        ("comparison.delivered.accuracy.uper.rmse_m", "mean 'upper'"),
        ("", "is no number"),
    ],
)
def test_a_limit_on_nothing_is_refused_before_the_work(quantity, words, project_with):
    with pytest.raises(ProjectError, match=words):
        check_quantities(project_with(quantity))
