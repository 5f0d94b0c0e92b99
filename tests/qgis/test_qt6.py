"""What would not run in QGIS 4, which is built on Qt 6, is found in the text."""

import ast
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
FILES = sorted(
    path
    for folder in ("trigpoint_qgis", "trigpoint_panel")
    for path in (ROOT / "plugin" / folder).rglob("*.py")
)
GONE = re.compile(
    r"\bexec_\(|^\s*(from|import) (PyQt|PySide)\d|supportsQt6"
    r"|\bQ(DesktopWidget|RegExp)\b",
    re.MULTILINE,
)
MODULES = ("QtCore", "QtGui", "QtWidgets", "QtTest")
# Enumerations by themselves, not members of one: given a shorter name, or named as a type.
ENUMERATION = re.compile(
    r"(Policy|Type|Shape|Mode|Flag|Role|Group|Button|Orientation|Direction|OnExistingFile)$"
)


def faults(text):
    """Name what Qt 6 lacks: functions that are gone, and members without their enumeration."""
    found = [match[0].strip() for match in GONE.finditer(text)]
    tree = ast.parse(text)
    above = {child: node for node in ast.walk(tree) for child in ast.iter_child_nodes(node)}
    for node in ast.walk(tree):
        if not (isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name)):
            continue
        owner, member, parent = node.value.id, node.attr, above[node]
        scoped = isinstance(parent, ast.Attribute)
        nested_class = isinstance(parent, ast.Call) and parent.func is node
        if (
            re.match(r"Q[A-Za-z]", owner)
            and owner not in MODULES
            and re.match(r"[A-Z][a-z]\w*$|[A-Z]$", member)
            and not (scoped or nested_class or ENUMERATION.search(member))
        ):
            found.append(f"{node.lineno}: {owner}.{member}")
    return found


@pytest.mark.parametrize("path", FILES, ids=lambda path: f"{path.parent.name}/{path.name}")
def test_nothing_in_a_file_runs_on_qt_5_alone(path):
    assert not faults(path.read_text("utf-8"))


@pytest.mark.parametrize(
    "line",
    [
        "label.setAlignment(Qt.AlignLeft)",
        "dialog.exec_()",
        "from PyQt5.QtCore import Qt",
        "frame.setFrameShape(QFrame.NoFrame)",
        "fields.append(QgsField('a', QVariant.String))",
        "bar.pushMessage('a', Qgis.Warning)",
        "QgsTask('a', QgsTask.CanCancel)",
    ],
)
def test_the_rules_find_what_they_are_for(line):
    assert faults(line)


@pytest.mark.parametrize(
    "line",
    [
        "label.setAlignment(Qt.AlignmentFlag.AlignLeft)",
        "dialog.exec()",
        "from qgis.PyQt.QtCore import Qt",
        "frame.setFrameShape(QFrame.Shape.NoFrame)",
        "QgsTask('a', QgsTask.Flag.CanCancel)",
        "name = QFileDialog.getOpenFileName(self)",
        "policy = QtWidgets.QSizePolicy.Policy",
        "options = QgsVectorFileWriter.SaveVectorOptions()",
        "newer = Qgis.QGIS_VERSION_INT >= 33800",
    ],
)
def test_the_rules_leave_alone_what_runs_on_both(line):
    assert not faults(line)
