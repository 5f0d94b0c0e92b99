"""What every driver uses: steps one after another in QGIS's event loop, told in a file, then quit.

A driver runs inside QGIS (`qgis --code`), where nothing that is raised or printed reaches the test.
"""

import faulthandler
import json
import os
import sys
import time
import traceback
from pathlib import Path

from qgis.PyQt.QtCore import QEvent, QPoint, Qt, QTimer
from qgis.PyQt.QtTest import QTest
from qgis.PyQt.QtWidgets import QApplication, QMessageBox
from qgis.utils import iface, plugins

faulthandler.enable()
GIVEN = json.loads(os.environ["TRIGPOINT_GIVEN"])
SAID, ERRORS = {}, []
NAME = "trigpoint_qgis"

# QGIS's own installer ends with a box that somebody would have to close.
for _name in ("information", "warning", "critical"):
    setattr(QMessageBox, _name, staticmethod(lambda *a, **_k: ERRORS.append(f"a box: {a[1:3]}")))


def drive(steps):
    """Run a function once QGIS has started, tell what it found, and quit."""

    def hook(kind, value, trace):
        ERRORS.append("".join(traceback.format_exception(kind, value, trace)))

    def start():
        sys.excepthook = hook
        try:
            steps()
        except Exception:
            ERRORS.append(traceback.format_exc())
        told = json.dumps({"said": SAID, "errors": ERRORS})
        Path(os.environ["TRIGPOINT_TOLD"]).write_text(told, "utf-8")
        QTimer.singleShot(0, iface.actionExit().trigger)

    QTimer.singleShot(1500, start)


def breathe(seconds=0.2):
    """Let QGIS handle its events."""
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        QApplication.processEvents()
        # What is to be deleted waits for the loop that this is called in.
        QApplication.sendPostedEvents(None, QEvent.Type.DeferredDelete)
        time.sleep(0.005)


def wait(true, what, seconds=40):
    """Wait until something holds."""
    end = time.monotonic() + seconds
    while not true():
        if time.monotonic() > end:
            message = f"it took longer than {seconds} s: {what}"
            raise TimeoutError(message)
        breathe(0.02)


def opened(then=lambda _: None):
    """Open the dock as a user does; return it once it shows the panel or the card.

    What is to happen to it before it is filled is done `then`.
    """
    plugin = plugins[NAME]
    plugin.action.trigger()
    dock = plugin.dock
    then(dock)
    wait(lambda: dock.panel is not None or dock.card is not None, "the panel or the card")
    return dock


def panel_of(dock):
    """Return the panel that a dock shows, or say what its card says."""
    assert dock.panel is not None, f"{dock.card.text.text()} {dock.card.fault.text()}"
    return dock.panel


def card_of(dock):
    """Return the card that a dock shows in place of the panel."""
    assert dock.card is not None, "the dock shows the panel"
    return dock.card


def shot(name):
    """Take a picture of the whole screen."""
    breathe(0.3)
    path = Path(os.environ["TRIGPOINT_SHOTS"]) / f"{name}.png"
    QApplication.primaryScreen().grabWindow(0).save(str(path))


def rendered(seconds=30):
    """Wait until the map is drawn."""
    canvas = iface.mapCanvas()
    canvas.zoomToFullExtent()
    breathe(0.5)
    wait(lambda: not canvas.isDrawing(), "the map to be drawn", seconds)
    breathe(0.5)


def colours(widget):
    """Count the strongly coloured pixels that the user sees of a widget."""
    import numpy as np

    place = widget.mapToGlobal(QPoint(0, 0))
    size = widget.size()
    picture = QApplication.primaryScreen().grabWindow(
        0, place.x(), place.y(), size.width(), size.height()
    )
    image = picture.toImage().convertToFormat(picture.toImage().Format.Format_RGB32)
    bits = image.constBits()
    bits.setsize(image.sizeInBytes())
    pixels = np.frombuffer(bits, np.uint8).reshape(image.height(), image.width(), 4)[..., :3]
    return int((np.ptp(pixels.astype(int), axis=2) > 30).sum())


def click(widget, x, y):
    """Click with the left button, as a user does."""
    at = QPoint(round(float(x)), round(float(y)))
    QTest.mouseMove(widget, at)
    QTest.mouseClick(widget, Qt.MouseButton.LeftButton, Qt.KeyboardModifier.NoModifier, at)
    breathe(0.05)
