import ast
import json

import nbformat
import pytest

from trigpoint_reporting import recount
from trigpoint_reporting.blocks import Passage, Table, Value
from trigpoint_reporting.evidence import Evidence
from trigpoint_reporting.notebook import build_notebook, to_percent
from trigpoint_reporting.outline import Section
from trigpoint_reporting.viewer import viewer_html

HOSTILE = '"); import os; os.system("x")  #<script>\n%%bash'
HASH = "0" * 64


def result(evidence):
    return [Passage([evidence.results["project"]["title"]])]


def picks(evidence, name):
    found = evidence.results["reconstructions"][name]
    if not found["picks"]:
        return []
    table = Table(name, ("Pick", "3D (m)"), [(name, Value("0.1", "x"))])
    return [Passage([name]), table, Passage(["then"]), Passage(["last"])]


def vectors(_evidence, _name):
    return Passage(["not drawn"])


def section(name, function, *figures, per_reconstruction=False):
    return Section(name, name.title(), function, per_reconstruction, figures)


SECTIONS = (section("result", result), section("picks", picks, vectors, per_reconstruction=True))


@pytest.fixture
def evidence(tmp_path):
    about = dict.fromkeys(("id", "title", "site", "surveyor", "organisation"), HOSTILE)
    names = {HOSTILE: {"picks": True}, "مسح": {"picks": False}}
    project = about | {"status": "draft", "revision": 3, "date": None}
    return Evidence(tmp_path, {"project": project, "reconstructions": names})


@pytest.fixture
def notebook(evidence):
    return build_notebook(evidence, HASH, SECTIONS)


def sources(notebook):
    return {cell.id: cell.source for cell in notebook.cells}


def test_nothing_that_a_project_says_is_written_into_a_cell(notebook):
    for source in sources(notebook).values():
        assert "os.system" not in source
        assert "script" not in source.replace("transcript", "")
        assert "مسح" not in source
        assert source.isascii() or source == sources(notebook)["recount-table"]


def test_every_cell_is_python_that_names_what_the_setup_imports(notebook):
    code = [cell.source for cell in notebook.cells if cell.cell_type == "code"]
    tree = ast.parse("\n".join(code))
    imported = {
        alias.asname or alias.name
        for node in ast.walk(tree)
        if isinstance(node, ast.Import | ast.ImportFrom)
        for alias in node.names
    }
    assert {"open_evidence", "show", "heading", __name__.rpartition(".")[2]} <= imported


def test_a_cell_shows_one_table_with_the_text_before_it(notebook):
    found = sources(notebook)
    module = __name__.rpartition(".")[2]
    assert found["picks-0"] == "name = evidence.names[0]\nheading(name)"
    assert found["picks-0-blocks-0"] == (
        f"blocks = {module}.picks(evidence, name)\nshow(*blocks[0:2])"
    )
    assert found["picks-0-blocks-1"] == "show(*blocks[2:4])"
    assert found["picks-0-figure-0"] == f"show({module}.vectors(evidence, name))"
    assert found["result-blocks-0"] == f"blocks = {module}.result(evidence)\nshow(blocks[0])"
    assert "picks-1-blocks-0" not in found


def test_figures_are_left_out_where_there_is_no_table_and_a_section_where_there_is_nothing(
    evidence, notebook
):
    assert "picks-1-figure-0" not in sources(notebook)
    assert "picks-1" in sources(notebook)
    empty = build_notebook(evidence, HASH, (section("paired", lambda _: []),))
    assert "paired" not in sources(empty)


def test_what_compares_all_stands_before_what_is_about_each_and_the_viewer_is_embedded(evidence):
    both = section("zones", picks, vectors, viewer_html, per_reconstruction=True)
    found = sources(build_notebook(evidence, HASH, (both,)))
    assert found["zones-figure-0"] == "embed(viewer.viewer_html(evidence))"
    ids = list(found)
    assert ids.index("zones-figure-0") < ids.index("zones-0") < ids.index("zones-0-figure-0")


def test_the_same_evidence_gives_the_same_notebook(evidence, notebook):
    again = build_notebook(evidence, HASH, SECTIONS)
    assert nbformat.writes(again) == nbformat.writes(notebook)
    nbformat.validate(notebook)
    ids = [cell.id for cell in notebook.cells]
    assert len(set(ids)) == len(ids)


def test_the_parameters_are_tagged_and_hold_the_hash_of_the_data(notebook):
    (cell,) = [cell for cell in notebook.cells if "parameters" in cell.metadata.get("tags", [])]
    assert cell.source == f'bundle = "."\nresults_sha256 = "{HASH}"'


def test_the_notebook_refuses_other_data(notebook, tmp_path):
    (tmp_path / "data").mkdir()
    (tmp_path / "data" / "results.json").write_text("{}")
    module = __name__.rpartition(".")[2]  # a test's own sections can't be imported
    lines = [line for line in sources(notebook)["setup"].splitlines() if module not in line]
    with pytest.raises(SystemExit, match="not the file that this notebook was made from"):
        exec("\n".join(lines), {"bundle": str(tmp_path), "results_sha256": HASH})


def test_the_cell_that_recomputes_shows_how(notebook):
    source = sources(notebook)["recount-table"]
    assert "def recount(evidence" in source
    assert source.endswith("show(recount(evidence))")
    assert recount.__doc__ in source


def test_the_script_has_every_cell_and_is_python(notebook):
    script = to_percent(notebook)
    assert script.count("# %%") == len(notebook.cells)
    assert "# %% [markdown]\n# ## Picks" in script
    assert '# %% tags=["parameters"]' in script
    ast.parse(script)


def test_the_title_is_the_id_where_a_project_has_none(evidence):
    evidence.results["project"]["title"] = ""
    evidence.results["project"]["id"] = "TP-1"
    stated = build_notebook(evidence, HASH, SECTIONS).metadata["trigpoint"]
    assert stated["title"] == "TP-1"
    assert json.dumps(stated).count("null") == 0
