"""Collects what the QGIS plugin says into `i18n/trigpoint.ts`, the template of its translations.

::

    python plugin/make_translations.py

A translation is a copy named `trigpoint_de.ts`, filled in with Qt Linguist; `lrelease` turns it
into `trigpoint_de.qm`, which the plugin loads where QGIS speaks that language.
"""

from __future__ import annotations

import ast
import sys
from collections.abc import Iterator
from pathlib import Path
from xml.sax.saxutils import escape

FOLDER = Path(__file__).resolve().parent / "trigpoint_qgis"
TEMPLATE = FOLDER / "i18n" / "trigpoint.ts"
# One context for all: a text that occurs twice is translated once.
CONTEXT = "Trigpoint"
# Functions, the position of the text among what they are given, and names of class attributes.
CALLS = {"tr": 0, "_tr": 0, "number": 1}
ATTRIBUTES = ("TITLE", "HELP")
# Names in the rows of tables whose texts are translated when they are used.
TABLES = ("CANVASES",)


def main() -> int:
    """Write the template."""
    TEMPLATE.write_text(template(), "utf-8")
    print(f"{TEMPLATE}: {len(texts())} texts")
    return 0


def texts() -> list[str]:
    """Return what the plugin says, sorted."""
    found = set()
    for path in FOLDER.rglob("*.py"):
        found.update(_spoken(ast.parse(path.read_text("utf-8"))))
    return sorted(found)


def template() -> str:
    """Return the template as Qt's XML."""
    messages = "".join(
        f'  <message>\n   <source>{escape(text)}</source>\n   <translation type="unfinished"/>\n'
        "  </message>\n"
        for text in texts()
    )
    return (
        '<?xml version="1.0" encoding="utf-8"?>\n<!DOCTYPE TS>\n<TS version="2.1">\n'
        f" <context>\n  <name>{CONTEXT}</name>\n{messages} </context>\n</TS>\n"
    )


def _spoken(tree: ast.Module) -> Iterator[str]:
    for node in ast.walk(tree):
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute):
            position = CALLS.get(node.func.attr)
            if position is not None and len(node.args) > position:
                yield from _literal(node.args[position])
        elif isinstance(node, ast.Assign) and isinstance(node.targets[0], ast.Name):
            if node.targets[0].id in ATTRIBUTES:
                yield from _literal(node.value)
            elif node.targets[0].id in TABLES and isinstance(node.value, ast.Tuple):
                for row in node.value.elts:
                    assert isinstance(row, ast.Tuple)
                    yield from _literal(row.elts[1])
        elif isinstance(node, ast.For) and isinstance(node.target, ast.Tuple):
            # Rows of parameters: a name, its title, and more.
            rows = node.iter.elts if isinstance(node.iter, ast.Tuple) else []
            named = [name.id for name in node.target.elts if isinstance(name, ast.Name)]
            for row in rows:
                if isinstance(row, ast.Tuple) and named[:2] == ["name", "title"]:
                    yield from _literal(row.elts[1])


def _literal(node: ast.expr) -> Iterator[str]:
    if isinstance(node, ast.Constant) and isinstance(node.value, str) and node.value:
        yield node.value


if __name__ == "__main__":
    sys.exit(main())
