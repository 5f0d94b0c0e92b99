import base64
import json
import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from trigpoint.delivery import write_csv
from trigpoint.errors import MissingPackageError

pytest.importorskip("nbclient", reason="notebooks are executed with nbclient")
pytest.importorskip("nbconvert", reason="the exporter is nbconvert's")

from nbformat.v4 import new_output

from trigpoint_reporting import document, pdf
from trigpoint_reporting.document import write_report
from trigpoint_reporting.execution import NotebookError
from trigpoint_reporting.outline import Section

HOSTILE = '"); import os; <script>alert(1)</script> ${x} {{ 7*7 }} \u202e'
ARABIC = "برج الساعة"
WRITTEN = ("audit.ipynb", "audit.py", "report.html", "report.pdf", "figures/plan-0.png")

CONTENT = """
import struct
import zlib

from trigpoint_reporting.blocks import Passage, Picture, Table, Value


def result(evidence):
    project = evidence.results["project"]
    return [Passage([value, ". "]) for value in project.values() if isinstance(value, str)]


def picks(evidence, name):
    found = evidence.results["reconstructions"][name]["alignment"]
    rows = [
        (row["id"], Value(f"{row['d_m']:.3f}", f"reconstructions.{name}.residuals[{k}].d_m"))
        for k, row in enumerate(found["residuals"])
    ]
    return [Table(name, ("Pick", "3D (m)"), rows, (evidence.results["project"]["site"],))]


def plan(evidence, name):
    def chunk(kind, content):
        check = zlib.crc32(kind + content)
        return struct.pack(">I", len(content)) + kind + content + struct.pack(">I", check)

    head = chunk(b"IHDR", struct.pack(">IIBBBBB", 8, 2, 8, 0, 0, 0, 0))
    body = chunk(b"IDAT", zlib.compress(bytes(18), 9)) + chunk(b"IEND", b"")
    position = evidence.names.index(name)
    return Picture(f"plan-{position}", name, name, b"\\x89PNG\\r\\n\\x1a\\n" + head + body, "png")
"""


def results():
    residuals = [
        {"id": f"{k} {HOSTILE}", "role": "control", "used": True}
        | {"dx_m": 0.01 * k, "dy_m": 0.0, "dz_m": 0.0, "d_m": 0.01 * k}
        for k in range(90)
    ]
    squares = sum(row["d_m"] ** 2 for row in residuals)
    distances = {"n": 3, "rmse_m": 0.2160246899469287}
    within = [{"threshold_m": 0.2, "pct": 66.666666666667}]
    zones = {zone: distances | {"within": within} for zone in ("all", "lower")}
    empty = {"n": 0, "rmse_m": None, "within": [{"threshold_m": 0.2, "pct": 0.0}]}
    stage = dict.fromkeys(("accuracy", "completeness"), zones | {"upper": empty})
    found = {
        "alignment": {
            "residuals": residuals,
            "rmse_m": (squares / 90) ** 0.5,
            "rmse_dof_m": (squares / (90 - 7 / 3)) ** 0.5,
        },
        "loocv": {"rmse_m": 0.1, "max_scale_change_pct": 0.25},
        "checks": {"n": 0},
        "comparison": {"delivered": stage, "after_icp": None},
    }
    about = dict.fromkeys(("title", "site", "surveyor", "organisation"), HOSTILE + ARABIC)
    project = about | {"id": "TP-1", "status": "issued", "revision": 2, "date": "2026-09-21"}
    return {"project": project, "reconstructions": {"nerf": found}}


def bundle(folder):
    (folder / "data").mkdir(parents=True)
    stated = results()
    (folder / "data" / "results.json").write_text(json.dumps(stated))
    write_csv(
        folder / "data" / "picks-nerf.csv",
        stated["reconstructions"]["nerf"]["alignment"]["residuals"],
    )
    folds = [{"d_m": 0.1, "scale_change_pct": change} for change in (-0.25, 0.125)]
    write_csv(folder / "data" / "loocv-nerf.csv", folds)
    values = {"zone_edges_m": np.array([0.0, 5.0, 9.0])}
    for direction in ("accuracy", "completeness"):
        values[f"delivered_{direction}_m"] = np.array([0.1, 0.2, 0.3])
        values[f"delivered_{direction}_height_m"] = np.array([-1.0, 0.0, 4.9])
    np.savez_compressed(folder / "data" / "distances-nerf.npz", **values)
    return folder


def section(name, function, *figures, per_reconstruction=False):
    return Section(name, name.title(), function, per_reconstruction, figures)


@pytest.fixture(scope="module")
def sections(tmp_path_factory):
    """Sections in a package that the kernel can import too."""
    root = tmp_path_factory.mktemp("content")
    package = root / "shown_content"
    package.mkdir()
    (package / "__init__.py").touch()
    (package / "tables.py").write_text(CONTENT, encoding="utf-8")
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(root)
        patch.setenv("PYTHONPATH", str(root), prepend=os.pathsep)
        from shown_content import tables

        yield (
            section("result", tables.result),
            section("picks", tables.picks, tables.plan, per_reconstruction=True),
        )


@pytest.fixture(scope="module")
def twice(tmp_path_factory, sections):
    """The same report in two folders, the second elsewhere in every sense."""
    pytest.importorskip("weasyprint", reason="WeasyPrint makes the PDF")
    one = bundle(tmp_path_factory.mktemp("one") / "TP-1-r2")
    assert write_report(one, sections=sections) == ()
    other = bundle(tmp_path_factory.mktemp("other") / "مجلد" / "x")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("TZ", "Pacific/Kiritimati")
        patch.setenv("LANG", "de_DE.UTF-8")
        patch.setenv("LC_ALL", "C")
        patch.setenv("HOME", str(tmp_path_factory.mktemp("home")))
        patch.setenv("OMP_NUM_THREADS", "1")
        patch.chdir(other)
        assert write_report(Path(), sections=sections) == ()
    return one, other


@pytest.mark.parametrize("name", WRITTEN)
def test_two_runs_write_the_same_bytes(twice, name):
    one, other = twice
    assert (one / name).read_bytes() == (other / name).read_bytes()


def test_no_output_says_where_or_by_whom_it_was_made(twice):
    words = [str(folder) for folder in twice] + [sys.prefix, str(Path.home()), "Traceback"]
    words += ["No description has been provided", "object at 0x", ">nan<", ">None<", ">inf<"]
    for name in ("audit.ipynb", "audit.py", "report.html"):
        text = (twice[0] / name).read_text("utf-8")
        for word in words:
            assert word not in text, (name, word)


def test_hostile_words_reach_the_page_as_words(twice):
    html = (twice[0] / "report.html").read_text("utf-8")
    assert "<script" not in html
    assert "&lt;script&gt;alert(1)&lt;/script&gt;" in html
    assert "\u202e" not in html
    assert ARABIC in html
    assert "49" not in re.findall(r"\$\{x\} (\S+)", html)


def test_nothing_outside_is_asked_for_and_every_picture_is_told(twice):
    html = (twice[0] / "report.html").read_text("utf-8")
    assert re.findall(r'(?:src|href)="(?!#|data:)[^"]*"', html) == []
    images = re.findall(r"<img [^>]*>", html)
    assert images
    assert all(re.search(r'alt="[^"]', image) for image in images)


def test_the_script_for_review_is_python(twice):
    compile((twice[0] / "audit.py").read_text("utf-8"), "audit.py", "exec")


def test_the_figure_beside_the_report_is_the_one_in_it(twice):
    html = (twice[0] / "report.html").read_text("utf-8")
    encoded = re.search(r'data-file="plan-0.png" src="data:image/png;base64,([^"]+)"', html)[1]
    assert (twice[0] / "figures" / "plan-0.png").read_bytes() == base64.b64decode(encoded)


def test_a_long_table_repeats_its_head_and_loses_no_row(twice):
    try:
        told = subprocess.run(
            ["pdftotext", "-layout", twice[0] / "report.pdf", "-"],
            check=True,
            capture_output=True,
            text=True,
        ).stdout
    except FileNotFoundError:
        pytest.skip("pdftotext reads the PDF")
    pages = told.split("\f")
    assert sum("3D (m)" in page for page in pages) >= 2
    assert all(f"{0.01 * k:.3f}" in told for k in range(90))
    assert "Page 1 of" in pages[0]


def test_the_numbers_were_counted_again(twice):
    html = (twice[0] / "report.html").read_text("utf-8")
    assert "Numbers recomputed from the stored tables" in html


def test_without_the_libraries_the_html_is_whole_and_says_what_to_install(
    tmp_path, sections, monkeypatch
):
    def missing():
        message = f"install {pdf.LIBRARIES}"
        raise MissingPackageError(message)

    monkeypatch.setattr(pdf, "_weasyprint", missing)
    monkeypatch.setattr(document, "execute", lambda *_: None)
    folder = bundle(tmp_path / "b")
    (folder / "report.pdf").write_text("of an earlier run")
    (caution,) = write_report(folder, sections=sections)
    assert caution.code == "pdf_not_made"
    assert "libpango-1.0-0" in caution.message
    assert (folder / "report.html").stat().st_size > 0
    assert not (folder / "report.pdf").exists()


def test_a_pdf_with_letters_that_no_font_has_is_not_declared_pdf_a_and_says_so(
    tmp_path, sections, monkeypatch
):
    made = []
    monkeypatch.setattr(document, "letters_without_font", lambda _: "東<")
    monkeypatch.setattr(document, "write_pdf", lambda html, _, **how: made.append((html, how)))
    monkeypatch.setattr(document, "execute", lambda *_: None)
    folder = bundle(tmp_path / "b")
    (folder / "README.txt").write_text("what stands in these files", "utf-8")
    (caution,) = write_report(folder, sections=sections)
    ((html, how),) = made
    assert caution.code == "letters_without_font"
    assert how["variant"] is None
    assert {"data/results.json", "README.txt"} <= set(how["attachments"])
    said = "This PDF is not declared to be PDF/A: no font of the report has 東&lt;"
    assert said in html
    assert said not in (tmp_path / "b" / "report.html").read_text("utf-8")


def test_two_pictures_of_one_name_are_refused(tmp_path, sections, monkeypatch):
    html = '<img alt="x" data-file="a.png" src="data:image/png;base64,AA==">'
    output = new_output("display_data", {"text/html": html})

    def twofold(notebook, _):
        notebook.cells[0]["outputs"] = [output, output]

    monkeypatch.setattr(document, "execute", twofold)
    with pytest.raises(NotebookError, match=r"Two pictures are called 'a\.png'"):
        write_report(bundle(tmp_path / "b"), sections=sections, pdf=None)


def test_a_package_that_is_missing_is_named_with_what_to_install():
    program = (
        "import sys\n"
        "sys.modules['nbclient'] = None\n"
        "from trigpoint.errors import MissingPackageError\n"
        "try:\n"
        "    import trigpoint_reporting.document\n"
        "except MissingPackageError as error:\n"
        "    print(error)\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=True
    )
    assert "trigpoint[reporting]" in done.stdout
