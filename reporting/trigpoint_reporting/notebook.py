"""The audit as a notebook: the cells that show each table and figure, from files and not by text.

Nothing that a project says is written into code. A cell holds section names of ours and positions:
a reconstruction is `evidence.names[0]`, whatever it is called.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Any

import nbformat
from nbformat import NotebookNode

import trigpoint
from trigpoint_reporting import recount
from trigpoint_reporting.blocks import Block, Passage, Table
from trigpoint_reporting.evidence import Evidence
from trigpoint_reporting.outline import Section
from trigpoint_reporting.render import printable, side_by_side
from trigpoint_reporting.viewer import viewer_html

Cell = dict[str, Any]
# Of the evidence, and of a reconstruction's name where it is about one; the viewer is HTML.
Figure = Callable[..., Block | str]

RESULTS = "data/results.json"
SETUP = """\
from pathlib import Path

from trigpoint.delivery import sha256
{imports}
from trigpoint_reporting.evidence import open_evidence
from trigpoint_reporting.render import embed, heading, show

if sha256(Path(bundle) / "{results}") != results_sha256:
    raise SystemExit("{results} is not the file that this notebook was made from")
evidence = open_evidence(bundle)
"""


def build_notebook(
    evidence: Evidence, results_sha256: str, sections: Sequence[Section]
) -> NotebookNode:
    """Build the notebook of an audit, not yet executed.

    The same evidence gives the same bytes: cells are named by their section and place in it.

    Parameters
    ----------
    evidence : Evidence
    results_sha256 : str
        Of the results.json that it was opened from; the notebook refuses another.
    sections : sequence of Section
        What is shown, in order.
    """
    cells = [
        _code("parameters", f'bundle = "."\nresults_sha256 = "{results_sha256}"', "parameters"),
        _code("setup", SETUP.format(imports=_imports(sections), results=RESULTS).rstrip(), "setup"),
    ]
    for section in sections:
        cells += _section(evidence, section)
    cells += _recount()
    notebook = {"nbformat": 4, "nbformat_minor": 5, "metadata": _metadata(evidence), "cells": cells}
    return nbformat.from_dict(notebook)  # type: ignore[no-untyped-call,no-any-return]


def to_percent(notebook: NotebookNode) -> str:
    """Return a notebook's cells as a script in the py:percent format, for review."""
    return "\n".join(_percent(notebook.cells))


def _section(evidence: Evidence, section: Section) -> Iterator[Cell]:
    cells = list(_shown(evidence, section))
    if cells:  # a section may have nothing to say, such as of pairs where there is one cloud
        yield _titled(section.id, section.title)
        yield from cells


def _shown(evidence: Evidence, section: Section) -> Iterator[Cell]:
    shared = [figure for figure in section.figures if not _takes_a_name(figure)]
    own = [figure for figure in section.figures if _takes_a_name(figure)]
    source = _callable(section.function)
    if not section.per_reconstruction:
        yield from _tables(section.function(evidence), f"{source}(evidence)", section.id)
    # What compares all reconstructions stands before what is about each.
    yield from _figures(shared, section.id, "evidence")
    if not (section.per_reconstruction or own):
        return
    for position, name in enumerate(evidence.names):
        start, chosen = f"{section.id}-{position}", f"name = evidence.names[{position}]"
        blocks = section.function(evidence, name) if section.per_reconstruction else []
        # Where words say why there is no table, a heading and a figure would say it again.
        said = section.per_reconstruction and not any(isinstance(block, Table) for block in blocks)
        if said:
            yield _code(start, f"{chosen}\nshow(*{source}(evidence, name))", "table")
        else:
            yield _code(start, f"{chosen}\nheading(name)", "heading")
            yield from _tables(blocks, f"{source}(evidence, name)", start)
            yield from _figures(own, start, "evidence, name")


def _tables(blocks: Sequence[Block], source: str, start: str) -> Iterator[Cell]:
    """Yield the cells that show blocks."""
    for number, (first, last) in enumerate(_groups(blocks)):
        lines = [] if number else [f"blocks = {source}"]
        several = f"*blocks[{first}:{last}]"
        lines.append(f"show({several if last - first > 1 else f'blocks[{first}]'})")
        yield _code(f"{start}-blocks-{number}", "\n".join(lines), "table")


def _figures(figures: Iterable[Figure], start: str, arguments: str) -> Iterator[Cell]:
    for number, figure in enumerate(figures):
        shown = "embed" if figure is viewer_html else "show"
        source = f"{shown}({_callable(figure)}({arguments}))"
        yield _code(f"{start}-figure-{number}", source, "figure")


def _takes_a_name(figure: Figure) -> bool:
    return len(inspect.signature(figure).parameters) > 1


def _groups(blocks: Sequence[Block]) -> Iterator[tuple[int, int]]:
    """Yield where each cell's blocks begin and end: a table or two, and what leads."""
    first, beside = 0, side_by_side(blocks)
    for position, block in enumerate(blocks, 1):
        if position == len(blocks) or not (isinstance(block, Passage) or position - 1 in beside):
            yield first, position
            first = position


def _recount() -> Iterator[Cell]:
    yield _titled("recount", "Numbers recomputed")
    # The whole room, not its name: who reads the notebook sees how each number is had again.
    source = f"{inspect.getsource(recount).rstrip()}\n\n\nshow(recount(evidence))"
    yield _code("recount-table", source, "table")


def _metadata(evidence: Evidence) -> dict[str, Any]:
    project = evidence.results["project"]
    about = {
        "title": project["title"] or project["id"],
        "site": project["site"],
        "author": ", ".join(filter(None, (project["surveyor"], project["organisation"]))),
        "report": f"{project['id']} r{project['revision']}",
        "status": project["status"],
        "date": project["date"] or "",
        "generator": f"trigpoint {trigpoint.__version__}",
    }
    return {
        "kernelspec": {"display_name": "Python 3", "language": "python", "name": "python3"},
        "language_info": {"name": "python"},
        "trigpoint": {key: printable(value) for key, value in about.items()},
    }


def _titled(section: str, title: str) -> Cell:
    stated = {"trigpoint": {"section": section, "title": title}}
    return {"cell_type": "markdown", "id": section, "metadata": stated, "source": f"## {title}"}


def _code(name: str, source: str, tag: str) -> Cell:
    return {
        "cell_type": "code",
        "id": name,
        "metadata": {"tags": [tag]},
        "execution_count": None,
        "outputs": [],
        "source": source,
    }


def _imports(sections: Iterable[Section]) -> str:
    functions = [each for section in sections for each in (section.function, *section.figures)]
    modules = sorted({str(each.__module__) for each in functions})
    return "\n".join(
        f"from {package} import {module}"
        for package, _, module in (each.rpartition(".") for each in modules)
    )


def _callable(function: Callable[..., Any]) -> str:
    return f"{function.__module__.rpartition('.')[2]}.{function.__name__}"


def _percent(cells: Iterable[Cell]) -> Iterator[str]:
    for cell in cells:
        if cell["cell_type"] == "markdown":
            yield "# %% [markdown]"
            yield from (f"# {line}".rstrip() for line in cell["source"].splitlines())
        else:
            tags = ", ".join(f'"{tag}"' for tag in cell["metadata"]["tags"])
            yield f"# %% tags=[{tags}]"
            yield cell["source"]
        yield ""
