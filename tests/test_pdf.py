import builtins
import datetime as dt
import re
import shutil
import subprocess
import sys

import pytest

from trigpoint.errors import MissingPackageError
from trigpoint_reporting import pdf
from trigpoint_reporting.pdf import LIBRARIES, PdfError, letters_without_font, write_pdf

BODY = "<h1>Tower</h1><p>It holds.</p>"


def page(body=BODY):
    return (
        '<!doctype html><html lang="en"><head><title>Tower</title></head>'
        f"<body>{body}</body></html>"
    )


@pytest.fixture
def weasyprint():
    return pytest.importorskip("weasyprint", reason="WeasyPrint makes the PDF")


def unpacked(path):
    """Return a PDF with its objects in the open."""
    qpdf = shutil.which("qpdf")
    if qpdf is None:
        pytest.skip("qpdf unpacks a PDF")
    plain = path.with_suffix(".plain.pdf")
    options = ("--stream-data=uncompress", "--object-streams=disable")
    subprocess.run([qpdf, *options, path, plain], check=True)
    return plain.read_bytes()


def written(tmp_path, html, **settings):
    path = tmp_path / "report.pdf"
    write_pdf(html, path, **settings)
    return path


@pytest.mark.usefixtures("weasyprint")
def test_the_same_report_twice_is_the_same_file(tmp_path, monkeypatch):
    (tmp_path / "a.csv").write_text("id\n1\n")
    settings = {"attachments": {"data/a.csv": tmp_path / "a.csv"}, "date": dt.date(2026, 9, 21)}
    one = written(tmp_path, page(), **settings).read_bytes()
    monkeypatch.setenv("TZ", "Pacific/Kiritimati")
    monkeypatch.setenv("LANG", "de_DE.UTF-8")
    monkeypatch.setenv("SOURCE_DATE_EPOCH", "1")
    monkeypatch.chdir(tmp_path)
    assert written(tmp_path, page(), **settings).read_bytes() == one
    plain = unpacked(tmp_path / "report.pdf")
    assert b"D:20260921" in plain
    assert str(tmp_path).encode() not in plain


@pytest.mark.usefixtures("weasyprint")
@pytest.mark.parametrize(("variant", "part"), [("a-3a", b"3"), ("a-2a", b"2")])
def test_the_pdf_declares_its_archive_form_and_is_tagged(tmp_path, variant, part):
    content = unpacked(written(tmp_path, page(), variant=variant))
    for name in (b"/MarkInfo", b"/StructTreeRoot", b"/OutputIntents", b"/Lang (en)"):
        assert name in content
    assert b'pdfaid:part="' + part + b'"' in content
    assert b'pdfaid:conformance="A"' in content


@pytest.mark.usefixtures("weasyprint")
def test_without_a_variant_nothing_is_declared_and_files_are_embedded_all_the_same(tmp_path):
    (tmp_path / "a.csv").write_text("a")
    settings = {"variant": None, "attachments": {"data/a.csv": tmp_path / "a.csv"}}
    path = written(tmp_path, page(), **settings)
    made, content = path.read_bytes(), unpacked(path)
    assert b"pdfaid" not in content
    assert b"/StructTreeRoot" in content
    assert b"data-a.csv" in content
    assert written(tmp_path, page(), **settings).read_bytes() == made


@pytest.mark.usefixtures("weasyprint")
def test_every_font_is_embedded_whatever_the_script(tmp_path):
    if shutil.which("pdffonts") is None:
        pytest.skip("pdffonts lists the fonts")
    path = written(tmp_path, page("<h1>Ж Ω מגדל برج ✗</h1><pre>0.123 ✓</pre>"))
    listed = subprocess.run(["pdffonts", path], check=True, capture_output=True, text=True).stdout
    rows = listed.splitlines()[2:]
    assert rows
    assert all(row.split()[-5] == "yes" for row in rows)
    families = {row.split()[0].partition("+")[2] for row in rows}
    assert all(name.startswith(("IBM-Plex", "DejaVu")) for name in families), families


@pytest.mark.usefixtures("weasyprint")
def test_attachments_are_listed_once_and_hold_what_the_files_hold(tmp_path):
    if shutil.which("pdfdetach") is None or shutil.which("qpdf") is None:
        pytest.skip("pdfdetach and qpdf take them out")
    names = ("audit.ipynb", "config/picks.csv", "data/picks.csv")
    for name in names:
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text(name)
    path = written(tmp_path, page(), attachments={name: tmp_path / name for name in names})
    assert len(re.findall(rb"\d+ 0 R", re.search(rb"/AF \[([^]]*)\]", unpacked(path))[1])) == 3
    out = tmp_path / "out"
    out.mkdir()
    subprocess.run(["pdfdetach", "-saveall", "-o", out, path], check=True)
    found = {file.name: file.read_text() for file in out.iterdir()}
    assert found == {name.replace("/", "-"): name for name in names}


def test_pdf_a_2_refuses_attachments(tmp_path, weasyprint):  # noqa: ARG001
    with pytest.raises(PdfError, match="holds no attachments, and 1"):
        written(tmp_path, page(), variant="a-2a", attachments={"a": tmp_path / "a"})


@pytest.mark.usefixtures("weasyprint")
@pytest.mark.parametrize(
    "body",
    [
        '<img alt="x" src="http://127.0.0.1:9/x.png">',
        '<img alt="x" src="file:///etc/hostname">',
        '<p style="background: url(//example.org/x.png)">x</p>',
        '<link rel="stylesheet" href="../trigpoint_reporting/cli.py">',
        "<style>@import url(https://example.org/x.css);</style>",
    ],
)
def test_a_report_that_asks_for_anything_outside_is_refused(tmp_path, body):
    with pytest.raises(PdfError, match="lies outside it"):
        written(tmp_path, page(BODY + body))
    assert list(tmp_path.iterdir()) == []


@pytest.mark.usefixtures("weasyprint")
def test_what_weasyprint_calls_an_error_stops_the_build(tmp_path):
    with pytest.raises(PdfError, match="would not be sound"):
        written(tmp_path, page(BODY + '<img alt="x" src="data:image/png;base64,AAAA">'))
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("missing", "words"),
    [
        (OSError("cannot load library 'libpango-1.0-0'"), LIBRARIES),
        (ModuleNotFoundError("No module named 'weasyprint'"), r"trigpoint\[reporting\]"),
    ],
)
def test_what_is_missing_is_named_with_what_to_install(tmp_path, monkeypatch, missing, words):
    real = builtins.__import__

    def fake(name, *args, **kw):
        if name == "weasyprint":
            raise missing
        return real(name, *args, **kw)

    monkeypatch.delitem(sys.modules, "weasyprint", raising=False)
    monkeypatch.setattr(builtins, "__import__", fake)
    with pytest.raises(MissingPackageError, match=words):
        write_pdf(page(), tmp_path / "report.pdf")


@pytest.mark.usefixtures("weasyprint")
def test_letters_that_no_font_of_the_report_has_are_named():
    assert letters_without_font(page("<p title='東'>Łódź مدينة &#1488; ✗ &lt; \u2212</p>")) == ""
    assert letters_without_font(page("<p>東京, &#26481;</p>")) == "京東"


def test_the_fallback_fonts_are_there():
    for name in ("DejaVuSans.ttf", "DejaVuSans-Bold.ttf", "DejaVuSansMono.ttf"):
        assert (pdf._matplotlib_fonts() / name).is_file()
