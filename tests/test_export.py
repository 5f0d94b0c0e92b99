import json
import subprocess
import sys
from html.parser import HTMLParser

import nbformat
import pytest
from nbformat.v4 import new_code_cell, new_markdown_cell, new_notebook, new_output

pytest.importorskip("nbconvert", reason="the exporter is nbconvert's")

from trigpoint_reporting.blocks import Passage, Table
from trigpoint_reporting.export import AuditExporter
from trigpoint_reporting.manifest import RECORD, record_hash, write_manifest
from trigpoint_reporting.render import heading, show

VOID = {"meta", "link", "img", "br", "hr", "wbr", "input"}
HOSTILE = '"></title><script src="http://evil.example/x.js"></script>'


class Page(HTMLParser):
    """A page's tags in order; it must close what it opens."""

    def __init__(self, html):
        super().__init__()
        self.tags, self.open, self.text = [], [], ""
        self.feed(html)
        self.close()
        assert self.open == []

    def handle_starttag(self, tag, attrs):
        self.tags.append((tag, dict(attrs)))
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        if self.open and self.open[-1] not in ("style", "script"):
            self.text += data

    def of(self, tag):
        return [attributes for name, attributes in self.tags if name == tag]

    @property
    def headings(self):
        return [int(tag[1]) for tag, _ in self.tags if tag in ("h1", "h2", "h3", "h4", "h5", "h6")]


def shown(*results, source="show()", name="c"):
    outputs = [
        new_output("execute_result", {"text/html": each._repr_html_(), "text/plain": repr(each)})
        for each in results
    ]
    return new_code_cell(source, id=name, outputs=outputs)


def section(name, title):
    cell = new_markdown_cell(f"## {title}", id=name)
    cell.metadata["trigpoint"] = {"section": name, "title": title}
    return cell


def notebook(*cells, **about):
    return new_notebook(cells=list(cells), metadata={"trigpoint": about} if about else {})


def export(given, **resources):
    html, _ = AuditExporter().from_notebook_node(given, resources)
    return html


@pytest.fixture
def page():
    table = show(Table("Picks", ("Pick", "3D (m)"), [("a", "0.123")]))
    return notebook(
        shown(source="bundle = '.'", name="parameters"),
        section("result", "Result"),
        shown(show(Passage(["It holds."], "pass")), table, name="c1"),
        section("picks", "Picks & residuals"),
        shown(heading("nerf"), table, source="show(blocks[0])  # <b>", name="c2"),
        title="Tower",
        report="TP-1 r2",
        site="Saint Louis",
        status="draft",
        author="A. Surveyor",
        date="2026-09-21",
        generator="trigpoint 0.1.0",
    )


def test_the_page_has_a_language_one_title_and_no_heading_skipped(page):
    found = Page(export(page))
    assert found.of("html") == [{"lang": "en"}]
    assert found.headings[0] == 1
    assert found.headings.count(1) == 1
    assert all(b - a <= 1 for a, b in zip(found.headings, found.headings[1:], strict=False))


def test_each_section_is_numbered_and_listed_in_the_contents(page):
    found = Page(export(page))
    assert [each["id"] for each in found.of("section")] == ["result", "picks"]
    links = [each["href"] for each in found.of("a") if each["href"] != "#report"]
    assert links == ["#result", "#picks"]
    ids = [attributes["id"] for _, attributes in found.tags if "id" in attributes]
    assert len(ids) == len(set(ids))
    assert {link[1:] for link in links} | {"report"} <= set(ids)


def test_code_is_there_but_folded(page):
    html = export(page)
    found = Page(html)
    assert "open" not in {key for each in found.of("details") for key in each}
    assert "show(blocks[0])  # &lt;b&gt;" in html


def test_nothing_is_asked_for_from_outside(page):
    html = export(page)
    found = Page(html)
    for tag, attributes in found.tags:
        for key in ("src", "href", "data", "action", "poster", "srcset"):
            assert attributes.get(key, "#").startswith(("#", "data:")), (tag, attributes)
    style = html.partition("<style>")[2].partition("</style>")[0]
    assert "url(" not in style
    assert "@import" not in style
    assert "http" not in style


def test_the_browser_is_told_to_load_nothing(page):
    (policy,) = [each for each in Page(export(page)).of("meta") if "http-equiv" in each]
    assert policy["http-equiv"] == "Content-Security-Policy"
    assert policy["content"].startswith("default-src 'none'; img-src data:;")


def test_hostile_words_about_a_project_are_text():
    keys = ("title", "report", "site", "status", "author", "date", "generator")
    found = Page(export(notebook(section("a", HOSTILE), **dict.fromkeys(keys, HOSTILE))))
    assert found.of("script") == []
    assert found.of("title") == [{}]
    assert HOSTILE in found.text


def test_hostile_markdown_and_printed_text_are_text():
    given = notebook(
        new_markdown_cell("*told* <script>alert(1)</script> [x](javascript:alert(1))", id="m"),
        new_code_cell("1", id="p", outputs=[new_output("stream", name="stdout", text="<script>")]),
        new_code_cell("1", id="q", outputs=[new_output("stream", name="stderr", text="/home/me")]),
        new_code_cell(
            "1", id="r", outputs=[new_output("execute_result", {"text/plain": "<script>"})]
        ),
    )
    html = export(given)
    found = Page(html)
    assert found.of("script") == []
    assert found.of("em") == [{}]
    assert "javascript:" not in " ".join(each.get("href", "") for each in found.of("a"))
    assert "/home/me" not in html


def test_a_reason_given_twice_in_turn_is_printed_once():
    why = show(Passage(["Not drawn: no picks."]))
    found = Page(export(notebook(shown(why, name="a"), shown(why, name="b"), shown(heading("x")))))
    assert found.text.count("Not drawn") == 1


def test_svg_keeps_the_case_of_its_names():
    svg = show(Passage(["x"]))
    given = notebook(shown(svg), title="t")
    given.cells[0].outputs[0]["data"]["text/html"] = '<svg viewBox="0 0 1 1"><clipPath/></svg>'
    assert '<svg viewBox="0 0 1 1"><clipPath/></svg>' in export(given)


def test_the_record_beside_the_notebook_is_named_and_its_hash_printed(page, tmp_path):
    write_manifest(tmp_path / RECORD, {"data/results.json": "0" * 64})
    html = export(page, metadata={"path": str(tmp_path)})
    assert f"<code>{record_hash(tmp_path)}</code>" in html
    assert str(tmp_path) not in html
    assert "record" not in Page(export(page)).text


def test_a_notebook_of_another_kind_is_exported_too():
    found = Page(export(notebook(new_markdown_cell("hello", id="x")), metadata={"name": "other"}))
    assert found.headings == [1]
    assert "other" in found.text


def test_nbconvert_finds_the_exporter_by_its_name(page, tmp_path):
    path = tmp_path / "audit.ipynb"
    path.write_text(nbformat.writes(page), encoding="utf-8")
    # From a folder with a template of the same name, which is not ours.
    rogue = tmp_path / "trigpoint"
    rogue.mkdir()
    (rogue / "index.html.j2").write_text("rogue")
    (rogue / "conf.json").write_text(json.dumps({"base_template": "rogue"}))
    done = subprocess.run(
        [sys.executable, "-m", "nbconvert", "--to", "trigpoint", path.name],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "audit.html").read_text("utf-8").rstrip() == export(
        page, metadata={"path": str(tmp_path)}
    ).rstrip()
