"""The marks over a view: what is hidden looks hidden, labels are read, and colours are enough."""

from dataclasses import replace

import numpy as np
import pytest

pytest.importorskip("qtpy", reason="the panel's packages are not installed", exc_type=ImportError)
from qtpy import QtCore, QtGui

from trigpoint.similarity import Similarity
from trigpoint_panel.camera import camera_from
from trigpoint_panel.colouring import Legend
from trigpoint_panel.legend import LegendCard
from trigpoint_panel.marks import FLAGGED, LOOKS, SELECTED, Marker
from trigpoint_panel.view import CloudView

FOOT = (741_000.0, 4_279_000.0, 150.0)
TOP = (741_000.0, 4_279_000.0, 170.0)
BEHIND = (741_000.0, 4_279_002.0, 160.0)
FRONT = (741_000.0, 4_278_998.0, 160.0)


@pytest.fixture
def view(qtbot, opened_tower):
    made = CloudView("target", canvas="image")
    qtbot.addWidget(made, before_close_func=lambda _: made.shutdown())
    made.resize(500, 420)
    made.set_cloud(opened_tower())
    with qtbot.waitExposed(made):
        made.show()
    qtbot.waitUntil(lambda: made.canvas is not None)
    made.look("front")
    rest(qtbot, made)
    return made


def rest(qtbot, view):
    qtbot.wait(20)
    qtbot.waitUntil(lambda: not view._rest.isActive())
    qtbot.wait(20)


def grabbed(view):
    """Return the picture with everything that lies over it."""
    image = view._stage.grab().toImage().convertToFormat(QtGui.QImage.Format.Format_RGB888)
    bits = image.constBits()
    if hasattr(bits, "setsize"):  # PyQt hands out a pointer that knows no end
        bits.setsize(image.sizeInBytes())
    rows = np.frombuffer(bytes(bits), np.uint8).reshape(image.height(), image.bytesPerLine())
    return rows[:, : 3 * image.width()].reshape(image.height(), image.width(), 3).astype(int)


def share_of(view, colour):
    wanted = np.array(QtGui.QColor(colour).getRgb()[:3])
    return (np.abs(grabbed(view) - wanted).max(axis=2) <= 6).mean()


def luminance(colour):
    parts = np.array(QtGui.QColor(colour).getRgbF()[:3])
    linear = np.where(parts <= 0.04045, parts / 12.92, ((parts + 0.055) / 1.055) ** 2.4)
    return float(linear @ [0.2126, 0.7152, 0.0722])


@pytest.mark.parametrize("look", [*LOOKS.values(), SELECTED, FLAGGED])
def test_the_letters_of_every_label_stand_out(look):
    low, high = sorted([luminance(look.colour), luminance(look.ink)])
    assert (high + 0.05) / (low + 0.05) >= 4.5


@pytest.mark.parametrize("kind", ["control", "check", "off", "ghost", "next"])
def test_a_mark_and_its_label_are_over_the_picture_in_the_colours_of_their_kind(view, kind):
    bare = share_of(view, LOOKS[kind].colour)
    view.set_markers([Marker(FRONT, "P6", kind)])
    assert share_of(view, LOOKS[kind].colour) > bare + 0.001
    view.set_markers([])
    assert share_of(view, LOOKS[kind].colour) == pytest.approx(bare, abs=1e-5)


def test_what_the_cloud_hides_has_a_dashed_mark_and_a_name_in_brackets(qtbot, view):
    view.set_markers([Marker(FRONT, "near"), Marker(BEHIND, "far", "next")])
    marks = view._stage.marks
    assert marks.hidden.tolist() == [False, True]
    assert [marks._text(k) for k in range(2)] == ["near", "(far)"]
    hidden = share_of(view, LOOKS["next"].colour)
    # From the other side it is the other way round, once the view rests.
    view.look("back")
    rest(qtbot, view)
    assert marks.hidden.tolist() == [True, False]
    assert share_of(view, LOOKS["next"].colour) > 2 * hidden


def test_an_overlay_hides_what_lies_behind_it_as_long_as_it_is_seen(view, opened_tower):
    marks, shift = view._stage.marks, np.array([741_000.0, 4_278_994.0, 150.0])
    view.set_markers([Marker(FRONT, "between"), Marker(BEHIND, "far")])
    assert marks.hidden.tolist() == [False, True]
    # It stands six metres before the cloud.
    view.set_overlay(opened_tower(crs=None), Similarity(1.0, np.eye(3), shift))
    assert marks.hidden.tolist() == [True, True]
    view.set_overlay_opacity(0.0)
    assert marks.hidden.tolist() == [False, True]
    view.set_overlay_opacity(0.6)
    view.swap()
    assert marks.hidden.tolist() == [False, True]
    view.swap()
    assert not view.scene.shows_cloud
    assert marks.hidden.tolist() == [True, True]
    view.set_overlay(None)
    assert marks.hidden.tolist() == [False, True]


def test_nothing_is_hidden_by_a_cloud_that_is_not_shown(view, opened_tower):
    view.set_overlay(opened_tower(200))
    view.swap()
    view.swap()
    assert not view.scene.shows_cloud
    view.set_markers([Marker(BEHIND, "far")])
    assert not view._stage.marks.hidden.any()


def test_a_place_behind_the_camera_has_no_mark(view):
    view.set_camera(camera_from((0, 1, 0), (0, 0, 1), np.array([741_000.0, 4_278_990, 160]), 1.0))
    view.set_markers([Marker((741_000.0, 4_279_020.0, 160.0), "P6", "ghost")])
    assert share_of(view, LOOKS["ghost"].colour) == 0
    assert view._stage.marks.labels == {}


def test_a_suspect_has_a_red_ring_and_a_word(view):
    view.set_markers([Marker(FRONT, "clock-s")])
    assert share_of(view, FLAGGED.colour) == 0
    view.set_markers([Marker(FRONT, "clock-s", flag="suspect")])
    assert view._stage.marks._text(0) == "clock-s: suspect"
    assert share_of(view, FLAGGED.colour) > 0.001
    view.set_markers([Marker(FRONT, "clock-s", selected=True, flag="suspect")])
    assert share_of(view, FLAGGED.colour) > 0.0002


@pytest.mark.parametrize("dark", [False, True])
def test_the_selected_label_stands_out_in_both_themes(view, dark):
    palette = view.palette()
    palette.setColor(QtGui.QPalette.ColorRole.Window, QtGui.QColor("#202020" if dark else "white"))
    view.setPalette(palette)
    view.set_markers([Marker((741_008.0, 4_279_000.0, 160.0), "P1", selected=True)])
    picture = grabbed(view)
    rect = view._stage.marks.labels["P1"].toRect()
    ratio = view.devicePixelRatioF()
    x, y = round(rect.center().x() * ratio), round(rect.top() * ratio)
    assert picture[y - 1 : y + 2, x].max() > 240  # its frame
    assert picture[y + 3 : y + 5, x].max() < 40  # its ground


def test_a_crowd_leaves_labels_out_and_the_mouse_brings_them_back(view):
    crowd = [Marker((741_000.0 + 0.05 * k, *FRONT[1:]), f"long-name-{k:02d}") for k in range(40)]
    view.set_markers([*crowd[:-1], replace(crowd[-1], selected=True)])
    grabbed(view)
    marks = view._stage.marks
    shown = dict(marks.labels)
    assert crowd[-1].label in shown
    assert 5 <= len(shown) < 40
    left_out = next(k for k in range(39) if crowd[k].label not in shown)
    x, y = marks.pixels()[left_out]
    assert marks.point_at(QtCore.QPointF(x, y))
    grabbed(view)
    assert set(marks.labels) > set(shown)
    assert marks.point_at(None)
    grabbed(view)
    assert set(marks.labels) == set(shown)


def test_the_selected_label_is_shown_even_where_there_is_no_room(view):
    marks = view._stage.marks
    view.set_markers([Marker(FRONT, "P1", selected=True)])
    marks.keep_clear(view._stage.rect())
    grabbed(view)
    assert list(marks.labels) == ["P1"]
    view.set_markers([Marker(FRONT, "P1")])
    marks.keep_clear(view._stage.rect())
    grabbed(view)
    assert marks.labels == {}


def test_a_long_name_is_shortened_and_stays_in_the_view(view):
    name = "north-west-corner-of-the-third-string-course-below-the-clock"
    view.set_markers([Marker(FRONT, name)])
    grabbed(view)
    (rect,) = view._stage.marks.labels.values()
    assert QtCore.QRectF(view._stage.rect()).contains(rect)
    assert rect.width() < 200


def test_letters_are_shaped_as_qt_shapes_them(view):
    # Joined and from right to left, a word is narrower than the letters one by one.
    name = "الزاوية"
    view.set_markers([Marker(FRONT, name)])
    marks = view._stage.marks
    metrics = QtGui.QFontMetricsF(marks.font())
    grabbed(view)
    alone = sum(metrics.horizontalAdvance(letter) for letter in name)
    assert marks.labels[name].width() - 10 <= alone
    assert marks.labels[name].width() - 10 == pytest.approx(metrics.horizontalAdvance(name), abs=1)


def test_the_legend_stands_where_it_covers_no_mark_and_no_label_stands_on_it(qtbot, view):
    view.colour_by("height")
    rest(qtbot, view)
    stage = view._stage
    assert stage.legend.geometry().center().x() < stage.width() / 2
    under = stage.legend.geometry().center()
    # The place that is seen under the legend.
    right = (under.x() - stage.width() / 2) / stage.height()
    upward = (stage.height() / 2 - under.y()) / stage.height()
    view.set_markers([Marker(view.camera.panned(right, upward).focal_point, "P1")])
    assert stage.legend.geometry().center().x() > stage.width() / 2
    x, y = stage.marks.pixels()[0]
    assert not stage.legend.geometry().contains(QtCore.QPoint(round(x), round(y)))
    grabbed(view)
    assert not stage.marks.labels["P1"].intersects(QtCore.QRectF(stage.legend.geometry()))


def test_a_view_says_which_zone_it_shows_alone(view):
    heights = view.opened.cloud.coordinates[:, 2]
    assert not view.legend.isVisible()
    view.isolate(heights > 160, "zone Upper")
    assert view.legend.isVisible()
    assert view.legend.accessibleName() == "Only zone Upper is shown"
    view.colour_by("height")
    assert "Height from" in view.legend.accessibleName()
    assert "Only zone Upper is shown" in view.legend.accessibleName()
    view.isolate(None)
    assert "Only" not in view.legend.accessibleName()
    view.colour_by("rgb")
    assert not view.legend.isVisible()


def test_a_note_makes_the_legend_as_large_as_it_needs(qtbot):
    card = LegendCard(None)
    qtbot.addWidget(card)
    card.show_legend(Legend("Height", ("#000000", "#ffffff"), "0 m", "1 m"))
    small = card.sizeHint()
    card.show_legend(Legend("Height", ("#000000", "#ffffff"), "0 m", "1 m"), "Only zone Upper " * 3)
    assert card.sizeHint().height() > small.height()
    assert card.sizeHint().width() > card.fontMetrics().horizontalAdvance("Only zone Upper " * 3)


def test_the_best_place_is_shown_with_its_surroundings_from_where_it_is_seen(qtbot, view):
    place = (741_000.0, 4_279_008.0, 150.0)
    view.fly_to(place)
    assert view.scene.is_hidden(np.array([place]))[0]
    view.show_place(place)
    assert not view.scene.is_hidden(np.array([place]))[0]
    assert view.camera.height > 0.5 * view.scene.extent
    pixel = view.scene.project(np.array(place)) / view.devicePixelRatioF()
    assert pixel == pytest.approx([view.canvas.width() / 2, view.canvas.height() / 2], abs=2)
    rest(qtbot, view)
