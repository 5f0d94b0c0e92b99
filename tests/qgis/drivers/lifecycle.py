"""From the zip to the way out: install, open, pick, fit, float, unload, reload, quit while open."""

import os
import sys
import time

sys.path.insert(0, os.environ["TRIGPOINT_DRIVERS"])
import numpy as np
from driving import (
    GIVEN,
    NAME,
    SAID,
    breathe,
    click,
    colours,
    drive,
    opened,
    panel_of,
    shot,
    wait,
)
from qgis.core import Qgis, QgsApplication, QgsProject
from qgis.PyQt.QtCore import Qt
from qgis.PyQt.QtTest import QTest
from qgis.utils import active_plugins, iface, loadPlugin, plugins, startPlugin, unloadPlugin


def steps():
    SAID["qgis"] = Qgis.QGIS_VERSION
    before = set(sys.path)
    iface.mainWindow().setGeometry(0, 0, 1600, 1000)

    import pyplugin_installer

    pyplugin_installer.instance().installFromZipFile(GIVEN["archive"])
    wait(lambda: NAME in active_plugins, "the plugin to be active")
    SAID["algorithms"] = sorted(
        algorithm.id()
        for algorithm in QgsApplication.processingRegistry().providerById("trigpoint").algorithms()
    )
    SAID["imported_early"] = [m for m in ("pyvista", "trigpoint", "pandas") if m in sys.modules]

    # The dock floats, and is filled only once it has its own window.
    begun = time.monotonic()
    dock = opened()
    panel = panel_of(dock)
    SAID["seconds_to_panel"] = round(time.monotonic() - begun, 2)
    SAID["floating"] = dock.isFloating()
    breathe(1)
    shot("qgis-1-empty")
    begun = time.monotonic()
    panel.open_session(GIVEN["project"])
    wait(lambda: all(panel.views.opened.values()), "both clouds")
    wait(lambda: not panel.foot.running, "the jobs")
    SAID["seconds_to_clouds"] = round(time.monotonic() - begun, 2)
    views = {side: panel.views.view(side) for side in ("source", "target")}
    breathe(1)
    SAID["colours_at_first"] = {side: colours(view.canvas) for side, view in views.items()}
    SAID["canvas"] = {side: view.canvas.kind for side, view in views.items()}
    shot("qgis-2-clouds")

    picked(panel, views)
    shot("qgis-3-picked")

    # Floated, docked, hidden and shown again, the clouds stay to be seen.
    SAID["colours"] = {}
    for name, change in (
        ("docked", lambda: dock.setFloating(False)),
        ("floated", lambda: dock.setFloating(True)),
        ("hidden", dock.hide),
        ("shown", lambda: plugins[NAME].action.trigger()),
    ):
        change()
        breathe(0.8)
        if name != "hidden":
            SAID["colours"][name] = [colours(view.canvas) for view in views.values()]
        if name == "docked":
            shot("qgis-4-docked")
    SAID["pairs_kept"] = len(panel.model.pairs)

    region()

    SAID["unloaded"] = unloadPlugin(NAME)
    breathe(0.5)
    SAID["left_behind"] = {
        "provider": QgsApplication.processingRegistry().providerById("trigpoint") is not None,
        "docks": [d.objectName() for d in docks()],
        "actions": [a.objectName() for a in iface.pluginMenu().actions() if "rigpoint" in a.text()],
        "path": [p for p in sys.path if p not in before and "_vendor" in p],
        "modules": [m for m in sys.modules if m.split(".")[0].startswith("trigpoint")],
    }

    # Reloaded; docked at once, so that it is filled there, then floated before its first paint.
    SAID["reloaded"] = loadPlugin(NAME) and startPlugin(NAME)
    panel = panel_of(opened(lambda dock: (dock.setFloating(False), dock.setFloating(True))))
    panel.open_session(GIVEN["project"])
    wait(lambda: all(panel.views.opened.values()), "both clouds again")
    breathe(1.5)
    SAID["colours_after_reload"] = [
        colours(panel.views.view(side).canvas) for side in ("source", "target")
    ]
    shot("qgis-5-reloaded")
    SAID["layers"] = len(QgsProject.instance().mapLayers())


def picked(panel, views):
    """Pick the project's own places again, by mouse, and see that the fit is there."""
    from trigpoint_panel.camera import Camera

    model = panel.model
    pairs = [pair for pair in model.pairs if pair.role != "off"]
    fit = model.similarity
    middle = np.mean([pair.target for pair in pairs], axis=0)
    model.delete([pair.id for pair in model.pairs])
    assert model.similarity is None
    SAID["line_without_pairs"] = panel.line.text
    panel.activateWindow()
    views["source"].setFocus()
    QTest.keyClick(panel, Qt.Key.Key_P)
    if not panel.action("pick").isChecked():
        panel.action("pick").trigger()
    seconds = []
    for pair in pairs[:6]:
        outward = np.array(pair.target) - middle
        outward[2] = 0.4 * np.linalg.norm(outward[:2])
        outward *= 12 / np.linalg.norm(outward)
        back = {"source": fit.rotation.T @ outward / fit.scale, "target": outward}
        up = {"source": fit.rotation.T @ [0, 0, 1], "target": [0, 0, 1]}
        for side, view in views.items():
            place = np.array(getattr(pair, side))
            view.set_camera(
                Camera(
                    tuple((place + back[side]).tolist()),
                    tuple(place.tolist()),
                    tuple(map(float, up[side])),
                )
            )
            breathe(0.1)
            pixel = view.scene.project(place) / view.devicePixelRatioF()
            surface = view.canvas.surface
            begun = time.monotonic()
            click(surface, pixel[0], surface.height() - pixel[1])
            seconds.append(time.monotonic() - begun)
    wait(lambda: not panel.foot.running, "the fit")
    breathe(0.5)
    done = model.pairs
    SAID["picked"] = len([p for p in done if p.source is not None and p.target is not None])
    SAID["scale"] = None if model.similarity is None else float(model.similarity.scale)
    SAID["rmse_m"] = float(model.fit.rmse_m)
    SAID["line"] = panel.line.text
    SAID["slowest_click_s"] = round(max(seconds), 2)
    model.undo()
    SAID["pairs_after_undo"] = len([p for p in model.pairs if p.source and p.target])
    model.redo()


def region():
    """Shapely and GDAL of the environment, in the process where QGIS's own are loaded."""
    from trigpoint.cloud import cloud_from
    from trigpoint.crs import parse_crs
    from trigpoint.zones import read_outline

    crs = parse_crs("EPSG:32615")
    outline = read_outline(GIVEN["region"], crs=crs)
    places = np.array([[741_013.0, 4_279_063.0, 160.0], [500_000.0, 4_000_000.0, 160.0]])
    inside = outline.contains(cloud_from(places, crs=crs))
    SAID["region"] = inside.tolist()


def docks():
    from qgis.PyQt.QtWidgets import QDockWidget

    return [
        dock
        for dock in iface.mainWindow().findChildren(QDockWidget)
        if "rigpoint" in dock.objectName()
    ]


drive(steps)
