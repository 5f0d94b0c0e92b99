"""Whole reports by the command line, of a project that is awkward in every way at once."""

import getpass
import json
import os
import re
import shutil
import socket
import subprocess
import sys
from html import unescape
from pathlib import Path

import numpy as np
import pytest

import trigpoint
from trigpoint.picks import picks_from

HOSTILE = '"); import os; <script>alert(1)</script> ${x} {{ 7*7 }} |=HYPERLINK(1)'
ARABIC = "برج الساعة"
LONG = "the uppermost moulding of the north-eastern pinnacle, left of"
FIELDS = ("title", "site", "client", "surveyor", "organisation", "purpose", "limitations")
SETTINGS = """intervals = false
zones = [0.33, 0.9999]
[[limit]]
quantity = "loocv.rmse_m"
of = "nerf"
max = 0.001
source = {hostile}
"""
MADE = {}
PDF_TOOLS = ("pdffonts", "pdfinfo", "pdftotext")


def awkward(small_project, folder):
    """Write the project: hostile and Arabic words in every field, a pick to be rejected."""
    quoted = json.dumps(f"{HOSTILE} {ARABIC}", ensure_ascii=False)
    path, truth = small_project(folder, extra=SETTINGS.format(hostile=quoted))
    text = path.read_text("utf-8")
    about = "\n".join(f"{field} = {quoted}" for field in FIELDS)
    text = text.replace('title = "<script>"', about)
    text = text.replace("accuracy_m = 0.02", f"accuracy_m = 0.02\naccuracy_source = {quoted}")
    path.write_text(text, "utf-8")
    picks = trigpoint.read_picks(folder / "picks.csv")
    ids = [HOSTILE, ARABIC, LONG, "Ж Ω é ß", "=1+1", *picks.ids[5:], "rejected"]
    stray = picks.target.mean(axis=0, keepdims=True)
    more = picks_from(
        ids,
        np.vstack([picks.source, truth.inverse()(stray + 4.0)]),
        np.vstack([picks.target, stray]),
        roles=[*picks.roles, "control"],
    )
    trigpoint.write_picks(folder / "picks.csv", more)
    return path


def started(*arguments, **settings):
    command = [sys.executable, "-m", "trigpoint_reporting", *map(str, arguments)]
    pipe = subprocess.PIPE
    return subprocess.Popen(command, stdout=pipe, stderr=pipe, text=True, **settings)


def run(*arguments, **settings):
    process = started(*arguments, **settings)
    out, err = process.communicate()
    return process.returncode, out, err


@pytest.fixture
def twice(small_project, tmp_path_factory):
    """The bundle of one project made twice, the second elsewhere in every sense, without OpenGL."""
    for module in ("weasyprint", "nbclient", "pyvista"):
        pytest.importorskip(module, reason="reports need trigpoint[reporting]")
    if not MADE:
        one = tmp_path_factory.mktemp("one")
        other = tmp_path_factory.mktemp("other") / "مجلد"
        blind = {"__EGL_VENDOR_LIBRARY_FILENAMES": "/none.json", "LIBGL_DRIVERS_PATH": "/none"}
        environment = {k: v for k, v in os.environ.items() if k != "DISPLAY"} | blind
        elsewhere = {"TZ": "Pacific/Kiritimati", "LANG": "de_DE.UTF-8", "OMP_NUM_THREADS": "1"}
        path = awkward(small_project, one / "site")
        shutil.copytree(one / "site", other / "site")
        home = {"HOME": str(tmp_path_factory.mktemp("home"))}
        runs = [
            started("audit", path, env=environment),
            started(
                *("audit", "site/project.toml", "--out", "out"),
                cwd=other,
                env=environment | elsewhere | home,
            ),
        ]
        MADE["runs"] = [(each.communicate()[1], each.returncode) for each in runs]
        MADE["folders"] = [one / "site" / "audit" / "small-r1", other / "out" / "small-r1"]
    return MADE["folders"]


@pytest.fixture
def page(twice):
    return (twice[0] / "report.html").read_text("utf-8")


def words_of(html):
    """What a reader sees: no script, no markup, no code."""
    html = re.sub(r"(?s)<(script|style|details)\b.*?</\1>", " ", html)
    return unescape(re.sub(r"<wbr>", "", re.sub(r"<(?!wbr)[^>]*>", " ", html)))


def test_a_limit_that_is_missed_is_exit_1_and_a_verdict(twice, page):
    for said, code in MADE["runs"]:
        assert code == 1, said
    assert re.search(r"✗\s+FAIL\s*: not every limit that the project states is met", words_of(page))
    results = json.loads((twice[0] / "data" / "results.json").read_text("utf-8"))
    assert results["reconstructions"]["nerf"]["alignment"]["outliers"] == ["rejected"]


@pytest.mark.parametrize("name", ["audit.ipynb", "audit.py", "report.html", "report.pdf", "zip"])
def test_two_runs_write_the_same_bytes(twice, name):
    one, other = (f.with_suffix(".zip") if name == "zip" else f / name for f in twice)
    assert one.read_bytes() == other.read_bytes()


def test_nothing_of_the_machine_or_of_python_is_in_any_output(twice, page):
    secrets = [str(folder.parents[1]) for folder in twice] + [sys.prefix, str(Path.home())]
    secrets += ["Traceback", "No description has been provided"]
    # A short one, such as root, is a part of other words.
    secrets += [name for name in (socket.gethostname(), getpass.getuser()) if len(name) > 5]
    for path in twice[0].rglob("*"):
        if path.suffix in (".ipynb", ".py", ".html", ".json", ".csv", ".toml", ".txt", ".svg"):
            text = path.read_text("utf-8")
            for secret in secrets:
                assert secret not in text, (path.name, secret)
    told = words_of(page)
    assert not re.search(r"\b(nan|NaN|None|inf|True|False)\b|<object", told)
    assert "not available" in told


def test_nothing_outside_is_asked_for_and_every_picture_is_told(page):
    assert not re.findall(r'(?:src|href)="(?!#|data:)[^"]*"', page)
    assert not re.findall(r"url\((?!data:)", page)
    pictures = re.findall(r"<img [^>]*>", page)
    assert len(pictures) > 10
    assert all(re.search(r'alt="[^"]{20,}"', picture) for picture in pictures)
    assert len(page.encode()) < 3e6


def test_whatever_a_project_says_is_printed_as_that(page):
    assert "<script>alert" not in page
    told = words_of(page)
    assert told.count(HOSTILE) >= len(FIELDS)
    assert told.count(ARABIC) > len(FIELDS)
    assert LONG in told
    assert "REJECTED" in told


def test_a_missing_opengl_is_a_box_in_the_report(page):
    told = words_of(page)
    assert "Perspective view unavailable: OpenGL did not start" in told
    assert "(on Debian: apt-get install libegl1 libgl1-mesa-dri)" in told


@pytest.mark.skipif(not all(map(shutil.which, PDF_TOOLS)), reason="poppler reads the PDF")
def test_the_pdf_is_tagged_has_its_fonts_and_every_pick(twice):
    path = twice[0] / "report.pdf"

    def told(*command):
        return subprocess.run(command, check=True, capture_output=True, text=True).stdout

    assert re.search(r"Tagged: +yes", told("pdfinfo", path))
    tags = told("pdfinfo", "-struct", path)
    for tag in ("H1", "H2", "Table", "TH", "Figure"):
        assert re.search(rf"^\s*{tag}\b", tags, re.MULTILINE), tag
    fonts = told("pdffonts", path).splitlines()[2:]
    assert fonts
    assert all(row.split()[-5] == "yes" for row in fonts)
    letters = re.sub(r"\s", "", told("pdftotext", path, "-"))
    for label in (LONG, HOSTILE, "Ж Ω é ß", "rejected"):
        assert re.sub(r"\s", "", label) in letters, label
    assert "Page1of" in letters


def test_the_bundle_verifies_as_folder_and_as_zip(twice):
    for bundle in (twice[0], twice[1].with_suffix(".zip")):
        code, out, _ = run("verify", bundle)
        assert code == 0, out


def test_picks_that_agree_on_nothing_are_refused_in_one_line(small_project):
    path, _ = small_project()
    picks = trigpoint.read_picks(path.parent / "picks.csv")
    scattered = np.random.default_rng(4).uniform(0, 60, picks.source.shape)
    trigpoint.write_picks(path.parent / "picks.csv", picks_from(picks.ids, scattered, picks.target))
    code, out, err = run("audit", path)
    assert (code, out) == (2, "")
    assert "Traceback" not in err
    assert err.splitlines()[-1].startswith("trigpoint: ")
    assert not (path.parent / "audit").exists()


def test_an_output_that_can_not_be_written_is_one_line(small_project, tmp_path):
    path, _ = small_project()
    (tmp_path / "file").write_text("no folder")
    code, out, err = run("audit", path, "--out", tmp_path / "file" / "out")
    assert (code, out) == (2, "")
    # The first line, too: nothing was computed before.
    assert err.startswith(f"trigpoint: Nothing can be written to {tmp_path / 'file' / 'out'}: ")
    assert err.count("\n") == 1


def changed(folder, tmp_path, *changes):
    """Copy a bundle, change text in its files, and seal it again: what a forger would do."""
    from trigpoint_reporting.sealing import seal

    copy = tmp_path / folder.name
    shutil.copytree(folder, copy)
    for name, before, after in changes:
        path = copy / name
        text = path.read_text("utf-8")
        assert before in text
        path.write_text(text.replace(before, after), "utf-8")
    seal(copy)
    return copy


FORGED = {
    "a style": (
        ("report.html", "</head>", "<style>.passage.fail{font-size:0}</style></head>"),
        "report.html is what audit.ipynb makes",
    ),
    "a script": (
        ("report.html", "</body>", "<script>document.title = 'PASS'</script></body>"),
        "report.html is what audit.ipynb makes",
    ),
    "a cell": (
        ("audit.ipynb", "show(recount(evidence))", "print('all is well')"),
        "audit.ipynb: the source of recount-table",
    ),
    "the script": (
        ("audit.py", "show(recount(evidence))", "print('all is well')"),
        "audit.py is audit.ipynb",
    ),
}


@pytest.fixture
def same_source(monkeypatch):
    """What made the bundle runs here: of a checkout that is being worked on it is not known."""
    from trigpoint_reporting import remade

    monkeypatch.setattr(remade, "is_of_here", lambda _: True)


@pytest.mark.usefixtures("same_source")
@pytest.mark.parametrize("forged", FORGED)
def test_what_is_forged_around_the_numbers_is_named(twice, tmp_path, forged):
    from trigpoint_reporting.verification import verify

    assert verify(twice[0]).holds
    change, named = FORGED[forged]
    found = verify(changed(twice[0], tmp_path, change))
    assert named in [row.quantity for row in found.report.differences]


@pytest.mark.usefixtures("same_source")
def test_words_that_were_changed_in_every_copy_are_named_when_the_report_is_made_again(
    twice, tmp_path
):
    from trigpoint_reporting.verification import verify

    inputs = twice[0].parents[1]
    assert verify(twice[0], inputs=inputs, again=True).report.differences == []
    words = "leave-one-out is internal validation"
    changes = [(name, words, "leave-one-out is proof") for name in ("audit.ipynb", "report.html")]
    copy = changed(twice[0], tmp_path, *changes)
    found = verify(copy, inputs=inputs, again=True)
    named = [row.quantity for row in found.report.differences]
    assert any(re.fullmatch(r"audit\.ipynb: what .* shows, run again", each) for each in named)
