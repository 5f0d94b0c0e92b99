"""Views under real mouse events, on both canvases: clicks pick, and drags turn."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

pytest.importorskip("qtpy", reason="the panel's packages are not installed", exc_type=ImportError)
from qtpy import QtCore, QtGui, QtWidgets

from trigpoint_panel import stage
from trigpoint_panel.canvas import GlCanvas
from trigpoint_panel.link import Link
from trigpoint_panel.loupe import SIDE, ZOOM, narrowed
from trigpoint_panel.marks import Marker
from trigpoint_panel.steering import WHEEL
from trigpoint_panel.view import CloudView

Left, Right = QtCore.Qt.MouseButton.LeftButton, QtCore.Qt.MouseButton.RightButton
Control, Shift = (
    QtCore.Qt.KeyboardModifier.ControlModifier,
    QtCore.Qt.KeyboardModifier.ShiftModifier,
)


@pytest.fixture(params=["image", "gl"])
def kind(request, qapp):
    if request.param == "gl" and qapp.platformName() in ("offscreen", "minimal"):
        pytest.skip("OpenGL widgets need a display; there is none")
    return request.param


@pytest.fixture
def shown(qtbot, kind):
    """Show a view in a window, and close it cleanly."""

    def make(side="target", opened=None, size=(500, 420)):
        made = CloudView(side, canvas=kind)
        # It keeps the view until then: qtbot alone would not.
        qtbot.addWidget(made, before_close_func=lambda _: made.shutdown())
        made.resize(*size)
        if opened is not None:
            made.set_cloud(opened)
        with qtbot.waitExposed(made):
            made.show()
        qtbot.waitUntil(lambda: made.canvas is not None)
        rest(qtbot, made)
        return made

    return make


def rest(qtbot, view):
    qtbot.wait(20)
    qtbot.waitUntil(lambda: not view._rest.isActive())
    qtbot.wait(20)


def middle(view, dx=0, dy=0):
    return view.canvas.surface.rect().center() + QtCore.QPoint(dx, dy)


def drag(qtbot, view, dx, dy, button=Left, modifier=QtCore.Qt.KeyboardModifier.NoModifier):
    surface, start = view.canvas.surface, middle(view)
    qtbot.mousePress(surface, button, modifier, start)
    for k in range(1, 6):
        at = start + QtCore.QPoint(dx * k // 5, dy * k // 5)
        event = QtGui.QMouseEvent(
            QtCore.QEvent.Type.MouseMove,
            QtCore.QPointF(at),
            QtCore.QPointF(surface.mapToGlobal(at)),
            QtCore.Qt.MouseButton.NoButton,
            button,
            modifier,
        )
        QtWidgets.QApplication.sendEvent(surface, event)
    qtbot.mouseRelease(surface, button, modifier, start + QtCore.QPoint(dx, dy))


def pixel(view, xyz):
    """Where a place is on the widget, in Qt's pixels."""
    x, y = view.scene.project(xyz) / view.devicePixelRatioF()
    return np.array([x, view.canvas.height() - y])


def inked(view):
    picture = (
        view.canvas.surface.grab().toImage().convertToFormat(QtGui.QImage.Format.Format_RGB888)
    )
    bits = picture.constBits()
    if hasattr(bits, "setsize"):  # PyQt hands out a pointer that knows no end
        bits.setsize(picture.sizeInBytes())
    rows = np.frombuffer(bytes(bits), np.uint8)
    rows = rows.reshape(picture.height(), picture.bytesPerLine())[:, : 3 * picture.width()]
    ground = np.round(255 * np.array(view.scene.background))
    pixels = rows.reshape(picture.height(), picture.width(), 3).astype(int)
    return (np.abs(pixels - ground).max(axis=2) > 12).mean()


class Renders:
    """Counts the pictures that VTK draws."""

    def __init__(self, view):
        self.count = 0
        view.scene.renderer.AddObserver("EndEvent", self._add)

    def _add(self, *_):
        self.count += 1


def test_nothing_is_drawn_before_the_view_is_shown_and_everything_then(qtbot, kind, opened_tower):
    view = CloudView("target", canvas=kind)
    qtbot.addWidget(view, before_close_func=lambda _: view.shutdown())
    view.set_cloud(opened_tower())
    view.set_markers([Marker((741_000.0, 4_279_000.0, 170.0), "P1")])
    view.fly_to((741_000.0, 4_279_000.0, 170.0))
    view.set_overlay(opened_tower(200))
    assert view.canvas is None
    camera = view.camera
    with qtbot.waitExposed(view):
        view.show()
    qtbot.waitUntil(lambda: view.canvas is not None)
    rest(qtbot, view)
    assert view.canvas.kind == kind
    assert view.camera == camera
    assert inked(view) > 0.05


def test_a_view_that_floats_before_its_first_picture_shows_its_cloud(qtbot, kind, opened_tower):
    window = QtWidgets.QMainWindow()
    dock = QtWidgets.QDockWidget("dock", window)
    view = CloudView("target", canvas=kind)
    dock.setWidget(view)
    window.addDockWidget(QtCore.Qt.DockWidgetArea.RightDockWidgetArea, dock)
    view.set_cloud(opened_tower())
    qtbot.addWidget(window)
    window.show()
    dock.setFloating(True)
    dock.resize(400, 400)
    qtbot.waitUntil(lambda: view.canvas is not None)
    rest(qtbot, view)
    assert inked(view) > 0.05
    dock.setFloating(False)
    rest(qtbot, view)
    assert inked(view) > 0.02
    view.shutdown()


def test_a_click_picks_what_is_under_it(qtbot, shown, opened_tower):
    opened = opened_tower()
    view = shown(opened=opened)
    view.set_picking(True)
    for dx, dy in ((0, 0), (7, 21), (-9, 40)):
        at = middle(view, dx, dy)
        with qtbot.waitSignal(view.picked) as signal:
            qtbot.mouseClick(view.canvas.surface, Left, pos=at)
        picked = signal.args[0]
        assert np.hypot(*(pixel(view, np.array(picked.xyz)) - [at.x(), at.y()])) <= 6
        # The very number that the file holds.
        assert (opened.cloud.coordinates == picked.xyz).all(axis=1).any()
        assert picked.raw == picked.xyz
        assert 0 < picked.sigma < 0.5
        assert picked.note == ""


def test_without_picking_a_click_does_nothing(qtbot, shown, opened_tower):
    view = shown(opened=opened_tower())
    with qtbot.assertNotEmitted(view.picked), qtbot.assertNotEmitted(view.refused):
        qtbot.mouseClick(view.canvas.surface, Left, pos=middle(view))


def test_a_click_beside_the_cloud_says_why_it_picked_nothing(qtbot, shown, opened_tower):
    view = shown(opened=opened_tower())
    view.set_picking(True)
    with qtbot.waitSignal(view.refused) as signal, qtbot.assertNotEmitted(view.picked):
        qtbot.mouseClick(view.canvas.surface, Left, pos=QtCore.QPoint(3, 3))
    assert "no point within 5 pixels" in signal.args[0]


def test_a_drag_turns_and_does_not_pick(qtbot, shown, opened_tower):
    view = shown(opened=opened_tower())
    view.set_picking(True)
    before = view.camera
    with qtbot.waitSignal(view.camera_changed), qtbot.assertNotEmitted(view.picked):
        drag(qtbot, view, 60, 20)
    assert view.camera.position != before.position
    assert view.camera.focal_point == before.focal_point
    assert view.camera.up == (0.0, 0.0, 1.0)


def test_a_hand_that_trembles_still_picks(qtbot, shown, opened_tower):
    view = shown(opened=opened_tower())
    view.set_picking(True)
    with qtbot.waitSignal(view.picked):
        drag(qtbot, view, 2, 1)


@pytest.mark.parametrize(
    ("button", "modifier"),
    [(Right, None), (Left, Shift), (QtCore.Qt.MouseButton.MiddleButton, None)],
)
def test_other_drags_move(qtbot, shown, opened_tower, button, modifier):
    view = shown(opened=opened_tower())
    place = np.array(view.camera.focal_point)
    before = pixel(view, place)
    drag(qtbot, view, 50, -30, button, modifier or QtCore.Qt.KeyboardModifier.NoModifier)
    assert pixel(view, place) - before == pytest.approx([50, -30], abs=1)


def test_the_wheel_zooms_to_the_cursor(qtbot, shown, opened_tower):
    view = shown(opened=opened_tower())
    at = QtCore.QPointF(middle(view, 60, 30))
    event = QtGui.QWheelEvent(
        at,
        at,
        QtCore.QPoint(),
        QtCore.QPoint(0, 240),
        QtCore.Qt.MouseButton.NoButton,
        QtCore.Qt.KeyboardModifier.NoModifier,
        QtCore.Qt.ScrollPhase.NoScrollPhase,
        False,
    )
    before = view.camera
    under = np.asarray(
        before.panned(60 / view.canvas.height(), -30 / view.canvas.height()).focal_point
    )
    QtWidgets.QApplication.sendEvent(view.canvas.surface, event)
    assert view.camera.height == pytest.approx(before.height / WHEEL**2)
    assert pixel(view, under) == pytest.approx([at.x(), at.y()], abs=1.5)
    qtbot.wait(10)


def test_rolling_makes_a_lying_cloud_stand(qtbot, shown, opened_tower):
    view = shown(opened=opened_tower())
    drag(qtbot, view, 40, 0, Left, Control)
    assert view.camera.up != (0.0, 0.0, 1.0)
    assert view.scene.up == view.camera.up


def test_a_double_click_flies_there_unless_picking(qtbot, shown, opened_tower):
    view = shown(opened=opened_tower())
    height = view.camera.height
    qtbot.mouseDClick(view.canvas.surface, Left, pos=middle(view, 0, 20))
    assert view.camera.height < 0.5 * height
    rest(qtbot, view)


def test_one_action_draws_one_picture(qtbot, shown, opened_tower):
    view = shown(opened=opened_tower())
    renders = Renders(view)
    view.set_markers([Marker((741_000.0, 4_279_000.0, 170.0), "P1")])
    view.set_ghost(Marker((741_001.0, 4_279_000.0, 170.0), "P2?", "ghost"))
    view.set_point_size(4)
    view.colour_by("height")
    view.set_camera(replace(view.camera, parallel_scale=30.0))
    rest(qtbot, view)
    assert renders.count == 1
    qtbot.wait(300)
    assert renders.count == 1
    view.set_markers([Marker((741_000.0, 4_279_000.0, 170.0), "P1")])
    qtbot.wait(50)
    assert renders.count == 1


def test_few_points_are_drawn_while_the_view_moves(qtbot, shown, opened_tower):
    view = shown(opened=opened_tower(60_000))
    assert not view.scene.is_thinned
    drag(qtbot, view, 60, 20)
    assert view.scene.is_thinned
    renders = Renders(view)
    qtbot.waitUntil(lambda: not view.scene.is_thinned, timeout=2000)
    rest(qtbot, view)
    assert renders.count >= 1


def test_what_a_movement_draws_follows_how_long_its_pictures_take(
    qtbot, shown, opened_tower, monkeypatch
):
    view = shown(opened=opened_tower(60_000))
    told = []
    monkeypatch.setattr(
        view.scene._motion.pace, "took", lambda *taken: told.append(taken) and False
    )
    drag(qtbot, view, 60, 20)
    qtbot.waitUntil(lambda: bool(told))
    seconds, drawn = told[0]
    assert 0 < seconds < 10
    assert drawn == view.scene._motion.pace.count < 60_000
    rest(qtbot, view)
    told.clear()
    view.refresh()
    qtbot.wait(50)
    assert not told


def test_the_cameras_are_tied_through_the_similarity(qtbot, shown, opened_tower, similarity_from):
    fit = similarity_from(4, np.array([741_000.0, 4_279_000.0, 150.0]))
    target = opened_tower()
    source = opened_tower(crs=None, coordinates=fit.inverse()(target.cloud.coordinates))
    a, b = shown("source", source), shown("target", target)
    link = Link(a, b)
    assert not link.is_tied
    link.follow(fit)
    places = target.cloud.coordinates[::5000]
    for lead in (b, a):
        drag(qtbot, lead, 50, -25)
        rest(qtbot, a)
        rest(qtbot, b)
        for place in places:
            there = pixel(a, fit.inverse()(place[None])[0])
            assert there == pytest.approx(pixel(b, place), abs=1.0)
    b.set_parallel(True)
    assert a.camera.parallel
    assert pixel(a, fit.inverse()(places)[0]) == pytest.approx(pixel(b, places[0]), abs=1.0)
    link.follow(None)
    before = a.camera
    drag(qtbot, b, 30, 30)
    assert a.camera == before


def test_a_snapped_pick_carries_its_sigma_and_how_it_came(qtbot, shown, opened_tower):
    corner = np.array([741_002.0, 4_278_998.0, 170.0])
    view = shown(opened=opened_tower(60_000))
    view.fly_to(tuple(corner))
    rest(qtbot, view)
    view.set_picking(True)
    view.set_snap("corner", 1.2)
    with qtbot.waitSignal(view.picked) as signal:
        qtbot.mouseClick(view.canvas.surface, Left, pos=middle(view, -2, 3))
    picked = signal.args[0]
    assert np.linalg.norm(np.array(picked.xyz) - corner) < 0.01
    assert picked.sigma < 0.05
    assert "corner of three planes within 1.2" in picked.note
    assert f"clicked {picked.raw[0]:.3f}" in picked.note
    view.set_snap("corner", 0.01)
    with qtbot.waitSignal(view.refused) as refusal:
        qtbot.mouseClick(view.canvas.surface, Left, pos=middle(view, -2, 3))
    assert "larger radius" in refusal.args[0]


def test_hovering_tells_the_point_once_the_mouse_rests(qtbot, shown, opened_tower):
    view = shown(opened=opened_tower())
    with qtbot.waitSignal(view.hovered, timeout=2000) as signal:
        qtbot.mouseMove(view.canvas.surface, middle(view))
        drag_free = QtGui.QMouseEvent(
            QtCore.QEvent.Type.MouseMove,
            QtCore.QPointF(middle(view)),
            QtCore.QPointF(view.canvas.surface.mapToGlobal(middle(view))),
            QtCore.Qt.MouseButton.NoButton,
            QtCore.Qt.MouseButton.NoButton,
            QtCore.Qt.KeyboardModifier.NoModifier,
        )
        QtWidgets.QApplication.sendEvent(view.canvas.surface, drag_free)
    assert signal.args[0] is not None


def test_the_magnifier_shows_four_times_as_large(qtbot, shown, opened_tower):
    view = shown(opened=opened_tower())
    place = tuple(view.scene.coordinates(view.scene.pick_at(250, 250)))
    view.magnify(True, at=place)
    qtbot.wait(50)
    loupe = view._magnifier._loupe
    assert loupe.isVisible()
    x, y = pixel(view, np.array(place))
    size = view.canvas.width(), view.canvas.height()
    near = narrowed(view.camera, (x, y), size, SIDE / ZOOM)
    # A pixel of the inset is a quarter of one of the view.
    assert near.height / SIDE == pytest.approx(view.camera.height / size[1] / ZOOM, rel=0.05)
    view.magnify(False)
    assert not loupe.isVisible()
    view.set_cloud(None)
    view.magnify(True)
    assert view._magnifier._loupe is None


def test_an_opengl_widget_without_a_context_gives_way_to_the_image(
    qtbot, kind, opened_tower, monkeypatch
):
    if kind == "image":
        pytest.skip("it is about OpenGL widgets")
    monkeypatch.setattr(GlCanvas, "works", property(lambda _: False))
    monkeypatch.setattr(stage, "PATIENCE", 50)
    view = CloudView("target", canvas="gl")
    qtbot.addWidget(view, before_close_func=lambda _: view.shutdown())
    view.set_cloud(opened_tower())
    view.set_markers([Marker((741_000.0, 4_279_000.0, 170.0), "P1")])
    view.show()
    qtbot.waitUntil(lambda: view.canvas is not None and view.canvas.kind == "image", timeout=3000)
    rest(qtbot, view)
    assert inked(view) > 0.05
    view.set_picking(True)
    with qtbot.waitSignal(view.picked):
        qtbot.mouseClick(view.canvas.surface, Left, pos=middle(view))


def test_keys_are_left_to_whoever_holds_the_view(qtbot, kind, opened_tower):
    class Holder(QtWidgets.QWidget):
        keys: list[int] = []  # noqa: RUF012

        def keyPressEvent(self, event):  # noqa: N802
            self.keys.append(event.key())

    holder = Holder()
    layout = QtWidgets.QVBoxLayout(holder)
    view = CloudView("target", canvas=kind)
    layout.addWidget(view)
    view.set_cloud(opened_tower(2000))
    qtbot.addWidget(holder)
    with qtbot.waitExposed(holder):
        holder.show()
    qtbot.waitUntil(lambda: view.canvas is not None)
    qtbot.mouseClick(view.canvas.surface, Left, pos=middle(view))
    assert view.hasFocus() or not holder.isActiveWindow()
    for key in (QtCore.Qt.Key.Key_Q, QtCore.Qt.Key.Key_W, QtCore.Qt.Key.Key_E):
        qtbot.keyClick(view, key)
    assert Holder.keys == [QtCore.Qt.Key.Key_Q, QtCore.Qt.Key.Key_W, QtCore.Qt.Key.Key_E]
    view.shutdown()


def test_a_file_can_be_dropped(qtbot, shown, tmp_path):
    view = shown()
    mime = QtCore.QMimeData()
    mime.setUrls([QtCore.QUrl.fromLocalFile(str(tmp_path / "a.laz"))])
    accepted = []
    event = SimpleNamespace(mimeData=lambda: mime, acceptProposedAction=lambda: accepted.append(1))
    view.dragEnterEvent(event)
    assert accepted
    with qtbot.waitSignal(view.dropped) as signal:
        view.dropEvent(event)
    assert signal.args == [str(tmp_path / "a.laz")]


def test_the_header_says_what_is_shown(shown, opened_tower):
    view = shown()
    assert view.header.label.text() == "Reference"
    assert not view.header.colour.isVisible()
    view.set_cloud(opened_tower(total=62_000_000))
    assert view.header.label.text() == "Reference: tower.laz, EPSG:32615, m, 30 k of 62.0 M points"
    assert "30,000 of 62,000,000 points shown" in view.header.label.toolTip()
    assert "UTM zone 15N" in view.header.label.toolTip()
    assert [view.header.colour.itemText(k) for k in range(2)] == ["Own colours", "Height"]
    view.header.colour.setCurrentIndex(1)
    view.header.colour.activated.emit(1)
    assert view.scene.mode == "height"
    assert view.legend.isVisible()
    assert view.legend.accessibleName().startswith("Height from 150")
    view.set_cloud(None)
    assert view.header.label.text() == "Reference"
    assert not view.legend.isVisible()


@pytest.mark.parametrize(("by", "offers"), [((0, 0), True), ((60, 20), False)])
def test_a_right_click_offers_a_menu_and_a_right_drag_moves(qtbot, shown, opened_tower, by, offers):
    view = shown("target", opened_tower())
    menu = view.header.more.menu()
    drag(qtbot, view, *by, button=Right)
    assert menu.isVisible() is offers
    assert [each.text() for each in menu.actions()][:3] == ["Fit", "", "Front"]
    menu.close()


@pytest.mark.parametrize(("wide", "tools"), [(600, 5), (400, 4), (320, 3), (250, 2)])
def test_a_narrow_header_keeps_the_name_and_drops_what_has_keys(shown, opened_tower, wide, tools):
    view = shown(opened=opened_tower(2000), size=(wide, 300))
    header = view.header
    parts = (header.colour, header.more, header.fit, header.eye_dome, header.size_slider)
    assert sum(part.isVisible() for part in parts) == tools
    assert header.label.width() >= 60


def test_a_narrow_header_leaves_whole_facts_out_and_cuts_no_number(shown, opened_tower):
    label = shown(opened=opened_tower(2000), size=(900, 300)).header.label
    whole, metrics = label.text(), label.fontMetrics()
    assert label.shown == whole == "Reference: tower.laz, EPSG:32615, m, 2 k points"
    seen = set()
    for width in range(metrics.horizontalAdvance(whole) + 8, 40, -1):
        label.resize(width, label.height())
        seen.add(label.shown)
    name = "Reference: tower.laz"
    assert {each for each in seen if "…" not in each} == {
        whole,
        f"{name}, EPSG:32615, m",
        f"{name}, EPSG:32615",
        name,
    }
    assert all(name.startswith(each.rstrip("…")) for each in seen if "…" in each)


def test_dark_follows_the_palette(shown, opened_tower):
    view = shown(opened=opened_tower(2000))
    palette = view.palette()
    for colour, dark in (("#202020", True), ("#f0f0f0", False)):
        palette.setColor(QtGui.QPalette.ColorRole.Window, QtGui.QColor(colour))
        view.setPalette(palette)
        assert (view.scene.background[0] < 0.5) == dark


def test_a_turned_source_is_shown_upright(shown, opened_tower):
    points = opened_tower(crs=None).cloud.coordinates[:, [2, 0, 1]]
    view = shown("source", opened_tower(crs=None, coordinates=points))
    assert view.scene.up == pytest.approx((1, 0, 0), abs=0.02)
    view.header.up_chosen.emit((0.0, 0.0, 1.0))
    assert view.camera.up == (0.0, 0.0, 1.0)


def test_a_view_can_be_shut_down_twice_and_never_shown(qtbot, kind, opened_tower):
    view = CloudView("source", canvas=kind)
    qtbot.addWidget(view)
    view.set_cloud(opened_tower(500))
    view.shutdown()
    view.shutdown()
    view.show()
    qtbot.wait(30)
    assert view.canvas is None
    view.set_markers([Marker((0.0, 0.0, 0.0), "P1")])
    view.fit_view()
    view.magnify(True)
