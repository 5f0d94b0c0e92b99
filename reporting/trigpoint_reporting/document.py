"""A bundle's report: the notebook executed, its figures, the HTML and the PDF, in that order."""

from __future__ import annotations

import base64
import datetime as dt
from collections.abc import Callable, Sequence
from html import escape
from html.parser import HTMLParser
from pathlib import Path

from trigpoint.canonical import write_text
from trigpoint.cautions import Caution
from trigpoint.delivery import sha256
from trigpoint.errors import MissingPackageError
from trigpoint_reporting.evidence import Evidence, open_evidence
from trigpoint_reporting.manifest import RECORD
from trigpoint_reporting.pdf import Variant, letters_without_font, write_pdf
from trigpoint_reporting.readme import README

try:
    import nbformat
    from nbformat import NotebookNode

    from trigpoint_reporting.execution import NotebookError, execute
    from trigpoint_reporting.export import AuditExporter
    from trigpoint_reporting.notebook import RESULTS, build_notebook, to_percent
    from trigpoint_reporting.outline import SECTIONS, Section
except ImportError as error:
    _MESSAGE = 'Reports need Jupyter\'s notebooks: pip install "trigpoint[reporting]"'
    raise MissingPackageError(_MESSAGE, name=error.name) from error

UNDECLARED = (
    "This PDF is not declared to be PDF/A: no font of the report has {letters}, drawn here in "
    "fonts of the machine that made it, or as boxes."
)

Say = Callable[[str], None]

NOTEBOOK, SCRIPT, HTML, PDF = "audit.ipynb", "audit.py", "report.html", "report.pdf"
# What the PDF embeds of the bundle: all but clouds, distances and pictures that it shows anyway.
EMBEDDED = (
    NOTEBOOK,
    SCRIPT,
    README,
    RECORD,
    "config/*.toml",
    "data/*.csv",
    "data/*.json",
    "env/*",
    "quality/*.json",
    "transform/*",
    "verify/verify.py",
)


def write_report(
    folder: Path,
    *,
    pdf: Variant | None = "a-3a",
    sections: Sequence[Section] = SECTIONS,
    say: Say = lambda _: None,
) -> tuple[Caution, ...]:
    """Write audit.ipynb, audit.py, figures/, report.html and report.pdf into a bundle.

    Every footer states the SHA-256 of record-sha256.txt, the list of what the report rests on: a
    PDF can't state the hash of a manifest that lists the PDF.

    Parameters
    ----------
    folder : Path
        The bundle, as `sealing.write_record` left it.
    pdf : {"a-3a", "a-2a"} or None, optional
        With the notebook, tables and matrices embedded; without; no PDF. Where a name is in a
        script that the report's fonts lack, neither is declared.
    sections : sequence of Section, optional
        What is shown, in order.
    say : callable, optional
        Told each step as it begins.

    Returns
    -------
    tuple of Caution
        ``pdf_not_made`` where this system lacks what the PDF needs; the HTML is whole without.
        ``letters_without_font`` where a name is in a script that the report's fonts lack.

    Raises
    ------
    NotebookError
        If a cell of the notebook fails.
    PdfError
        If the PDF would not be sound.
    """
    say("executing the notebook")
    evidence = open_evidence(folder)
    notebook = build_notebook(evidence, sha256(folder / RESULTS), sections)
    execute(notebook, folder)
    text = nbformat.writes(notebook)  # type: ignore[no-untyped-call]
    write_text(folder / NOTEBOOK, f"{text}\n")
    write_text(folder / SCRIPT, to_percent(notebook))
    _write_figures(folder / "figures", notebook)
    say("writing report.html")
    html = to_html(notebook, folder)
    write_text(folder / HTML, html)
    (folder / PDF).unlink(missing_ok=True)
    if pdf is None:
        return ()
    say("writing report.pdf")
    cautions: tuple[Caution, ...] = ()
    variant: Variant | None = pdf
    printed = html
    if letters := letters_without_font(html):
        # Fonts of this machine would have to be called the report's own: it declares nothing.
        variant = None
        said = UNDECLARED.format(letters=letters)
        printed = printed.replace("</footer>", f"<p>{escape(said)}</p>\n</footer>", 1)
        cautions = (Caution("letters_without_font", f"{PDF}: {said}"),)
    try:
        write_pdf(
            printed,
            folder / PDF,
            variant=variant,
            attachments=_embedded(folder) if pdf == "a-3a" else {},
            date=_date(evidence),
        )
    except MissingPackageError as error:
        return (Caution("pdf_not_made", f"{HTML} is whole, but there is no {PDF}. {error}"),)
    return cautions


def to_html(notebook: NotebookNode, folder: Path) -> str:
    """Return an executed notebook as the page that belongs into a bundle."""
    exporter = AuditExporter()  # type: ignore[no-untyped-call]
    html, _ = exporter.from_notebook_node(notebook, {"metadata": {"path": str(folder)}})
    return str(html)


def _write_figures(folder: Path, notebook: NotebookNode) -> None:
    """Write the pictures as the report shows them: taken from the notebook, not drawn again."""
    found = _Pictures()
    for cell in notebook.cells:
        for output in cell.get("outputs", []):
            found.feed("".join(output.get("data", {}).get("text/html", "")))
    found.close()
    if not found.pictures:
        return
    folder.mkdir(exist_ok=True)
    for name, content in found.pictures.items():
        (folder / name).write_bytes(content)


class _Pictures(HTMLParser):
    def __init__(self) -> None:
        super().__init__()
        self.pictures: dict[str, bytes] = {}

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        given = dict(attrs)
        name, source = given.get("data-file"), given.get("src")
        if tag != "img" or name is None or source is None:
            return
        if name in self.pictures or Path(name).name != name:
            message = f"Two pictures are called {name!r}, or it is no file name."
            raise NotebookError(message)
        self.pictures[name] = base64.b64decode(source.partition(",")[2])


def _embedded(folder: Path) -> dict[str, Path]:
    return {
        path.relative_to(folder).as_posix(): path
        for pattern in EMBEDDED
        for path in folder.glob(pattern)
        if path.is_file()
    }


def _date(evidence: Evidence) -> dt.date | None:
    stated = evidence.results["project"]["date"]
    return None if stated is None else dt.date.fromisoformat(stated)
