"""An analyst's whole story, told by mouse and keys alone."""

import importlib.util
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("qtpy", reason="the panel's packages are not installed", exc_type=ImportError)
pytest.importorskip("pyvista", reason="the panel's packages are not installed")

from qtpy.QtCore import QSettings, Qt
from qtpy.QtWidgets import QApplication

from trigpoint.files import write
from trigpoint.synthetic import clock_tower

PICKED = ("plinth-sw", "course1-se", "course2-nw", "clock-s", "roof-se", "cornice-sw")
CORNER = "roof-se"  # three planes that airborne points show


def load_hand():
    place = Path(__file__).with_name("hand.py")
    spec = importlib.util.spec_from_file_location("hand", place)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    """Two small clouds on disk, and the truth."""
    folder = tmp_path_factory.mktemp("site")
    scene = clock_tower(density=0.15)
    write(folder / "nerf.ply", scene.neural)
    write(folder / "lidar.laz", scene.reference)
    return folder, scene


@pytest.fixture
def hand(qapp, tmp_path):
    """A hand over a fresh window."""
    assert qapp is not None
    from trigpoint_panel.window import Window

    settings = QSettings(str(tmp_path / "settings.ini"), QSettings.Format.IniFormat)
    window = Window(settings, scratch=tmp_path / "scratch")
    window.resize(1366, 768)
    made = load_hand().Hand(window)
    made.come_to_the_front()
    yield made
    window.panel.session.discard_autosave()
    assert window.end()
    window.close()
    window.deleteLater()
    QApplication.processEvents()


def nearest(opened, place):
    """The shown point nearest to a place."""
    return opened.cloud.coordinates[
        np.argmin(((opened.cloud.coordinates - place) ** 2).sum(axis=1))
    ]


def test_the_whole_story(hand, site, tmp_path, monkeypatch):
    folder, scene = site
    panel, model, views = hand.panel, hand.panel.model, hand.panel.views
    key, ctrl, shift = (
        Qt.Key,
        Qt.KeyboardModifier.ControlModifier,
        Qt.KeyboardModifier.ShiftModifier,
    )
    opened_documents = []
    monkeypatch.setattr(panel.host, "open_document", opened_documents.append)
    assert panel.line.text == "Open a source cloud and a reference cloud."

    # Two clouds are opened by key.
    for name, pressed in (("nerf.ply", key.Key_O), ("lidar.laz", key.Key_R)):
        monkeypatch.setattr(panel.host, "open_file", lambda *_, name=name: folder / name)
        hand.key(pressed, ctrl)
        hand.idle()
    assert hand.window.strip.texts() == []
    assert "Press P" in panel.line.text
    hand.until(lambda: all(views.view(s).canvas is not None for s in ("source", "target")))

    # Six pairs are picked; the source's camera is where a person would have turned it.
    hand.key(key.Key_P)
    assert panel.action("pick").isChecked()
    back = scene.truth.inverse()
    views.source.set_up(tuple(back.rotation[:, 2]))
    for count, name in enumerate(PICKED, start=1):
        corner = scene.corners[name]
        near = {
            "source": nearest(views.opened["source"], back(corner[None])[0]),
            "target": nearest(views.opened["target"], corner),
        }
        views.target.fly_to(tuple(near["target"]))
        views.source.set_camera(views.target.camera.through(back))
        views.source.fly_to(tuple(near["source"]))
        hand.pick("source", near["source"])
        assert "now click the same corner in the reference view" in panel.line.text
        hand.pick("target", near["target"])
        pair = model.pairs[-1]
        assert pair.is_complete
        assert np.linalg.norm(np.subtract(pair.target, corner)) < 1.0
        assert len(model.pairs) == count
        assert (model.fit.similarity is not None) == (count >= 3)
    assert abs(model.fit.similarity.scale - scene.truth.scale) < 0.1
    assert "6 control, 0 check" in panel.line.text
    assert panel.totals.numbers.text().startswith(
        "RMSE\N{NO-BREAK SPACE}control\N{NO-BREAK SPACE}0."
    )
    assert panel.table.cell("P1", "d_m")

    # A drag turns the view and picks nothing.
    before = views.target.camera
    hand.drag("target", (60, 10))
    assert views.target.camera != before
    assert len(model.pairs) == 6

    # Undo and redo.
    hand.key(key.Key_Z, ctrl)
    assert model.pairs[-1].is_half_open
    assert "P6" in panel.line.text
    hand.key(key.Key_Z, ctrl | shift)
    assert model.pairs[-1].is_complete

    # The pick mode is left; one pair becomes a check pair.
    hand.key(key.Key_Escape)
    assert not panel.action("pick").isChecked()
    hand.choose("P2", "id")
    hand.key(key.Key_Space, widget=panel.table)
    assert model.pairs[1].role == "check"
    assert panel.table.cell("P2", "role") == "check"
    assert "5 control, 1 check" in panel.line.text
    hand.key(key.Key_Z, ctrl)
    assert model.pairs[1].role == "control"

    # One pick is spoilt by 0.7 m: it is named, in words.
    east = model.pairs[3].target[0]
    hand.enter("P4", "target_x", repr(east + 0.7))
    assert model.pairs[3].target[0] == east + 0.7
    assert model.fit.suspects == ("P4",)
    assert panel.table.cell("P4", "flag") in ("rejected", "suspect")
    assert "P4" in panel.line.text
    assert panel.line.word in ("Rejected", "Suspect")
    assert panel.line.level == "red"
    hand.key(key.Key_Z, ctrl)
    assert model.pairs[3].target[0] == east
    assert model.fit.suspects == ()

    # The views are linked: turning one turns the other.
    hand.key(key.Key_L)
    assert panel.action("link").isChecked()
    before = views.source.camera
    hand.drag("target", (-50, 20))
    assert views.source.camera != before
    hand.key(key.Key_L)

    # A corner of three planes is snapped to.
    hand.key(key.Key_P)
    bar = panel.bar
    bar.snap.setFocus()
    for _ in range(3):
        hand.key(key.Key_Down, widget=bar.snap)
    assert bar.snap.currentText() == "Corner of 3 planes"
    bar.radius.setFocus()
    bar.radius.selectAll()
    hand.type("2.5")
    hand.key(key.Key_Return, widget=bar.radius)
    corner = scene.corners[CORNER]
    near = nearest(views.opened["target"], corner)
    aside = (near[0] + 10, near[1] - 12, near[2] + 8)
    views.target.set_camera(replace(views.target.camera, position=aside, focal_point=tuple(near)))
    hand.rest()
    hand.pick("target", near)
    assert hand.window.strip.texts() == []
    snapped = model.pairs[-1]
    assert "planes" in snapped.note
    assert snapped.sigma_target > 0
    assert np.linalg.norm(np.subtract(snapped.target, corner)) < 0.1
    hand.key(key.Key_Escape)  # drops the open half
    assert len(model.pairs) == 6
    hand.key(key.Key_Escape)

    # The comparison is run, cancelled, and run again.
    tab = panel.errors_tab
    panel.tabs.setCurrentWidget(tab)
    hand.click(tab.compare)
    assert panel.foot.job is not None
    assert not panel.foot.stop.isHidden()
    hand.key(key.Key_Escape)
    hand.idle()
    assert tab.findings is None
    assert panel.foot.stop.isHidden()
    hand.click(tab.compare)
    hand.until(lambda: tab.findings is not None)
    assert tab.accuracy.rowCount() == 4
    assert tab.completeness.item(0, 0).text() == "All"
    tab.accuracy.setFocus()
    tab.accuracy.selectRow(0)
    hand.key(key.Key_Down, widget=tab.accuracy)
    assert tab.completeness.currentRow() == 1

    # The report is written, by the command line's own audit.
    panel.tabs.setCurrentWidget(panel.report_tab)
    for box in (panel.report_tab.icp, panel.report_tab.intervals):
        box.setFocus()
        hand.key(key.Key_Space, widget=box)
        assert not box.isChecked()
    project = tmp_path / "job" / "project.toml"
    project.parent.mkdir()
    monkeypatch.setattr(panel.host, "save_file", lambda *_: project)
    hand.key(key.Key_E, ctrl)
    assert panel.foot.job is not None
    hand.idle(240)
    audited = panel.report_tab.audited
    assert audited is not None, hand.window.strip.texts()
    assert audited.verdict == "NOT TESTED"
    results = json.loads((audited.folder / "data" / "results.json").read_text("utf-8"))
    found = results["reconstructions"]["nerf"]["alignment"]
    assert found["scale"] == pytest.approx(model.fit.similarity.scale, abs=1e-9)
    assert opened_documents == list(audited.documents[:1])
    assert "Verdict: NOT TESTED" in panel.report_tab.verdict.text()
