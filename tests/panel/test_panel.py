import hashlib
import json
import os
import time
from pathlib import Path
from types import SimpleNamespace

import laspy
import numpy as np
import pyproj
import pytest

pytest.importorskip("qtpy", reason="the panel's packages are not installed", exc_type=ImportError)
pytest.importorskip("pyvista", reason="the panel's packages are not installed")

from qtpy.QtCore import QEvent, QLocale, QMimeData, QPoint, QPointF, Qt, QUrl
from qtpy.QtGui import QDragEnterEvent, QDropEvent, QFontMetrics, QPalette, QTextDocument
from qtpy.QtTest import QTest
from qtpy.QtWidgets import (
    QAbstractSpinBox,
    QApplication,
    QDockWidget,
    QLabel,
    QLineEdit,
    QMainWindow,
    QPushButton,
    QScrollArea,
    QToolButton,
)

from trigpoint.cloud import cloud_from
from trigpoint.errors import CloudError, CrsError, RegionError
from trigpoint.files import write
from trigpoint.similarity import Similarity
from trigpoint.trial import Trial
from trigpoint_panel import stateline
from trigpoint_panel.actions import COMMANDS, keys_told
from trigpoint_panel.auditing import Audited
from trigpoint_panel.jobs import Job, Pool, told
from trigpoint_panel.pairs import SIDES
from trigpoint_panel.panel import Panel
from trigpoint_panel.session import read_session
from trigpoint_panel.style import DARK, LIGHT, apply_theme, palette_of, sheet
from trigpoint_reporting.elevations import LIMIT_M, distance_colours

TRUTH = Similarity(
    3.26, np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]]), np.array([741_000.0, 4_279_000, 150])
)
CORNERS = np.array(
    [[-2, -2, 0], [2, -2, 0], [2, 2, 0], [-2, -2, 20], [2, -2, 20], [2, 2, 20]], float
)


class FakeHost:
    """A host that notes what it is told, and runs jobs in real threads."""

    def __init__(self):
        self.said, self.settings, self.layers, self.documents = [], {}, [], []
        self.answers = []
        self.pool = Pool()

    def setting(self, key, default):
        return self.settings.get(key, default)

    def set_setting(self, key, value):
        self.settings[key] = value

    def message(self, level, text, details="", actions=()):
        self.said.append((level, text, details, dict(actions)))

    def clear_messages(self):
        self.said.clear()

    def run(self, job):
        self.pool.run(job)

    def open_file(self, _title, _filters):
        return self.answers.pop(0)

    def save_file(self, _title, _filters, _suggestion):
        return self.answers.pop(0)

    def choose_crs(self, _current, chosen):
        chosen(self.answers.pop(0))

    def add_layer(self, path, kind):
        self.layers.append((path, kind))

    def open_document(self, path):
        self.documents.append(path)

    def python(self):
        return ("python-that-is-not-there",)

    def shutdown(self):
        return self.pool.wait(5000)


@pytest.fixture
def clouds(tmp_path):
    """A tower on disk, in its own frame and in UTM."""
    rng = np.random.default_rng(2)
    u, v, side = rng.random(20_000), rng.random(20_000), rng.integers(0, 5, 20_000)
    a, flat = 4 * u - 2, np.zeros(20_000)
    faces = [(a, flat - 2), (a, flat + 2), (flat - 2, a), (flat + 2, a), (6 * a, 24 * v - 12)]
    plan = np.choose(side[:, None], [np.column_stack(face) for face in faces])
    points = np.column_stack([plan, np.where(side == 4, 0, 20 * v)])
    write(tmp_path / "own.ply", cloud_from(points))
    write(tmp_path / "utm.laz", cloud_from(TRUTH(points), crs=pyproj.CRS("EPSG:32615")))
    write(tmp_path / "nowhere.laz", cloud_from(TRUTH(points)))
    return tmp_path


@pytest.fixture
def host(qapp):
    assert qapp is not None
    return FakeHost()


@pytest.fixture
def panel(qtbot, host, tmp_path):
    made = Panel(host, scratch=tmp_path / "scratch", canvas="image")
    qtbot.addWidget(made, before_close_func=lambda each: each.shutdown())
    made.resize(1200, 700)
    with qtbot.waitActive(made):  # keys find an active window only
        made.show()
        made.activateWindow()
    yield made
    assert host.shutdown()


def feed(panel, count=6, spoilt=None):
    """Pick corners, as the views would tell."""
    for k in range(count):
        panel.model.place("source", CORNERS[k])
        target = TRUTH(CORNERS[[k]])[0] + [0.01 * (k % 3), 0.01 * (k % 2), 0.005 * k]
        panel.model.place("target", target + ([0.7, 0, 0] if k == spoilt else [0, 0, 0]))


def load(panel, clouds, qtbot):
    panel.open_cloud("source", clouds / "own.ply")
    panel.open_cloud("target", clouds / "utm.laz")
    qtbot.waitUntil(lambda: panel.foot.job is None, timeout=20_000)


def test_every_command_is_wired_and_every_key_is_used_once(panel):
    keys = [keys for command in COMMANDS.values() for keys in command.keys.split()]
    assert len(keys) == len(set(keys))
    assert {"P", "Esc", "Ctrl+Z", "N", "G", "L", "O", "X", "E", "F", "F1"} <= set(keys)
    for name, action in panel.actions_by_name.items():
        assert action.shortcutContext() == Qt.ShortcutContext.WidgetWithChildrenShortcut
        assert action in panel.actions()
        assert action.toolTip(), name
    shown = [keys for group in keys_told().values() for keys, _ in group]
    assert len(shown) == len(set(shown)) > 25
    for command in COMMANDS.values():
        assert not command.keys or " or ".join(command.keys.split()) in shown, command
    assert {"F10", "Wheel", "Double click", "Ctrl and drag"} <= set(shown)


def test_the_help_shows_every_key_on_one_screen(panel, qtbot):
    panel.action("help").trigger()
    shown = [label.text() for label in panel._keys.findChildren(QLabel)]
    for group, lines in keys_told().items():
        assert {group, *(word for line in lines for word in line)} <= set(shown)
    assert panel._keys.sizeHint().width() < 1366
    assert panel._keys.sizeHint().height() < 700
    assert qtbot is not None


@pytest.fixture
def large_letters(qapp):
    """A desktop of someone who sees badly."""
    before = qapp.font()
    letters = qapp.font()
    letters.setPointSize(3 * before.pointSize())
    qapp.setFont(letters)
    yield
    qapp.setFont(before)


@pytest.mark.usefixtures("large_letters")
def test_with_large_letters_the_help_stays_on_the_screen_and_scrolls(panel, qtbot):
    panel.action("help").trigger()
    keys = panel._keys
    room = keys.screen().availableSize()
    assert keys.sizeHint().width() > room.width()
    assert keys.size() == keys.sizeHint().boundedTo(room)
    (area,) = keys.findChildren(QScrollArea)
    qtbot.waitUntil(lambda: area.horizontalScrollBar().maximum() > 0, timeout=2000)
    for label in keys.findChildren(QLabel):
        assert label.width() >= label.fontMetrics().horizontalAdvance(label.text()), label.text()


def test_a_row_of_the_table_has_a_menu(panel):
    feed(panel)
    names = [action.objectName() for action in panel.table.actions()]
    assert names == ["fly", "to_control", "to_check", "to_off", "delete"]
    assert panel.table.contextMenuPolicy() == Qt.ContextMenuPolicy.ActionsContextMenu
    panel.table.selectRow(1)
    panel.action("to_check").trigger()
    assert [pair.role for pair in panel.model.pairs][:3] == ["control", "check", "control"]
    panel.action("to_off").trigger()
    assert panel.model.pairs[1].role == "off"
    panel.model.undo()
    assert panel.model.pairs[1].role == "check"
    panel.action("fly").trigger()


def test_what_can_be_done_follows_the_state_line(panel):
    assert panel.line.enabled == stateline.OPEN
    assert not panel.action("pick").isEnabled()
    feed(panel, 2)
    assert panel.line.text.startswith("2 of 3 pairs")
    assert not panel.action("link").isEnabled()
    feed(panel)
    assert panel.action("link").isEnabled()
    assert panel.totals.layout_verdict.text().startswith("Layout:")
    panel.model.undo()
    assert panel.action("redo").isEnabled()
    assert "complete P" in panel.action("redo").toolTip()


def test_linking_ends_with_the_fit(panel):
    feed(panel)
    panel.action("link").setChecked(True)
    panel.model.delete({pair.id for pair in panel.model.pairs[:5]})
    assert not panel.action("link").isChecked()


def test_an_overlay_can_be_swapped_and_ends_with_the_fit(panel, clouds, qtbot):
    load(panel, clouds, qtbot)
    feed(panel)
    assert not panel.action("swap").isEnabled()
    panel.action("overlay").setChecked(True)
    assert panel.action("swap").isEnabled()
    panel.model.delete({pair.id for pair in panel.model.pairs[:5]})
    assert not panel.action("overlay").isChecked()
    assert not panel.action("swap").isEnabled()


def test_escape_cancels_then_drops_then_leaves_picking(panel, qtbot):
    feed(panel, 3)
    panel.action("pick").setChecked(True)
    panel.model.place("source", CORNERS[4])

    def work(tick):
        while True:
            tick(0.2)
            time.sleep(0.01)

    job = panel.foot.begin(Job("Waiting", work))
    qtbot.waitUntil(lambda: "20 %" in panel.foot.line.text(), timeout=5000)
    assert panel.line.enabled == {"cancel", "pick"}
    QTest.keyClick(panel, Qt.Key.Key_Escape)
    assert not job.running
    assert panel.model.half_open is not None
    QTest.keyClick(panel, Qt.Key.Key_Escape)
    assert panel.model.half_open is None
    assert panel.action("pick").isChecked()
    QTest.keyClick(panel, Qt.Key.Key_Escape)
    assert not panel.action("pick").isChecked()


def test_a_crash_in_a_job_is_one_message_and_the_panel_stays_usable(panel, host, qtbot):
    feed(panel)
    panel.runs.begin(Job("Sums", lambda _: 1 / 0))
    qtbot.waitUntil(lambda: bool(host.said), timeout=5000)
    level, text, details, _ = host.said[-1]
    assert level == "error"
    assert "Something went wrong while doing this: Sums" in text
    assert "ZeroDivisionError" in details
    assert panel.line.level == "red"
    panel.model.undo()
    assert "Something" not in panel.line.text


def test_a_pick_far_from_its_ghost_is_doubted_and_can_be_taken_back(panel, host):
    feed(panel, 5)
    panel.model.place("source", CORNERS[5])
    from trigpoint_panel.picking import Picked

    far = tuple((TRUTH(CORNERS[[5]])[0] + [2.3, 0, 0]).tolist())
    panel.views.target.picked.emit(Picked(far, 0.05, "", far))
    level, text, _, actions = host.said[-1]
    assert level == "warning"
    assert text == "P6 in the reference: 2.3 m from where 5 pairs put it. Keep?"
    actions["Undo"]()
    assert panel.model.pairs[-1].is_half_open


def test_a_doubt_about_a_crs_says_what_to_do_in_the_panel(panel, host, clouds, qtbot):
    stray = clouds / "stray.laz"
    xyz = np.random.default_rng(0).uniform([9e6, 2e7, 0], [9e6 + 1, 2e7 + 1, 1], (100, 3))
    write(stray, cloud_from(xyz, crs=pyproj.CRS("EPSG:32615")))
    panel.open_cloud("source", stray)
    qtbot.waitUntil(lambda: panel.views.opened["source"] is not None, timeout=10_000)
    assert host.said == []  # the fit carries it from wherever it is
    panel.open_cloud("target", stray)
    qtbot.waitUntil(lambda: bool(host.said), timeout=10_000)
    level, text, _, actions = host.said[-1]
    assert level == "warning"
    assert text.startswith("stray.laz: the header says WGS 84 / UTM zone 15N, but")
    assert text.endswith("name the right CRS in the menu, under CRS of the reference.")
    assert COMMANDS["choose_crs"].text.rstrip("…") in text
    host.answers.append("EPSG:32615")
    actions["Choose a CRS…"]()
    assert panel.model.state.crs == "EPSG:32615"


def test_no_error_told_in_the_panel_names_an_option_of_the_command_line():
    for error in (
        RegionError("area.geojson is in degrees: assign one with --crs."),
        CrsError("Name the right CRS with --crs."),
    ):
        assert told(error).endswith("in the menu, under CRS of the reference.")


def test_a_cloud_without_crs_can_be_given_one(panel, host, clouds, qtbot):
    panel.open_cloud("target", clouds / "nowhere.laz")
    qtbot.waitUntil(lambda: bool(host.said), timeout=10_000)
    _, text, _, actions = host.said[-1]
    assert "nowhere.laz has no CRS" in text
    assert panel.views.opened["target"] is None
    assert panel.model.state.target_path is None
    host.answers.append("EPSG:32615")
    actions["Choose a CRS…"]()
    assert panel.model.state.crs == "EPSG:32615"
    panel.open_cloud("target", clouds / "nowhere.laz")
    qtbot.waitUntil(lambda: panel.views.opened["target"] is not None, timeout=10_000)
    assert panel.model.survey is not None


def test_a_crs_is_offered_for_the_reference_alone_and_goes_with_its_file(
    panel, host, clouds, qtbot
):
    load(panel, clouds, qtbot)
    bare = clouds / "nowhere.laz"
    panel.open_cloud("target", bare)
    qtbot.waitUntil(lambda: bool(host.said), timeout=10_000)
    _, text, _, actions = host.said[-1]
    assert "nowhere.laz" in text
    host.answers.append("EPSG:32614")
    actions["Choose a CRS…"]()
    assert panel.model.state.crs == ""  # the reference that is open keeps its own
    qtbot.waitUntil(lambda: panel.foot.job is None, timeout=10_000)
    assert panel.model.state.crs == "EPSG:32614"
    assert panel.model.state.target_path == panel.views.opened["target"].path == bare
    panel.model.set_reference(crs="")

    degrees = clouds / "degrees.laz"
    write(degrees, cloud_from(CORNERS))
    las = laspy.read(degrees)
    las.header.add_crs(pyproj.CRS("EPSG:4326"))
    las.write(degrees)
    for side, offered in (("source", []), ("target", ["Choose a CRS…"])):
        host.clear_messages()
        panel.open_cloud(side, degrees)
        qtbot.waitUntil(lambda: panel.foot.job is None, timeout=10_000)
        assert panel.views.opened[side].path != degrees
        (said,) = host.said
        assert "degrees.laz" in said[1]
        assert list(said[3]) == offered


def test_only_what_the_session_names_comes_into_the_views(panel, host, clouds, qtbot):
    load(panel, clouds, qtbot)
    feed(panel)
    for name, folder in (("a", clouds), ("b", clouds / "b")):
        folder.mkdir(exist_ok=True)
        host.answers.append(folder / name)
        panel.desk.save(elsewhere=True)
    text = (clouds / "b" / "b.trig.json").read_text("utf-8")
    (clouds / "b" / "b.trig.json").write_text(text.replace("../", ""), "utf-8")
    panel.open_session(clouds / "a.trig.json")
    panel.open_session(clouds / "b" / "b.trig.json")
    qtbot.waitUntil(lambda: panel.foot.job is None, timeout=20_000)
    assert panel.title == "b.trig.json"
    assert panel.views.opened == {"source": None, "target": None}
    assert any("b/utm.laz" in text.replace("\\", "/") for _, text, *_ in host.said)

    panel.open_session(clouds / "a.trig.json")
    panel.open_cloud("source", clouds / "utm.laz")
    qtbot.waitUntil(lambda: panel.foot.job is None, timeout=20_000)
    assert panel.model.state.source_path == clouds / "utm.laz"
    assert panel.views.opened["source"].path == clouds / "utm.laz"


def test_a_cloud_replaced_on_disk_is_noticed_before_it_is_measured_or_audited(
    panel, host, clouds, qtbot
):
    load(panel, clouds, qtbot)
    feed(panel)
    path = clouds / "utm.laz"
    before = path.read_bytes()
    os.utime(path, ns=(1, 1))  # copied, not changed
    assert panel.desk.are_as_opened()
    write(path, cloud_from(TRUTH(CORNERS), crs=pyproj.CRS("EPSG:32615")))
    said = "utm.laz has changed since it was opened: open it again."
    for act in (panel.compare, panel.try_icp, panel.make_report):
        host.clear_messages()
        assert act() is None
        assert [text for _, text, *_ in host.said] == [said]
    host.answers.append(clouds / "mine")
    assert panel.desk.save()
    assert [text for _, text, *_ in host.said][-1] == said
    record = json.loads((clouds / "mine.trig.json").read_text("utf-8"))["files"]["reference"]
    assert record["sha256"] == hashlib.sha256(before).hexdigest()
    doubts = read_session(clouds / "mine.trig.json").doubts
    assert doubts == ("utm.laz has changed since the session was saved: its picks may not fit it.",)
    host.said[-1][3]["Open it again"]()
    qtbot.waitUntil(lambda: panel.foot.job is None, timeout=20_000)
    assert panel.views.opened["target"].total == len(CORNERS)
    assert panel.desk.are_as_opened()


def test_what_was_not_saved_is_kept_when_another_session_is_opened(panel, host, clouds, qtbot):
    load(panel, clouds, qtbot)
    host.answers.append(clouds / "mine")
    panel.desk.save()
    feed(panel)
    pairs = panel.model.pairs
    host.clear_messages()
    panel.open_session(clouds / "mine.trig.json")
    qtbot.waitUntil(lambda: panel.foot.job is None, timeout=20_000)
    assert panel.model.pairs == ()
    ((_, text, _, ways),) = host.said
    assert text == "The changes to mine.trig.json were not saved, and are kept."
    panel.model.place("source", (1, 2, 3))
    panel.desk.autosave()
    ways["Restore"]()  # and what was done since is kept in its turn
    assert panel.model.pairs == pairs
    ways = host.said[-1][3]
    qtbot.waitUntil(lambda: panel.foot.job is None, timeout=20_000)
    ways["Restore"]()
    assert [pair.source for pair in panel.model.pairs] == [(1, 2, 3)]
    host.said[-1][3]["Delete them"]()
    assert panel.session.recoverable() == ()
    qtbot.waitUntil(lambda: panel.foot.job is None, timeout=20_000)


def test_a_session_that_another_window_has_saved_is_not_overwritten(panel, host, clouds, qtbot):
    load(panel, clouds, qtbot)
    host.answers.append(clouds / "mine")
    panel.desk.save()
    saved = clouds / "mine.trig.json"
    saved.write_text(saved.read_text("utf-8") + "\n", "utf-8")
    theirs = saved.read_bytes()
    feed(panel)
    assert not panel.desk.save()
    _, text, _, ways = host.said[-1]
    assert text.startswith("mine.trig.json has changed since it was read, in another window")
    assert saved.read_bytes() == theirs
    host.answers.append(clouds / "ours")
    assert ways["Save as…"]()
    assert panel.title == "ours.trig.json"
    assert panel.desk.save()


@pytest.mark.parametrize("spoil", ["empty", "truncated", "gone"])
def test_a_bad_file_is_one_sentence(panel, host, clouds, qtbot, spoil):
    path = clouds / "utm.laz"
    if spoil == "gone":
        path = clouds / "gone.laz"
    else:
        path.write_bytes(b"" if spoil == "empty" else path.read_bytes()[:4000])
    panel.open_cloud("target", path)
    qtbot.waitUntil(lambda: bool(host.said), timeout=10_000)
    (said,) = host.said
    assert path.name in said[1]
    assert said[2] == ""
    assert panel.foot.job is None
    assert panel.action("open_target").isEnabled()


def test_a_zone_is_isolated_by_choosing_its_row(panel, host, clouds, qtbot):
    load(panel, clouds, qtbot)
    feed(panel)
    tab = panel.errors_tab
    assert tab.compare.isEnabled()
    panel.compare()
    qtbot.waitUntil(lambda: tab.findings is not None, timeout=20_000)
    assert [tab.accuracy.item(row, 0).text() for row in range(4)] == [
        "All",
        "Upper",
        "Middle",
        "Lower",
    ]
    assert panel.views.source.scene.mode == "distance"
    shown = []
    panel.views.source.isolate = lambda mask, name: shown.append((mask, name))
    tab.accuracy.selectRow(1)
    heights = TRUTH(panel.views.opened["source"].cloud.coordinates)[:, 2]
    low, high = heights.min(), heights.max()
    assert tab.completeness.currentRow() == 1
    mask, name = shown[-1]
    assert name == "zone Upper"
    agree = mask == (heights >= low + 0.66 * (high - low))
    assert agree.mean() > 0.999
    tab.accuracy.selectRow(0)
    assert shown[-1] == (None, "")
    panel.model.undo()
    assert "Changed since" in tab.note.text()
    assert [level for level, *_ in host.said if level == "error"] == []


def test_distances_are_coloured_as_the_report_of_the_same_project_does(panel, clouds, qtbot):
    load(panel, clouds, qtbot)
    feed(panel)
    panel.model.set_comparison(within_m=(0.01, 0.08))
    panel.compare()
    qtbot.waitUntil(lambda: panel.errors_tab.findings is not None, timeout=20_000)
    found = panel.errors_tab.findings
    assert found.limit_m == 0.2  # two and a half times the largest threshold
    assert panel.errors_tab.legend.ends == ("0 m", "0.10 m", "0.20 m")
    scene = panel.views.source.scene
    assert scene.legend.high == "0.20 m"
    assert (scene._colours == distance_colours(found.source_m, limit=0.2)).all()
    panel.views.set_findings(None)
    assert scene._limit == LIMIT_M


def test_findings_go_with_the_cloud_that_they_were_of(panel, host, clouds, qtbot):
    load(panel, clouds, qtbot)
    feed(panel)
    panel.compare()
    qtbot.waitUntil(lambda: panel.errors_tab.findings is not None, timeout=20_000)
    panel.errors_tab.accuracy.selectRow(1)
    kept, shown = panel.errors_tab.findings, dict(panel.views.opened)
    write(clouds / "few.ply", cloud_from(CORNERS))
    panel.open_cloud("source", clouds / "few.ply")
    qtbot.waitUntil(lambda: panel.foot.job is None, timeout=20_000)
    assert panel.errors_tab.findings is None
    assert "distance" not in panel.views.target.scene.modes
    panel.errors_tab.accuracy.selectRow(2)
    panel.runs._compared(kept, None, shown)  # as one that was under way
    assert panel.errors_tab.findings is None
    assert [text for level, text, *_ in host.said if level != "success"] == [
        "Another cloud was opened meanwhile: compare again."
    ]


def test_icp_is_an_experiment_that_can_be_adopted_and_discarded(panel, host, clouds, qtbot):
    load(panel, clouds, qtbot)
    feed(panel)
    tab = panel.align_tab
    fitted = panel.model.similarity
    panel.try_icp()
    qtbot.waitUntil(lambda: panel.foot.job is None, timeout=60_000)
    assert "not adopted" in tab.verdict.text()
    assert "m → " in tab.errors.text()
    assert "ICP" not in panel.line.text + panel.totals.numbers.text()
    assert panel.model.similarity is fitted
    tab.adopt.click()
    assert panel.model.state.adopted is not None
    assert "adopted" in tab.verdict.text()
    # What is said is of what is shown and saved.
    moved = panel.model.similarity(CORNERS)
    errors = np.array([pair.target for pair in panel.model.pairs]) - moved
    rmse = np.sqrt((errors**2).sum(axis=1).mean())
    assert (
        panel.totals.numbers.text()
        .replace("\N{NO-BREAK SPACE}", " ")
        .startswith(f"RMSE after ICP: control {rmse:.3f} m")
    )
    assert "(before" in panel.totals.numbers.text()
    assert panel.table.cell("P1", "dx_m") == f"{errors[0, 0]:.3f}"
    assert panel.table.cell("P1", "loo_m") == ""
    assert "ICP adopted" in panel.line.text
    assert tab.geometry_verdict.text().startswith("Of the fit, before ICP: ")
    panel.desk.save_aligned(clouds / "moved.ply")
    qtbot.waitUntil(lambda: panel.foot.job is None, timeout=20_000)
    assert "points, carried by the fit with ICP adopted, written to" in host.said[-2][1]
    panel.model.undo()
    assert panel.model.state.adopted is None
    tab.adopt.click()
    tab.discard.click()
    assert panel.model.state.adopted is None
    assert not tab.adopt.isEnabled()


@pytest.mark.parametrize(
    ("after", "said", "level"),
    [
        (
            0.173,
            "Undecided, not adopted. Error at the 2 check pairs: 0.174 m → 0.173 m, -0.001 m: "
            "less than 2 pairs can show (±0.050 m).",
            "",
        ),
        (
            0.1,
            "Better, not adopted. Error at the 2 check pairs: 0.174 m → 0.100 m, -0.074 m; it is "
            "known to ±0.050 m.",
            "success",
        ),
        (
            0.3,
            "Worse, not adopted. Error at the 2 check pairs: 0.174 m → 0.300 m, +0.126 m; it is "
            "known to ±0.050 m.",
            "warning",
        ),
    ],
)
def test_icp_is_better_or_worse_only_by_more_than_the_held_out_pairs_can_show(
    panel, after, said, level
):
    feed(panel)
    panel.model.set_role({"P2", "P5"}, "check")
    panel.align_tab.set_trial(trial(0.174, after), panel.model.fit.alignment)
    assert panel.align_tab.verdict.text() == said.replace("m, -", "m, \N{MINUS SIGN}")
    assert panel.align_tab.verdict.property("level") == level


def trial(before, after):
    still = Similarity(1.0, np.eye(3), np.zeros(3))
    refinement = SimpleNamespace(
        similarity=still,
        shift_m=0.1,
        rotation_deg=0.1,
        surface_rmse_before_m=0.1,
        surface_rmse_after_m=0.1,
    )
    return Trial(refinement, 0.1, 0.2, None, None, before, after, after < before, "", ())


def test_the_places_to_pick_next_are_missing_for_a_reason(panel):
    said = panel.align_tab.next
    assert said.text() == "Known from three control pairs on, once the reference is open."
    for k in range(4):
        panel.model.place("source", [0, 0, k])
        panel.model.place("target", [0, 0, 3 * k])
    assert said.text() == (
        "Not known without a fit. The control points lie on one line: add one off the line."
    )
    panel.model.delete({"P1", "P2", "P3", "P4"})
    feed(panel)
    assert said.text() == "Known once the reference is open."


def test_a_name_from_right_to_left_does_not_turn_the_state_line(panel):
    feed(panel)
    panel.model.rename("P4", "דגל 4")
    panel.model.reopen("דגל 4", "target")
    said = panel.foot.line.text()
    assert "דגל 4" in said
    documents = [QTextDocument(text) for text in (said, "דגל 4: click")]  # to outlive their blocks
    ways = [document.firstBlock().textDirection() for document in documents]
    assert ways == [Qt.LayoutDirection.LeftToRight, Qt.LayoutDirection.RightToLeft]


def test_what_there_is_not_is_said_once(panel):
    def said():
        text = panel.totals.numbers.text().replace("\N{NO-BREAK SPACE}", " ")
        return text.replace("\N{NON-BREAKING HYPHEN}", "-")

    assert said() == "No fit yet: no RMSE."
    feed(panel)
    assert said().startswith("RMSE control 0.")
    assert "no check pairs   leave-one-out 0." in said()
    panel.model.set_role({"P4"}, "check")
    assert "   check 0." in said()


def test_what_is_shown_while_an_overlay_is_swapped_is_said_in_words(panel, clouds, qtbot):
    load(panel, clouds, qtbot)
    feed(panel)
    panel.action("overlay").setChecked(True)
    said = panel.views.target._overlay_bar._state
    shown = [said.text()]
    for _ in range(3):
        panel.action("swap").trigger()
        shown.append(said.text())
    assert shown == ["both", "reference", "source", "both"]


def test_a_sound_layout_is_not_green_beside_a_suspect(panel):
    feed(panel)
    assert panel.totals.layout_verdict.text() == "Layout: sound"
    assert panel.totals.layout_verdict.property("level") == "success"
    target = np.add(panel.model.pairs[3].target, [0.3, 0, 0])
    panel.model.move("P4", "target", target)
    assert panel.totals.layout_verdict.text() == "Layout: sound, a pick suspect"
    assert panel.totals.layout_verdict.property("level") == "warning"
    assert "Pick P4 does not fit the others" in panel.align_tab.geometry_verdict.text()
    assert panel.align_tab.geometry_verdict.property("level") == "warning"
    panel.model.move("P4", "target", target + 3.0)
    assert panel.totals.layout_verdict.text() == "Layout: sound, a pick rejected"


def test_an_audit_that_can_not_run_says_so(panel, host, clouds, qtbot):
    load(panel, clouds, qtbot)
    feed(panel)
    host.answers.append(clouds / "job.toml")
    panel.make_report()
    qtbot.waitUntil(lambda: panel.foot.job is None, timeout=10_000)
    assert host.said[-1][0] == "error"
    assert "python-that-is-not-there" in host.said[-1][1]
    assert (clouds / "job.toml").is_file()
    assert not panel.model.is_stale


VERDICTS = {"PASS": "success", "CONDITIONAL": "warning", "FAIL": "error", "NOT TESTED": "info"}


@pytest.mark.parametrize("verdict", VERDICTS)
def test_a_verdict_is_told_in_its_colour_and_keeps_it_when_pairs_change(
    panel, host, tmp_path, verdict
):
    feed(panel)
    warnings = [{"code": "a", "message": "Too few checks."}, {"code": "b", "message": "No CRS."}]
    audited = Audited(tmp_path, tmp_path, {"verdict": verdict, "warnings": warnings})
    panel.runs._audited(audited, panel.model.state)
    (level, text, details, _), *_ = host.said
    assert level == VERDICTS[verdict]
    assert f"Verdict: {verdict}, with 2 warnings." in text
    assert details == "Too few checks.\nNo CRS."
    tab = panel.report_tab
    assert tab.warnings.text() == "• Too few checks.\n• No CRS."
    assert panel.foot.word.text() != "Outdated:"
    x, y, z = panel.model.pairs[0].target
    panel.model.move(panel.model.pairs[0].id, "target", (x + 0.01, y, z))
    assert tab.verdict.text().endswith("Made before the pairs changed: run again.")
    assert tab.verdict.property("level") == VERDICTS[verdict]
    assert panel.foot.word.text() == "Outdated:"


def test_no_project_file_chosen_means_no_audit(panel, host, clouds, qtbot):
    load(panel, clouds, qtbot)
    feed(panel)
    host.answers.append(None)
    assert panel.make_report() is None
    assert panel.foot.job is None


def test_a_session_is_saved_and_opened_with_its_cameras(panel, host, clouds, qtbot):
    load(panel, clouds, qtbot)
    feed(panel)
    panel.views.target.look("top")
    camera = panel.views.target.camera
    host.answers.append(clouds / "mine")
    assert panel.desk.save()
    saved = clouds / "mine.trig.json"
    assert json.loads(saved.read_text("utf-8"))
    assert panel.title == "mine.trig.json"
    pairs = panel.model.pairs
    panel.model.delete({"P1"})
    assert panel.title == "mine.trig.json *"
    panel.views.target.look("front")
    panel.open_session(saved)
    qtbot.waitUntil(lambda: panel.foot.job is None and panel.model.pairs == pairs, timeout=20_000)
    qtbot.waitUntil(lambda: panel.views.opened["target"] is not None, timeout=20_000)
    np.testing.assert_allclose(panel.views.target.camera.position, camera.position)


def test_a_moved_cloud_is_said_and_the_rest_opens(panel, host, clouds, qtbot):
    load(panel, clouds, qtbot)
    feed(panel)
    host.answers.append(clouds / "mine")
    panel.desk.save()
    host.clear_messages()
    (clouds / "own.ply").rename(clouds / "moved.ply")
    panel.open_session(clouds / "mine.trig.json")
    qtbot.waitUntil(lambda: panel.foot.job is None and bool(host.said), timeout=20_000)
    qtbot.waitUntil(lambda: panel.views.opened["target"] is not None, timeout=20_000)
    assert any("own.ply" in text for _, text, *_ in host.said)
    assert len(panel.model.pairs) == 6


def test_changes_are_autosaved_and_offered_after_a_crash(panel, host, qtbot, tmp_path):
    feed(panel, 3)
    scratch = tmp_path / "scratch"
    qtbot.waitUntil(lambda: any(scratch.glob("*~")), timeout=5000)
    other = Panel(host, scratch=scratch, canvas="image")
    qtbot.addWidget(other, before_close_func=lambda each: each.shutdown())
    other.desk.offer_recovery()
    assert host.said == []  # its window is still open
    panel.session.leave()
    other.desk.offer_recovery()
    _, text, _, actions = host.said[-1]
    assert "Unsaved changes" in text
    actions["Restore"]()
    assert other.model.pairs == panel.model.pairs


def test_files_are_taken_by_drag_and_drop(panel, host, clouds, qtbot):
    mime = QMimeData()
    mime.setUrls([QUrl.fromLocalFile(str(clouds / "own.ply"))])
    buttons, keys = Qt.MouseButton.LeftButton, Qt.KeyboardModifier.NoModifier
    enter = QDragEnterEvent(QPoint(5, 5), Qt.DropAction.CopyAction, mime, buttons, keys)
    panel.dragEnterEvent(enter)
    assert enter.isAccepted()
    drop = QDropEvent(QPointF(5, 5), Qt.DropAction.CopyAction, mime, buttons, keys)
    panel.dropEvent(drop)
    qtbot.waitUntil(lambda: panel.views.opened["source"] is not None, timeout=10_000)
    assert panel.model.state.source_path == clouds / "own.ply"
    assert host.said == []


def test_picks_go_out_and_come_back(panel, host, clouds):
    feed(panel)
    pairs = panel.model.pairs
    host.answers.append(clouds / "out.csv")
    panel.action("export_picks").trigger()
    assert "out.csv: written." in host.said[-1][1]
    host.answers.append(clouds / "out.csv")
    panel.action("import_picks").trigger()
    level, _, _, actions = host.said[-1]
    assert level == "error"  # every id is taken
    panel.model.delete({"P1"})
    actions["Replace the pairs"]()
    assert [pair.source for pair in panel.model.pairs] == [pair.source for pair in pairs]


def test_a_second_operator_begins_and_ends(panel, host):
    feed(panel)
    panel.action("second_begin").trigger()
    assert panel.model.state.is_second_operator
    assert "Second operator" in panel.line.text
    for k in range(6):
        panel.model.place("source", CORNERS[k] + [0.01, 0, 0])
        panel.model.place("target", TRUTH(CORNERS[[k]])[0] + [0, 0.02, 0])
    panel.action("second_keep").trigger()
    assert not panel.model.state.is_second_operator
    assert host.said[-1][0] == "success"


def test_views_are_linked_and_overlaid_again_after_a_second_operator(panel, clouds, qtbot):
    load(panel, clouds, qtbot)
    feed(panel)
    for name in ("link", "overlay"):
        panel.action(name).setChecked(True)
    panel.action("second_begin").trigger()
    assert not panel.action("link").isEnabled()
    assert not panel.views._link.is_tied
    panel.action("second_cancel").trigger()
    assert panel.action("link").isEnabled()
    assert panel.action("link").isChecked()
    assert panel.action("overlay").isChecked()
    assert panel.views._link.is_tied


def test_a_command_that_can_not_be_is_refused_in_a_sentence(panel, host):
    panel.action("second_begin").setEnabled(True)
    panel.action("second_begin").trigger()
    assert host.said[-1][0] == "error"
    assert host.said[-1][1].startswith("Begin: There is no pair")


def test_settings_that_can_not_be_are_refused(panel, host):
    tab = panel.errors_tab
    tab.zones.setText("0.9, 0.3")
    tab.zones.editingFinished.emit()
    assert "ascend" in tab.trouble.text()
    tab.zones.setText("0.5")
    tab.zones.editingFinished.emit()
    assert panel.model.state.comparison.zones == (0.5,)
    tab.within.setText("near")
    tab.within.editingFinished.emit()
    assert "Thresholds are distances" in tab.trouble.text()
    tab.within.setText("0,05")
    tab.within.editingFinished.emit()
    assert panel.model.state.comparison.within_m == (0.05,)
    assert tab.within.text() == "0.05"
    tab.within.setText("0,05,0,1")
    tab.within.editingFinished.emit()
    assert "Thresholds are distances" in tab.trouble.text()
    assert panel.model.state.comparison.within_m == (0.05,)
    panel.report_tab.date.setText("yesterday")
    panel.report_tab.date.editingFinished.emit()
    assert "is no date" in host.said[-1][1]
    panel.report_tab.status.setCurrentText("issued")
    assert host.said[-1][0] == "error"


def test_typed_details_are_one_undoable_step_each(panel):
    tab = panel.report_tab
    tab.fields["title"].setText("Bell tower")
    tab.fields["title"].editingFinished.emit()
    assert panel.model.state.about.title == "Bell tower"
    assert panel.model.undo_text == "Change project details"
    panel.model.undo()
    assert tab.fields["title"].text() == ""


@pytest.fixture
def desktop(request):
    """A desktop of another language."""
    before = QLocale()
    QLocale.setDefault(QLocale(request.param))
    yield
    QLocale.setDefault(before)


@pytest.mark.usefixtures("desktop")
@pytest.mark.parametrize("desktop", ["de_DE", "tr_TR", "en_US"], indirect=True)
@pytest.mark.parametrize("typed", ["0.05", "0,05"])
def test_five_centimetres_are_five_centimetres_on_every_desktop(host, qtbot, tmp_path, typed):
    panel = Panel(host, scratch=tmp_path / "scratch", canvas="image")
    window, dock = QMainWindow(), QDockWidget()
    dock.setWidget(panel)
    window.addDockWidget(Qt.DockWidgetArea.LeftDockWidgetArea, dock)
    qtbot.addWidget(window, before_close_func=lambda _: panel.shutdown())
    window.show()
    panel.bar.snap.setCurrentIndex(1)
    tab = panel.align_tab
    for floats in (False, True):
        dock.setFloating(floats)
        (dock if floats else window).resize(1700, 800)  # the toolbar hides what has no room
        QApplication.processEvents()
        for field in panel.findChildren(QAbstractSpinBox):
            assert field.locale().decimalPoint() == "."
        for front, field in (
            (tab, tab.threshold),
            (panel.errors_tab, panel.errors_tab.voxel),
            (tab, panel.bar.radius),
        ):
            panel.tabs.setCurrentWidget(front)
            field.setValue(7)
            field.selectAll()
            QTest.keyClicks(field, typed)
            QTest.keyClick(field, Qt.Key.Key_Return)
            assert field.value() == 0.05
            field.setValue(7)
            field.selectAll()
            field.findChild(QLineEdit).insert(typed)  # as pasting does
            field.interpretText()
            assert field.value() == 0.05
            assert field.text().startswith("0.05")
    assert panel.model.state.alignment.threshold_m == 0.05
    assert panel.model.state.comparison.voxel_m == 0.05
    panel.model.set_alignment(trials=12_345)
    assert tab.trials.value() == 12345


@pytest.mark.parametrize("look", [LIGHT, DARK])
def test_what_is_on_but_can_not_be_used_is_as_faint_as_the_rest(look):
    faint = palette_of(look).color(QPalette.ColorGroup.Disabled, QPalette.ColorRole.ButtonText)
    rule = sheet(look).split("checked:disabled {")[1].split("}")[0]
    assert f"color: rgba{faint.getRgb()};" in rule


def test_a_place_under_the_mouse_is_told_in_its_unit(panel, clouds, qtbot):
    load(panel, clouds, qtbot)
    told = panel.foot.where
    panel.views.source.hovered.emit((1.0, 2.0, 3.0))
    assert told.text() == "X 1.000   Y 2.000   Z 3.000 units"
    panel.views.target.hovered.emit((741_000.0, 4_279_000.0, 150.0))
    assert told.text() == "E 741000.000   N 4279000.000   H 150.000 m"
    panel.views.target.hovered.emit(None)
    assert told.text() == ""


def test_the_magnifier_is_on_while_z_is_held(panel, clouds, qtbot):
    load(panel, clouds, qtbot)
    held = []
    panel.views.magnify = held.append
    panel.setFocus()
    QTest.keyPress(panel, Qt.Key.Key_Z)
    QTest.keyRelease(panel, Qt.Key.Key_Z)
    assert held == [True, False]


def test_the_magnifier_stays_while_its_switch_is_on_and_follows_the_mouse(panel, clouds, qtbot):
    load(panel, clouds, qtbot)
    feed(panel)
    views, switch = panel.views, panel.action("magnify")

    def seen():
        loupes = [views.view(side)._magnifier._loupe for side in SIDES]
        return [loupe is not None and loupe.isVisible() for loupe in loupes]

    switch.setChecked(True)
    assert seen() == [False, False]  # the mouse is in no view
    view, other = views.source, views.target
    row = next(
        row
        for row in range(len(view.opened.cloud))
        if not view.scene.is_hidden(view.scene.coordinates(row)[None])[0]
    )
    x, y = view.scene.project(view.scene.coordinates(row)) / view._stage.ratio
    QTest.mouseMove(view.canvas.surface, QPoint(round(x), round(view._stage.height() - y)))
    qtbot.waitUntil(lambda: seen() == [True, True], timeout=5000)
    assert view._magnifier.is_at_mouse
    assert not other._magnifier.is_at_mouse
    QTest.keyPress(panel, Qt.Key.Key_Z)
    QTest.keyRelease(panel, Qt.Key.Key_Z)
    assert seen() == [True, True]
    QApplication.sendEvent(view.canvas.surface, QEvent(QEvent.Type.Leave))
    assert seen() == [False, False]
    switch.setChecked(False)
    assert not views._magnifies


def test_letters_go_into_a_field_and_not_to_the_panel(panel, qtbot):
    panel.tabs.setCurrentWidget(panel.report_tab)
    panel.activateWindow()
    field = panel.report_tab.fields["client"]
    field.setFocus()
    QTest.keyClicks(field, "Pole n Lofo 137")
    assert field.text() == "Pole n Lofo 137"
    assert not panel.action("pick").isChecked()
    assert qtbot is not None


@pytest.mark.parametrize("size", [(1366, 768), (1920, 1080), (960, 600)])
@pytest.mark.parametrize("theme", ["light", "dark"])
def test_nothing_is_cut_off_or_on_top_of_another(panel, qapp, size, theme, qtbot):
    before = qapp.palette()
    name = qapp.style().objectName()
    try:
        apply_theme(qapp, theme)
        panel.resize(*size)
        feed(panel, 6, spoilt=4)
        for tab in range(3):
            panel.tabs.setCurrentIndex(tab)
            QApplication.processEvents()
            qtbot.wait(20)
            _check_layout(panel, size)
        look = DARK if theme == "dark" else LIGHT
        assert look.accent in panel.styleSheet()
    finally:
        qapp.setStyle(name)
        qapp.setPalette(before)


def _check_layout(panel, size):
    assert panel.width() == size[0]
    assert panel.height() == size[1]
    for label in panel.findChildren(QLabel):
        if (
            label.isVisible()
            and label.text()
            and not label.wordWrap()
            and label is not panel.foot.line
        ):
            wide = QFontMetrics(label.font()).horizontalAdvance(label.text())
            if panel.views.isAncestorOf(label):
                continue  # the views elide
            assert label.width() >= wide - 1, label.text()
    for button in [*panel.findChildren(QPushButton), *panel.findChildren(QToolButton)]:
        shows_words = not isinstance(button, QToolButton) or (
            button.toolButtonStyle() != Qt.ToolButtonStyle.ToolButtonIconOnly
        )
        if (
            button.isVisible()
            and button.text()
            and (shows_words or button.icon().isNull())
            and not panel.views.isAncestorOf(button)
        ):
            wide = QFontMetrics(button.font()).horizontalAdvance(button.text())
            assert button.width() >= wide, button.text()
    for tab in (panel.align_tab, panel.errors_tab, panel.report_tab):
        if tab.isVisible():
            assert tab.inside.width() <= tab.viewport().width()
            shown = [
                each
                for each in tab.inside.children()
                if isinstance(each, QLabel | QPushButton | QLineEdit) and each.isVisible()
            ]
            for k, one in enumerate(shown):
                for other in shown[k + 1 :]:
                    assert not one.geometry().intersects(other.geometry()), (one, other)


def test_a_narrow_panel_shows_the_views_or_the_tabs(panel, qtbot):
    feed(panel)
    pane = panel.action("pane")
    panel.resize(480, panel.minimumSizeHint().height())
    qtbot.wait(20)
    assert panel.width() == 480
    assert (panel.upright.isVisible(), panel.tabs.isVisible()) == (True, False)
    left, right = panel.views.source, panel.views.target
    assert left.geometry().right() < right.geometry().left()
    for view in (left, right):
        assert view.header.width() >= view.header.minimumSizeHint().width()
    assert panel.totals.y() >= panel.table.geometry().bottom()
    assert panel.totals.numbers.height() >= panel.totals.numbers.heightForWidth(
        panel.totals.numbers.width()
    )
    pane.trigger()
    assert (panel.upright.isVisible(), panel.tabs.isVisible()) == (False, True)
    pane.trigger()
    panel.resize(1200, 700)
    qtbot.wait(20)
    assert (panel.upright.isVisible(), panel.tabs.isVisible()) == (True, True)
    pane.trigger()
    panel.resize(480, 700)
    panel.resize(1200, 700)
    qtbot.wait(20)
    assert not panel.tabs.isVisible()  # who had sent them away has them away still


def test_a_state_line_that_does_not_fit_ends_in_dots(panel, qtbot):
    feed(panel)
    line = panel.foot.line
    assert line.shown == line.text()
    panel.resize(480, 500)
    panel.foot.where.setText("E 741000.000   N 4279000.000   H 150.000")
    qtbot.wait(20)
    assert line.shown.endswith("…")
    assert line.toolTip() == line.text()


def test_shutting_down_twice_is_fine_and_frees_the_model(panel):
    listeners = len(panel.model.changed)
    panel.shutdown()
    panel.shutdown()
    assert len(panel.model.changed) == listeners - 1


def test_the_panel_names_no_binding_and_no_host():
    import trigpoint_panel

    unscoped = []
    for path in Path(trigpoint_panel.__file__).parent.glob("*.py"):
        text = path.read_text("utf-8")
        for name in ("PySide6", "PyQt5", "PyQt6", "qgis", "exec_("):
            if f"import {name}" in text or f"from {name}" in text or "exec_(" in text:
                unscoped.append((path.name, name))
    assert unscoped == []
    assert issubclass(CloudError, ValueError)
