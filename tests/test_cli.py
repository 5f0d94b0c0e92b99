import json
import os
import subprocess
import sys
import time
from dataclasses import replace

import numpy as np
import pytest
from rich.console import Console

import trigpoint
from trigpoint.picks import picks_from
from trigpoint.similarity import umeyama
from trigpoint_reporting import bundling, cli
from trigpoint_reporting import console as people


@pytest.fixture
def run(monkeypatch, capsys):
    """Run the command line in this process: exit code, standard output, standard error."""

    def call(*arguments):
        monkeypatch.setattr(sys, "argv", ["trigpoint", *map(str, arguments)])
        with pytest.raises(SystemExit) as stop:
            cli.main()
        captured = capsys.readouterr()
        return stop.value.code, captured.out, captured.err

    return call


@pytest.fixture
def without_report(monkeypatch):
    """Leave the report out, where the test is about what the audit does besides."""
    monkeypatch.setattr(bundling, "report", lambda *_: ())


@pytest.fixture
def small(small_project):
    path, _ = small_project()
    return path.parent


def test_version_is_printed(run):
    assert run("--version") == (0, f"trigpoint {trigpoint.__version__}\n", "")


def test_no_command_shows_the_commands(run):
    code, out, err = run()
    assert (code, out) == (2, "")
    lines = [line.split(None, 1) for line in err.splitlines()]
    for command in ("demo", "new", "info", "align", "compare", "apply", "audit", "verify"):
        told = [rest for first, *rest in filter(None, lines) if first == command]
        assert len(told) == 1
        assert told[0][0].rstrip().endswith(".")
        assert "..." not in told[0][0]


@pytest.mark.parametrize(
    ("command", "first"), [("audit", "no limit is missed"), ("verify", "everything holds")]
)
def test_the_help_says_what_an_exit_code_means(run, command, first):
    code, out, _ = run(command, "--help")
    said = " ".join(out.split())
    assert code == 0
    assert f"Exit code 0: {first}. 1: " in said
    assert "2: it could not be done." in said


def test_new_lays_out_a_project_that_can_be_read(run, tmp_path):
    code, out, _ = run("new", tmp_path / "site")
    assert code == 0
    assert out.splitlines() == [
        str(tmp_path / "site" / name) for name in ("project.toml", "picks.csv")
    ]
    assert trigpoint.read_project(tmp_path / "site").about.id == "site"
    assert len(trigpoint.read_picks(tmp_path / "site" / "picks.csv")) == 0
    _, out, _ = run("new", tmp_path / "other", "--json")
    assert json.loads(out)["written"][0] == str(tmp_path / "other" / "project.toml")


@pytest.mark.parametrize(
    ("folder", "name"),
    [("Maria-Laach 2", "Maria-Laach-2"), (".kirche", "kirche"), ("教会", "my-building")],
)
def test_a_new_project_is_named_after_its_folder(run, tmp_path, folder, name):
    run("new", tmp_path / folder)
    assert trigpoint.read_project(tmp_path / folder).about.id == name


def test_new_overwrites_nothing(run, tmp_path):
    run("new", tmp_path)
    code, out, err = run("new", tmp_path)
    assert (code, out) == (2, "")
    assert "already there" in err


def test_info_takes_the_empty_picks_of_a_new_project(run, tmp_path):
    run("new", tmp_path / "site")
    code, out, _ = run("info", tmp_path / "site" / "picks.csv", "--json")
    found = json.loads(out)
    assert (code, found["picks"], found["target_low_m"]) == (0, 0, None)


def test_apply_doubts_a_cloud_that_is_in_the_frame_already(run, small, tmp_path):
    run("align", small / "picks.csv", "--crs", "EPSG:32615", "--out", tmp_path / "s.json")
    for name, doubted in (("nerf.ply", False), ("lidar.laz", True)):
        there = tmp_path / "there.laz"
        code, out, _ = run("apply", tmp_path / "s.json", small / name, there, "--json")
        codes = [each["code"] for each in json.loads(out)["warnings"]]
        assert (code, "crs_doubtful" in codes) == (0, doubted)


def test_info_tells_clouds_from_picks(run, small):
    cloud = json.loads(run("info", small / "lidar.laz", "--json")[1])
    assert (cloud["kind"], cloud["points"], cloud["crs_code"]) == ("cloud", 6000, "EPSG:32615")
    assert "vertical_datum_unknown" in [each["code"] for each in cloud["warnings"]]
    picks = json.loads(run("info", small / "picks.csv", "--json")[1])
    assert (picks["kind"], picks["control"], picks["check"]) == ("picks", 6, 2)
    code, out, _ = run("info", small / "nerf.ply")
    assert code == 0
    assert "8,000" in out


def test_align_prints_one_json_object_and_writes_the_similarity(run, small, tmp_path):
    code, out, err = run(
        "align", small / "picks.csv", "--crs", "EPSG:32615", "--out", tmp_path / "s.json", "--json"
    )
    assert (code, err) == (0, "")
    printed = json.loads(out)
    assert set(printed) == {"alignment", "loocv", "checks", "reliability", "warnings"}
    written = json.loads((tmp_path / "s.json").read_text("utf-8"))
    assert written == {**printed["alignment"], "crs": "EPSG:32615"}
    picks = trigpoint.read_picks(small / "picks.csv").control
    np.testing.assert_allclose(
        written["matrix"], umeyama(picks.source, picks.target).matrix, rtol=1e-11
    )


@pytest.mark.parametrize(
    ("arguments", "code", "words"),
    [
        (["align", "nowhere.csv"], "picks", "can't be read"),
        (["align", "PICKS", "--method", "magic"], "usage", "magic"),
        (["align", "PICKS", "--threshold", "0"], "setting", "above zero"),
        (["align", "PICKS", "--trials", "0"], "usage", "trials"),
        (["align", "PICKS", "--weighted"], "picks", "sigma"),
        (["align", "PICKS", "--crs", "EPSG:999999"], "crs", "999999"),
        (["align", "PICKS", "--crs", "EPSG:4326"], "crs", "degree"),
        (["align", "PICKS", "--threshold", "0.0001"], "no_consensus", "agree"),
        (["compare", "PICKS", "LIDAR"], "cloud", "not a point cloud"),
        (["compare", "LIDAR", "LIDAR", "--zones", "a,b"], "region", "must be a number"),
        (["compare", "LIDAR", "LIDAR", "--zones", "0.66,0.33"], "region", "ascend"),
        (["compare", "LIDAR", "LIDAR", "--margin", "-1"], "region", "margin"),
        (["compare", "LIDAR", "LIDAR", "--within", "0"], "region", "above zero"),
        (["apply", "PICKS", "LIDAR", "OUT"], "similarity", "similarity"),
        (["audit", "nowhere.toml"], "project", "can't be read"),
        (["frobnicate"], "usage", "frobnicate"),
        (["info", "nowhere.laz"], "cloud", "no such file"),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, list) else None,
)
def test_bad_input_is_exit_2_and_one_line_or_one_json_object(run, small, arguments, code, words):
    names = {"PICKS": small / "picks.csv", "LIDAR": small / "lidar.laz", "OUT": small / "out.laz"}
    arguments = [names.get(each, each) for each in arguments]
    before = sorted(small.rglob("*"))
    status, out, err = run(*arguments)
    assert (status, out) == (2, "")
    assert err.splitlines()[-1].startswith("trigpoint: ")
    assert words in err.splitlines()[-1]
    assert "Traceback" not in err
    status, out, _ = run(*arguments, "--json")
    error = json.loads(out)["error"]
    assert (status, error["code"]) == (2, code)
    assert words in error["message"]
    assert sorted(small.rglob("*")) == before


def test_a_refused_geometry_is_exit_2(run, tmp_path):
    rows = [f"p{i},{0.4 * i},{0.9 * i},{0.2 * i},{1.3 * i},{2.9 * i},{0.6 * i}" for i in range(6)]
    path = tmp_path / "line.csv"
    path.write_text("id,source_x,source_y,source_z,target_x,target_y,target_z\n" + "\n".join(rows))
    code, out, err = run("align", path)
    assert (code, out) == (2, "")
    assert "on a line" in err


def test_compare_prints_the_contract_and_zero_for_itself(run, small):
    printed = json.loads(run("compare", small / "lidar.laz", small / "lidar.laz", "--json")[1])
    assert set(printed) == {"accuracy", "completeness", "counts", "icp", "warnings"}
    assert printed["accuracy"]["all"]["rmse_m"] == 0
    assert printed["completeness"]["upper"]["within"][1]["pct"] == 100
    assert printed["icp"] is None


@pytest.mark.parametrize("columns", [60, 80, 100, 200])
def test_no_number_is_shortened_on_a_narrow_terminal(run, small, monkeypatch, columns):
    monkeypatch.setenv("COLUMNS", str(columns))
    _, out, _ = run("align", small / "picks.csv")
    assert "…" not in out
    assert max(map(len, out.splitlines())) <= columns
    found = json.loads(run("align", small / "picks.csv", "--json")[1])
    for pick in found["reliability"]["picks"]:
        assert f"{pick['detectable_blunder_m']:.2f}" in out
    for pick in found["alignment"]["residuals"]:
        assert sum(line.split()[:1] == [pick["id"]] for line in out.splitlines()) >= 1


def test_of_many_picks_the_worst_are_printed_and_where_all_are(run, tmp_path, capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "200")  # no line of it is to be broken
    rng = np.random.default_rng(5)
    source = rng.uniform(0, 20, (1240, 3))
    roles = ["control"] * 1180 + ["check"] * 60
    picks = picks_from(
        [f"p{i}" for i in range(1240)],
        source,
        3 * source + rng.normal(0, 0.05, source.shape),
        roles=roles,
    )
    trigpoint.write_picks(tmp_path / "picks.csv", picks)
    arguments = ("align", tmp_path / "picks.csv", "--threshold", 0.15)
    printed = json.loads(run(*arguments, "--json")[1])
    assert len(printed["alignment"]["residuals"]) == 1180
    out = run(*arguments)[1]
    named = [line.split()[0] for line in out.splitlines() if line.strip().startswith("p")]
    wanted = [
        row["id"]
        for part in ("alignment", "checks")
        for row in sorted(printed[part]["residuals"], key=lambda row: -row["d_m"])[:20]
    ]
    assert [name for name in named if name != "pick"] == wanted
    assert "The 20 largest residuals; 1,160 picks more are in --json." in out
    assert "The 20 largest residuals; 40 picks more are in --json." in out
    people.show_alignment(Console(width=200), printed, name="nerf")
    assert "1,160 picks more are in data/picks-nerf.csv." in capsys.readouterr().out


@pytest.mark.parametrize("option", [[], ["--icp"]])
def test_compare_says_of_which_pose_its_numbers_are(run, small, option):
    _, out, _ = run("compare", small / "sfm.laz", small / "lidar.laz", "--voxel", 0, *option)
    for direction in ("Accuracy", "Completeness"):
        assert (f"{direction} after ICP: " in out) == bool(option)


def test_compare_refuses_a_cloud_that_is_nowhere_near(run, small):
    clouds = small / "nerf.ply", small / "lidar.laz"
    code, out, err = run("compare", *clouds)
    assert (code, out) == (2, "")
    said = " ".join(err.split())
    assert "None of the 8,000 points of nerf.ply lies within 1.0 m of the reference's" in said
    lidar = trigpoint.describe(clouds[1])
    assert f"the reference {lidar.low[0]:,.1f} to {lidar.high[0]:,.1f} x " in said
    code, out, _ = run("compare", *clouds, "--json")
    assert (code, json.loads(out)["error"]["code"]) == (2, "region")
    (small / "away.csv").write_text("x,y,z\n741020,4279000,160\n741021,4279000,160\n")
    assert run("compare", small / "away.csv", small / "lidar.laz")[0] == 2
    wide = ("--margin", 20, "--json")  # all are misses then, which is measured
    code, out, _ = run("compare", small / "away.csv", small / "lidar.laz", *wide)
    assert code == 0
    assert json.loads(out)["completeness"]["all"]["within"][0]["pct"] == 0


def test_compare_with_icp_says_what_it_moved(run, small):
    code, out, _ = run(
        "compare", small / "sfm.laz", small / "lidar.laz", "--icp", "--voxel", "0", "--json"
    )
    printed = json.loads(out)
    assert code == 0
    assert printed["icp"]["shift_m"] < 0.1
    assert printed["icp"]["retained"] is False


def test_compare_prints_tables_for_people(run, small):
    code, out, err = run("compare", small / "sfm.laz", small / "lidar.laz", "--margin", "none")
    assert code == 0
    assert "Completeness" in out
    assert "reading" in err


def test_apply_there_and_back_is_the_same_cloud(run, small, tmp_path):
    run("align", small / "picks.csv", "--crs", "EPSG:32615", "--out", tmp_path / "s.json")
    there, back = tmp_path / "there.laz", tmp_path / "back.ply"
    code, out, _ = run("apply", tmp_path / "s.json", small / "nerf.ply", there, "--json")
    assert (code, json.loads(out)["points"]) == (0, 8000)
    assert trigpoint.describe(there).crs.to_epsg() == 32615
    assert run("apply", tmp_path / "s.json", there, back, "--inverse")[0] == 0
    one, other = trigpoint.read(small / "nerf.ply"), trigpoint.read(back)
    np.testing.assert_allclose(other.coordinates, one.coordinates, atol=1e-4)
    np.testing.assert_array_equal(other.attributes["red"], one.attributes["red"])


def test_audit_prints_its_results_and_where_they_lie(run, small, monkeypatch):
    monkeypatch.setenv("COLUMNS", "200")
    code, out, err = run("audit", small / "project.toml")
    assert code == 0
    assert "Verdict: NOT TESTED" in out
    stored = small / "audit" / "small-r1" / "data" / "results.json"
    (pair,) = json.loads(stored.read_text("utf-8"))["paired"]["delivered"]
    assert "nothing is said within 0.05, 0.1 and 0.2 m, not above the voxel" in pair["statement"]
    assert f"As delivered: {pair['statement']}" in out.replace("\n", " ")
    page = str(small / "audit" / "small-r1" / "report.html")
    assert out.replace("\n", "").endswith(f"Result: {page}")
    assert "putting rigid ICP on trial" in err


@pytest.mark.usefixtures("without_report")
def test_an_audit_that_misses_a_limit_is_exit_1_and_still_delivers(run, small_project, tmp_path):
    path, _ = small_project(
        extra='[[limit]]\nquantity = "loocv.rmse_m"\nof = "nerf"\nmax = 0.001\nsource = "b"\n'
    )
    code, out, _ = run("audit", path, "--out", tmp_path / "out", "--json")
    assert code == 1
    audits = json.loads(out)["audits"]
    assert audits[0]["results"]["verdict"] == "FAIL"
    assert (tmp_path / "out" / "small-r1" / "data" / "results.json").exists()


@pytest.mark.usefixtures("without_report")
def test_a_bundle_verifies_as_folder_and_as_zip_and_a_changed_one_does_not(run, small):
    assert run("audit", small / "project.toml")[0] == 0
    bundle = small / "audit" / "small-r1"
    for path in (bundle, bundle.with_name("small-r1.zip")):
        code, out, _ = run("verify", path, "--json")
        assert (code, json.loads(out)["verified"]) == (0, True)
    results = bundle / "data" / "results.json"
    results.write_text(results.read_text("utf-8").replace("NOT TESTED", "PASS"), "utf-8")
    code, out, _ = run("verify", bundle)
    assert code == 1
    assert "verdict" in out


@pytest.mark.usefixtures("without_report")
def test_several_projects_get_an_index_page(run, small_project, tmp_path):
    one, _ = small_project(folder=tmp_path / "one")
    other, _ = small_project(folder=tmp_path / "other")
    other.write_text(other.read_text("utf-8").replace('id = "small"', 'id = "second"'), "utf-8")
    assert run("audit", one, other, "--out", tmp_path / "out", "--json")[0] == 0
    page = (tmp_path / "out" / "index.html").read_text("utf-8")
    assert page.count("NOT TESTED") >= 2
    assert "second" in page


def test_projects_are_all_read_before_the_first_is_run(run, small_project, tmp_path):
    one, _ = small_project(folder=tmp_path / "one")
    other, _ = small_project(folder=tmp_path / "other")
    code, _, err = run("audit", one, other, "--out", tmp_path / "out")
    assert code == 2
    assert "Two projects would be written to" in err
    (tmp_path / "file").write_text("no folder")
    code, out, err = run("audit", one, "--out", tmp_path / "file" / "out")
    assert (code, out) == (2, "")
    assert "Nothing can be written to" in err
    assert "reading" not in err
    other.write_text("[project]", "utf-8")
    code, _, err = run("audit", one, other)
    assert code == 2
    assert f"{other}: " in " ".join(err.split())
    assert not (tmp_path / "out").exists()
    assert not (tmp_path / "one" / "audit").exists()


@pytest.mark.usefixtures("without_report")
def test_an_issued_bundle_that_lacks_only_its_zip_gets_it_and_is_not_made_again(run, small):
    project = small / "project.toml"
    issued = 'id = "small"\nstatus = "issued"\ndate = 2026-09-21'
    project.write_text(project.read_text("utf-8").replace('id = "small"', issued), "utf-8")
    code, out, _ = run("audit", project, "--json")
    (first,) = json.loads(out)["audits"]
    archive = small / "audit" / "small-r1.zip"
    whole = archive.read_bytes()
    archive.unlink()
    again = run("audit", project, "--json")
    assert (code, again[0]) == (0, 0)
    assert json.loads(again[1])["audits"] == [first]
    assert "reading" not in again[2]
    assert archive.read_bytes() == whole
    assert run("audit", project)[0] == 2


def test_output_that_nobody_reads_on_is_no_failed_limit(tmp_path):
    # 141 is what a shell reports of such programs; 1 would say that a limit failed.
    read, write = os.pipe()
    os.close(read)
    child = [sys.executable, "-m", "trigpoint_reporting", "new", str(tmp_path / "project")]
    with os.fdopen(write, "w") as closed:
        done = subprocess.run(child, stdout=closed, stderr=subprocess.PIPE, text=True)
    assert (done.returncode, done.stderr) == (141, "")


def test_info_says_of_a_format_that_holds_no_crs_that_there_is_none(run, tmp_path):
    (tmp_path / "points.xyz").write_text("1 2 3\n2 3 4\n")
    code, out, _ = run("info", tmp_path / "points.xyz", "--json")
    assert code == 0
    assert [warning["code"] for warning in json.loads(out)["warnings"]] == ["crs_missing"]


def test_apply_gives_each_point_its_sigma_on_request(run, small, tmp_path):
    _, out, _ = run("align", small / "picks.csv", "--crs", "EPSG:32615", "--json")
    (tmp_path / "worth.json").write_text(out, encoding="utf-8")
    there = tmp_path / "there.laz"
    assert run("apply", tmp_path / "worth.json", small / "nerf.ply", there, "--sigma")[0] == 0
    cloud = trigpoint.read(there)
    worth = trigpoint.align(trigpoint.read_picks(small / "picks.csv")).reliability
    sigmas = np.column_stack([cloud.attributes[name] for name in ("sigma_e", "sigma_n", "sigma_h")])
    np.testing.assert_allclose(sigmas, worth.sigma(cloud.coordinates), rtol=1e-3)
    assert "red" in cloud.attributes


def test_one_file_carries_a_cloud_with_its_crs_and_its_sigmas(run, small, tmp_path):
    path, there = tmp_path / "s.json", tmp_path / "there.laz"
    _, out, _ = run("align", small / "picks.csv", "--crs", "EPSG:32615", "--json")
    path.write_text(out, encoding="utf-8")
    assert run("apply", path, small / "nerf.ply", there, "--sigma")[0] == 0
    cloud = trigpoint.read(there)
    assert cloud.crs.to_epsg() == 32615
    assert "sigma_h" in cloud.attributes


@pytest.mark.parametrize("written", ["nerf.ply", "s.json"])
def test_apply_does_not_overwrite_what_it_reads(run, small, written):
    run("align", small / "picks.csv", "--out", small / "s.json")
    before = (small / written).read_bytes()
    code, _, err = run("apply", small / "s.json", small / "nerf.ply", small / written)
    assert code == 2
    assert "it would be overwritten" in err
    assert (small / written).read_bytes() == before


def test_align_does_not_overwrite_the_picks(run, small):
    before = (small / "picks.csv").read_bytes()
    assert run("align", small / "picks.csv", "--out", small / "picks.csv")[0] == 2
    assert (small / "picks.csv").read_bytes() == before


@pytest.mark.parametrize(
    ("stored", "more", "words"),
    [("s.json", [], "no covariance"), ("worth.json", ["--inverse"], "can't go with --inverse")],
)
def test_apply_refuses_sigmas_that_there_are_not(run, small, tmp_path, stored, more, words):
    _, out, _ = run("align", small / "picks.csv", "--out", tmp_path / "s.json", "--json")
    (tmp_path / "worth.json").write_text(out, encoding="utf-8")
    there = tmp_path / "there.laz"
    code, _, err = run("apply", tmp_path / stored, small / "nerf.ply", there, "--sigma", *more)
    assert (code, there.exists()) == (2, False)
    assert words in err


def test_picks_repeated_give_the_sigma_that_align_uses(run, small, tmp_path):
    picks = trigpoint.read_picks(small / "picks.csv")
    noise = np.random.default_rng(1).normal(0, 0.03, picks.target.shape)
    trigpoint.write_picks(tmp_path / "again.csv", replace(picks, target=picks.target + noise))
    arguments = ["align", small / "picks.csv", "--repeat", tmp_path / "again.csv"]
    worth = json.loads(run(*arguments, "--json")[1])["reliability"]
    (found,) = worth["repeats"]
    assert (found["frame"], found["places"], worth["noise"]) == ("target", 8, "stated")
    assert worth["sigma_m"] == pytest.approx(found["sigma"], abs=1e-9)
    assert "repeated in the target" in run(*arguments)[1]


def test_align_takes_less_than_a_second_once_it_is_loaded(run, small):
    start = time.process_time()
    assert run("align", small / "picks.csv")[0] == 0
    assert time.process_time() - start < 1


def test_what_rounds_to_nought_has_no_sign():
    assert people.number(-0.0004) == "0.000"
    assert people.number(-0.0006) == "-0.001"
