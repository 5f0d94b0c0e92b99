import json
import shutil
import subprocess
import sys
import zipfile

import pytest
from bundles import sealed_bundle

import trigpoint
from trigpoint.delivery import archive_of, sha256
from trigpoint_reporting.manifest import MANIFEST, RECORD, BundleError, list_files, read_manifest
from trigpoint_reporting.quality import quality_report
from trigpoint_reporting.sealing import pack, pack_left, seal, verifier_source
from trigpoint_reporting.verifier.verify import look_up

BUILT = {}
ABOUT = (
    'surveyor = "Ann O\'Hara"\norganisation = "Surveys & Söhne"\ndate = 2026-09-21\n'
    'status = "issued"\n'
)


@pytest.fixture
def bundle(small_project, tmp_path, tmp_path_factory):
    """A sealed bundle of the small building, made once and copied for each test."""
    if not BUILT:
        path, _ = small_project(tmp_path_factory.mktemp("made") / "small")
        text = path.read_text("utf-8").replace("title =", f"{ABOUT}title =")
        path.write_text(text, "utf-8")

        def report(draft, _):
            (draft / "report.html").write_text("later", "utf-8")

        BUILT["folder"], BUILT["project"] = sealed_bundle(path, report), path
    copy = tmp_path / BUILT["folder"].name
    shutil.copytree(BUILT["folder"], copy)
    return copy


def graph_of(folder):
    crate = json.loads((folder / "ro-crate-metadata.json").read_text("utf-8"))
    return {each["@id"]: each for each in crate["@graph"]}


def test_the_manifest_lists_everything_and_the_record_what_came_before_the_report(bundle):
    listed, recorded = read_manifest(bundle / MANIFEST), read_manifest(bundle / RECORD)
    assert set(listed) == set(list_files(bundle)) - {MANIFEST}
    assert "report.html" not in recorded
    assert set(listed) - set(recorded) == {RECORD, "report.html", "ro-crate-metadata.json"}
    assert {name: listed[name] for name in recorded} == recorded


def test_the_correspondences_hold_every_bit_of_the_picks(bundle):
    picks = trigpoint.read_picks(BUILT["project"].parent / "picks.csv")
    again = trigpoint.read_picks(bundle / "data" / "correspondences-nerf.csv")
    assert again.ids == picks.ids
    assert (again.source == picks.source).all()
    assert (again.target == picks.target).all()
    assert again.roles.tolist() == picks.roles.tolist()


def test_a_reconstruction_without_picks_has_no_correspondences(bundle):
    assert not (bundle / "data" / "correspondences-sfm.csv").exists()


def test_the_bundle_carries_the_verifier_and_the_pick_file_as_they_are(bundle):
    assert (bundle / "verify" / "verify.py").read_bytes() == verifier_source()
    picks = BUILT["project"].parent / "picks.csv"
    assert (bundle / "config" / "picks-nerf.csv").read_bytes() == picks.read_bytes()


def test_sealing_again_changes_nothing(bundle):
    before = (bundle / MANIFEST).read_bytes()
    seal(bundle)
    assert (bundle / MANIFEST).read_bytes() == before


def test_the_same_audit_gives_the_same_bundle_and_zip_anywhere(bundle, tmp_path):
    code = (
        "import sys, trigpoint\n"
        "from trigpoint.bundle import bundle_folder, fill_bundle\n"
        "from trigpoint.delivery import whole_folder\n"
        "from trigpoint_reporting.sealing import pack, seal, write_record\n"
        "audit = trigpoint.audit(sys.argv[1])\n"
        "results = audit.results()\n"
        "folder = bundle_folder(audit.project)\n"
        "with whole_folder(folder) as draft:\n"
        "    fill_bundle(draft, audit, results)\n"
        "    write_record(draft, audit, results)\n"
        "    (draft / 'report.html').write_text('later')\n"
        "    seal(draft)\n"
        "pack(folder)\n"
    )
    elsewhere = tmp_path / "else where"
    shutil.copytree(
        BUILT["project"].parent, elsewhere, ignore=shutil.ignore_patterns("audit", "*.zip")
    )
    environment = {
        "OMP_NUM_THREADS": "1",
        "OPENBLAS_NUM_THREADS": "1",
        "TZ": "Asia/Kathmandu",
        "LC_ALL": "C",
    }
    subprocess.run(
        [sys.executable, "-c", code, elsewhere / "project.toml"], check=True, env=environment
    )
    twin = elsewhere / "audit" / bundle.name
    assert read_manifest(twin / MANIFEST) == read_manifest(bundle / MANIFEST)
    assert sha256(pack(bundle)) == sha256(twin.with_name(f"{twin.name}.zip"))


def test_a_zip_is_sorted_undated_and_ends_whole(bundle):
    path = pack(bundle)
    with zipfile.ZipFile(path) as archive:
        entries = archive.infolist()
        assert archive.testzip() is None
    names = [entry.filename for entry in entries]
    assert names == [f"{bundle.name}/{name}" for name in list_files(bundle)]
    assert {entry.date_time for entry in entries} == {(1980, 1, 1, 0, 0, 0)}
    assert {entry.external_attr >> 16 for entry in entries} == {0o100644}
    assert not list(bundle.parent.glob(".*"))


def test_an_issued_zip_is_never_overwritten_and_a_draft_is(bundle):
    path = pack(bundle)
    with pytest.raises(BundleError, match="never overwritten"):
        pack(bundle)
    results = bundle / "data" / "results.json"
    results.write_text(results.read_text("utf-8").replace('"issued"', '"draft"'), "utf-8")
    assert pack(bundle) == path


def test_an_issued_bundle_that_was_left_without_its_zip_gets_it_and_no_other_does(bundle):
    whole = pack(bundle).read_bytes()
    assert pack_left(bundle) is None  # it has one
    path = archive_of(bundle)
    path.unlink()
    assert pack_left(bundle) == path
    assert path.read_bytes() == whole
    assert pack_left(bundle.parent / "none-r1") is None
    path.unlink()
    results = bundle / "data" / "results.json"
    results.write_text(results.read_text("utf-8").replace('"issued"', '"draft"'), "utf-8")
    assert pack_left(bundle) is None  # a draft is made again


@pytest.mark.parametrize("act", ["change", "remove", "add", "unseal"])
def test_an_issued_bundle_that_was_changed_gets_no_zip(bundle, act):
    target = bundle / ("note.txt" if act == "add" else "report.html")
    if act == "unseal":
        (bundle / MANIFEST).unlink()
    elif act == "remove":
        target.unlink()
    else:
        target.write_text("another", "utf-8")
    with pytest.raises(BundleError, match=MANIFEST if act == "unseal" else target.name):
        pack_left(bundle)
    assert not archive_of(bundle).exists()


def test_no_path_user_or_time_of_the_machine_is_in_it(bundle):
    made_in = str(BUILT["project"].parent.parent).encode()
    for name in list_files(bundle):
        content = (bundle / name).read_bytes()
        assert made_in not in content, name
        assert b"/home/" not in content, name


def test_the_crate_is_a_process_run_with_every_file_and_input(bundle):
    graph = graph_of(bundle)
    root = graph["./"]
    assert root["conformsTo"] == {"@id": "https://w3id.org/ro/wfrun/process/0.5"}
    assert root["datePublished"] == "2026-09-21"
    listed = read_manifest(bundle / MANIFEST)
    parts = {each["@id"] for each in root["hasPart"]}
    assert parts == (set(listed) - {"ro-crate-metadata.json"}) | {MANIFEST}
    for name in parts - {MANIFEST}:
        assert graph[name]["sha256"] == listed[name]
        assert int(graph[name]["contentSize"]) == (bundle / name).stat().st_size
    action = graph["#audit"]
    assert action["instrument"] == {"@id": "#trigpoint"}
    assert action["agent"] == {"@id": "#surveyor"}
    assert graph["#surveyor"]["affiliation"] == {"@id": "#organisation"}
    read = {graph[each["@id"]]["name"] for each in action["object"]}
    assert read == {
        "lidar.laz",
        "nerf.ply",
        "sfm.laz",
        "config/picks-nerf.csv",
        "config/project.toml",
    }
    assert graph["#picking-1"]["result"] == {"@id": "config/picks-nerf.csv"}
    mentioned = {each["@id"] for each in root["mentions"]}
    assert mentioned == {"#audit", "#picking-1"}


def test_every_reference_in_the_crate_is_described_in_it(bundle):
    graph = graph_of(bundle)
    outside = {"https://w3id.org/ro/crate/1.1", "http://schema.org/CompletedActionStatus"}

    def references(value):
        if isinstance(value, dict):
            if set(value) == {"@id"}:
                yield value["@id"]
            for item in value.values():
                yield from references(item)
        elif isinstance(value, list):
            for item in value:
                yield from references(item)

    named = {name for entity in graph.values() for name in references(list(entity.values()))}
    assert named - outside <= set(graph)


def test_a_draft_without_a_date_has_none(bundle):
    results = bundle / "data" / "results.json"
    results.write_text(results.read_text("utf-8").replace('"2026-09-21"', "null"), "utf-8")
    seal(bundle)
    text = (bundle / "ro-crate-metadata.json").read_text("utf-8")
    assert "datePublished" not in text
    assert "endTime" not in text


def test_every_quality_element_is_a_number_of_results_json(bundle):
    results = json.loads((bundle / "data" / "results.json").read_text("utf-8"))
    quality = json.loads((bundle / "quality" / "iso19157.json").read_text("utf-8"))
    assert [scope["scope"]["name"] for scope in quality["reports"]] == ["nerf", "sfm"]
    elements = [each for scope in quality["reports"] for each in scope["elements"]]
    assert {each["element"] for each in elements} == {
        "absolute external positional accuracy",
        "completeness: omission",
        "completeness: commission",
    }
    for each in elements:
        path, value = each["result"]["path"], each["result"]["value"]
        stored = look_up(results, path.removeprefix("100 - "))
        expected = 100 - stored if path.startswith("100 - ") else stored
        assert value == pytest.approx(expected, abs=1e-11)
    independent = [each for each in elements if "check picks" in each["measure"]["name"]]
    assert len(independent) == 1
    assert independent[0]["evaluationMethod"]["type"] == "direct external"


def test_a_threshold_that_reads_like_a_position_is_not_taken_for_one(bundle):
    results = json.loads((bundle / "data" / "results.json").read_text("utf-8"))
    for found in results["reconstructions"].values():
        for direction in ("accuracy", "completeness"):
            within = found["comparison"]["delivered"][direction]["all"]["within"]
            for share, threshold, pct in zip(within, (0.5, 1.0, 2.0), (40, 60, 80), strict=True):
                share |= {"threshold_m": threshold, "pct": pct}
    checked = 0
    for scope in quality_report(results)["reports"]:
        for each in scope["elements"]:
            path, value = each["result"].get("path", ""), each["result"].get("value")
            if path.startswith("100 - "):
                assert 100 - look_up(results, path.removeprefix("100 - ")) == value
                checked += 1
    assert checked == 12
