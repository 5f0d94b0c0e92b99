import json

import pytest

from trigpoint_reporting.manifest import BundleError
from trigpoint_reporting.revisions import compare_results, find_earlier, write_changes


def results(revision, **values):
    return {"project": {"id": "tower", "revision": revision}, **values}


def lay(folder, revision, stored):
    data = folder / f"tower-r{revision}" / "data"
    data.mkdir(parents=True)
    (data / "results.json").write_text(stored, "utf-8")


def test_equal_results_have_no_changes():
    one = results(1, rows=[{"id": "a", "d_m": 0.1}], mean_m=[1, 2])
    assert compare_results(one, json.loads(json.dumps(one))) == []


def test_rows_are_followed_by_their_id_and_not_by_their_place():
    before = {"picks": [{"id": "a", "d_m": 0.1}, {"id": "b", "d_m": 0.2}]}
    after = {"picks": [{"id": "b", "d_m": 0.2}, {"id": "a", "d_m": 0.3}]}
    assert compare_results(before, after) == [
        {"path": "picks[a].d_m", "kind": "changed", "before": 0.1, "after": 0.3}
    ]


def test_rows_of_one_name_are_followed_by_their_place():
    before = [{"zone": "all", "threshold_m": 0.1}, {"zone": "upper", "threshold_m": 0.1}]
    after = [before[0], {"zone": "upper", "threshold_m": 0.2}]
    assert compare_results({"rows": before}, {"rows": before}) == []
    paths = [row["path"] for row in compare_results({"rows": before}, {"rows": after})]
    # By threshold now: what was unnamed gets a name.
    assert len(paths) == 6
    unnamed = [{"a": 1}, {"a": 2}]
    rows = compare_results({"rows": unnamed}, {"rows": [{"a": 1}, {"a": 3}]})
    assert [row["path"] for row in rows] == ["rows[1].a"]


def test_what_was_added_and_what_is_null_differ():
    rows = compare_results({"a": None}, {"a": None, "b": None})
    assert rows == [{"path": "b", "kind": "added", "before": None, "after": None}]


def test_a_second_revision_lists_what_changed_since_the_latest_before_it(tmp_path):
    lay(tmp_path, 1, json.dumps(results(1, verdict="FAIL")))
    lay(tmp_path, 2, json.dumps(results(2, verdict="PASS")))
    path = tmp_path / "changes.json"
    write_changes(path, results(4, verdict="CONDITIONAL"), tmp_path)
    changes = json.loads(path.read_text("utf-8"))
    assert changes["against"] == "tower-r2"
    assert {row["path"]: (row["before"], row["after"]) for row in changes["changes"]} == {
        "project.revision": (2, 4),
        "verdict": ("PASS", "CONDITIONAL"),
    }
    assert find_earlier(tmp_path, "tower", 2).name == "tower-r1"


def test_a_first_revision_has_no_changes_and_a_lonely_one_says_so(tmp_path):
    path = tmp_path / "changes.json"
    write_changes(path, results(1), tmp_path)
    assert not path.exists()
    write_changes(path, results(3), tmp_path)
    assert json.loads(path.read_text("utf-8")) == {"against": None, "changes": []}


def test_an_earlier_revision_that_is_broken_is_named(tmp_path):
    lay(tmp_path, 1, "{")
    with pytest.raises(BundleError, match="tower-r1"):
        write_changes(tmp_path / "changes.json", results(2), tmp_path)
