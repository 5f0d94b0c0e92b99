"""The tamper suite: every act is caught, and what was touched is named."""

import base64
import json
import shutil
import zipfile
import zlib
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from bundles import sealed_bundle

import trigpoint
from trigpoint import pairing
from trigpoint.delivery import sha256
from trigpoint_reporting import verification
from trigpoint_reporting.blocks import Passage, Picture, Table, Value
from trigpoint_reporting.manifest import MANIFEST, RECORD, BundleError, hash_files, record_hash
from trigpoint_reporting.manifest import write_manifest as write_hashes
from trigpoint_reporting.numbers import Numbers
from trigpoint_reporting.render import to_html
from trigpoint_reporting.sealing import pack, seal, verifier_source
from trigpoint_reporting.verification import verify
from trigpoint_reporting.verifier import verify as verifier

LIMITS = (
    '[[limit]]\nquantity = "loocv.rmse_m"\nof = "nerf"\nmax = 0.2\nsource = "brief, clause 4"\n'
    '[[cross_check]]\nkind = "scale_bar"\nfrom = [0, 0, 0]\nto = [1, 0, 0]\n'
    'length_m = 3.26\nsigma_m = 0.01\nof = "nerf"\n'
    '[[cross_check]]\nkind = "up_direction"\nup = [0.1, -0.8, 0.6]\nsigma_deg = 0.2\n'
    '[[cross_check]]\nkind = "camera_positions"\nsource = [[0, 0, 9], [3, 1, 4]]\n'
    "target_m = [[741010, 4279010, 180], [741000, 4279000, 170]]\nsigma_m = 0.02\n"
)
LIMITATIONS = "Only the façade was seen; “upper” parts are <extrapolated>."
DOT = base64.b64decode(
    "iVBORw0KGgoAAAANSUhEUgAAAAEAAAABCAAAAAA6fptVAAAACklEQVR4nGNgAAAAAgABSK+kcQAAAABJRU5ErkJggg=="
)


def page(results, record):
    """A short report of its own, so that what is verified does not hang on how reports look."""
    nerf = results["reconstructions"]["nerf"]
    at = "reconstructions.nerf"
    minus = str(np.round(nerf["alignment"]["residuals"][0]["dx_m"], 3)).replace("-", "\u2212")
    blocks = [
        Passage([f"{results['project']['title']}: ", Value(results["verdict"], "verdict")]),
        Table(
            "Picks",
            ("what", "value"),
            [
                ("fit", Value(f"{nerf['alignment']['rmse_m']:.3f}", f"{at}.alignment.rmse_m")),
                ("loocv", Value(f"{nerf['loocv']['rmse_m']:.3f}", f"{at}.loocv.rmse_m")),
                (
                    "dx",
                    Value(
                        f"{float(minus.replace(chr(0x2212), '-')):.3f}".replace("-", "\u2212"),
                        f"{at}.alignment.residuals.0.dx_m",
                    ),
                ),
                ("none", Value("not available", "project.date")),
            ],
        ),
        Passage([results["project"]["limitations"]]),
        Picture("dot", "A dot.", "One dot, black.", DOT, "png"),
    ]
    shown = [to_html(block) for block in blocks]
    html = f"<!doctype html><html><body>{''.join(shown)}<p>record {record}</p></body></html>"
    cells = [{"cell_type": "code", "outputs": [{"data": {"text/html": each}}]} for each in shown]
    return html, json.dumps({"cells": cells})


BUILT = {}


@pytest.fixture(autouse=True)
def _short_page(monkeypatch):
    """Leave the report out: here it is a short one; tests/test_report.py has whole ones."""
    for name in ("_check_page", "_check_report"):
        monkeypatch.setattr(verification, name, lambda *_: None)


@pytest.fixture
def bundle(small_project, tmp_path, tmp_path_factory):
    """A sealed bundle with a report, made once and copied for each test."""
    if not BUILT:
        path, _ = small_project(tmp_path_factory.mktemp("made") / "small", extra=LIMITS)
        text = path.read_text("utf-8").replace(
            'title = "<script>"', f"title = \"<script>\"\nlimitations = '{LIMITATIONS}'"
        )
        text = text.replace(
            'picks = "picks.csv"', 'picks = "picks.csv"\npicks_repeated = ["again.csv"]'
        )
        path.write_text(text, "utf-8")
        picks = trigpoint.read_picks(path.with_name("picks.csv"))
        noise = np.random.default_rng(5).normal(0, 0.02, picks.target.shape)
        again = replace(picks, target=picks.target + noise)
        trigpoint.write_picks(path.with_name("again.csv"), again)

        def report(draft, results):
            html, notebook = page(results, record_hash(draft))
            (draft / "report.html").write_text(html, "utf-8")
            (draft / "audit.ipynb").write_text(notebook, "utf-8")
            (draft / "figures").mkdir()
            (draft / "figures" / "dot.png").write_bytes(DOT)

        BUILT["folder"], BUILT["inputs"] = sealed_bundle(path, report), path.parent
    copy = tmp_path / BUILT["folder"].name
    shutil.copytree(BUILT["folder"], copy)
    return copy


def rehash(folder, *, record=True):
    """Make every manifest fit again, as who tampers with care would."""
    if record:
        kept = set((folder / RECORD).read_text("utf-8").split()[1::2])
        hashes = {name: digest for name, digest in hash_files(folder).items() if name in kept}
        write_hashes(folder / RECORD, hashes)
    seal(folder)


def differing(folder, **settings):
    found = verify(folder, **settings)
    assert not found.holds
    return [row.quantity for row in found.report.differences]


def edit(path, before, after):
    text = path.read_text("utf-8")
    assert before in text
    path.write_text(text.replace(before, after, 1), "utf-8")


def edit_results(folder, change):
    path = folder / "data" / "results.json"
    results = json.loads(path.read_text("utf-8"))
    change(results)
    path.write_text(json.dumps(results, indent=1, ensure_ascii=False) + "\n", "utf-8")


def test_an_untouched_bundle_holds_as_folder_and_as_zip(bundle):
    found = verify(bundle)
    assert found.report.differences == []
    assert found.holds
    assert found.results()["checks"] > 300
    assert verify(pack(bundle)).holds


def test_what_was_not_recomputed_is_said(bundle):
    text = verify(bundle).text()
    assert "hashed, not recomputed" in text
    assert "resampled (Monte Carlo)" in text
    assert record_hash(bundle) in text


def test_a_changed_byte_is_named_by_its_file(bundle):
    path = bundle / "clouds" / "nerf-accuracy.laz"
    content = bytearray(path.read_bytes())
    content[-1] ^= 1
    path.write_bytes(content)
    assert f"{MANIFEST}: clouds/nerf-accuracy.laz" in differing(bundle)


def test_a_missing_file_and_a_file_too_many_are_named(bundle):
    (bundle / "env" / "platform.json").unlink()
    (bundle / "data" / "extra.csv").write_text("x\n")
    names = differing(bundle)
    assert f"{MANIFEST}: env/platform.json" in names
    assert f"{MANIFEST}: data/extra.csv is listed" in names


def test_trap_one_digit_in_the_html(bundle):
    rmse = json.loads((bundle / "data/results.json").read_text("utf-8"))["reconstructions"]["nerf"][
        "loocv"
    ]["rmse_m"]
    edit(bundle / "report.html", f">{rmse:.3f}<", f">{rmse + 0.001:.3f}<")
    rehash(bundle)
    names = differing(bundle)
    assert "report.html: reconstructions.nerf.loocv.rmse_m" in names
    assert "report.html prints output 2 of audit.ipynb as it is" in names


def test_a_difference_that_shows_in_many_places_is_told_once(bundle):
    def change(results):
        results["reconstructions"]["nerf"]["alignment"]["rmse_m"] += 0.01

    edit_results(bundle, change)
    found = verify(bundle)
    lines = [line for line in found.text().splitlines() if line.startswith("DIFFERS")]
    assert len(lines) == len(set(lines)) <= len(found.report.differences)
    assert any(
        line.startswith("DIFFERS  reconstructions.nerf.alignment.rmse_m: stored 0.")
        for line in lines
    )


def test_trap_one_digit_in_the_notebook(bundle):
    at = "reconstructions.nerf.loocv.rmse_m"
    edit(bundle / "audit.ipynb", f'{at}\\">0.0', f'{at}\\">0.1')
    rehash(bundle)
    assert f"audit.ipynb: {at}" in differing(bundle)


def test_trap_a_number_hidden_behind_the_printed_one(bundle):
    edit(bundle / "report.html", 'value="0.0', 'value="0.1')
    rehash(bundle)
    assert any(name.endswith("its value attribute") for name in differing(bundle))


def test_trap_one_digit_in_results_json(bundle):
    def change(results):
        results["reconstructions"]["nerf"]["alignment"]["rmse_m"] += 1e-6

    edit_results(bundle, change)
    rehash(bundle)
    assert "reconstructions.nerf.alignment.rmse_m" in differing(bundle)


def test_trap_one_digit_in_a_table(bundle):
    path = bundle / "data" / "zones-nerf.csv"
    cell = path.read_text("utf-8").splitlines()[2].split(",")[6]
    edit(path, cell, f"{float(cell) + 1e-6:.9f}")
    rehash(bundle)
    assert "data/zones-nerf.csv agrees with results.json" in differing(bundle)


def test_trap_one_pick_moved(bundle):
    path = bundle / "data" / "correspondences-nerf.csv"
    cell = path.read_text("utf-8").splitlines()[1].split(",")[5]
    edit(path, cell, repr(float(cell) + 0.01))
    rehash(bundle)
    names = differing(bundle)
    assert "reconstructions.nerf.alignment.rmse_m" in names
    assert "reconstructions.nerf.reliability.sigma0_m" in names


def test_trap_picks_repeated_closer_than_they_were(bundle):
    path = bundle / "data" / "repeats-nerf.csv"
    rows = path.read_text("utf-8").splitlines()
    first = next(row for row in rows if row.startswith("target,1,"))
    place = first.split(",", 3)[2]
    again = next(row for row in rows if row.startswith(f"target,2,{place},"))
    edit(path, again, first.replace("target,1,", "target,2,"))
    rehash(bundle)
    found = differing(bundle)
    assert "reconstructions.nerf.reliability.repeats[target].sigma" in found
    assert "reconstructions.nerf.reliability.repeats[target].bias_p_value" in found


def test_trap_another_first_session_than_the_picks_that_were_fitted(bundle):
    path = bundle / "data" / "repeats-nerf.csv"
    row = path.read_text("utf-8").splitlines()[1]
    edit(path, row, row[:-1] + ("1" if row[-1] != "1" else "2"))
    rehash(bundle)
    frame = row.split(",")[0]
    where = f"reconstructions.nerf.reliability.repeats[{frame}]"
    assert f"{where}: the first session is what was fitted" in differing(bundle)


def test_trap_swapped_matrix_rows(bundle):
    path = bundle / "transform" / "nerf_matrix.txt"
    rows = path.read_text("utf-8").splitlines()
    rows[0], rows[1] = rows[1], rows[0]
    path.write_text("\n".join(rows) + "\n", "utf-8")
    rehash(bundle)
    names = differing(bundle)
    assert "transform/nerf_matrix.txt row 1" in names
    assert "transform/nerf_matrix.txt row 2" in names


def test_trap_replaced_figure(bundle):
    (bundle / "figures" / "dot.png").write_bytes(DOT[:-1] + b"x")
    rehash(bundle)
    assert "figures/dot.png is the picture in report.html" in differing(bundle)


def test_trap_removed_limitations(bundle):
    for name in ("report.html", "audit.ipynb"):
        text = (bundle / name).read_text("utf-8")
        start = text.index("Only the fa")
        (bundle / name).write_text(text[:start] + text[text.index("</p>", start) :], "utf-8")
    rehash(bundle)
    assert "report.html prints the project's limitations" in differing(bundle)


def test_trap_removed_limitations_in_the_results_too(bundle):
    edit_results(bundle, lambda results: results["project"].update(limitations=""))
    rehash(bundle)
    assert "project.limitations" in differing(bundle)


def test_trap_another_input_of_the_same_name(bundle, tmp_path):
    inputs = tmp_path / "inputs"
    shutil.copytree(BUILT["inputs"], inputs, ignore=shutil.ignore_patterns("audit"))
    assert verify(bundle, inputs=inputs).holds
    shutil.copyfile(inputs / "sfm.laz", inputs / "lidar.laz")
    assert differing(bundle, inputs=inputs) == ["inputs: lidar.laz is the file that was audited"]


def test_trap_a_zip_made_anew_with_a_new_manifest_and_the_old_date(bundle):
    edit(bundle / "quality" / "iso19157.json", "direct external", "direct internal")
    rehash(bundle)
    path = pack(bundle)
    with zipfile.ZipFile(path) as archive:
        assert {entry.date_time[0] for entry in archive.infolist()} == {1980}
    # Every hash fits again, but the report states the record that it was written from.
    assert differing(path) == ["report.html states the record's hash"]


def test_trap_the_verdict_alone(bundle):
    for name in ("report.html", "audit.ipynb"):
        edit(bundle / name, ">CONDITIONAL<", ">PASS<")
    rehash(bundle)
    assert "report.html: verdict" in differing(bundle)
    edit_results(bundle, lambda results: results.update(verdict="PASS"))
    rehash(bundle)
    assert "verdict" in differing(bundle)


def test_trap_a_wider_limit(bundle):
    def change(results):
        results["criteria"][0].update(limit="max 2", margin=1.9)

    edit_results(bundle, change)
    rehash(bundle)
    names = differing(bundle)
    assert "criteria[0].limit" in names
    assert "criteria[0].margin" in names


def test_trap_a_suppressed_rejection(bundle):
    def change(results):
        alignment = results["reconstructions"]["nerf"]["alignment"]
        alignment["residuals"] = alignment["residuals"][1:]
        alignment["inliers"] = alignment["inliers"][1:]

    edit_results(bundle, change)
    rehash(bundle)
    assert "reconstructions.nerf.alignment.n" in differing(bundle)


def test_trap_what_a_pair_concludes(bundle):
    def change(results):
        results["paired"]["delivered"][0]["statement"] = "Over all zones, nerf is more complete."

    edit_results(bundle, change)
    rehash(bundle)
    assert "paired.delivered[0].statement" in differing(bundle)


@pytest.mark.parametrize(
    ("low", "high", "gap", "verdict"),
    [
        (1.0, 2.0, 1.5, "better"),
        (-2.0, -1.0, -1.5, "worse"),
        (-1.0, 2.0, 1.5, "not distinguishable"),
        (1.0, 2.0, -0.1, "not told"),
        (-2.0, -1.0, 0.0, "not told"),
        (None, None, 1.5, "not known"),
    ],
)
def test_what_a_difference_tells_is_concluded_again(low, high, gap, verdict):
    row = {"threshold_m": 0.2, "low_pct": low, "high_pct": high, "difference_pct": gap}
    assert verifier._told_apart(row, 0.1) == verdict
    assert verifier._told_apart(row, 0.2) == "not resolvable"
    for told in (verdict, "not resolvable"):
        pair = {"names": ["nerf", "sfm"], "differences": [row | {"zone": "all", "verdict": told}]}
        stated = verifier._pair_statement(pair, {"nerf": True, "sfm": False})
        table = pd.DataFrame(pair["differences"])
        assert stated == pairing._statement(table, ("nerf", "sfm"), (True, False))
        assert ("95 % intervals" in stated) == (told != "not resolvable")


def test_trap_a_distance_made_smaller(bundle):
    path = bundle / "data" / "distances-nerf.npz"
    with np.load(path) as stored:
        arrays = {key: stored[key] for key in stored.files}
    arrays["delivered_accuracy_m"] = arrays["delivered_accuracy_m"] * 0.999
    np.savez_compressed(path, **arrays)
    rehash(bundle)
    assert "reconstructions.nerf.comparison.delivered.accuracy.all.rmse_m" in differing(bundle)


def test_trap_a_pdf_that_embeds_other_data(bundle):
    def pdf(content):
        packed = zlib.compress(content)
        return b"%PDF-1.7\n<</Type /EmbeddedFile/Length 9>>\nstream\n" + packed + b"\nendstream\n"

    table = (bundle / "data" / "loocv-nerf.csv").read_bytes()
    (bundle / "report.pdf").write_bytes(pdf(table))
    rehash(bundle)
    assert verify(bundle).holds
    (bundle / "report.pdf").write_bytes(pdf(table.replace(b"0.0", b"0.1", 1)))
    rehash(bundle)
    assert differing(bundle) == ["report.pdf attachment 1 is a file of the bundle"]


def test_a_verifier_that_always_agrees_is_found_out_and_not_run(bundle):
    path = bundle / "verify" / "verify.py"
    path.write_text("from pathlib import Path\nPath('ran').touch()\n", "utf-8")
    rehash(bundle)
    assert "verify/verify.py is trigpoint's own" in differing(bundle)
    assert not any(bundle.parent.rglob("ran"))


def test_a_bundle_of_another_version_may_carry_another_verifier(bundle):
    def change(results):
        results["environment"]["trigpoint"] = "0.0.1"

    edit_results(bundle, change)
    (bundle / "verify" / "verify.py").write_bytes(verifier_source() + b"\n")
    rehash(bundle)
    found = verify(bundle)
    assert "verify/verify.py is trigpoint's own" not in [r.quantity for r in found.report.rows]
    assert any("0.0.1" in note for note in found.report.notes)


def test_text_of_a_bundle_is_data(bundle):
    edit_results(bundle, lambda results: results["project"].update(title="x" * 10_000_000))
    found = verify(bundle)
    assert len(found.text()) < 100_000


@pytest.mark.parametrize(
    "content",
    [b"", b"{", b"[]", b"\xff\xfe", b'{"schema": "trigpoint-results/9"}', b'{"schema": NaN}'],
)
def test_what_is_no_bundle_is_refused_in_one_line(bundle, content):
    (bundle / "data" / "results.json").write_bytes(content)
    with pytest.raises(BundleError, match=r"results\.json"):
        verify(bundle)


def test_a_folder_without_a_manifest_is_refused(bundle):
    (bundle / MANIFEST).unlink()
    with pytest.raises(BundleError, match="manifest"):
        verify(bundle)
    with pytest.raises(BundleError, match="no such bundle"):
        verify(bundle.parent / "nothing")


def test_what_can_not_be_checked_is_a_difference_and_no_crash(bundle):
    (bundle / "data" / "correspondences-nerf.csv").write_text("id,role\na,control\n")
    (bundle / "data" / "distances-sfm.npz").write_bytes(b"no zip")
    (bundle / "config" / "project.toml").write_text("[project", "utf-8")
    names = differing(bundle)
    assert "reconstructions.nerf.alignment: can be checked" in names
    assert "reconstructions.sfm.comparison: can be checked" in names
    assert "config/project.toml: can be checked" in names


def test_verifying_changes_nothing(bundle):
    before = hash_files(bundle)
    verify(bundle)
    assert hash_files(bundle) == before
    assert sha256(bundle / MANIFEST) == before[MANIFEST]


def test_every_number_as_the_reports_print_it_is_accepted(bundle):
    results = json.loads((bundle / "data" / "results.json").read_text("utf-8"))
    rounding = json.loads((bundle / "data" / "rounding.json").read_text("utf-8"))
    assert all(verifier._is_tame(rule["pattern"]) for rule in rounding["rules"])

    def leaves(part):
        if isinstance(part.stored, dict):
            for _, each in part.items():
                yield from leaves(each)
        elif isinstance(part.stored, list):
            for each in part.rows():
                yield from leaves(each)
        elif not isinstance(part.stored, bool):
            yield part.value()

    seen = 0
    for value in leaves(Numbers(results)):
        if value.path and not value.path.startswith("criteria"):
            stored = verifier.look_up(results, value.path)
            digits = verifier.digits_for(rounding, value.path, results)
            right, _ = verifier.printed_right(value.text, stored, digits, exact=digits is None)
            assert right, value
            seen += 1
    assert seen > 500


def test_a_limit_is_printed_as_its_quantity(bundle):
    results = json.loads((bundle / "data" / "results.json").read_text("utf-8"))
    rounding = json.loads((bundle / "data" / "rounding.json").read_text("utf-8"))
    for path in ("criteria.0.found", "criteria[0].margin"):
        assert verifier.digits_for(rounding, path, results) == 3


@pytest.mark.parametrize("pattern", ["(a+)+b", "(a*)*", "(.*){1,}x", "a*a*a*a*b", "a" * 201])
def test_a_pattern_that_could_keep_the_verifier_busy_is_not_matched(pattern):
    rounding = {"rules": [{"pattern": pattern, "digits": 3}]}
    assert verifier.digits_for(rounding, "a" * 5000, {}) is None


def test_running_again_gives_the_same_numbers(bundle):
    found = verify(bundle, inputs=BUILT["inputs"], again=True)
    assert found.rerun.versions == []
    assert found.rerun.moved == []
    assert found.holds


@pytest.fixture
def audit_again(monkeypatch):
    """Let an audit that is run again find what the given change makes of a bundle's results."""

    class Again:
        def __init__(self, results):
            self.results = lambda: results

    def make(folder, change):
        results = json.loads((folder / "data" / "results.json").read_text("utf-8"))
        change(results)
        monkeypatch.setattr("trigpoint.audit", lambda *_, **__: Again(results))

    return make


def test_running_again_names_what_moved(bundle, audit_again):
    def change(results):
        results["reconstructions"]["nerf"]["icp"]["shift_m"] += 1e-6

    audit_again(bundle, change)
    found = verify(bundle, inputs=BUILT["inputs"], again=True)
    assert [row["path"] for row in found.rerun.moved] == ["reconstructions.nerf.icp.shift_m"]
    assert not found.holds


def test_other_versions_drift_and_do_not_fail(bundle, audit_again):
    def change(results):
        results["environment"]["numpy"] = "1.0"
        results["reconstructions"]["nerf"]["icp"]["shift_m"] += 1e-6
        results["reconstructions"]["nerf"]["icp"]["overlap_pct"] += 1.0

    audit_again(bundle, change)
    found = verify(bundle, inputs=BUILT["inputs"], again=True)
    assert [row["path"] for row in found.rerun.versions] == ["environment.numpy"]
    assert [row["path"] for row in found.rerun.moved] == ["reconstructions.nerf.icp.overlap_pct"]
    assert found.holds
    assert "1 values drifted" in found.text()


def test_running_again_needs_the_inputs(bundle, tmp_path):
    with pytest.raises(BundleError, match="needs its inputs"):
        verify(bundle, again=True)
    with pytest.raises(BundleError, match="not at hand"):
        verify(bundle, inputs=tmp_path, again=True)
