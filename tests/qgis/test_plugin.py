"""The plugin's life, its card and its host inside QGIS's own Python."""

import sys
import time
from pathlib import Path

import pytest

pytest.importorskip("qgis.core", reason="this Python is not QGIS's; .ci/qgis.sh makes one that is")
pytest.importorskip("pytest_qgis", reason="pytest-qgis is not installed")

from qgis.core import Qgis, QgsApplication, QgsSettings, QgsTask
from qgis.PyQt.QtWidgets import QMainWindow, QPushButton

import trigpoint_qgis
from trigpoint_qgis import deps, installer

pytestmark = pytest.mark.qgis


@pytest.fixture(autouse=True)
def settings(qgis_app, tmp_path, monkeypatch):  # noqa: ARG001
    """Give each test a profile of its own."""
    monkeypatch.setattr(
        QgsApplication, "qgisSettingsDirPath", staticmethod(lambda: str(tmp_path) + "/")
    )
    yield QgsSettings()
    QgsSettings().remove("trigpoint")


@pytest.fixture
def plugin(qgis_iface, qgis_processing):  # noqa: ARG001
    for name in ("registerOptionsWidgetFactory", "unregisterOptionsWidgetFactory"):
        if not hasattr(qgis_iface, name):
            setattr(qgis_iface, name, lambda _factory: None)
    made = trigpoint_qgis.classFactory(qgis_iface)
    made.initGui()
    yield made
    made.unload()


def wait_until(true, seconds=10):
    end = time.monotonic() + seconds
    while not true():
        assert time.monotonic() < end, "it took too long"
        QgsApplication.processEvents()
        time.sleep(0.01)


def test_nothing_heavy_is_imported_at_the_start(qgis_iface):
    import subprocess

    code = (
        "import sys\nfrom qgis.core import QgsApplication\napp = QgsApplication([], False)\n"
        "import trigpoint_qgis.plugin\n"
        "print([m for m in ('pyvista', 'vtk', 'trigpoint', 'pandas', 'shapely', 'qtpy') "
        "if m in sys.modules])"
    )
    found = subprocess.run(
        [sys.executable, "-c", code],
        capture_output=True,
        text=True,
        check=True,
        env={**__import__("os").environ, "PYTHONPATH": str(Path(deps.HERE).parent)},
    )
    assert found.stdout.strip().endswith("[]")
    assert qgis_iface is not None


def test_unloading_takes_everything_away(qgis_iface, qgis_processing):  # noqa: ARG001
    registry = QgsApplication.processingRegistry()
    for name in ("registerOptionsWidgetFactory", "unregisterOptionsWidgetFactory"):
        if not hasattr(qgis_iface, name):
            setattr(qgis_iface, name, lambda _factory: None)
    before = list(sys.path)
    for _ in range(2):
        made = trigpoint_qgis.classFactory(qgis_iface)
        made.initGui()
        assert registry.providerById("trigpoint") is not None
        made.unload()
        assert registry.providerById("trigpoint") is None
    assert [entry for entry in sys.path if entry not in before] == []


@pytest.fixture
def lacking(monkeypatch):
    lacks = (deps.Lack("laspy", "2.5", None), deps.Lack("vtk", "9.4.2", "9.3.0"))
    found = list(lacks)
    monkeypatch.setattr(deps, "lacking", lambda *_: tuple(found))
    return found


def test_the_card_says_what_is_missing_why_and_how_big(plugin, lacking):  # noqa: ARG001
    plugin.show_panel()
    wait_until(lambda: plugin.dock.card is not None)
    shown = plugin.dock.card
    assert "Missing: laspy." in shown.text.text()
    assert "an older one crashes QGIS when it quits" in shown.text.text()
    assert deps.SIZE in shown.text.text()
    assert [b.text() for b in shown.findChildren(QPushButton) if not b.isHidden()] == [
        "Install…",
        "Choose folder…",
        "Copy commands",
    ]


def test_the_commands_can_be_copied(plugin, lacking):  # noqa: ARG001
    plugin.show_panel()
    wait_until(lambda: plugin.dock.card is not None)
    plugin.dock.card.copy_commands()
    text = QgsApplication.clipboard().text()
    assert "-m venv --clear --system-site-packages" in text
    assert "numpy==" in text


def test_a_card_whose_commands_have_run_makes_room_when_the_dock_is_opened_again(
    plugin, lacking, monkeypatch
):
    opened = []
    monkeypatch.setattr(type_of_dock(), "_open", lambda _: opened.append(1) or "stopped here")
    plugin.show_panel()
    wait_until(lambda: plugin.dock.card is not None)
    plugin.show_panel(False)
    plugin.show_panel()
    assert not opened, "they are still missing"
    plugin.show_panel(False)
    lacking.clear()
    plugin.show_panel()
    wait_until(lambda: opened)


def test_a_floating_dock_beyond_the_screen_comes_back(plugin, lacking):  # noqa: ARG001
    plugin.show_panel()
    wait_until(lambda: plugin.dock.card is not None)
    dock, free = plugin.dock, plugin.dock.screen().availableGeometry()
    dock.setFloating(False)
    dock.setFloating(True)
    dock.move(free.right() - 50, free.bottom() - 50)
    dock._stay_on_screen()
    assert free.contains(dock.frameGeometry())


def test_a_folder_that_can_t_be_used_is_refused_on_the_card(plugin, lacking, tmp_path):  # noqa: ARG001
    plugin.show_panel()
    wait_until(lambda: plugin.dock.card is not None)
    (tmp_path / "empty").mkdir()
    plugin.dock.card.use(str(tmp_path / "empty"))
    assert "neither" in plugin.dock.card.fault.text()
    assert QgsSettings().value("trigpoint/python_env", "") == ""


def install_with(monkeypatch, work):
    monkeypatch.setattr(installer, "install", work)


def test_an_installation_shows_its_log_and_ends_with_the_panel(plugin, lacking, monkeypatch):
    def work(_folder, _requirements, *, on_line, poll):
        poll()
        on_line("Collecting laspy")
        lacking.clear()

    install_with(monkeypatch, work)
    opened = []
    monkeypatch.setattr(type_of_dock(), "_open", lambda _: opened.append(1) or "stopped here")
    plugin.show_panel()
    wait_until(lambda: plugin.dock.card is not None)
    first = plugin.dock.card
    log = first.log
    first.start()
    assert not first.install.isEnabled()
    assert not first.cancel.isHidden()
    wait_until(lambda: opened)
    assert "Collecting laspy" in log.toPlainText()


def test_an_installation_that_fails_says_why_and_can_be_tried_again(plugin, lacking, monkeypatch):  # noqa: ARG001
    def work(*_given, **_more):
        raise installer.InstallError(installer.classify("No space left"), "No space left")

    install_with(monkeypatch, work)
    plugin.show_panel()
    wait_until(lambda: plugin.dock.card is not None)
    plugin.dock.card.start()
    wait_until(lambda: plugin.dock.card.install.isEnabled())
    assert "disk is full" in plugin.dock.card.fault.text()


def test_an_installation_can_be_cancelled(plugin, lacking, monkeypatch):  # noqa: ARG001
    def work(*_given, poll, **_more):
        for _ in range(500):
            poll()
            time.sleep(0.01)

    install_with(monkeypatch, work)
    plugin.show_panel()
    wait_until(lambda: plugin.dock.card is not None)
    plugin.dock.card.start()
    time.sleep(0.1)
    plugin.dock.card.stop()
    wait_until(lambda: plugin.dock.card.install.isEnabled())
    assert "Cancelled" in plugin.dock.card.fault.text()


def test_a_panel_that_can_t_be_made_is_told_on_the_card(plugin, monkeypatch):
    monkeypatch.setattr(deps, "lacking", lambda *_: ())
    monkeypatch.setitem(sys.modules, "trigpoint_panel.panel", None)
    plugin.show_panel()
    wait_until(lambda: plugin.dock.card is not None)
    assert "ModuleNotFoundError" in plugin.dock.card.fault.text()


def type_of_dock():
    from trigpoint_qgis.dock import TrigpointDock

    return TrigpointDock


@pytest.fixture
def host(qgis_app):  # noqa: ARG001
    pytest.importorskip("qtpy", reason="qtpy is not installed")
    from trigpoint_panel.strip import MessageStrip
    from trigpoint_qgis.host import QgisHost

    window = QMainWindow()
    made = QgisHost(window, MessageStrip(window))
    made.strip = made._strip
    made.window = window
    yield made
    made.shutdown()
    window.deleteLater()


def job(work):
    from trigpoint_panel.jobs import Job

    heard = {"progress": []}
    made = Job("Testing", work)
    made.progress.connect(lambda share, _text: heard["progress"].append(share))
    made.done.connect(lambda found: heard.update(done=found))
    made.failed.connect(lambda said, _details: heard.update(failed=said))
    made.cancelled.connect(lambda: heard.update(cancelled=True))
    return made, heard


def test_a_job_runs_as_a_task_of_qgis(host):
    def work(tick):
        for k in range(5):
            tick(k / 5, "counting")
        return 42

    made, heard = job(work)
    host.run(made)
    assert QgsApplication.taskManager().tasks()[-1].description() == "Trigpoint: Testing"
    wait_until(lambda: "done" in heard)
    assert heard["done"] == 42
    assert heard["progress"] == [0.0, 0.2, 0.4, 0.6, 0.8]


def test_a_job_that_fails_is_told(host):
    def work(_tick):
        message = "no such cloud"
        raise OSError(message)

    made, heard = job(work)
    host.run(made)
    wait_until(lambda: "failed" in heard)
    assert "no such cloud" in heard["failed"]


def endless(tick):
    while True:
        tick(None)
        time.sleep(0.01)


def test_a_task_cancelled_in_qgis_s_own_list_cancels_its_job(host):
    made, heard = job(endless)
    host.run(made)
    time.sleep(0.1)
    QgsApplication.taskManager().cancelAll()
    wait_until(lambda: "cancelled" in heard)


def test_shutting_down_cancels_what_runs(host):
    made, heard = job(endless)
    host.run(made)
    begun = time.monotonic()
    host.shutdown()
    wait_until(lambda: "cancelled" in heard)
    assert time.monotonic() - begun < 3


@pytest.mark.parametrize("value", [True, False, 3, 0.25, "image", b"\x00\x01"])
def test_settings_come_back_as_they_were(host, value):
    host.set_setting("tested", value)
    default = type(value)()
    found = host.setting("tested", default)
    assert bytes(found) == value if isinstance(value, bytes) else found == value


def test_messages_appear_in_the_strip_with_what_can_be_done_and_their_details_in_the_log(host):
    pressed, logged = [1], []
    QgsApplication.messageLog().messageReceived[str, str, Qgis.MessageLevel].connect(
        lambda *said: logged.append(said)
    )
    host.message("error", "The cloud has no CRS.", "found: none", [("Choose", pressed.clear)])
    assert host.strip.texts() == ["The cloud has no CRS."]
    assert logged == [
        ("The cloud has no CRS.\nfound: none", "Trigpoint", Qgis.MessageLevel.Critical)
    ]
    titles = {button.text(): button for button in host.strip.messages[0].buttons}
    assert {"Choose", "Details"} <= set(titles)
    titles["Choose"].click()
    assert not pressed
    host.message("info", "Carried.")
    host.clear_messages()
    assert host.strip.texts() == []


def test_a_message_is_read_whole_where_the_dock_is_narrow(host):
    host.message("error", "The reference lidar.laz has no CRS: " + "choose one. " * 8, "details")
    host.strip.resize(480, 200)
    host.window.resize(480, 300)
    host.window.show()
    wait_until(lambda: host.strip.messages[0].sentence.width() > 300)
    sentence = host.strip.messages[0].sentence
    wait_until(lambda: sentence.verticalScrollBar().maximum() == 0)
    assert sentence.height() > 2 * sentence.fontMetrics().height()


def test_a_message_that_is_shown_follows_a_change_of_theme(plugin, lacking):  # noqa: ARG001
    pytest.importorskip("qtpy", reason="qtpy is not installed")
    from trigpoint_panel.strip import MessageStrip
    from trigpoint_panel.style import LOOKS, palette_of

    plugin.show_panel()
    wait_until(lambda: plugin.dock.card is not None)
    strip = plugin.dock.strip = MessageStrip(plugin.dock.widget())
    message = strip.add("info", "Carried.")
    strip.show()
    for theme in ("dark", "light", "dark"):
        plugin.dock.setPalette(palette_of(LOOKS[theme]))
        wait_until(lambda: LOOKS[theme].raised in message.styleSheet())  # noqa: B023
    plugin.dock.strip = None


def test_a_document_that_nothing_opens_is_told_with_its_place(host, monkeypatch, tmp_path):
    from trigpoint_qgis import host as room

    asked = []
    monkeypatch.setattr(
        room.QDesktopServices, "openUrl", lambda url: bool(asked.append(url.toLocalFile()))
    )
    host.open_document(tmp_path / "report.html")
    assert asked == [str(tmp_path / "report.html")]
    assert str(tmp_path / "report.html") in host.strip.texts()[0]


def test_what_runs_is_told_by_the_panel_and_not_by_qgis_too(host):
    made, heard = job(lambda _tick: 1)
    host.run(made)
    silent = getattr(QgsTask.Flag, "Silent", None)
    if silent is not None:
        assert QgsApplication.taskManager().tasks()[-1].flags() & silent
    wait_until(lambda: "done" in heard)


def test_children_run_where_the_packages_are(host):
    assert host.python()[1].endswith("beside.py")


def test_the_host_has_all_that_the_panel_asks_for(host):
    from trigpoint_panel.host import Host

    asked = {name for name in vars(Host) if not name.startswith("_")}
    assert asked <= set(dir(host))


def test_the_options_keep_what_is_chosen(settings, tmp_path):
    from trigpoint_qgis.options import OptionsFactory

    changed = []
    factory = OptionsFactory(lambda: changed.append(1))
    page = factory.createWidget(None)
    assert page.folder.filePath() == ""
    page.folder.setFilePath(str(tmp_path))
    page.canvas.setCurrentIndex(page.canvas.findData("image"))
    page.apply()
    assert changed == [1]
    assert settings.value("trigpoint/python_env") == str(tmp_path)
    assert settings.value("trigpoint/canvas") == "image"
    page.apply()
    assert changed == [1], "nothing was changed"


def test_the_options_say_at_once_why_a_folder_can_t_be_used(settings, tmp_path):  # noqa: ARG001
    from trigpoint_qgis.options import OptionsFactory

    page = OptionsFactory(lambda: None).createWidget(None)
    assert page.fault.isHidden()
    page.folder.setFilePath(str(tmp_path / "none"))
    assert not page.fault.isHidden()
    assert "is not a folder" in page.fault.text()
    page.folder.setFilePath("")
    assert page.fault.isHidden()
