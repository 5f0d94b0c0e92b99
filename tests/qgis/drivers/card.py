"""Without the packages: the card is shown, QGIS works on, and quits while it is open."""

import os
import sys
from pathlib import Path

sys.path.insert(0, os.environ["TRIGPOINT_DRIVERS"])
from driving import GIVEN, SAID, breathe, card_of, drive, opened, shot, wait
from qgis.core import QgsApplication
from qgis.PyQt.QtWidgets import QApplication
from qgis.utils import iface


def steps():
    dock = opened()
    card = card_of(dock)
    SAID["text"] = card.text.text()
    SAID["panel"] = dock.panel is not None
    SAID["modal"] = QApplication.activeModalWidget() is not None
    shot("qgis-6-card")
    algorithm = QgsApplication.processingRegistry().algorithmById("trigpoint:align")
    SAID["can_execute"] = algorithm.canExecute()[0]
    card.copy_commands()
    SAID["clipboard"] = QApplication.clipboard().text()
    # No network here: the installation fails, and says why.
    card.start()
    breathe(0.5)
    SAID["tasks"] = QgsApplication.taskManager().countActiveTasks()
    wait(lambda: card.install.isEnabled(), "the installation to fail", 150)
    SAID["fault"] = card.fault.text()
    SAID["log"] = card.log.toPlainText()[-2000:]
    SAID["left"] = (Path(GIVEN["profile"]) / "python" / "trigpoint-env").exists()
    shot("qgis-7-failed")
    # The folder that has them opens the panel, without a restart.
    card.use(GIVEN["environment"])
    wait(lambda: dock.panel is not None, "the panel")
    shot("qgis-8-ready")
    iface.messageBar().clearWidgets()


drive(steps)
