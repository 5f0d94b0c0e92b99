import copy
import json

import pytest

from trigpoint.canonical import to_json
from trigpoint_reporting.blocks import Passage, Table
from trigpoint_reporting.content.changes import MOST, changes, replaced
from trigpoint_reporting.content.front import result
from trigpoint_reporting.content.provenance import provenance
from trigpoint_reporting.render import to_html
from trigpoint_reporting.revisions import compare_results, leaves
from trigpoint_reporting.verifier import verify


@pytest.fixture
def revised(make_evidence):
    """Return what revision 2 says after `change` was done to the results of revision 1."""

    def make(change, case="full"):
        evidence = make_evidence(case)
        before = copy.deepcopy(evidence.results)
        evidence.results["project"]["revision"] = 2
        change(evidence.results)
        rows = compare_results(before, evidence.results)
        stored = {"against": "tower-r1", "changes": rows}
        (evidence.folder / "data" / "changes.json").write_text(to_json(stored), "utf-8")
        return changes(evidence)

    return make


def rows_of(blocks):
    return [row for block in blocks if isinstance(block, Table) for row in block.rows]


def told(blocks):
    return " ".join(
        str(part) for block in blocks if isinstance(block, Passage) for part in block.parts
    )


def test_a_first_revision_and_one_without_its_predecessor_say_so(make_evidence):
    evidence = make_evidence("paper")
    assert "This is the first revision." in told(changes(evidence))
    path = evidence.folder / "data" / "changes.json"
    path.write_text(to_json({"against": None, "changes": []}), "utf-8")
    assert "changes are not known" in told(changes(evidence))
    path.write_text(to_json({"against": "tower-r1", "changes": []}), "utf-8")
    assert "Nothing differs from tower-r1." in told(changes(evidence))


def test_a_setting_that_changed_is_told_first_under_its_own_name(revised):
    def change(results):
        results["project"]["settings"]["comparison"] |= {"voxel_m": 0.05, "within_m": [0.05, 0.1]}

    blocks = revised(change)
    assert rows_of(blocks[:1]) == [
        ("Setting", "comparison.voxel_m", "0.1", "0.05"),
        ("Setting", "comparison.within_m", "0.05, 0.1, 0.2", "0.05, 0.1"),
    ]
    assert "Findings that changed since tower-r1: none, as printed." in told(blocks)
    assert "3 values of data/results.json differ" in told(blocks)
    assert "data/changes.json" in told(blocks)


def test_what_prints_alike_is_no_change_of_a_headline(revised):
    def change(results):
        results["reconstructions"]["nerf"]["alignment"]["rmse_m"] += 1e-6
        for row in results["reconstructions"]["nerf"]["alignment"]["residuals"]:
            row["d_m"] += 1e-6

    assert rows_of(revised(change)) == []


def test_headline_numbers_are_told_as_they_are_printed(revised):
    def change(results):
        found = results["reconstructions"]["nerf"]
        found["alignment"]["rmse_m"] = 0.2
        found["icp"]["retained"] = True
        shares = found["comparison"]["delivered"]["completeness"]["all"]["within"]
        shares[1]["pct"] = 12.34

    assert rows_of(revised(change, "paper")) == [
        ("RMSE at the control picks, 3D (m)", "nerf", "0.137", "0.200"),
        ("ICP retained", "nerf", "no", "yes"),
        ("Completeness, all zones: within 0.1 m (%)", "nerf", "90.7", "12.3"),
    ]


def test_the_verdict_its_criteria_and_doubts_are_told(make_evidence, revised):
    row = {
        "quantity": "alignment.rmse_m",
        "of": "nerf",
        "limit": "max 0.15",
        "found": 0.137,
        "margin": 0.013,
        "met": True,
        "source": "",
    }
    before = make_evidence("paper").results | {"criteria": [row], "verdict": "PASS"}

    def change(results):
        results["criteria"][0] |= {"limit": "max 0.1", "margin": -0.037, "met": False}
        results["verdict"] = "FAIL"
        results["warnings"].append({"code": "picks_few", "message": "Three."})

    label = "Criterion: RMSE at the control picks, 3D (m)"
    assert rows_of(revised(change, before)[1:]) == [
        ("Verdict", "", "PASS", "FAIL"),
        ("In doubt", "", "vertical_datum_unknown", "vertical_datum_unknown, picks_few"),
        (label, "nerf", "max 0.15: 0.137, met", "max 0.1: 0.137, not met"),
    ]


@pytest.fixture
def limited(make_evidence):
    """Return results judged against one limit."""
    row = {"quantity": "alignment.rmse_m", "of": "nerf", "limit": "max 0.15", "found": 0.137}
    row |= {"margin": 0.013, "met": True, "source": ""}
    return make_evidence("paper").results | {"criteria": [row], "verdict": "PASS"}


def test_a_limit_that_only_moved_is_a_setting_and_no_finding(limited, revised):
    def loosen(results):
        results["criteria"][0] |= {"limit": "max 0.25", "margin": 0.113}

    blocks = revised(loosen, limited)
    assert rows_of(blocks[:1]) == [
        ("Limit: RMSE at the control picks, 3D (m)", "nerf", "max 0.15", "max 0.25")
    ]
    assert "Findings that changed since tower-r1: none, as printed." in told(blocks)


def test_a_limit_that_was_added_or_taken_away_is_a_setting(limited, revised):
    def swap(results):
        results["criteria"][0] |= {"quantity": "loocv.rmse_m"}

    label, dash = "RMSE at the control picks, 3D (m)", "\N{EN DASH}"
    assert rows_of(revised(swap, limited)[:1]) == [
        ("Limit: Leave-one-out RMSE, 3D (m)", "nerf", dash, "max 0.15"),
        (f"Limit: {label}", "nerf", "max 0.15", dash),
    ]


def test_criteria_of_one_quantity_are_kept_apart_by_what_they_are_about(make_evidence, revised):
    rows = [
        {"quantity": "alignment.rmse_m", "of": name, "limit": "max 0.15", "found": 0.137}
        | {"margin": 0.013, "met": True, "source": ""}
        for name in ("nerf", "sfm")
    ]
    before = make_evidence("paper").results | {"criteria": rows}

    def change(results):
        del results["criteria"][0]

    label = "Criterion: RMSE at the control picks, 3D (m)"
    assert rows_of(revised(change, before)[1:]) == [
        (label, "nerf", "max 0.15: 0.137, met", "\N{EN DASH}")
    ]


def test_an_input_that_was_replaced_is_one_row(revised):
    def change(results):
        results["inputs"][0] |= {"sha256": "cd" * 32, "points": 400000, "bytes": 99}
        results["environment"]["trigpoint"] = "0.2.0"

    assert rows_of(revised(change, "paper")) == [
        (
            "Input: neural",
            "nerf",
            "nerf.ply, 12,345,678 bytes, 500,000 points, SHA-256 abababababababab…",
            "nerf.ply, 99 bytes, 400,000 points, SHA-256 cdcdcdcdcdcdcdcd…",
        ),
        ("Version", "trigpoint", "0.1.0", "0.2.0"),
    ]


def test_a_reconstruction_that_was_added_or_taken_away_breaks_nothing(revised):
    def take(results):
        del results["reconstructions"]["sfm"]

    def add(results):
        results["reconstructions"]["other"] = results["reconstructions"]["nerf"]

    assert rows_of(revised(take, "paper")) == []
    assert ("Scale", "other", "\N{EN DASH}", "3.260000") in rows_of(revised(add, "paper"))


def test_a_revision_that_changes_everything_stays_within_a_page_or_two(revised):
    def change(results):
        results["environment"] = {f"package-{k}": "1" for k in range(200)}

    (table,) = [block for block in revised(change) if isinstance(block, Table)]
    assert len(table.rows) == MOST
    assert f"The first {MOST} of 202." in table.note


@pytest.mark.parametrize("case", ["hostile", "hollow", "few", "unpicked"])
def test_every_case_can_be_told_against_another(case, make_evidence, revised):
    other = copy.deepcopy(make_evidence(case).results)

    def change(results):
        results |= copy.deepcopy(other)
        results["project"]["revision"] = 2

    for block in revised(change):
        html = to_html(block)
        assert "<script>" not in html
        assert "nan" not in html


def test_the_versions_that_made_the_report_are_told_from_the_lock(make_evidence):
    evidence = make_evidence("paper")

    def rows():
        return [tuple(str(cell) for cell in row) for row in provenance(evidence)[0].rows]

    assert not any("weasyprint" in row for row in rows())
    (evidence.folder / "env").mkdir()
    lock = "jinja2==3.1.6\nnumpy==2.0.0\nvtk==9.4.2\nweasyprint==70.0\n"
    (evidence.folder / "env" / "requirements.lock").write_text(lock, "utf-8")
    (evidence.folder / "env" / "source.txt").write_text("commit abc, without local changes\n")
    assert rows()[-4:] == [
        ("jinja2", "3.1.6"),
        ("vtk", "9.4.2"),
        ("weasyprint", "70.0"),
        ("source in git", "commit abc, without local changes"),
    ]


@pytest.fixture
def second(make_evidence):
    """Return revision 2, and revision 1 as `change` makes it, told against each other."""

    def make(change, case="paper"):
        evidence = make_evidence(case)
        before = copy.deepcopy(evidence.results)
        change(before)
        evidence.results["project"]["revision"] = 2
        stored = {"against": "tower-r1", "changes": compare_results(before, evidence.results)}
        path = evidence.folder / "data" / "changes.json"
        path.write_text(to_json(stored), "utf-8")
        (evidence.folder / "report.html").write_text(
            "".join(to_html(block) for block in result(evidence)), "utf-8"
        )
        return evidence, path

    return make


def first_page_rows(evidence):
    (block,) = [each for each in result(evidence) if getattr(each, "caption", "") == "This report"]
    return dict(block.rows)


def test_the_first_page_names_what_it_replaces_and_the_verdict_of_that(second):
    def fail(results):
        results["verdict"] = "FAIL"
        results["project"]["status"] = "issued"

    evidence, path = second(fail)
    assert first_page_rows(evidence)["Replaces"] == "revision 1, issued, FAIL"
    path.write_text(to_json({"against": None, "changes": []}), "utf-8")
    assert first_page_rows(evidence)["Replaces"].startswith("not known: no earlier revision")
    path.unlink()
    assert first_page_rows(evidence)["Replaces"].startswith("not known")
    evidence.results["project"]["revision"] = 1
    assert "Replaces" not in first_page_rows(evidence)


@pytest.mark.parametrize(
    ("change", "ends"),
    [
        (lambda rows: rows[0].update(limit="max 0.1"), "FAIL; 1 limit changed since"),
        (lambda rows: rows.clear(), "FAIL; 1 limit changed since"),
        (lambda rows: rows.append(rows[0] | {"of": "sfm"}), "FAIL; 1 limit changed since"),
        (lambda rows: rows.insert(0, rows[0] | {"source": "4.1"}), "FAIL; 1 limit changed since"),
        (lambda rows: rows[0].update(limit="min 0.1"), "FAIL; 2 limits changed since"),
        (lambda rows: rows[0].update(found=0.2, met=False), "FAIL"),
    ],
)
def test_the_first_page_says_that_limits_changed_and_the_verifier_asks_for_it(
    change, ends, limited, second
):
    def earlier(results):
        results["verdict"] = "FAIL"
        results["criteria"] = copy.deepcopy(limited["criteria"])
        change(results["criteria"])

    evidence, _ = second(earlier, limited)
    assert first_page_rows(evidence)["Replaces"] == f"revision 1, draft, {ends}"
    assert checked(evidence) == []
    page = evidence.folder / "report.html"
    page.write_text(page.read_text("utf-8").replace(" changed since", ""), "utf-8")
    assert checked(evidence) == ["report.html says what it replaces"] * (";" in ends)


def checked(evidence):
    report = verify.Report()
    verify.check_changes(report, evidence.folder, evidence.results)
    return [row.quantity for row in report.differences]


def test_the_verifier_holds_what_changed_against_the_results_and_the_first_page(second):
    def fail(results):
        results["verdict"] = "FAIL"
        results["reconstructions"]["nerf"]["alignment"]["residuals"][0]["d_m"] = 0.5
        del results["reconstructions"]["nerf"]["alignment"]["residuals"][1]

    evidence, path = second(fail)
    assert checked(evidence) == []
    assert dict(verify.leaves(evidence.results)) == leaves(evidence.results)
    whole = path.read_text("utf-8")
    stored = json.loads(whole)
    assert verify.replaced(stored, evidence.results) == replaced(evidence)
    path.write_text(whole.replace('"FAIL"', '"PASS"'), "utf-8")
    assert checked(evidence) == ["report.html says what it replaces"]
    stored["changes"][-1]["after"] = 7
    path.write_text(json.dumps(stored), "utf-8")
    assert checked(evidence) == [
        "data/changes.json: of what changed, all is in results.json as it is after"
    ]
    path.unlink()
    assert checked(evidence) == ["data/changes.json is there"]


def test_doubts_in_another_order_are_the_same_doubts(make_evidence, revised):
    codes = ("picks_few", "grid_scale")
    before = make_evidence("paper").results
    before["warnings"] = [{"code": code, "message": code} for code in codes]

    def change(results):
        results["warnings"][0]["message"] = "nerf: picks_few"

    assert rows_of(revised(change, before)) == []
