import os
import subprocess
import sys
from pathlib import Path

import pytest

pytest.importorskip("qtpy", reason="the panel's packages are not installed", exc_type=ImportError)
pytest.importorskip("pyvista", reason="the panel's packages are not installed")

from qtpy.QtCore import QSettings, Qt, QTimer
from qtpy.QtTest import QTest
from qtpy.QtWidgets import QApplication, QDialogButtonBox

from trigpoint_panel import app
from trigpoint_panel.crsfield import CrsField
from trigpoint_panel.host import StandaloneHost
from trigpoint_panel.strip import MessageStrip
from trigpoint_panel.style import DARK, LIGHT, apply_theme, look_of
from trigpoint_panel.window import Window


@pytest.fixture
def window(qtbot, tmp_path):
    settings = QSettings(str(tmp_path / "settings.ini"), QSettings.Format.IniFormat)
    made = Window(settings, canvas="image", scratch=tmp_path / "scratch")
    made.show()
    yield made
    made.panel.session.discard_autosave()
    assert made.end()
    made.ask_unsaved = lambda: "discard"
    made.close()
    made.deleteLater()
    qtbot.wait(1)


def test_a_laptops_bar_names_what_is_opened_and_says_where_to_snap(window, qtbot):
    bar = window.panel.bar
    window.resize(1024, 600)
    qtbot.wait(20)
    beside = Qt.ToolButtonStyle.ToolButtonTextBesideIcon
    for name in ("open_source", "open_target"):
        assert bar.widgetForAction(window.panel.action(name)).toolButtonStyle() == beside
    assert bar.radius.isVisible()
    assert not bar._arrow.isVisible()


def test_what_is_on_has_a_tick_in_a_menu(window):
    for action in window.panel.actions_by_name.values():
        assert not (action.isCheckable() and action.isIconVisibleInMenu())


@pytest.mark.parametrize("width", [None, 1366, 1092, 960, 700, 480])
def test_the_menu_is_in_reach_at_every_width(window, qtbot, width):
    if width is not None:
        window.resize(width, 600)
    window.activateWindow()
    qtbot.waitUntil(lambda: width is None or window.width() == width, timeout=2000)
    qtbot.waitUntil(window.isActiveWindow, timeout=2000)  # a display may let it wait for its keys
    bar = window.panel.bar
    assert bar.menu_button.isVisible()
    assert bar.rect().contains(bar.menu_button.geometry())
    seen = []

    def look():
        seen.append(QApplication.activePopupWidget())
        seen[0].close()

    QTimer.singleShot(100, look)
    QTest.keyClick(window.panel.views.source, Qt.Key.Key_F10)
    qtbot.waitUntil(lambda: bool(seen), timeout=2000)
    assert seen == [bar.menu]


def test_the_first_window_shows_its_words_and_a_narrow_one_an_arrow(window, qtbot):
    bar, beside = window.panel.bar, Qt.ToolButtonStyle.ToolButtonTextBesideIcon
    buttons = [bar.widgetForAction(window.panel.action(name)) for name in ("link", "pane")]
    window.resize(1320, 700)
    qtbot.wait(20)
    assert [button.toolButtonStyle() for button in buttons] == [beside, beside]
    assert not bar._arrow.isVisible()
    window.panel.action("pane").setChecked(False)
    window.resize(480, 600)
    qtbot.wait(20)
    assert bar._arrow.isVisible()
    held = bar._arrow.icon().pixmap(12, 12).toImage()
    assert any(held.pixelColor(x, y).alpha() for x in range(12) for y in range(12))


def test_what_to_snap_to_and_how_far_around_are_in_reach_in_a_narrow_dock(window, qtbot):
    bar = window.panel.bar
    window.resize(480, 600)
    bar.snap.setCurrentIndex(bar.snap.findData("corner"))
    qtbot.wait(20)
    for field in (bar.snap, bar.radius):
        assert field.isVisible()
        assert bar.rect().contains(field.geometry())
        assert not field.geometry().intersects(bar._arrow.geometry())


def test_a_radius_is_asked_for_where_there_is_one(window):
    bar = window.panel.bar
    assert not bar.radius.isEnabled()
    bar.snap.setCurrentIndex(1)
    assert bar.radius.isEnabled()
    window.resize(700, 600)
    assert bar.radius.isEnabled()


@pytest.mark.parametrize("lacking", ["pyvistaqt", "matplotlib"])
def test_without_its_packages_it_says_what_to_install(capsys, monkeypatch, lacking):
    monkeypatch.setattr(
        app.importlib.util, "find_spec", lambda name: None if name == lacking else 1
    )
    with pytest.raises(SystemExit) as stopped:
        app.main([])
    assert stopped.value.code == 2
    told = capsys.readouterr().err
    assert told.startswith(f"trigpoint-panel: {lacking} missing. Install what the panel needs: ")
    assert told.endswith('pip install "trigpoint[panel]"\n')


def test_the_command_line_loads_no_qt_until_it_must():
    code = (
        "import sys, trigpoint_panel.app;"
        "print([name for name in sys.modules if 'Qt' in name or 'vtk' in name])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "[]\n"


def test_it_says_its_version(capsys):
    import trigpoint

    with pytest.raises(SystemExit) as stopped:
        app.main(["--version"])
    assert stopped.value.code == 0
    assert capsys.readouterr().out == f"trigpoint {trigpoint.__version__}\n"


def test_the_demo_opens_the_clock_tower(window, qtbot, tmp_path, monkeypatch):
    from trigpoint import synthetic

    small = synthetic.clock_tower(density=0.05)
    monkeypatch.setattr(synthetic, "clock_tower", lambda: small)
    window.panel.open_demo(tmp_path / "demo")
    panel = window.panel
    qtbot.waitUntil(
        lambda: panel.foot.job is None and all(panel.views.opened.values()), timeout=60_000
    )
    assert (tmp_path / "demo" / "project.toml").is_file()
    assert "6 control, 4 check" in panel.line.text
    assert window.strip.texts() == []
    assert window.windowTitle() == "project.toml"


def test_a_cloud_given_on_the_command_line_of_the_wrong_kind_is_told(window, qtbot, tmp_path):
    (tmp_path / "broken.toml").write_text("[project", "utf-8")
    window.panel.desk.open_dropped(tmp_path / "broken.toml")
    qtbot.waitUntil(lambda: bool(window.strip.texts()), timeout=10_000)
    assert "broken.toml" in window.strip.texts()[0]


@pytest.mark.parametrize(("answer", "closes"), [("cancel", False), ("discard", True)])
def test_only_closing_with_changes_asks(window, answer, closes):
    window.ask_unsaved = lambda: answer
    window.panel.model.place("source", (1, 2, 3))
    assert window.windowTitle() == "untitled *"
    assert window.close() is closes


def test_closing_without_changes_asks_nothing(window):
    window.ask_unsaved = lambda: pytest.fail("it asked")
    assert window.close()


def test_closing_leaves_no_autosave_of_what_was_undone(window, tmp_path):
    window.panel.model.place("source", (1, 2, 3))
    window.panel.desk.autosave()
    assert list((tmp_path / "scratch").iterdir())
    window.panel.model.undo()
    assert window.close()
    assert list((tmp_path / "scratch").iterdir()) == []


def test_saving_on_the_way_out(window, tmp_path):
    window.ask_unsaved = lambda: "save"
    window.host.save_file = lambda *_: tmp_path / "kept.trig.json"
    window.panel.model.place("source", (1, 2, 3))
    assert window.close()
    assert (tmp_path / "kept.trig.json").is_file()


def test_a_read_only_folder_keeps_the_window_open(window, tmp_path):
    window.ask_unsaved = lambda: "save"
    window.host.save_file = lambda *_: tmp_path / "no" / "such" / "folder.trig.json"
    (tmp_path / "no").write_text("a file where a folder should be", "utf-8")
    window.panel.model.place("source", (1, 2, 3))
    assert not window.close()
    assert "can't be written" in window.strip.texts()[0]


def test_an_error_that_nobody_foresaw_is_a_message(window, qtbot, capsys):
    try:
        1 / 0  # noqa: B018
    except ZeroDivisionError as error:
        window.report(type(error), error, error.__traceback__)
    qtbot.waitUntil(lambda: bool(window.strip.texts()), timeout=2000)
    assert window.strip.texts() == ["Something went wrong: ZeroDivisionError: division by zero."]
    assert "test_app.py" in window.strip.messages[0].details
    assert "ZeroDivisionError" in capsys.readouterr().err


def test_messages_that_come_together_in_a_narrow_window_cover_nothing(window, qtbot):
    window.resize(480, 640)
    ways = [(name, lambda: None) for name in ("Choose a CRS", "Keep as it is", "Open the folder")]
    long = "Opening /home/analyst/projects/deliveries/a_reconstruction.ply: it was cut short. " * 4
    window.host.message("error", 2 * long, "Traceback")
    qtbot.wait(200)
    window.host.clear_messages()
    window.host.message("warning", "It names no vertical datum: heights are as given.", "why", ways)
    qtbot.wait(200)
    window.host.message("warning", long, "why", ways)
    window.host.message("success", "Saved.")
    qtbot.wait(200)
    for message in window.strip.messages:
        assert message.height() >= message.minimumSizeHint().height()
        for button in message.buttons[:-1]:
            assert not button.geometry().intersects(message.sentence.geometry())


def test_the_strip_shows_the_newest_on_top_and_the_same_once(qtbot):
    strip = MessageStrip()
    qtbot.addWidget(strip)
    assert strip.isHidden()
    done = []
    for text in ("one", "two", "three", "four", "two"):
        strip.add("warning", text, "why", [("Do it", lambda text=text: done.append(text))])
    assert strip.texts() == ["two", "four", "three"]
    strip.messages[0].buttons[0].click()
    assert done == ["two"]
    assert strip.texts() == ["four", "three"]
    message = strip.messages[0]
    assert message.accessibleName() == "Warning: four"
    message.buttons[1].click()
    message.buttons[2].click()
    assert QApplication.clipboard().text() == "four\n\nwhy"
    strip.clear()
    assert strip.isHidden()


PATH = "/survey/" + "a-folder-with-a-long-name/" * 12 + "project.toml"


@pytest.mark.parametrize("text", [f"{PATH} can't be written.", "word " * 60, PATH.replace("/", "")])
def test_a_long_message_is_read_whole_and_widens_nothing(window, qtbot, text):
    window.resize(700, 600)
    narrowest = window.minimumSizeHint().width()
    ways_out = [("Restore", lambda: None), ("Delete them", lambda: None)]
    message = window.strip.add("error", text, "why", ways_out)
    qtbot.waitUntil(lambda: message.height() >= message.sentence.height() > 30, timeout=2000)
    assert window.minimumSizeHint().width() == narrowest
    assert window.width() == 700
    sentence = message.sentence
    lines = int(sentence.document().size().height())
    assert 1 < lines <= 5
    assert sentence.viewport().height() >= lines * sentence.fontMetrics().lineSpacing()
    assert sentence.verticalScrollBar().maximum() == 0
    sentence.selectAll()
    sentence.copy()
    assert QApplication.clipboard().text() == text
    window.resize(1200, 600)
    qtbot.waitUntil(lambda: int(sentence.document().size().height()) < lines, timeout=2000)


def test_a_message_stays_while_what_it_offers_can_be_given_up(qtbot):
    strip = MessageStrip()
    qtbot.addWidget(strip)
    asked = []
    message = strip.add("error", "no CRS", "", [("Choose a CRS…", lambda: asked.append(1))])
    message.buttons[0].click()
    assert asked == [1]
    assert strip.texts() == ["no CRS"]


@pytest.mark.parametrize(("width", "below"), [(800, True), (1500, False)])
def test_a_message_has_room_beside_its_buttons_or_above_them(window, qtbot, width, below):
    window.resize(width, 600)
    ways = [(text, lambda: None) for text in ("Choose a CRS…", "Keep as it is", "Open the folder")]
    message = window.strip.add("warning", "word " * 30, "why", ways)
    qtbot.waitUntil(lambda: message.width() == width, timeout=2000)
    qtbot.waitUntil(lambda: message.sentence.width() >= 400, timeout=2000)
    under = message.sentence.geometry().bottom
    qtbot.waitUntil(lambda: (message.buttons[0].y() > under()) is below, timeout=2000)


def test_a_message_of_many_lines_leaves_room_and_scrolls(window, qtbot):
    message = window.strip.add("error", "\n".join(map(str, range(200))))
    qtbot.waitUntil(lambda: message.sentence.verticalScrollBar().maximum() > 100, timeout=2000)
    assert message.height() < 150
    line = message.sentence.cursorRect().height()
    assert message.sentence.height() == 5 * line + 2  # and nothing of a sixth
    longer = [window.strip.add("error", f"{'word ' * 130}{k}") for k in range(3)]
    line = longer[0].sentence.cursorRect().height()
    window.resize(720, 700)
    for each in longer:
        qtbot.waitUntil(lambda each=each: each.sentence.height() == 5 * line + 2, timeout=2000)
        qtbot.waitUntil(lambda each=each: each.height() >= each.sentence.height() + 8, timeout=2000)


def test_a_crs_is_named_back_before_it_is_taken(qtbot):
    taken = []
    field = CrsField(None, "", taken.append)
    qtbot.addWidget(field)
    field.show()
    ok = field.buttons.button(QDialogButtonBox.StandardButton.Ok)
    field.field.setText("4326")
    assert "degrees" in field.found.text()
    assert not ok.isEnabled()
    field.field.setText("EPSG:99")
    assert not ok.isEnabled()
    field.field.setText("32615")
    assert field.found.text() == "WGS 84 / UTM zone 15N"
    QTest.keyClick(field.field, Qt.Key.Key_Return)
    assert taken == ["EPSG:32615"]


def test_settings_come_back_as_what_they_were(qtbot, tmp_path):
    strip = MessageStrip()
    qtbot.addWidget(strip)
    path = str(tmp_path / "settings.ini")
    host = StandaloneHost(strip, strip, QSettings(path, QSettings.Format.IniFormat))
    for key, value in (("on", True), ("count", 7), ("size", 2.5), ("name", "x")):
        host.set_setting(key, value)
    host._settings.sync()
    again = StandaloneHost(strip, strip, QSettings(path, QSettings.Format.IniFormat))
    assert again.setting("on", False) is True
    assert again.setting("count", 0) == 7
    assert again.setting("size", 0.0) == 2.5
    assert again.setting("name", "") == "x"
    assert again.setting("other", 3) == 3


def test_words_are_legible_in_both_themes(qapp):
    def luminance(colour):
        parts = [int(colour[i : i + 2], 16) / 255 for i in (1, 3, 5)]
        linear = [p / 12.92 if p <= 0.04045 else ((p + 0.055) / 1.055) ** 2.4 for p in parts]
        return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]

    def contrast(one, other):
        high, low = sorted((luminance(one), luminance(other)), reverse=True)
        return (high + 0.05) / (low + 0.05)

    for look in (LIGHT, DARK):
        for ink in (look.text, look.faint, look.success, look.warning, look.error, look.info):
            assert contrast(ink, look.window) >= 4.5, (ink, look.window)
        for ground in (look.base, look.amber_row, look.red_row, look.bar):
            assert contrast(look.text, ground) >= 4.5, ground
        assert contrast(look.on_accent, look.accent) >= 4.5
    before, name = qapp.palette(), qapp.style().objectName()
    try:
        apply_theme(qapp, "dark")
        assert look_of() is DARK
    finally:
        qapp.setStyle(name)
        qapp.setPalette(before)


def test_the_process_ends_when_its_window_closes(tmp_path):
    code = (
        "import sys; from qtpy.QtCore import QTimer; from trigpoint_panel import app, window;"
        "show = window.Window.show;"
        "window.Window.show = lambda self: (show(self), QTimer.singleShot(1500, self.close));"
        "app.main([])"
    )
    place = {
        "HOME": str(tmp_path),
        "XDG_DATA_HOME": str(tmp_path),
        "XDG_CONFIG_HOME": str(tmp_path),
    }
    done = subprocess.run(
        [sys.executable, "-c", code],
        env=os.environ | place,
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert "Traceback" not in done.stderr
    assert Path(tmp_path).is_dir()


def started(tmp_path, code, **more):
    """Run the panel in a process of its own, as a terminal does."""
    place = dict.fromkeys(("HOME", "XDG_DATA_HOME", "XDG_CONFIG_HOME"), str(tmp_path))
    return subprocess.run(
        [sys.executable, "-c", code],
        env={**os.environ, **place, **more},
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="displays are Linux's")
def test_without_a_display_it_says_so_in_one_sentence(tmp_path):
    nowhere = dict.fromkeys(app.DISPLAYS, "")
    done = started(tmp_path, "from trigpoint_panel import app; app.main([])", **nowhere)
    assert done.returncode == 2
    assert done.stderr.startswith("trigpoint-panel: There is no display (")
    assert len(done.stderr.splitlines()) == 1


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="displays are Linux's")
@pytest.mark.parametrize(
    ("given", "why"),
    [
        ({"DISPLAY": ":4099", "QT_QPA_PLATFORM": "xcb"}, "could not connect to display :4099"),
        ({"QT_QPA_PLATFORM": "canvas"}, 'Could not find the Qt platform plugin "canvas"'),
    ],
)
def test_a_display_that_is_not_there_is_told_in_one_sentence(tmp_path, given, why):
    nowhere = dict.fromkeys(app.DISPLAYS, "")
    done = started(tmp_path, "from trigpoint_panel import app; app.main([])", **nowhere | given)
    assert done.returncode == 2
    assert done.stderr.startswith("trigpoint-panel: Qt can't show a window with ")
    assert all(f"{name}={value}" in done.stderr for name, value in given.items())
    assert why in done.stderr
    assert done.stderr.endswith("start it on a desktop.\n")
    assert len(done.stderr.splitlines()) == 1


@pytest.mark.skipif(sys.platform == "win32", reason="signals are sent otherwise there")
def test_an_interrupt_closes_the_window(tmp_path):
    code = (
        "import os, signal; from qtpy.QtCore import QTimer; from trigpoint_panel import app;"
        "begin = app.close_on_interrupt;"
        "later = lambda: os.kill(os.getpid(), signal.SIGINT);"
        "app.close_on_interrupt = lambda w: (QTimer.singleShot(1000, later), begin(w))[1];"
        "app.main([])"
    )
    done = started(tmp_path, code)
    assert done.returncode == 0, done.stderr
    assert "Traceback" not in done.stderr
