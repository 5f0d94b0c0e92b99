import numpy as np
import pytest

pytest.importorskip("qtpy", reason="the panel's packages are not installed", exc_type=ImportError)

from qtpy.QtCore import Qt
from qtpy.QtGui import QImage, QPainter
from qtpy.QtTest import QTest
from qtpy.QtWidgets import QApplication, QLineEdit, QStyle, QStyleOptionViewItem

from trigpoint.similarity import Similarity
from trigpoint_panel.columns import AT, COLUMNS
from trigpoint_panel.model import Model
from trigpoint_panel.style import look_of
from trigpoint_panel.table import LEVEL, PairTable

PLACES = np.array(
    [[0, 0, 0], [8, 0, 1], [8, 8, 0], [0, 8, 2], [1, 1, 12], [7, 6, 11], [2, 6, 5]], float
)


@pytest.fixture
def model(offset):
    rng = np.random.default_rng(4)
    truth = Similarity(3.26, np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]]), offset)
    made = Model()
    for source, target in zip(PLACES, truth(PLACES), strict=True):
        made.place("source", source)
        made.place("target", target + rng.normal(0, 0.02, 3))
    return made


@pytest.fixture
def table(qtbot, model):
    made = PairTable(model)
    qtbot.addWidget(made)
    model.changed.append(made.refresh)
    made.resize(1500, 300)
    made.show()
    return made


def test_every_pair_is_a_row_and_every_number_has_its_unit(table, model):
    assert table.model().rowCount() == 7
    assert [column.key for column in COLUMNS][:3] == ["role", "id", "flag"]
    assert table.cell("P1", "source_x") == "0.000"
    assert table.cell("P1", "d_m") == f"{model.fit.table['d_m'][0]:.3f}"
    assert table.cell("P1", "role") == "control"
    heads = {column.key: column.head for column in COLUMNS}
    assert heads["d_m"] == "3D\nm"
    assert len(set(heads.values())) == len(heads)  # none is to be told by its place alone


def test_what_a_pair_is_worth_stands_beside_its_name(table):
    keys = [column.key for column in COLUMNS]
    assert keys[3:8] == ["d_m", "loo_m", "dx_m", "dy_m", "dz_m"]
    edge = sum(table.columnWidth(AT[key]) for key in keys[:8])
    assert edge < 700


def test_a_selected_row_keeps_the_ground_of_what_is_wrong(table, model):
    x, y, z = model.pairs[4].target
    model.move("P5", "target", (x + 0.3, y, z))
    place = table.visualRect(table.index_of("P5", "flag"))

    def ground():
        # Not grab(): its pixmap is as deep as the screen. With 16 bits, #fbe0de reads #ffe3de.
        picture = QImage(table.viewport().size(), QImage.Format.Format_RGB32)
        table.viewport().render(picture)
        return picture.pixelColor(place.right() - 3, place.center().y()).name()

    table.clearSelection()
    before = ground()
    table.selectRow(table.index_of("P5", "flag").row())
    assert ground() == before == look_of(table).red_row


def test_a_pairs_name_stays_in_sight_when_the_table_is_scrolled_sideways(table):
    table.resize(480, 300)
    names, bar = table.verticalHeader(), table.horizontalScrollBar()
    assert not names.isVisible()
    bar.setValue(bar.maximum())
    assert names.isVisible()
    note = table.columnViewportPosition(AT["note"]) + table.columnWidth(AT["note"])
    assert note <= table.viewport().width()
    assert names.width() <= table.columnWidth(AT["id"])
    table.sortByColumn(AT["source_z"], Qt.SortOrder.DescendingOrder)
    rows = range(table.model().rowCount())
    shown = [table.model().headerData(row, Qt.Orientation.Vertical) for row in rows]
    assert shown == [table.model().index(row, AT["id"]).data() for row in rows]
    bar.setValue(0)
    assert not names.isVisible()


def test_the_words_of_the_current_cell_are_as_dark_as_their_neighbours(table):
    current = table.index_of("P3", "id")
    place = table.visualRect(current)
    option = QStyleOptionViewItem()
    option.initFrom(table)
    option.widget = table
    option.rect = place.translated(-place.topLeft())
    state = QStyle.StateFlag
    pictures = []
    for more in (state.State_None, state.State_HasFocus | state.State_MouseOver):
        option.state = state.State_Enabled | state.State_Active | state.State_Selected | more
        picture = QImage(option.rect.size(), QImage.Format.Format_RGB32)
        picture.fill(Qt.GlobalColor.white)
        painter = QPainter(picture)
        table.itemDelegate().paint(painter, option, current)
        painter.end()
        pictures.append(picture)
    plain, hovered = pictures
    inside = [(x, y) for x in range(3, place.width() - 4) for y in range(3, place.height() - 4)]
    assert all(plain.pixelColor(*at) == hovered.pixelColor(*at) for at in inside)
    assert plain.pixelColor(1, 5) != hovered.pixelColor(1, 5)  # the focus has a frame


def test_a_chance_below_a_thousandth_is_not_written_as_none(table, model):
    x, y, z = model.pairs[4].target
    model.move("P5", "target", (x + 0.3, y, z))
    assert table.cell("P5", "p_value") == "<0.001"


def test_a_coordinate_is_seen_whole_while_it_is_typed(table, model, qtbot):
    model.move("P2", "target", (741008.123456789, 4279056.123456789, 153.123456789))
    index = table.index_of("P2", "target_y")
    table.setCurrentIndex(index)
    QTest.keyClick(table, Qt.Key.Key_F2)
    (editor,) = [each for each in table.findChildren(QLineEdit) if each.isVisible()]
    qtbot.wait(20)
    assert editor.text() == "4279056.123456789"
    assert editor.fontMetrics().horizontalAdvance(editor.text()) < editor.width() - 6
    assert table.viewport().rect().contains(editor.geometry())


def test_a_suspect_has_a_word_a_level_and_a_reason(table, model):
    x, y, z = model.pairs[4].target
    model.move("P5", "target", (x + 0.3, y, z))
    index = table.index_of("P5", "flag")
    assert index.data() == "suspect"
    assert index.data(LEVEL) == "red"
    assert "does not fit the others" in index.data(Qt.ItemDataRole.ToolTipRole)


def test_an_emptied_coordinate_opens_its_half_to_be_picked_anew(table, model):
    assert table.model().setData(table.index_of("P2", "source_y"), "")
    assert model.pairs[1].source is None
    assert model.pairs[1].target is not None
    assert [table.cell("P2", f"source_{axis}") for axis in "xyz"] == ["", "", ""]
    model.undo()
    assert table.cell("P2", "source_y") == "0.000"


def test_numbers_are_sorted_as_numbers(table, model):
    table.sortByColumn(AT["source_z"], Qt.SortOrder.DescendingOrder)
    shown = [table.model().index(row, AT["source_z"]).data() for row in range(7)]
    assert shown[:3] == ["12.000", "11.000", "5.000"]
    table.sortByColumn(AT["d_m"], Qt.SortOrder.AscendingOrder)
    first = table.model().index(0, AT["id"]).data()
    assert first == model.fit.table.sort_values("d_m")["id"].iloc[0]


def test_selecting_a_row_selects_the_pair_and_the_other_way_round(table, model):
    table.selectRow(2)
    assert model.state.selected == "P3"
    model.select("P5")
    assert table.chosen() == ["P5"]


def test_a_click_on_the_box_goes_through_three_roles(table, model):
    index = table.index_of("P2", "role")
    for role, state in (
        ("check", Qt.CheckState.PartiallyChecked),
        ("off", Qt.CheckState.Unchecked),
        ("control", Qt.CheckState.Checked),
    ):
        table.model().setData(index, Qt.CheckState.Checked, Qt.ItemDataRole.CheckStateRole)
        assert model.pairs[1].role == role
        assert Qt.CheckState(index.data(Qt.ItemDataRole.CheckStateRole)) == state


def test_coordinates_are_typed_by_keyboard_alone(table, model):
    model.new_pair()
    table.setFocus()
    for key, text in zip(("source_x", "source_y", "source_z"), ("4", "4.5", "6"), strict=True):
        table.setCurrentIndex(table.index_of("P8", key))
        QTest.keyClick(table, Qt.Key.Key_Return)
        (editor,) = [each for each in table.findChildren(QLineEdit) if each.isVisible()]
        QTest.keyClicks(editor, text)
        QTest.keyClick(editor, Qt.Key.Key_Return)
        QApplication.processEvents()
    assert model.pairs[-1].source == (4.0, 4.5, 6.0)
    assert model.pairs[-1].is_half_open


def test_what_can_not_be_is_refused_in_a_sentence(table, model):
    told = []
    table.refused.connect(told.append)
    index = table.index_of("P1", "target_z")
    assert not table.model().setData(index, "high", Qt.ItemDataRole.EditRole)
    assert told == ["'high' is not a number: type digits, with a decimal point."]
    assert model.undo_text == "Complete P7 in the target"


def test_space_asks_for_another_role_and_z_is_left_to_the_magnifier(table, qtbot):
    table.selectRow(0)
    with qtbot.waitSignal(table.role_wanted, timeout=1000):
        QTest.keyClick(table, Qt.Key.Key_Space)
    QTest.keyClick(table, Qt.Key.Key_Z)
    assert table.chosen() == ["P1"]
