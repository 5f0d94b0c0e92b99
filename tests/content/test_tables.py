import inspect
import json
import re
from copy import deepcopy

import jsonschema
import numpy as np
import pandas as pd
import pytest

from trigpoint.criteria import schema
from trigpoint_reporting.blocks import Passage, Table, Value
from trigpoint_reporting.content.conduct import method
from trigpoint_reporting.content.distances import accuracy, completeness
from trigpoint_reporting.content.doubts import limitations
from trigpoint_reporting.content.frame import coordinate_reference
from trigpoint_reporting.content.front import result
from trigpoint_reporting.content.hypothesis import icp
from trigpoint_reporting.content.pairs import paired
from trigpoint_reporting.content.provenance import provenance
from trigpoint_reporting.content.residuals import MOST, picks
from trigpoint_reporting.content.scope import purpose
from trigpoint_reporting.content.sources import inputs
from trigpoint_reporting.content.transform import transformation
from trigpoint_reporting.content.validity import validation
from trigpoint_reporting.content.worth import reliability
from trigpoint_reporting.numbers import write_rounding
from trigpoint_reporting.render import to_html, to_text
from trigpoint_reporting.verifier import verify

MACHINE = re.compile(r"\bnan\b|\bNone\b|\binf\b|\bTrue\b|\bFalse\b|<object|\d[eE][+-]?\d{2}\b")


@pytest.fixture
def sections():
    return pytest.importorskip(
        "trigpoint_reporting.outline", reason="figures need matplotlib"
    ).SECTIONS


@pytest.fixture
def blocks_of(sections):
    """Return every block of every section."""

    def collect(evidence):
        for section in sections:
            if section.per_reconstruction:
                for name in evidence.names:
                    yield from section.function(evidence, name)
            else:
                yield from section.function(evidence)

    return collect


def cells(block):
    if isinstance(block, Passage):
        return list(block.parts)
    return [cell for row in block.rows for entry in row for cell in parts(entry)] + [*block.note]


def parts(entry):
    return entry if isinstance(entry, tuple) else (entry,)


def texts(row):
    return [
        "".join(cell.text if isinstance(cell, Value) else cell for cell in parts(entry))
        for entry in row
    ]


def told(blocks):
    return "\n".join(map(to_text, blocks))


def table(blocks, words):
    return next(each for each in blocks if isinstance(each, Table) and words in each.caption)


def test_the_samples_are_what_results_json_may_be(evidence):
    jsonschema.validate(evidence.results, schema())


def test_every_number_is_the_one_that_its_path_holds(evidence, blocks_of, tmp_path):
    write_rounding(tmp_path / "rounding.json")
    rounding = json.loads((tmp_path / "rounding.json").read_text("utf-8"))
    printed = 0
    for block in blocks_of(evidence):
        for cell in cells(block):
            if isinstance(cell, Value) and cell.path:
                stored = verify.look_up(evidence.results, cell.path)
                digits = verify.digits_for(rounding, cell.path, evidence.results)
                exact = digits is None
                right, expected = verify.printed_right(cell.text, stored, digits, exact=exact)
                assert right, (cell, expected)
                printed += 1
    assert printed > 90


def test_tables_are_whole_and_say_nothing_in_a_machines_words(evidence, blocks_of):
    for block in blocks_of(evidence):
        assert to_html(block)
        if isinstance(block, Table):
            assert block.caption
            assert block.rows
            assert {len(row) for row in block.rows} == {len(block.columns)}
        assert not MACHINE.search(to_text(block)), to_text(block)


def test_telling_changes_nothing_and_is_the_same_again(evidence, blocks_of):
    before = deepcopy(evidence.results)
    assert told(blocks_of(evidence)) == told(blocks_of(evidence))
    assert evidence.results == before


def test_hostile_text_is_printed_as_that(make_evidence, blocks_of):
    evidence = make_evidence("hostile")
    page = "".join(map(to_html, blocks_of(evidence))).replace("<wbr>", "")
    assert "<script" not in page
    assert "<b>" not in page
    assert page.count("&lt;script&gt;alert(1)&lt;/script&gt;") > 8
    assert "برج الساعة" in page


def test_sections_have_anchors_of_their_own_and_figures_that_can_be_called(sections):
    ids = [section.id for section in sections]
    assert len(set(ids)) == len(ids)
    for section in sections:
        assert re.fullmatch("[a-z-]+", section.id)
        assert section.title
        needed = 2 if section.per_reconstruction else 1
        assert len(inspect.signature(section.function).parameters) == needed
        for figure in section.figures:
            assert len(inspect.signature(figure).parameters) in (1, 2)


def test_the_first_page_reports_what_has_no_limit(make_evidence):
    rows = [texts(row) for row in table(result(make_evidence("paper")), "Criteria").rows]
    assert [row[3] for row in rows] == ["0.137", "0.205", "0.265", "90.7", "78.5"]
    assert {row[2] for row in rows} == {"no limit set"}


def test_limits_stand_with_their_source_and_are_not_reported_twice(make_evidence):
    rows = [texts(row) for row in table(result(make_evidence("full")), "Criteria").rows]
    assert rows[0] == [
        "Leave-one-out RMSE, 3D (m)",
        "nerf",
        "✓ met",
        "0.205",
        "max 0.25",
        "0.045",
        "brief, clause 4",
    ]
    assert sum(row[0].startswith("Leave-one-out") for row in rows) == 1


def test_a_threshold_typed_with_another_zero_is_the_same_limit(with_limits):
    quantity = "comparison.delivered.completeness.all.within[0.10].pct"
    evidence = with_limits((quantity, 95.0, 90.7), verdict="PASS")
    rows = [texts(row) for row in table(result(evidence), "Criteria").rows]
    assert [row[1] for row in rows if row[0].startswith("Completeness")] == ["nerf", "sfm"]


def test_a_limit_missed_by_a_hair_does_not_read_as_missed_by_nothing(with_limits):
    evidence = with_limits(("loocv.rmse_m", 0.205, 0.20504), verdict="FAIL")
    row = texts(table(result(evidence), "Criteria").rows[0])
    assert [row[2], row[5]] == ["✗ not met", "\N{MINUS SIGN}0.00004"]


def test_the_plot_scales_of_the_paper_are_printed(make_evidence):
    rows = [texts(row) for row in table(result(make_evidence("paper")), "plot scale").rows]
    assert [row[-1] for row in rows] == ["1:761", "1:1139"]


def test_missing_statements_are_said_to_be_missing(make_evidence):
    evidence = make_evidence("paper")
    assert "No purpose was stated" in told(purpose(evidence))
    assert "can't be told" in told(purpose(evidence))
    assert limitations(evidence)[0].tone == "warning"
    assert "No limitations statement was supplied." in told(limitations(evidence))


def test_residuals_are_summed_up_as_numpy_does(make_evidence):
    evidence = make_evidence("paper")
    shown = table(picks(evidence, "nerf"), "residuals")
    found = evidence.results["reconstructions"]["nerf"]["alignment"]["residuals"]
    frame = pd.DataFrame(found)[["dx_m", "dy_m", "dz_m"]]
    mean, spread, rmse, largest = ([*texts(row)] for row in shown.rows[-4:])
    assert [row[0] for row in (mean, spread, rmse, largest)] == [
        "Mean",
        "Standard deviation",
        "RMSE",
        "Largest",
    ]
    assert spread[2:5] == [f"{each:.3f}" for each in frame.std()]
    assert rmse[2:5] == [f"{each:.3f}" for each in np.sqrt((frame**2).mean())]
    assert largest[2:5] == [f"{each:.3f}" for each in frame.abs().max()]
    assert rmse[-1] == "0.137"
    # A mean of lengths is no error, and is not printed as one.
    assert mean[-1] == spread[-1] == "\N{EN DASH}"
    assert "3n − 7 = 11, it is 0.175 m" in to_text(shown)  # noqa: RUF001 - as printed


def test_rejected_picks_are_listed_and_enter_no_summary(make_evidence):
    shown = table(picks(make_evidence("rejected"), "nerf"), "residuals")
    rows = [texts(row) for row in shown.rows]
    assert [row[0] for row in rows if row[1] == "REJECTED"] == [f"wrong-{k}" for k in range(7)]
    assert float(rows[-1][-1]) < 0.1
    assert "7 of 10" in to_text(shown)


def test_three_hundred_picks_are_all_printed_and_thousands_by_their_worst(make_evidence):
    evidence = make_evidence("many")
    assert len(table(picks(evidence, "nerf"), "residuals").rows) == 304
    found = evidence.results["reconstructions"]["nerf"]["alignment"]
    found["residuals"] = [
        found["residuals"][0] | {"id": f"m{k}", "d_m": k / 1000} for k in range(900)
    ]
    shown = table(picks(evidence, "nerf"), "residuals")
    assert len(shown.rows) == MOST + 4
    assert shown.rows[0][0] == "m500"
    assert f"Printed are the {MOST} largest of 900" in to_text(shown)


def test_coordinates_are_printed_where_the_bundle_holds_them(make_evidence):
    evidence = make_evidence("paper")
    assert len(picks(evidence, "nerf")) == 1
    columns = [f"{frame}_{axis}" for frame in ("source", "target") for axis in "xyz"]
    frame = pd.DataFrame([[1.5, 2, 3, 741000.25, 4279050, 150]], columns=columns)
    frame = frame.assign(id="p0", role="control", sigma_source=0.0215, sigma_target=np.nan)
    frame.to_csv(evidence.folder / "data" / "correspondences-nerf.csv", index=False)
    row = texts(table(picks(evidence, "nerf"), "coordinates").rows[0])
    assert row[:4] == ["1", "p0", "control", "1.5000"]
    assert row[-2:] == ["0.0215", "not stated"]


def test_what_is_carried_through_is_said_with_the_sigmas_of_both_frames(make_evidence):
    evidence = make_evidence("paper")
    found = evidence.results["reconstructions"]["nerf"]["reliability"]
    rows = [" | ".join(texts(row)) for row in table(method(evidence), "Effects").rows]
    assert "residuals of the fit" in rows[0]
    assert rows[0].endswith("carried through: covariance, intervals")
    found |= {"noise": "stated", "sigma_m": 0.0991}
    frame = pd.DataFrame({"id": ["p0", "c0"], "role": ["control", "check"]})
    frame = frame.assign(sigma_source=[0.0215, 9.0], sigma_target=[0.07, 9.0])
    frame.to_csv(evidence.folder / "data" / "correspondences-nerf.csv", index=False)
    rows = [" | ".join(texts(row)) for row in table(method(evidence), "Effects").rows]
    assert "0.099 | m | sigmas of the picks: 0.07 m in the reference, 0.0215 units" in rows[0]
    assert rows[0].endswith("carried through: covariance, intervals")
    assert "as the fit shows it" in rows[1]
    assert rows[1].endswith("no: compared with the sigmas")


def test_the_transformation_is_told_in_every_usual_form(make_evidence):
    words = told(transformation(make_evidence("paper"), "nerf"))
    for part in (
        "90.000000",  # about the vertical
        "0.707106781",
        "det R = 1.000000000",
        "741012.500",
        "transform/nerf_matrix.txt",
        "Global registration error, total RMS (m)  0.137",
        "Total number of points                    500,000",
        "trigpoint apply transform/nerf.json",
    ):
        assert part in words


def test_validation_gives_the_interval_of_so_few_picks(make_evidence):
    words = told(validation(make_evidence("paper"), "nerf"))
    assert "0.175 m in space, with a 95 % interval from 0.124 to 0.298 m" in words
    assert "1.50 times as much" in words
    assert "There are no check picks." in words
    assert "0.265 %" in words


def test_only_few_picks_are_said_to_be_few(make_evidence):
    assert "So few picks" in told(validation(make_evidence("paper"), "nerf"))
    words = told(validation(make_evidence("many"), "nerf"))
    assert "So few picks" not in words
    assert "Allowing for 893 degrees of freedom the error at the control picks is 0.138 m" in words


def test_three_picks_have_nothing_to_leave_out_and_say_so(make_evidence):
    evidence = make_evidence("few")
    checked = told(validation(evidence, "nerf"))
    assert "needs at least four picks" in checked
    assert "nerf: leave-one-out" not in checked  # a table of nothing
    words = told(reliability(evidence, "nerf"))
    assert "The covariance of the similarity is not available." in words
    assert "not tested" in words
    assert "no error of that pick, however large, would show" in words


def test_a_consensus_that_was_not_redone_is_not_told(make_evidence):
    evidence = make_evidence("many")
    assert "consensus redone in each fold" in told(validation(evidence, "nerf"))
    evidence.results["reconstructions"]["nerf"]["loocv"]["rmse_procedure_m"] = None
    assert "redone in" not in told(validation(evidence, "nerf"))


def test_what_the_columns_mean_is_said_once_in_a_section(make_evidence):
    evidence = make_evidence("paper")
    for section in (accuracy, completeness):
        first, other = (to_text(section(evidence, name)[0]) for name in ("nerf", "sfm"))
        assert "two random halves" in first
        assert "Columns as for nerf." in other


def test_reliability_states_both_error_levels_and_the_weakest_axis_first(make_evidence):
    words = told(reliability(make_evidence("full"), "nerf"))
    assert "p < 0.05 / n = 0.0083" in words
    assert "α = 0.001 finds with power 0.80" in words  # noqa: RUF001 - as printed
    assert "0.400°, 0.200° and 0.100°" in words
    assert "scale bar" in words


def test_the_rule_for_icp_is_printed_before_its_numbers(make_evidence):
    words = told(icp(make_evidence("paper"), "nerf"))
    rule, cannot = words.index("Rule, set before the numbers"), words.index("cannot fall")
    assert rule < cannot < words.index("0.211")
    assert "Not retained: the held-out error did not fall." in words


def test_what_is_delivered_is_said_before_icp_is_judged(make_evidence):
    evidence = make_evidence("paper")
    evidence.results["reconstructions"]["nerf"]["icp"]["retained"] = True
    words = told(icp(evidence, "nerf"))
    assert words.index("as the similarity carries it, without ICP") < words.index("Rule, set")
    assert words.index("0.211") < words.index("The rule is met")
    assert "is not delivered" in words
    assert "is the cloud as it came, without ICP" in told(icp(evidence, "sfm"))


def test_icp_is_not_called_better_by_what_so_few_picks_cannot_show(make_evidence):
    evidence = make_evidence("full")
    trial = evidence.results["reconstructions"]["nerf"]["icp"]
    trial |= {"retained": True, "check_rmse_before_m": 0.174, "check_rmse_after_m": 0.173}
    words = told(icp(evidence, "nerf"))
    assert "an RMSE of 4 picks is itself known to about 0.036 m" in words
    assert "do not tell which of the two poses is the better one" in words
    evidence.results["reconstructions"]["nerf"]["checks"]["n"] = 1
    assert "an RMSE of 1 pick is itself" in told(icp(evidence, "nerf"))
    trial["check_rmse_after_m"] = 0.01
    assert "do not tell" not in told(icp(evidence, "nerf"))


def test_leave_one_out_over_some_of_the_picks_has_a_name_of_its_own(make_evidence):
    rows = table(icp(make_evidence("many"), "nerf"), "without and with").rows
    assert rows[2][0] == "Leave-one-out over 50 of the 300 picks, spread evenly: RMSE (m)"
    rows = table(icp(make_evidence("paper"), "nerf"), "without and with").rows
    assert rows[2][0] == "Leave-one-out RMSE (m)"


def test_icp_that_no_pick_was_held_out_for_is_not_said_to_have_been_judged(make_evidence):
    evidence = make_evidence("full")
    trial = evidence.results["reconstructions"]["nerf"]["icp"]
    assert "the held-out error did not fall" in told(icp(evidence, "nerf"))
    for part in ("loocv", "check"):
        trial |= {f"{part}_rmse_before_m": None, f"{part}_rmse_after_m": None}
    words = told(icp(evidence, "nerf"))
    assert "Not retained: nothing was held out to judge it by." in words


def test_icp_without_picks_is_judged_by_nothing(make_evidence):
    evidence = make_evidence("paper")
    words = told(icp(evidence, "sfm"))
    assert "nothing was held out" in words
    assert "control" not in words
    evidence.results["reconstructions"]["sfm"]["icp"] = None
    assert told(icp(evidence, "sfm")) == "The project asked for no ICP."


def test_zones_carry_their_heights_and_thresholds_below_the_voxel_a_mark(make_evidence):
    blocks = completeness(make_evidence("paper"), "nerf")
    heights = [texts(row)[1] for row in table(blocks, "distances as delivered").rows]
    assert heights[0] == "151.9 to 212.0"
    assert heights[3] == "191.6 to 212.0"
    marked = table(blocks, "within distances").columns
    assert marked == ["Zone", "RMSE (m)", "≤ 0.05 m * (%)", "≤ 0.1 m * (%)", "≤ 0.2 m (%)"]


def test_points_kept_and_lost_stand_side_by_side(make_evidence):
    shown = table(method(make_evidence("paper")), "kept and lost")
    assert shown.columns == ("Step", "nerf", "sfm")
    assert texts(shown.rows[0]) == ["reference points", "532,598", "532,598"]


def test_an_empty_zone_is_nothing_within_any_distance(make_evidence):
    blocks = accuracy(make_evidence("hollow"), "nerf")
    upper = texts(table(blocks, "distances as delivered").rows[3])
    assert upper[2:] == ["0", *["not available"] * 7]
    assert "No points in: upper." in told(blocks)
    assert texts(table(blocks, "within distances").rows[-1])[2] == "0.0"


def test_intervals_stand_beside_their_numbers_where_there_are_any(make_evidence):
    known = table(accuracy(make_evidence("full"), "nerf"), "within distances")
    assert texts(known.rows[0])[known.columns.index("≤ 0.1 m * (%)")] == "90.7 [87.7 to 93.7]"
    assert known.columns[1] == "RMSE (m), 95 %"
    unknown = table(accuracy(make_evidence("paper"), "nerf"), "within distances")
    assert texts(unknown.rows[0])[3] == "90.7"
    assert "95 % intervals: not available." in to_text(unknown)
    assert "From picking noise alone" in told(completeness(make_evidence("full"), "nerf"))


def test_what_lies_outside_its_own_interval_says_why_and_nothing_else_does(make_evidence):
    evidence = make_evidence("full")
    why = "the error of the pose has worsened what was measured"
    delivered = evidence.results["reconstructions"]["nerf"]["comparison"]["delivered"]
    assert why not in told(accuracy(evidence, "nerf"))
    assert "has moved" not in told(paired(evidence))
    delivered["accuracy"]["upper"]["within"][0]["low_pct"] = 99.0
    evidence.results["paired"]["delivered"][0]["differences"][1]["low_pct"] = 12.3
    assert why in told(accuracy(evidence, "nerf"))
    assert why not in told(completeness(evidence, "nerf"))
    assert "from which an error of a pose has moved the one measured" in told(paired(evidence))


def test_a_small_limit_is_printed_without_an_exponent(with_limits):
    evidence = with_limits(("alignment.rmse_m", 4e-07, 0.1), verdict="FAIL")
    assert "max 0.0000004" in texts(table(result(evidence), "Criteria").rows[0])
    evidence = with_limits(("alignment.rmse_m", 0.25, 0.1), verdict="PASS")
    assert "max 0.25" in texts(table(result(evidence), "Criteria").rows[0])


def test_a_number_below_zero_in_a_warning_has_a_true_minus_and_a_name_its_hyphen(make_evidence):
    evidence = make_evidence("paper")
    message = "height effect -28.5 ppm at pick -5 of course-2"
    evidence.results["warnings"] = [{"code": "grid_scale", "message": message}]
    words = told(limitations(evidence))
    assert "height effect \N{MINUS SIGN}28.5 ppm at pick -5 of course-2" in words


def test_warnings_of_one_code_are_one_row(make_evidence):
    evidence = make_evidence("paper")
    evidence.results["warnings"] = [
        {"code": "picks_few", "message": "No pick can be tested."},
        {"code": "grid_scale", "message": "The map stretches."},
        {"code": "picks_few", "message": "None can be left out."},
    ]
    rows = table(limitations(evidence), "Warnings").rows
    assert [texts(row) for row in rows] == [
        ["picks_few", "No pick can be tested. None can be left out."],
        ["grid_scale", "The map stretches."],
    ]


def test_making_it_again_names_a_command_that_works_from_a_bundle(make_evidence):
    rows = table(provenance(make_evidence("paper")), "To check it").rows
    assert texts(rows[-1])[1] == "trigpoint verify tower-r1.zip --again --inputs FOLDER"


def test_reconstructions_are_compared_where_they_were(make_evidence):
    words = told(paired(make_evidence("full")))
    more = "Over all zones, nerf is more complete than sfm within 0.2 m."
    assert f"As delivered: {more}" in words
    assert f"After ICP, pose taken out: {more}" in words
    assert "one reconstruction" in told(paired(make_evidence("unpicked")))
    assert "Not available" in told(paired(make_evidence("paper")))


def test_what_a_verdict_means_that_tells_nothing_is_said_below_the_table(make_evidence):
    evidence = make_evidence("full")
    disagree = "Not told: what was measured and its interval lie on different sides of zero."
    assert disagree not in told(paired(evidence))
    rows = evidence.results["paired"]["delivered"][0]["differences"]
    rows[0]["verdict"], rows[1]["verdict"] = "not told", "not resolvable"
    blocks = paired(evidence)
    shown = [texts(row)[5] for row in table(blocks, "completeness").rows]
    assert shown == ["not told", "not resolvable", "better", "better"]
    assert disagree in told(blocks)
    assert "Not resolvable: a threshold not above the voxel." in told(blocks)


def test_an_end_of_an_interval_below_the_floor_is_not_printed_as_a_number(make_evidence):
    evidence = make_evidence("full")
    zones = evidence.results["reconstructions"]["nerf"]["comparison"]["delivered"]["accuracy"]
    why = "An end below the floor"
    assert why not in told(accuracy(evidence, "nerf"))
    zones["lower"] |= {"rmse_low_m": 0.0, "rmse_high_m": 0.128}
    zones["middle"] |= {"rmse_low_m": 0.0, "rmse_high_m": 0.04}
    shown = [texts(row)[1] for row in table(accuracy(evidence, "nerf"), "within distances").rows]
    assert shown[1:3] == ["0.100 [up to 0.128]", "0.100 [below the floor]"]
    assert shown[0] == "0.100 [0.050 to 0.150]"
    assert told(accuracy(evidence, "nerf")).count(why) == 1


def test_a_difference_without_an_interval_stands_alone(make_evidence):
    evidence = make_evidence("full")
    for row in evidence.results["paired"]["delivered"][0]["differences"]:
        row |= {"low_pct": None, "high_pct": None}
    shown = paired(evidence)
    assert "[not available" not in told(shown)


def test_the_coordinate_reference_says_what_it_does_not_say(make_evidence):
    words = told(coordinate_reference(make_evidence("paper")))
    for part in ("vertical datum is unknown", "ensemble", "2.000 m", "28.4 mm over 100 m", "1.727"):
        assert part in words
    none = coordinate_reference(make_evidence("hollow"))
    assert "There is no coordinate reference" in told(none)


def test_an_input_is_told_with_its_format_and_version(make_evidence):
    table = inputs(make_evidence("paper"))[0]
    cell = table.rows[0][table.columns.index("Format")]
    assert cell == "PLY 1.0, little endian, float"
