"""The exporter behind `jupyter nbconvert --to trigpoint`: an audit notebook as one HTML file."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import mistune
from nbconvert.exporters import TemplateExporter
from nbformat import NotebookNode
from traitlets import default

from trigpoint_reporting.manifest import RECORD, record_hash
from trigpoint_templates import NOTEBOOK_TEMPLATE


class AuditExporter(TemplateExporter):
    """One HTML file with no reference outside it, of a notebook that was executed before.

    It is no child of nbconvert's HTMLExporter: that one parses its result again, which lowers the
    case of SVG names and gives images without alternative text a placeholder.
    """

    export_from_notebook = "trigpoint audit report"
    output_mimetype = "text/html"

    @default("file_extension")
    def _file_extension(self) -> str:
        return ".html"

    @default("template_name")
    def _template_name(self) -> str:
        return "trigpoint"

    @default("template_file")
    def _template_file(self) -> str:
        return "index.html.j2"

    @default("template_paths")
    def _template_paths(self) -> list[str]:
        # Ours alone: a template of the same name in the user's Jupyter folders is not ours.
        return [str(NOTEBOOK_TEMPLATE)]

    def default_filters(self) -> Any:
        """Add `prose`: Markdown as HTML in which HTML that it holds is text."""
        yield from super().default_filters()  # type: ignore[no-untyped-call]
        yield "prose", mistune.create_markdown(escape=True)

    def from_notebook_node(
        self, nb: NotebookNode, resources: dict[str, Any] | None = None, **kw: Any
    ) -> Any:
        """Convert a notebook; where a record lies beside it, the report states its hash."""
        resources = self._init_resources(resources or {})  # type: ignore[no-untyped-call]
        folder = Path(resources.get("metadata", {}).get("path") or ".")
        if (folder / RECORD).is_file():
            resources["record"] = record_hash(folder)
        return super().from_notebook_node(nb, resources, **kw)
