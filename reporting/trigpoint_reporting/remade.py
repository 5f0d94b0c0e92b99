"""A bundle's report made again: its page from its notebook, and all of it from its record."""

from __future__ import annotations

import hashlib
import shutil
import tempfile
from collections.abc import Callable
from pathlib import Path

import nbformat
from nbformat import NotebookNode

from trigpoint.delivery import sha256
from trigpoint_reporting.document import HTML, NOTEBOOK, PDF, SCRIPT, to_html, write_report
from trigpoint_reporting.evidence import open_evidence
from trigpoint_reporting.lockfile import LOCK, SOURCE, is_of_here
from trigpoint_reporting.manifest import RECORD, read_manifest
from trigpoint_reporting.notebook import RESULTS, build_notebook, to_percent
from trigpoint_reporting.outline import SECTIONS
from trigpoint_reporting.verifier.verify import Report

# What OpenGL draws is the same on the same driver only.
DRAWN = "perspective_views("
OTHERS = (
    f"The packages or the source here are not those of env/{LOCK} and env/{SOURCE}, or the source "
    "had local changes, which may be others here."
)


def check_page(report: Report, folder: Path) -> None:
    """Compare the notebook's code with what trigpoint writes, and the page with the notebook.

    So nothing is on the page, not a style and not a script, that the notebook's outputs did not
    put there. What the outputs say is checked by `check_report`.

    Parameters
    ----------
    report : Report
        Gets a row for each comparison.
    folder : Path
        A bundle made by this version of trigpoint.
    """
    stored = _read(folder / NOTEBOOK)
    built = build_notebook(open_evidence(folder), sha256(folder / RESULTS), SECTIONS)
    pairs = [(f"{NOTEBOOK} has the cells", *(str(_named(each)) for each in (stored, built)))]
    pairs += [
        (f"{NOTEBOOK}: the source of {other.id}", one.source, other.source)
        for one, other in zip(stored.cells, built.cells, strict=False)
    ]
    script, page = ((folder / name).read_text("utf-8") for name in (SCRIPT, HTML))
    pairs.append((f"{SCRIPT} is {NOTEBOOK}", script, to_percent(stored)))
    pairs.append((f"{HTML} is what {NOTEBOOK} makes", page, to_html(stored, folder)))
    if is_of_here(folder / "env"):
        for what, one, other in pairs:
            report.equal(what, _digest(one), _digest(other))
    elif odd := [what for what, one, other in pairs if one != other]:
        report.notes.append(
            f"Of the {len(pairs)} parts of the report that were made again from {NOTEBOOK}, "
            f"{len(odd)} differ, the first: {odd[0]}. {OTHERS}"
        )


def check_report(report: Report, folder: Path, *, say: Callable[[str], None]) -> None:
    """Make the whole report again from the record, and compare every cell, the page and the PDF.

    Parameters
    ----------
    report : Report
        Gets a row for each comparison.
    folder : Path
        A bundle made by this version of trigpoint.
    say : callable
        Told each step as it begins.
    """
    if not is_of_here(folder / "env"):
        report.notes.append(f"The report was not made again. {OTHERS}")
        return
    with tempfile.TemporaryDirectory(prefix="trigpoint-") as temporary:
        again = Path(temporary) / folder.name
        for name in (RECORD, *read_manifest(folder / RECORD)):
            (again / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(folder / name, again / name)
        write_report(again, pdf="a-3a" if (folder / PDF).is_file() else None, say=say)
        stored, made = _read(folder / NOTEBOOK), _read(again / NOTEBOOK)
        drawn_alike = True
        for one, other in zip(stored.cells, made.cells, strict=False):
            alike = one.get("outputs") == other.get("outputs")
            if DRAWN in other.source and not alike:
                drawn_alike = False
            elif "outputs" in other:
                what = f"{NOTEBOOK}: what {other.id} shows, run again"
                report.equal(what, *(_digest(str(cell.get("outputs"))) for cell in (one, other)))
        for path in sorted((folder / "figures").glob("*")):
            if path.stem != "perspective":
                own = again / "figures" / path.name
                digest = sha256(own) if own.is_file() else "not made"
                report.equal(f"figures/{path.name}, made again", sha256(path), digest)
        if not drawn_alike:
            report.notes.append(
                f"The perspective view is another here, as OpenGL's driver may be: it, {HTML} and "
                f"{PDF} were not compared with what is made again."
            )
            return
        for name in (HTML, PDF):
            if (folder / name).is_file():
                made_again = sha256(again / name) if (again / name).is_file() else "not made"
                report.equal(f"{name}, made again", sha256(folder / name), made_again)


def _read(path: Path) -> NotebookNode:
    return nbformat.reads(path.read_text("utf-8"), as_version=4)  # type: ignore[no-untyped-call, no-any-return]


def _named(notebook: NotebookNode) -> list[str]:
    return [str(cell.id) for cell in notebook.cells]


def _digest(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()
