"""What an audit or a cloud holds, drawn as map layers beside it and added in a group of its own."""

from __future__ import annotations

import csv
import json
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from qgis.core import (
    Qgis,
    QgsApplication,
    QgsLayerTreeGroup,
    QgsPointCloudLayer,
    QgsProject,
    QgsProviderRegistry,
    QgsRasterLayer,
    QgsTask,
    QgsVectorLayer,
)

from trigpoint_qgis import deps, layers, plan

CELL_M = 0.5
EXAGGERATION = 20.0
# Names the result that a group of layers shows, so that it is found again.
SHOWS = "trigpoint/shows"
# Patience with a map that is told to stop, milliseconds.
PATIENCE_MS = 2000
# The panel tells how a task ended; QGIS (3.26 and later) would tell it a second time, over the map.
QUIET = QgsTask.Flag.CanCancel | getattr(QgsTask.Flag, "Silent", QgsTask.Flag.CanCancel)


@dataclass(frozen=True)
class Drawn:
    """A layer's file.

    Attributes
    ----------
    title : str
    address : str
        Of the file, as QGIS writes it.
    kind : str
        Says how it is styled; see `layers.style`.
    largest : float
        Where the colours of a raster end.
    of : str
        The reconstruction that it shows; empty if there is but one.
    vertical : str
        WKT of the CRS of its heights; empty if that is not known.
    """

    title: str
    address: str
    kind: str
    largest: float = 0.0
    of: str = ""
    vertical: str = ""

    def layer(self) -> Any:
        """Open and style it; in the GUI thread."""
        if self.kind in layers.RASTERS:
            opened = QgsRasterLayer(self.address, self.title)
        else:
            opened = QgsVectorLayer(self.address, self.title, "ogr")
        if opened.isValid():
            layers.style(opened, self.kind, largest=self.largest, vertical=self.vertical)
        return opened


def map_folder(bundle: Path) -> Path:
    """Return the folder of a bundle's maps.

    It lies beside the bundle, which is sealed: its manifest lists every file in it.
    """
    return bundle.with_name(f"{bundle.name}-map")


def draw(
    bundle: Path, *, cell: float = CELL_M, poll: Callable[[], None] = lambda: None
) -> list[Drawn]:
    """Write the maps of a bundle into their folder.

    Parameters
    ----------
    bundle : Path
        The folder that an audit made.
    cell : float
        Edge of the cells of the maps, metres.
    poll : callable
        Called between layers; raises to cancel.
    """
    deps.load()
    from trigpoint.crs import metre_factors, parse_crs
    from trigpoint.files import read

    results = json.loads((bundle / "data" / "results.json").read_text("utf-8"))
    within = max(results["project"]["settings"]["comparison"]["within_m"])
    folder = map_folder(bundle)
    folder.mkdir(exist_ok=True)
    drawn: list[Drawn] = []
    for name, found in results["reconstructions"].items():
        clouds = {
            way: read(bundle / "clouds" / f"{name}-{way}.laz")
            for way in ("accuracy", "completeness")
        }
        poll()
        crs = clouds["completeness"].crs or parse_crs(results["crs"]["code"])
        factors, frame, heights = metre_factors(crs), layers.crs_of(crs), layers.heights_of(crs)
        places = {way: cloud.coordinates for way, cloud in clouds.items()}
        metres = {way: np.asarray(c.attributes["distance_m"], float) for way, c in clouds.items()}
        grid = plan.grid_over(np.concatenate(list(places.values())), cell)
        share = plan.completeness_pct(places["completeness"], metres["completeness"], grid, within)
        error = plan.rmse_m(places["accuracy"], metres["accuracy"], grid)
        package = folder / f"{name}.gpkg"
        package.unlink(missing_ok=True)
        for about, kind, values, largest in (
            (f"completeness within {within:g} m (%)", "completeness", share, 100.0),
            ("error (RMSE, m)", "error", error, plan.most(error)),
        ):
            poll()
            path = folder / f"{name}-{kind}.tif"
            layers.write_raster(path, values, grid, frame.toWkt(), factors, about)
            drawn.append(Drawn(f"{name}: {about}", str(path), kind, largest, name))
        outline = layers.footprint_feature(places["accuracy"], grid, factors)
        address = layers.write_features(package, "footprint", [outline], layers.POLYGONS, frame)
        drawn.append(Drawn(f"{name}: footprint", address, "footprint", of=name))
        if found["alignment"] is not None:
            rows = _picks(bundle / "data", name)
            for title, layer, kind, features in (
                (
                    f"{name}: residuals x {EXAGGERATION:g}",
                    layers.VECTORS,
                    layers.LINES,
                    layers.vector_features(rows, factors, EXAGGERATION),
                ),
                (
                    f"{name}: picks",
                    layers.PICKS,
                    layers.POINTS,
                    layers.pick_features(rows, factors),
                ),
            ):
                address = layers.write_features(package, layer, features, kind, frame)
                drawn.append(Drawn(title, address, layer, of=name, vertical=heights))
    # One scale of colours for all: what looks alike is alike.
    most = max(each.largest for each in drawn if each.kind == "error")
    return [replace(each, largest=most) if each.kind == "error" else each for each in drawn]


def outline_of(
    cloud: Path, *, cell: float = CELL_M, poll: Callable[[], None] = lambda: None
) -> list[Drawn]:
    """Write the footprint of a georeferenced cloud beside it; see `draw` of the parameters."""
    deps.load()
    from trigpoint.crs import metre_factors
    from trigpoint.files import stream

    taken: dict[tuple[int, int], None] = {}
    crs, count = None, 0
    for chunk in stream(cloud, attributes=False):
        poll()
        crs, count = chunk.crs, count + len(chunk.xyz)
        cells = np.unique(np.floor((chunk.xyz + chunk.origin)[:, :2] / cell), axis=0)
        taken.update(dict.fromkeys(map(tuple, cells.tolist())))
    middles = (np.array(list(taken)) + 0.5) * cell
    points = np.column_stack([middles, np.zeros(len(middles))])
    path = cloud.with_name(f"{cloud.stem}-footprint.gpkg")
    grid, factors = plan.grid_over(points, cell), metre_factors(crs)
    path.unlink(missing_ok=True)
    feature = layers.footprint_feature(points, grid, factors)
    feature["points"] = count
    address = layers.write_features(
        path, "footprint", [feature], layers.POLYGONS, layers.crs_of(crs)
    )
    return [Drawn(f"{cloud.name}: footprint", address, "footprint")]


def show(drawn: list[Drawn], group: str, *, of: Path | None = None) -> None:
    """Add layers to the map in a group, those drawn last on top.

    The layers of each reconstruction come together, the first on top. Of a pile of rasters only
    the uppermost would be seen, so that one is switched on.

    Parameters
    ----------
    drawn : list of Drawn
    group : str
        Title of the group.
    of : Path, optional
        The result that is shown.
    """
    place = QgsProject.instance().layerTreeRoot().insertGroup(0, group)
    if of is not None:
        place.setCustomProperty(SHOWS, str(of))
    names = list(dict.fromkeys(each.of for each in drawn))
    for order, name in enumerate(names):
        inner = place.addGroup(name) if len(names) > 1 else place
        for each in drawn:
            if each.of == name:
                _insert(each.layer(), inner, seen=each.kind != "completeness")
        if order > 0:
            inner.setItemVisibilityChecked(False)
            inner.setExpanded(False)


def _insert(layer: Any, place: QgsLayerTreeGroup, *, seen: bool = True) -> None:
    if layer.isValid():
        QgsProject.instance().addMapLayer(layer, False)
        node = place.insertLayer(0, layer)
        node.setItemVisibilityChecked(seen)
        node.setExpanded(seen)


def clear(path: Path) -> None:
    """Take away the layers of a result that is drawn anew: their files are about to change."""
    project = QgsProject.instance()
    every = project.layerTreeRoot().findGroups(True)
    # First listed, then removed: with a group those inside it go.
    for group in [each for each in every if each.customProperty(SHOWS) == str(path)]:
        project.removeMapLayers(group.findLayerIds())
        group.parent().removeChildNode(group)


def cloud_layer(path: Path) -> Any:
    """Open a cloud as a layer of points; None where this QGIS can't."""
    named = path.name.lower()
    known = QgsProviderRegistry.instance().providerList()
    for end, provider in ((".copc.laz", "copc"), (".laz", "pdal"), (".las", "pdal")):
        if named.endswith(end) and provider in known:
            layer = QgsPointCloudLayer(str(path), path.name, provider)
            if layer.isValid():
                return layer
    return None


def add(path: Path, kind: str, told: Callable[[str, str], None] = lambda *_: None) -> None:
    """Draw a result in a task of QGIS and add it to the map when it is drawn.

    Parameters
    ----------
    path : Path
    kind : {"bundle", "cloud"}
        A cloud is shown as points where this QGIS can, else by its footprint.
    told : callable
        Told a level (info or warning) and a sentence: what is shown instead, or what went wrong.
    """
    clear(path)
    if kind == "cloud":
        layer = cloud_layer(path)
        if layer is not None:
            group = QgsProject.instance().layerTreeRoot().insertGroup(0, f"Trigpoint {path.name}")
            group.setCustomProperty(SHOWS, str(path))
            _insert(layer, group)
            return
    work: Callable[..., list[Drawn]] = draw if kind == "bundle" else outline_of

    def run(task: QgsTask) -> list[Drawn]:
        def poll() -> None:
            if task.isCanceled():
                message = "it was cancelled."
                raise InterruptedError(message)

        return work(path, poll=poll)

    def finished(error: Exception | None, drawn: list[Drawn] | None = None) -> None:
        if task not in _running:
            return  # the plugin has gone
        _running.remove(task)
        if error is not None:
            message = f"{path.name} can't be put on the map: {error}"
            QgsApplication.messageLog().logMessage(message, "Trigpoint", Qgis.MessageLevel.Warning)
            told("warning", message)
        elif drawn:
            show(drawn, f"Trigpoint {path.name}", of=path)
            if kind == "cloud":
                told(
                    "info",
                    f"The map shows the footprint of {path.name}: this QGIS has no provider that "
                    "draws the points of such a file.",
                )

    title = f"Trigpoint: map of {path.name}"
    task = QgsTask.fromFunction(title, run, on_finished=finished, flags=QUIET)
    # Nobody else holds it while it runs.
    _running.append(task)
    QgsApplication.taskManager().addTask(task)


def stop() -> None:
    """Give up on the maps that are being drawn: nobody will be there to show them."""
    tasks = list(_running)
    _running.clear()
    for task in tasks:
        task.cancel()
        task.waitForFinished(PATIENCE_MS)


_running: list[QgsTask] = []


def _picks(folder: Path, name: str) -> list[dict[str, Any]]:
    """Join the picks of a bundle with their residuals."""
    residuals: dict[str, dict[str, str]] = {}
    for table in (f"picks-{name}.csv", f"checks-{name}.csv"):
        if (folder / table).is_file():
            residuals |= {row["id"]: row for row in _table(folder / table)}
    return [
        {**row, **residuals[row["id"]], "used": residuals[row["id"]].get("used") == "True"}
        for row in _table(folder / f"correspondences-{name}.csv")
        if row["id"] in residuals
    ]


def _table(path: Path) -> list[dict[str, str]]:
    with path.open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))
