"""A surveyor's day: the project, its fit, the comparison, the audit, and its results on the map."""

import os
import sys
from pathlib import Path

sys.path.insert(0, os.environ["TRIGPOINT_DRIVERS"])
from driving import (
    GIVEN,
    NAME,
    SAID,
    breathe,
    colours,
    drive,
    opened,
    panel_of,
    rendered,
    shot,
    wait,
)
from qgis.core import Qgis, QgsApplication, QgsMapLayer, QgsProject
from qgis.PyQt.QtCore import QObject, QUrl, pyqtSlot
from qgis.PyQt.QtGui import QDesktopServices
from qgis.PyQt.QtWidgets import QApplication
from qgis.utils import iface, plugins, unloadPlugin


def steps():
    # In place of the desktop, which has no browser here.
    asked = []
    desktop = Desktop(asked)
    QDesktopServices.setUrlHandler("file", desktop, "open")
    QgsApplication.setUITheme(GIVEN["theme"])
    iface.mainWindow().setGeometry(QApplication.primaryScreen().geometry())
    breathe(1)

    dock = opened()
    panel = panel_of(dock)
    shot("story-1-empty")
    panel.open_session(GIVEN["project"])
    wait(lambda: all(panel.views.opened.values()), "both clouds")
    wait(lambda: not panel.foot.running, "the jobs")
    breathe(1)
    SAID["rmse_m"] = float(panel.model.fit.rmse_m)
    SAID["line"] = panel.line.text
    shot("story-2-fit")
    dock.setFloating(False)
    breathe(1)
    shot("story-3-docked")
    SAID["clipped"] = clipped(panel)
    SAID["bold"] = list({label.font().bold() for label in headings(panel)})
    SAID["menu_seen_docked"] = panel.bar.menu_button.isVisible()
    SAID["docked_view_px"] = panel.views.view("source").height()
    dock.setFloating(True)
    breathe(0.5)
    free = dock.screen().availableGeometry()
    SAID["on_screen"] = free.contains(dock.frameGeometry())
    SAID["menu_seen"] = panel.bar.menu_button.isVisible()

    panel.compare()
    wait(lambda: panel.errors_tab.findings is not None, "the comparison", 120)
    breathe(1)
    shot("story-4-errors")

    panel.make_report()
    breathe(3)
    SAID["tasks"] = [task.description() for task in QgsApplication.taskManager().activeTasks()]
    shot("story-5-auditing")
    wait(lambda: panel.report_tab.audited is not None, "the audit", 400)
    SAID["verdict"] = panel.report_tab.audited.verdict
    breathe(0.5)
    SAID["opened"] = asked
    SAID["offered"] = [button.text() for button in dock.strip.messages[0].buttons]
    shot("story-6-report")
    project = QgsProject.instance()
    wait(lambda: project.layerTreeRoot().findGroups(), "the layers", 60)
    dock.hide()
    breathe(0.5)
    rendered()
    SAID["layers"] = [told(layer) for layer in project.mapLayers().values()]
    SAID["project_crs"] = project.crs().authid()
    SAID["drawn"] = colours(iface.mapCanvas())
    shot("story-7-map")
    plugins[NAME].action.trigger()
    dock.setFloating(False)
    breathe(1)
    shot("story-8-map-and-panel")

    SAID["loaded"] = loaded(Path(GIVEN["project"]))
    SAID["from_the_top"] = [each.name() for each in project.layerTreeRoot().findLayers()]
    shot("story-9-processing")

    # What was measured stays on the map when the plugin goes.
    SAID["unloaded"] = unloadPlugin(NAME)
    breathe(0.5)
    SAID["layers_after"] = len(project.mapLayers())
    # Or QGIS would ask whether to save it.
    project.clear()


def loaded(project):
    """Run algorithms as the toolbox does, and name what comes to the map with how it is drawn."""
    import processing

    there = set(QgsProject.instance().mapLayers())
    temporary = dict.fromkeys(("SIMILARITY", "POINTS", "VECTORS"), "TEMPORARY_OUTPUT")
    picks = {"PICKS": str(project.with_name("picks.csv")), "CRS": "EPSG:32615"}
    processing.runAndLoadResults("trigpoint:align", picks | temporary)
    names = ("RESULTS", "COMPLETENESS", "ERROR", "FOOTPRINT")
    clouds = {
        "RECONSTRUCTION": str(project.with_name("sfm.laz")),
        "REFERENCE": str(project.with_name("lidar.laz")),
    }
    processing.runAndLoadResults(
        "trigpoint:compare", clouds | dict.fromkeys(names, "TEMPORARY_OUTPUT")
    )
    breathe(0.5)
    return {
        layer.name(): [layer.renderer().type(), layer.crs().authid()]
        for key, layer in QgsProject.instance().mapLayers().items()
        if key not in there
    }


class Desktop(QObject):
    """Keeps what the desktop is asked to open."""

    def __init__(self, opened):
        super().__init__()
        self.opened = opened

    @pyqtSlot(QUrl)
    def open(self, url):
        self.opened.append(url.toLocalFile())


def told(layer):
    """Say what a test asks of a layer."""
    found = {
        "name": layer.name(),
        "valid": layer.isValid(),
        "crs": layer.crs().authid(),
        "kind": "raster" if layer.type() == QgsMapLayer.LayerType.RasterLayer else "vector",
    }
    if Qgis.QGIS_VERSION_INT >= 33800 and hasattr(layer, "verticalCrs"):
        found["vertical"] = layer.verticalCrs().authid()
    return found


def headings(panel):
    """Return the labels of the panel that head a section."""
    from qtpy.QtWidgets import QLabel

    return [label for label in panel.findChildren(QLabel) if label.property("role") == "heading"]


def clipped(panel):
    """Name the texts that are drawn in less room than they need."""
    from qtpy.QtWidgets import QLabel

    return [
        label.text()
        for label in panel.findChildren(QLabel)
        if type(label) is QLabel  # the others shorten what they say by themselves
        and label.isVisible()
        and not label.wordWrap()
        and label.text()
        and label.width() < label.minimumSizeHint().width()
    ]


drive(steps)
