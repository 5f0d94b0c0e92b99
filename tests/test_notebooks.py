from pathlib import Path

import pytest

NOTEBOOKS = sorted((Path(__file__).parents[1] / "notebooks").glob("*.ipynb"))


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_tutorial_runs_and_says_what_it_said(path):
    nbformat = pytest.importorskip("nbformat", reason="tutorials need trigpoint[reporting]")
    nbclient = pytest.importorskip("nbclient", reason="tutorials need trigpoint[reporting]")
    notebook = nbformat.read(path, as_version=4)
    stored = [texts(cell) for cell in notebook.cells]
    nbclient.NotebookClient(notebook, timeout=300, record_timing=False).execute()
    assert [texts(cell) for cell in notebook.cells] == stored


def texts(cell):
    """The words that a cell printed; pictures are left out."""
    outputs = cell.get("outputs", [])
    return [
        o.get("text") or o.get("data", {}).get("text/plain", "")
        for o in outputs
        if o.get("name") != "stderr"
    ]
