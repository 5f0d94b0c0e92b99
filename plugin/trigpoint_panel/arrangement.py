"""Where the panel's parts stand: views above the table, tabs beside them, the foot below."""

from __future__ import annotations

from collections.abc import Mapping

from qtpy.QtCore import Qt
from qtpy.QtWidgets import QFrame, QSplitter, QTabWidget, QVBoxLayout, QWidget

from trigpoint_panel.forms import Tab

NARROWEST = 480  # pixels
# Of what stands under the table, where the panel is at its narrowest.
LINES = 3


def tabbed(panel: QWidget, tabs: Mapping[str, Tab]) -> QTabWidget:
    """Put tabs together, as wide as the widest needs."""
    together = QTabWidget(panel)
    together.setDocumentMode(True)
    for name, tab in tabs.items():
        together.addTab(tab, name)
    together.setMinimumWidth(max(tab.needed for tab in tabs.values()))
    return together


def stacked(panel: QWidget, views: QWidget, table: QWidget, totals: QWidget) -> QSplitter:
    """Put the views above the table and what sums it up."""
    under = QWidget(panel)
    column = _column(under)
    column.addWidget(table, 1)
    column.addWidget(totals)
    # What sums it up takes more lines in less width, which a splitter does not ask about.
    under.setMinimumHeight(table.minimumHeight() + LINES * table.fontMetrics().height() + 8)
    upright = QSplitter(Qt.Orientation.Vertical, panel)
    upright.addWidget(views)
    upright.addWidget(under)
    upright.setStretchFactor(0, 3)
    upright.setStretchFactor(1, 1)
    upright.setSizes([470, 200])
    upright.setChildrenCollapsible(False)
    return upright


def arrange(
    panel: QWidget, bar: QWidget, upright: QWidget, tabs: QWidget, foot: QWidget
) -> QSplitter:
    """Fill the panel: the bar, what is stacked beside the tabs, and the foot under a line."""
    across = QSplitter(Qt.Orientation.Horizontal, panel)
    across.addWidget(upright)
    across.addWidget(tabs)
    across.setStretchFactor(0, 1)
    across.setStretchFactor(1, 0)
    across.setSizes([1030, max(336, tabs.minimumWidth())])
    across.setCollapsible(0, False)
    whole = _column(panel)
    whole.addWidget(bar)
    whole.addWidget(across, 1)
    line = QFrame(panel)
    line.setObjectName("rule")
    line.setFixedHeight(1)
    whole.addWidget(line)
    whole.addWidget(foot)
    panel.setMinimumWidth(NARROWEST)  # its height follows from what stands in it
    return across


def is_narrow(across: QSplitter) -> bool:
    """Tell whether there is too little room for the views and the tabs beside each other."""
    upright, tabs = across.widget(0), across.widget(1)
    assert upright is not None
    assert tabs is not None
    beside = upright.minimumSizeHint().width() + tabs.minimumWidth() + across.handleWidth()
    return across.width() < beside


def _column(inside: QWidget) -> QVBoxLayout:
    column = QVBoxLayout(inside)
    column.setContentsMargins(0, 0, 0, 0)
    column.setSpacing(0)
    return column
