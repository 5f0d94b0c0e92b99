"""The pair table: what was picked, how each pair fits, and a word for what is wrong."""

from __future__ import annotations

import math
from collections.abc import Hashable
from typing import Any

from qtpy.QtCore import (
    QAbstractTableModel,
    QItemSelectionModel,
    QModelIndex,
    QObject,
    QPersistentModelIndex,
    QRectF,
    QSortFilterProxyModel,
    Qt,
    Signal,
)
from qtpy.QtGui import QBrush, QColor, QFont, QFontMetrics, QKeyEvent, QPainter
from qtpy.QtWidgets import (
    QAbstractItemView,
    QHeaderView,
    QLineEdit,
    QStyle,
    QStyledItemDelegate,
    QStyleOptionViewItem,
    QTableView,
    QWidget,
)

from trigpoint.errors import TrigpointError
from trigpoint_panel.columns import AT, COLUMNS, Column
from trigpoint_panel.model import Model
from trigpoint_panel.pairs import Pair, Side
from trigpoint_panel.style import look_of

Index = QModelIndex | QPersistentModelIndex
NOWHERE = QModelIndex()
SORTED_BY = Qt.ItemDataRole.UserRole + 1
LEVEL = Qt.ItemDataRole.UserRole + 2
SHARE = Qt.ItemDataRole.UserRole + 3

AXES = ("x", "y", "z")
EDGE = 4  # pixels, at the left of a cell that has a level
SURE = 0.001  # a chance below this is not told by its digits
CHECKED = {
    "control": Qt.CheckState.Checked,
    "check": Qt.CheckState.PartiallyChecked,
    "off": Qt.CheckState.Unchecked,
}


class PairTableModel(QAbstractTableModel):
    """The pairs and their fit, as Qt reads tables."""

    refused = Signal(str)

    def __init__(self, model: Model, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self._model = model
        self._pairs = model.pairs
        self._rows = model.fit.table.to_dict("records")
        self._most = 0.0

    def refresh(self) -> None:
        """Take over what the model holds now."""
        pairs = self._model.pairs
        rows = self._model.fit.table.to_dict("records")
        self._most = max((row["d_m"] for row in rows if row["d_m"] == row["d_m"]), default=0.0)
        if [pair.id for pair in pairs] == [pair.id for pair in self._pairs]:
            self._pairs, self._rows = pairs, rows
            if pairs:
                last = self.index(len(pairs) - 1, len(COLUMNS) - 1)
                self.dataChanged.emit(self.index(0, 0), last)
            return
        self.beginResetModel()
        self._pairs, self._rows = pairs, rows
        self.endResetModel()

    def pair(self, row: int) -> Pair:
        """Return the pair of a row."""
        return self._pairs[row]

    def row_of(self, name: str | None) -> int | None:
        """Return the row of a pair."""
        return next((i for i, pair in enumerate(self._pairs) if pair.id == name), None)

    def rowCount(self, parent: Index = NOWHERE) -> int:
        """Return the number of pairs."""
        return 0 if parent.isValid() else len(self._pairs)

    def columnCount(self, parent: Index = NOWHERE) -> int:
        """Return the number of columns."""
        return 0 if parent.isValid() else len(COLUMNS)

    def headerData(
        self,
        section: int,
        orientation: Qt.Orientation,
        role: int = Qt.ItemDataRole.DisplayRole,
    ) -> Any:
        """Return a column's head, and in its tool tip what it means; a row's is its pair's name."""
        if orientation == Qt.Orientation.Vertical:
            return self._pairs[section].id if role == Qt.ItemDataRole.DisplayRole else None
        column = COLUMNS[section]
        if role == Qt.ItemDataRole.DisplayRole:
            return column.head
        if role == Qt.ItemDataRole.ToolTipRole:
            return column.about
        if role == Qt.ItemDataRole.TextAlignmentRole:
            return _alignment(column)
        return None

    def flags(self, index: Index) -> Qt.ItemFlag:
        """Say what can be typed into, and what can be ticked."""
        flags = super().flags(index)
        column = COLUMNS[index.column()]
        if column.key == "role":
            flags |= Qt.ItemFlag.ItemIsUserCheckable
        elif column.edited:
            flags |= Qt.ItemFlag.ItemIsEditable
        return flags

    def data(self, index: Index, role: int = Qt.ItemDataRole.DisplayRole) -> Any:
        """Return what a cell holds."""
        pair, found = self._pairs[index.row()], self._rows[index.row()]
        column = COLUMNS[index.column()]
        if role == Qt.ItemDataRole.CheckStateRole:
            return CHECKED[pair.role] if column.key == "role" else None
        if role == Qt.ItemDataRole.TextAlignmentRole:
            return _alignment(column)
        if role == LEVEL:
            return found["level"] if column.key in ("flag", "d_m") else ""
        if role == SHARE:
            return found["d_m"] / self._most if column.key == "d_m" and self._most else 0.0
        value, is_draft = self._value(pair, found, column)
        if role == SORTED_BY:
            return None if value != value else value  # NaN has no order
        if role == Qt.ItemDataRole.DisplayRole:
            if column.key == "p_value" and value < SURE:
                return f"<{SURE}"
            return _text(value, column.digits)
        if role == Qt.ItemDataRole.EditRole:
            return _text(value, None)
        if role == Qt.ItemDataRole.ToolTipRole:
            return self._tip(value, found, column)
        if role == Qt.ItemDataRole.FontRole and is_draft:
            font = QFont()
            font.setItalic(True)
            return font
        return None

    def setData(self, index: Index, value: Any, role: int = Qt.ItemDataRole.EditRole) -> bool:
        """Take over what was ticked or typed; a refusal is told, and the cell stays."""
        pair = self._pairs[index.row()]
        key = COLUMNS[index.column()].key
        if role == Qt.ItemDataRole.CheckStateRole:
            self._model.cycle_role({pair.id})
            return True
        if role != Qt.ItemDataRole.EditRole or str(value) == self.data(index, role):
            return False
        try:
            self._model.edit(pair.id, key, str(value))  # type: ignore[arg-type]
        except TrigpointError as error:
            self.refused.emit(str(error))
            return False
        return True

    def _value(self, pair: Pair, found: dict[Hashable, Any], column: Column) -> tuple[Any, bool]:
        side, _, axis = column.key.partition("_")
        if axis in AXES:
            which: Side = "source" if side == "source" else "target"
            place, i = pair.at(which), AXES.index(axis)
            return (place[i], False) if place else (self._model.draft(pair.id, which)[i], True)
        if column.key == "id":
            return pair.id, False
        if column.key in ("role", "note", "sigma_source", "sigma_target"):
            return getattr(pair, column.key), False
        return found[column.key], False

    def _tip(self, value: Any, found: dict[Hashable, Any], column: Column) -> str:
        if column.key in ("flag", "d_m") and found["why"]:
            return str(found["why"])
        if column.key == "role":
            return column.about
        return _text(value, None)


class PairTable(QTableView):
    """The table of pairs: sorted, edited and walked through by keyboard alone, if one wants.

    Attributes
    ----------
    flown : Signal(str)
        A pair was double-clicked: bring the views there.
    refused : Signal(str)
        Why what was typed can't be.
    role_wanted : Signal()
        The selected pairs are to change their role.
    """

    flown = Signal(str)
    refused = Signal(str)
    role_wanted = Signal()

    def __init__(self, model: Model, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._model = model
        self._rows = PairTableModel(model, self)
        self._rows.refused.connect(self.refused)
        self._proxy = QSortFilterProxyModel(self)
        self._proxy.setSourceModel(self._rows)
        self._proxy.setSortRole(SORTED_BY)
        self.setModel(self._proxy)
        self.setObjectName("pairs")
        self.setAccessibleName("Pairs")
        self.setItemDelegate(_Cells(self))
        self.setSelectionBehavior(QAbstractItemView.SelectionBehavior.SelectRows)
        self.setSelectionMode(QAbstractItemView.SelectionMode.ExtendedSelection)
        self.setEditTriggers(QAbstractItemView.EditTrigger.EditKeyPressed)
        self.setHorizontalScrollMode(QAbstractItemView.ScrollMode.ScrollPerPixel)
        self.setAlternatingRowColors(True)
        self.setShowGrid(False)
        self.setWordWrap(False)
        self.setCornerButtonEnabled(False)
        self.setSortingEnabled(True)
        self.setContextMenuPolicy(Qt.ContextMenuPolicy.ActionsContextMenu)
        self.setTabKeyNavigation(False)  # Tab leaves the table; arrows walk in it
        self.sortByColumn(-1, Qt.SortOrder.AscendingOrder)
        names, head = self.verticalHeader(), self.horizontalHeader()
        names.hide()
        names.setHighlightSections(False)
        names.setTextElideMode(Qt.TextElideMode.ElideMiddle)
        names.setDefaultSectionSize(self.fontMetrics().height() + 6)
        head.setHighlightSections(False)
        head.setSectionResizeMode(QHeaderView.ResizeMode.Interactive)
        head.setStretchLastSection(True)
        if hasattr(head, "setSortIndicatorClearable"):  # since Qt 6.1
            head.setSortIndicatorClearable(True)
        head.setMinimumSectionSize(30)
        self._fit_columns()
        names.setMaximumWidth(self.columnWidth(AT["id"]))
        self.setMinimumHeight(96)
        self.horizontalScrollBar().valueChanged.connect(lambda _: self._keep_names())
        self.doubleClicked.connect(self._fly)
        self.selectionModel().currentRowChanged.connect(self._choose)
        self._follows = False
        self.refresh()

    def refresh(self) -> None:
        """Take over what the model holds now, its selected pair among it."""
        self._follows = True
        try:
            self._rows.refresh()
            row = self._rows.row_of(self._model.state.selected)
            if row is None:
                self.clearSelection()
                self.setCurrentIndex(NOWHERE)
                return
            here = self._proxy.mapFromSource(self._rows.index(row, 0))
            current = self.currentIndex()
            if not current.isValid() or current.row() != here.row():
                column = max(current.column(), 1)
                there = here.sibling(here.row(), column)
                flag = QItemSelectionModel.SelectionFlag
                self.selectionModel().setCurrentIndex(there, flag.ClearAndSelect | flag.Rows)
            self.scrollTo(here.sibling(here.row(), max(self.currentIndex().column(), 0)))
        finally:
            self._follows = False

    def chosen(self) -> list[str]:
        """Return the ids of the selected rows."""
        rows = sorted(
            self._proxy.mapToSource(i).row() for i in self.selectionModel().selectedRows()
        )
        return [self._rows.pair(row).id for row in rows]

    def cell(self, name: str, key: str) -> str:
        """Return what the cell of a pair shows."""
        row = self._rows.row_of(name)
        assert row is not None
        return str(self._rows.data(self._rows.index(row, AT[key])) or "")

    def index_of(self, name: str, key: str) -> QModelIndex:
        """Return where the cell of a pair is."""
        row = self._rows.row_of(name)
        assert row is not None
        return self._proxy.mapFromSource(self._rows.index(row, AT[key]))

    def keyPressEvent(self, event: QKeyEvent) -> None:
        """Let Enter begin to type, as F2 does, and Space change the role."""
        enter = event.key() in (Qt.Key.Key_Return, Qt.Key.Key_Enter)
        if event.key() == Qt.Key.Key_Space and self.state() != QAbstractItemView.State.EditingState:
            self.role_wanted.emit()
            event.accept()
            return
        if event.key() == Qt.Key.Key_Z:  # the magnifier's, not a search's
            event.ignore()
            return
        if enter and self.state() != QAbstractItemView.State.EditingState:
            if self.currentIndex().flags() & Qt.ItemFlag.ItemIsEditable:
                self.edit(self.currentIndex())
            event.accept()
            return
        super().keyPressEvent(event)

    def _fit_columns(self) -> None:
        metrics = QFontMetrics(self.font())
        for i, column in enumerate(COLUMNS):
            lines = (*column.head.split("\n"), column.widest)
            widest = max(metrics.horizontalAdvance(line) for line in lines)
            self.setColumnWidth(i, widest + 14)

    def _keep_names(self) -> None:
        """Let the names stand at the left edge while their own column is scrolled out of sight."""
        bar, is_past = self.horizontalScrollBar(), self.columnViewportPosition(AT["id"]) < 0
        if is_past != self.verticalHeader().isVisible():
            is_at_end = bar.value() == bar.maximum()
            self.verticalHeader().setVisible(is_past)
            self.updateGeometries()
            if is_past and is_at_end:
                bar.setValue(bar.maximum())  # there is less room now

    def _choose(self, current: QModelIndex) -> None:
        if not self._follows and current.isValid():
            self._model.select(self._rows.pair(self._proxy.mapToSource(current).row()).id)

    def _fly(self, index: QModelIndex) -> None:
        self.flown.emit(self._rows.pair(self._proxy.mapToSource(index).row()).id)


class _Cells(QStyledItemDelegate):
    """Draws a level behind its word, and a bar behind a length."""

    def paint(self, painter: QPainter, option: QStyleOptionViewItem, index: Index) -> None:
        table = self.parent()
        look = look_of(table if isinstance(table, QWidget) else None)
        level, share = index.data(LEVEL), index.data(SHARE) or 0.0
        rectangle = QRectF(option.rect)
        if level:
            painter.fillRect(rectangle, QColor(look.red_row if level == "red" else look.amber_row))
        if share == share and share > 0:
            inner = rectangle.adjusted(2, 4, -2, -4)
            inner.setWidth(max(inner.width() * share, 2.0))
            strong = {"red": look.error, "amber": look.warning}.get(level or "", look.bar)
            colour = QColor(strong)
            colour.setAlpha(90 if level else 255)
            painter.fillRect(inner, QBrush(colour))
        flag = QStyle.StateFlag
        is_chosen, is_current = (
            option.state & flag.State_Selected,
            option.state & flag.State_HasFocus,
        )
        option = QStyleOptionViewItem(option)
        # A style would say both with a veil over the words.
        option.state &= ~(flag.State_HasFocus | flag.State_MouseOver)
        if level:
            option.rect = option.rect.adjusted(EDGE, 0, 0, 0)
        if level and is_chosen:  # which a selected row must not hide
            option.state &= ~flag.State_Selected
            for edge in (rectangle.top(), rectangle.bottom() - 2):
                line = QRectF(rectangle.left(), edge, rectangle.width(), 2)
                painter.fillRect(line, QColor(look.accent))
        super().paint(painter, option, index)
        if level:
            edge_of = QRectF(rectangle.left(), rectangle.top(), EDGE, rectangle.height())
            painter.fillRect(edge_of, QColor(look.error if level == "red" else look.warning))
        if is_current:
            painter.setPen(QColor(look.on_accent if is_chosen and not level else look.text))
            painter.drawRect(rectangle.adjusted(1, 1, -2, -2))

    def updateEditorGeometry(
        self, editor: QWidget, option: QStyleOptionViewItem, index: Index
    ) -> None:
        """Give a number the room to be seen whole: it is kept finer than its cell shows it."""
        super().updateEditorGeometry(editor, option, index)
        table = self.parent()
        if not isinstance(table, QTableView) or not isinstance(editor, QLineEdit):
            return
        room = table.viewport().rect()
        text = str(index.data(Qt.ItemDataRole.EditRole) or "")
        wanted = editor.fontMetrics().horizontalAdvance(text + "00") + 12
        where = editor.geometry()
        where.setWidth(min(max(where.width(), wanted), room.width()))
        where.moveLeft(max(0, min(where.left(), room.right() - where.width())))
        editor.setGeometry(where)


def _alignment(column: Column) -> Qt.AlignmentFlag:
    side = Qt.AlignmentFlag.AlignLeft if column.digits is None else Qt.AlignmentFlag.AlignRight
    return side | Qt.AlignmentFlag.AlignVCenter


def _text(value: Any, digits: int | None) -> str:
    if value is None or (isinstance(value, float) and math.isnan(value)):
        return ""
    if not isinstance(value, float):
        return str(value)
    if math.isinf(value):
        return "∞"
    return f"{value:.{digits}f}" if digits is not None else repr(float(value))
