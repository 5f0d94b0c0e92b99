"""Screenshots of the panel in every state, to be looked at: python shots.py FOLDER [--report].

Run it on a display such as Xvfb's, or with QT_QPA_PLATFORM=offscreen.
"""

import argparse
import tempfile
from pathlib import Path

import numpy as np
from hand import Hand
from qtpy.QtCore import QSettings, Qt
from qtpy.QtTest import QTest
from qtpy.QtWidgets import QApplication, QLineEdit

from trigpoint.synthetic import clock_tower, write_project
from trigpoint_panel.picking import Picked
from trigpoint_panel.style import apply_theme
from trigpoint_panel.window import Window

SIZES = {"1366x768": (1366, 768), "1920x1080": (1920, 1080)}
FIRST = ("plinth-sw", "course1-se", "clock-s", "roof-se", "cornice-ne")


class Shots:
    """Takes one window through its states, and keeps a picture of each."""

    def __init__(self, folder, project, scene, theme, size):
        self.folder, self.project, self.scene = folder, project, scene
        self.name = f"{theme}-{size}"
        scratch = Path(tempfile.mkdtemp())
        settings = QSettings(str(scratch / "settings.ini"), QSettings.Format.IniFormat)
        self.window = Window(settings, scratch=scratch)
        self.window.host.open_document = lambda _: None
        self.window.resize(*SIZES[size])
        self.hand = Hand(self.window)
        self.hand.come_to_the_front()
        self.panel, self.model = self.window.panel, self.window.panel.model
        self.count = 0

    def keep(self, state):
        """Save what the window shows now."""
        self.hand.rest(0.5)
        self.count += 1
        path = self.folder / f"{self.name}-{self.count:02d}-{state}.png"
        assert self.window.grab().save(str(path))
        print(path, "|", self.panel.line.text)

    def pick(self, name, side):
        """Pick a corner as a person would have."""
        corner = self.scene.corners[name]
        rng = np.random.default_rng(sum(map(ord, name)))
        if side == "target":
            self.model.place("target", corner + rng.normal(0, 0.05, 3), sigma=0.05)
        else:
            at = self.scene.truth.inverse()(corner[None])[0]
            self.model.place("source", at + rng.normal(0, 0.015, 3), sigma=0.015)

    def story(self, *, with_report):
        """Go through all states."""
        hand, panel, model = self.hand, self.panel, self.model
        self.keep("empty")
        panel.open_cloud("source", self.project.parent / "nerf.ply")
        hand.idle()
        self.keep("one-cloud")
        panel.open_cloud("target", self.project.parent / "lidar.laz")
        hand.idle()
        self.keep("clouds")
        panel.action("pick").setChecked(True)
        self.pick(FIRST[0], "source")
        self.keep("half-pair")
        self.pick(FIRST[0], "target")
        for name in FIRST[1:3]:
            self.pick(name, "source")
            self.pick(name, "target")
        self.keep("three-pairs")
        for name in FIRST[3:]:
            self.pick(name, "source")
            self.pick(name, "target")
        self.pick("cornice-sw", "source")
        self.keep("ghost")
        far = tuple((self.scene.corners["cornice-sw"] + [2.1, 0, 0]).tolist())
        panel.views.target.picked.emit(Picked(far, 0.05, "", far))
        self.keep("far-from-ghost")
        panel.open_session(self.project)
        hand.idle(120)
        panel.host.clear_messages()
        hand.rest(1)
        self.keep("fit")
        panel.action("link").setChecked(True)
        hand.drag("target", (40, 0))
        panel.action("overlay").setChecked(True)
        self.keep("linked-overlay")
        panel.action("overlay").setChecked(False)
        model.edit("clock-s", "target_x", repr(model.pairs[3].target[0] + 0.7))
        hand.choose("clock-s", "id")
        self.keep("suspect")
        model.undo()
        panel.tabs.setCurrentWidget(panel.errors_tab)
        panel.compare()
        hand.until(lambda: panel.foot.running is not None and panel.foot.running.share)
        self.keep("comparing")
        hand.idle(120)
        self.keep("errors")
        panel.errors_tab.accuracy.selectRow(1)
        self.keep("zone-alone")
        panel.errors_tab.accuracy.selectRow(0)
        for each in (panel.views.source, panel.views.target):
            each.colour_by(each.scene.modes[0])
        panel.try_icp()
        hand.idle(240)
        self.keep("icp")
        if with_report:
            panel.make_report()
            hand.until(lambda: panel.foot.running is not None and panel.foot.running.share)
            self.keep("reporting")
            hand.idle(400)
            self.keep("report")
            panel.host.clear_messages()
        panel.tabs.setCurrentWidget(panel.report_tab)
        panel.host.message("error", "reference.laz has no CRS: choose one.", "Traceback\n  …")
        panel.host.message("warning", "P6 in the reference: 2.3 m from where 5 pairs put it. Keep?")
        panel.host.message("info", "There is no point within 5 pixels of the click.")
        self.window.strip.messages[2].buttons[0].click()
        self.keep("messages")
        panel.host.clear_messages()
        panel.action("second_begin").trigger()
        self.keep("second-operator")
        panel.action("second_cancel").trigger()
        hand.key(Qt.Key.Key_Insert, widget=panel.table)
        (editor,) = [each for each in panel.table.findChildren(QLineEdit) if each.isVisible()]
        QTest.keyClicks(editor, "1.25 0.5")
        self.keep("typing")
        panel.action("help").trigger()
        hand.rest(0.2)
        keys = self.folder / f"{self.name}-keys.png"
        panel.findChildren(type(panel._keys))[0].grab().save(str(keys))
        panel.bar.menu.popup(panel.mapToGlobal(panel.rect().center()))
        hand.rest(0.2)
        panel.bar.menu.grab().save(str(self.folder / f"{self.name}-menu.png"))
        panel.bar.menu.close()
        panel.session.discard_autosave()
        self.window.end()
        self.window.close()


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--density", type=float, default=1.0)
    parser.add_argument("--size", choices=SIZES, action="append")
    parser.add_argument("--theme", choices=("light", "dark"), action="append")
    parser.add_argument("--report", action="store_true")
    given = parser.parse_args()
    given.folder.mkdir(parents=True, exist_ok=True)
    application = QApplication([])
    scene = clock_tower(density=given.density)
    project = write_project(tempfile.mkdtemp(), scene)
    for theme in given.theme or ("light", "dark"):
        apply_theme(application, theme)
        for size in given.size or SIZES:
            Shots(given.folder, project, scene, theme, size).story(with_report=given.report)


if __name__ == "__main__":
    main()
