"""From a QGIS without the packages to the panel: Install… as a user presses it."""

import os
import sys
from pathlib import Path

sys.path.insert(0, os.environ["TRIGPOINT_DRIVERS"])
import numpy as np
from driving import GIVEN, SAID, card_of, drive, opened, shot, wait
from qgis.core import QgsApplication


def steps():
    dock = opened()
    card = card_of(dock)
    shot("installing-1-card")
    card.install.click()
    wait(lambda: card.log.blockCount() > 20, "the log", 60)
    shot("installing-2-log")
    wait(lambda: dock.panel is not None or card.install.isEnabled(), "the end", 450)
    SAID["panel"] = dock.panel is not None
    SAID["fault"] = "" if SAID["panel"] else card.fault.text() + card.log.toPlainText()[-2000:]
    shot("installing-3-panel")
    own = Path(GIVEN["profile"]) / "python" / "trigpoint-env"
    SAID["own"] = str(own.resolve()) in str(Path(sys.modules["pyvista"].__file__).resolve())
    SAID["numpy_of_qgis"] = "trigpoint-env" not in np.__file__
    SAID["can_execute"] = all(
        algorithm.canExecute()[0]
        for algorithm in QgsApplication.processingRegistry().providerById("trigpoint").algorithms()
    )


drive(steps)
