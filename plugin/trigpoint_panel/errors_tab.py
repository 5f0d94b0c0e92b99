"""The Errors tab: accuracy and completeness by zone, with one legend for both views."""

from __future__ import annotations

import math

import numpy as np
import pandas as pd
from qtpy.QtCore import QRectF, QSize, Qt, Signal
from qtpy.QtGui import QColor, QPainter, QPaintEvent
from qtpy.QtWidgets import (
    QAbstractItemView,
    QComboBox,
    QFrame,
    QHeaderView,
    QLineEdit,
    QTableWidget,
    QTableWidgetItem,
    QWidget,
)

from trigpoint.comparison import Comparison
from trigpoint.errors import TrigpointError
from trigpoint.zones import height_zones
from trigpoint_panel.forms import NumberBox, Tab, listed, numbers, quietly, say, show_text
from trigpoint_panel.measuring import Findings
from trigpoint_panel.model import Model
from trigpoint_panel.style import look_of
from trigpoint_reporting.elevations import BANDS, LIMIT_M, band_edges, colour_table

ALL = "all"
HEADS = ("Zone\n", "n\npoints", "Mean\nm", "RMSE\nm", "P95\nm", "≤ t\n%")
FEWEST = 20  # distances; fewer have no 95th percentile worth the name


class ErrorsTab(Tab):
    """Settings of the comparison, its tables, and the legend of its colours.

    Attributes
    ----------
    compare_wanted : Signal()
    zone_chosen : Signal(object)
        The name of the zone to isolate in the views; None shows all.
    """

    compare_wanted = Signal()
    zone_chosen = Signal(object)

    def __init__(self, model: Model, parent: QWidget | None = None) -> None:
        super().__init__("errors", parent)
        self._model = model
        self._findings: Findings | None = None
        self._of: object = None

        self.heading("Distances, cloud to cloud")
        form = self.form()
        self.voxel = NumberBox(self.inside)
        self.voxel.setRange(0, 100)
        self.voxel.setDecimals(3)
        self.voxel.setSingleStep(0.05)
        self.voxel.setSuffix(" m")
        self.voxel.setSpecialValueText("no thinning")
        self.voxel.setKeyboardTracking(False)
        form.addRow("Voxel", self.voxel)
        self.margin = NumberBox(self.inside)
        self.margin.setRange(-1, 10_000)
        self.margin.setDecimals(1)
        self.margin.setSuffix(" m")
        self.margin.setSpecialValueText("no crop")
        self.margin.setKeyboardTracking(False)
        self.margin.setToolTip("Around the reference's extent: what lies beyond is not compared.")
        form.addRow("Margin", self.margin)
        self.zones = QLineEdit(self.inside)
        self.zones.setToolTip("Where the reference's height range is cut, from 0 to 1.")
        form.addRow("Zone cuts", self.zones)
        self.within = QLineEdit(self.inside)
        self.within.setToolTip("Distances in metres whose shares are wanted.")
        form.addRow("Thresholds, m", self.within)
        (self.compare,) = self.buttons(("Compare", self.compare_wanted.emit))
        self.note = self.sentence("", faint=True)
        self.trouble = self.sentence()

        self.threshold_row = self.form()
        self.threshold = QComboBox(self.inside)
        self.threshold.setToolTip("The t of the last column.")
        self.threshold_row.addRow("Share within t =", self.threshold)
        self.accuracy_heading = self.heading("Accuracy: source to reference")
        self.accuracy = _table(self, "Accuracy by zone")
        self.completeness_heading = self.heading("Completeness: reference to source")
        self.completeness = _table(self, "Completeness by zone")
        self.hint = self.sentence("Choose a zone: the views show it alone.", faint=True)
        self.legend = LegendBar(self.inside)
        self.column.addWidget(self.legend)
        self.doubts = self.sentence(faint=True)
        self.column.addStretch(1)

        self.voxel.valueChanged.connect(
            lambda v: self.change(model.set_comparison, voxel_m=float(v))
        )
        self.margin.valueChanged.connect(
            lambda v: self.change(model.set_comparison, margin_m=None if v < 0 else float(v))
        )
        self.zones.editingFinished.connect(self._set_zones)
        self.within.editingFinished.connect(self._set_within)
        self.threshold.currentIndexChanged.connect(lambda _: self._fill())
        for table in (self.accuracy, self.completeness):
            table.itemSelectionChanged.connect(lambda table=table: self._choose(table))
        self.refresh(can_run=False)

    def refresh(self, *, can_run: bool) -> None:
        """Take over what the model holds now; `can_run`: clouds are there, nothing runs."""
        settings = self._model.state.comparison
        with quietly(self.voxel, self.margin):
            self.voxel.setValue(settings.voxel_m)
            self.margin.setValue(-1 if settings.margin_m is None else settings.margin_m)
        show_text(self.zones, listed(settings.zones))
        show_text(self.within, listed(settings.within_m))
        self.compare.setEnabled(can_run)
        stale = self._findings is not None and self._of != question(self._model)
        if stale:
            say(self.note, "Changed since: compare again.", "warning")
        else:
            say(self.note, self._carried_by())
        self._fill()

    def set_findings(self, findings: Findings | None, of: object = None) -> None:
        """Show a comparison; None: there is none."""
        self._findings = findings
        self._of = question(self._model) if of is None else of
        with quietly(self.threshold):
            self.threshold.clear()
            if findings is not None:
                for metres in sorted(set(findings.comparison.within["threshold_m"])):
                    self.threshold.addItem(f"{metres:g} m", float(metres))
                self.threshold.setCurrentIndex(self.threshold.count() // 2)
                self.legend.set_limit(findings.limit_m)
        self.refresh(can_run=self.compare.isEnabled())

    @property
    def findings(self) -> Findings | None:
        """The comparison shown."""
        return self._findings

    def show_trouble(self, text: str) -> None:
        """Say why a setting can't be; empty: all can."""
        say(self.trouble, text, "error")

    def _carried_by(self) -> str:
        if self._findings is None:
            return "Both ways, thinned to one lattice; exact, never capped."
        adopted = self._model.state.adopted is not None
        return "Of the source as ICP moved it." if adopted else "Of the source as fitted."

    def _fill(self) -> None:
        found = self._findings
        shown = (
            self.accuracy_heading,
            self.accuracy,
            self.completeness_heading,
            self.completeness,
            self.hint,
            self.legend,
            self.threshold,
            self.threshold_row.labelForField(self.threshold),
        )
        for each in shown:
            each.setVisible(found is not None)
        if found is None:
            say(self.doubts, "")
            return
        metres = self.threshold.currentData()
        for direction, table in (
            ("accuracy", self.accuracy),
            ("completeness", self.completeness),
        ):
            _show(table, found.comparison, direction, 0.1 if metres is None else float(metres))
        few = _few(found.comparison)
        say(self.doubts, "\n".join([*few, *(each.message for each in found.comparison.cautions)]))

    def _choose(self, table: QTableWidget) -> None:
        chosen = table.selectedItems()
        if not chosen:
            return
        other = self.completeness if table is self.accuracy else self.accuracy
        with quietly(other):
            other.selectRow(chosen[0].row())
        name = _zone(table, chosen[0].row())
        self.zone_chosen.emit(None if name == ALL else name)

    def _set_zones(self) -> None:
        try:
            cuts = numbers(self.zones.text())
            height_zones(0.0, 1.0, fractions=cuts)
        except TrigpointError as error:
            self.show_trouble(str(error))
            return
        except ValueError:
            self.show_trouble("Zone cuts are numbers between 0 and 1, such as 0.33, 0.66.")
            return
        self.show_trouble("")
        self.zones.setModified(False)
        self.change(self._model.set_comparison, zones=cuts)

    def _set_within(self) -> None:
        try:
            metres = numbers(self.within.text())
            usable = bool(metres) and all(math.isfinite(m) and m > 0 for m in metres)
        except ValueError:
            usable = False
        if not usable:
            self.show_trouble("Thresholds are distances in metres above zero, such as 0.05, 0.1.")
            return
        self.show_trouble("")
        self.within.setModified(False)
        self.change(self._model.set_comparison, within_m=metres)


class LegendBar(QWidget):
    """The one legend of both views: the report's bands, what lies beyond, and no distance."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setAccessibleName("Legend of distances")
        self.setToolTip("The same colours in both views and in the report.")
        self._colours = [QColor(*rgb) for rgb in colour_table().tolist()]
        self.set_limit(LIMIT_M)

    def set_limit(self, limit: float) -> None:
        """Say up to where distances are told apart, in metres."""
        edges = band_edges(limit)
        self.ends = ("0 m", f"{edges[BANDS // 2]} m", f"{edges[BANDS]} m")
        self.update()

    def sizeHint(self) -> QSize:
        """Return the room it wants."""
        return QSize(260, 2 * self.fontMetrics().height() + 24)

    def minimumSizeHint(self) -> QSize:
        """Return the room it needs."""
        return QSize(160, self.sizeHint().height())

    def paintEvent(self, _event: QPaintEvent) -> None:
        """Draw the bands and the lengths at their ends, then the two swatches."""
        painter = QPainter(self)
        painter.setPen(QColor(look_of(self).text))
        line, width = self.fontMetrics().height(), self.width() - 2
        *bands, beyond, nothing = self._colours
        for k, colour in enumerate(bands):
            left, right = (1 + width * i / len(bands) for i in (k, k + 1))
            painter.fillRect(QRectF(left, 2, right - left + 0.5, 12), colour)
        row = QRectF(1, 16, width, line)
        sides = Qt.AlignmentFlag
        for side, end in zip(
            (sides.AlignLeft, sides.AlignHCenter, sides.AlignRight), self.ends, strict=True
        ):
            painter.drawText(row, side, end)
        left = 1.0
        for colour, name in ((beyond, f"beyond {self.ends[-1]}"), (nothing, "none measured")):
            swatch = QRectF(left, 20 + line, 11, 11)
            painter.fillRect(swatch, colour)
            painter.drawRect(swatch)
            text = QRectF(left + 17, 18 + line, width - left, line)
            painter.drawText(text, Qt.AlignmentFlag.AlignLeft, name)
            left += 40 + self.fontMetrics().horizontalAdvance(name)


def _table(tab: Tab, name: str) -> QTableWidget:
    table = QTableWidget(0, len(HEADS), tab.inside)
    table.setAccessibleName(name)
    table.setHorizontalHeaderLabels(list(HEADS))
    table.setSelectionBehavior(QAbstractItemView.SelectionBehavior.SelectRows)
    table.setSelectionMode(QAbstractItemView.SelectionMode.SingleSelection)
    table.setEditTriggers(QAbstractItemView.EditTrigger.NoEditTriggers)
    table.setTabKeyNavigation(False)
    table.setShowGrid(False)
    table.setFrameShape(QFrame.Shape.StyledPanel)
    table.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
    table.setVerticalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
    table.verticalHeader().hide()
    table.verticalHeader().setDefaultSectionSize(table.fontMetrics().height() + 7)
    head = table.horizontalHeader()
    head.setMinimumSectionSize(30)
    head.setSectionResizeMode(QHeaderView.ResizeMode.ResizeToContents)
    head.setSectionResizeMode(0, QHeaderView.ResizeMode.Stretch)
    head.setHighlightSections(False)
    tab.column.addWidget(table)
    return table


def _show(table: QTableWidget, found: Comparison, direction: str, metres: float) -> None:
    statistics = found.accuracy if direction == "accuracy" else found.completeness
    shares = found.within
    shares = shares[(shares["direction"] == direction) & np.isclose(shares["threshold_m"], metres)]
    within = dict(zip(shares["zone"], shares["pct"], strict=True))
    # Highest on top, as the building stands.
    names = [ALL, *(name for name in reversed(list(statistics.index)) if name != ALL)]
    with quietly(table):
        chosen = table.currentRow()
        table.setRowCount(len(names))
        for row, name in enumerate(names):
            values = statistics.loc[name]
            cells = (
                name.capitalize().replace("_", " "),
                f"{int(values['n']):,}",
                _metres(values["mean_m"]),
                _metres(values["rmse_m"]),
                _metres(values["p95_m"]) if values["n"] >= FEWEST else "",
                f"{within[name]:.1f}" if name in within else "",
            )
            for column, text in enumerate(cells):
                item = QTableWidgetItem(text)
                side = Qt.AlignmentFlag.AlignRight if column else Qt.AlignmentFlag.AlignLeft
                item.setTextAlignment(side | Qt.AlignmentFlag.AlignVCenter)
                item.setData(Qt.ItemDataRole.UserRole, name)
                table.setItem(row, column, item)
        if 0 <= chosen < len(names):
            table.selectRow(chosen)
    high = table.horizontalHeader().sizeHint().height()
    rows = table.verticalHeader().defaultSectionSize() * len(names)
    table.setFixedHeight(high + rows + 2 * table.frameWidth())


def _zone(table: QTableWidget, row: int) -> str:
    item = table.item(row, 0)
    return ALL if item is None else str(item.data(Qt.ItemDataRole.UserRole))


def _metres(value: float) -> str:
    return "" if pd.isna(value) else f"{value:.3f}"


def _few(found: Comparison) -> list[str]:
    lines = []
    for direction, table in (("accuracy", found.accuracy), ("completeness", found.completeness)):
        for name, n in table["n"].items():
            if 0 < n < FEWEST:
                lines.append(f"Only {int(n)} points in zone {name} ({direction}): no P95.")
    return lines


def question(model: Model) -> object:
    """Return what a comparison depends on."""
    state = model.state
    shown = model.similarity
    carried = None if shown is None else shown.matrix.tobytes()
    reference = state.project.reference
    return state.source_path, reference, state.comparison, carried
