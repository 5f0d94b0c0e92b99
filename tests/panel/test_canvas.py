"""Canvases: the one that runs here, one picture for many requests, and what HiDPI needs."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

pytest.importorskip("qtpy", reason="the panel's packages are not installed", exc_type=ImportError)
from trigpoint_panel.canvas import ImageCanvas, make_canvas

CHILD = """
import sys
from pathlib import Path
from qtpy import QtCore, QtTest, QtWidgets
import numpy as np
sys.path.insert(0, {tests!r})
import conftest
from trigpoint.cloud import cloud_from
from trigpoint.files import CloudInfo
from trigpoint_panel.opening import Opened
from trigpoint_panel.view import CloudView
app = QtWidgets.QApplication([])
points = conftest.tower(20_000)
info = CloudInfo(Path("t.laz"), "LAZ", len(points), points.min(0), points.max(0), None, (), 1, ())
view = CloudView("source")
view.resize(400, 300)
view.set_cloud(Opened(info, cloud_from(points)))
view.show()
while view.canvas is None or view._rest.isActive():
    app.processEvents()
QtTest.QTest.qWait(100)
got = []
view.picked.connect(got.append)
view.set_picking(True)
at = view.canvas.surface.rect().center()
none = QtCore.Qt.KeyboardModifier.NoModifier
QtTest.QTest.mouseClick(view.canvas.surface, QtCore.Qt.MouseButton.LeftButton, none, at)
x, y = view.scene.project(np.array(got[0].xyz)) / view.devicePixelRatioF()
away = np.hypot(x - at.x(), view.canvas.height() - y - at.y())
picture = view.canvas.surface.grab()
print(view.devicePixelRatioF(), away, picture.width(), view.canvas.width(), view.canvas.kind)
view.shutdown()
"""


@pytest.mark.parametrize("ratio", ["2", "1.5"])
def test_on_a_dense_screen_a_click_is_where_it_is_seen(ratio):
    script = CHILD.format(tests=str(Path(__file__).parent))
    environment = os.environ | {"QT_SCALE_FACTOR": ratio, "PYTHONWARNINGS": "ignore"}
    child = subprocess.run(
        [sys.executable, "-c", script], env=environment, capture_output=True, text=True, check=False
    )
    assert child.returncode == 0, child.stderr[-2000:]
    found, away, wide, logical, _ = child.stdout.split()
    assert float(found) == float(ratio)
    assert float(away) <= 6
    assert int(wide) == pytest.approx(float(ratio) * int(logical), abs=2)


def test_the_canvas_that_runs_here_is_taken(qtbot, qapp):
    canvas = make_canvas()
    qtbot.addWidget(canvas)
    without = qapp.platformName() in ("offscreen", "minimal")
    assert canvas.kind == ("image" if without else "gl")
    canvas.release()


def test_many_requests_draw_one_picture(qtbot):
    canvas = ImageCanvas()
    qtbot.addWidget(canvas, before_close_func=lambda widget: widget.release())
    canvas.resize(200, 100)
    drawn = []
    canvas.plotter.renderer.AddObserver("EndEvent", lambda *_: drawn.append(1))
    with qtbot.waitExposed(canvas):
        canvas.show()
    qtbot.wait(30)
    before = len(drawn)
    for _ in range(20):
        canvas.refresh()
    qtbot.wait(30)
    assert len(drawn) == before + 1
    canvas.update()
    qtbot.wait(30)
    assert len(drawn) == before + 1
    assert canvas.grab().width() == 200
    canvas.resize(300, 150)
    assert canvas.grab().width() == 300
