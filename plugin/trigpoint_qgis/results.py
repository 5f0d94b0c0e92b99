"""What an audit's bundle holds, drawn as map layers beside it and added in a group of their own."""

from __future__ import annotations

import csv
import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from qgis.core import (
    Qgis,
    QgsApplication,
    QgsProject,
    QgsRasterLayer,
    QgsTask,
    QgsVectorLayer,
)

from trigpoint_qgis import deps, layers, plan

CELL_M = 0.5
EXAGGERATION = 20.0


@dataclass(frozen=True)
class Drawn:
    """A layer's file: its title, address, and how it is styled."""

    title: str
    address: str
    kind: str
    largest: float = 0.0

    def layer(self) -> Any:
        """Open and style it; in the GUI thread."""
        if self.kind in ("completeness", "error", "raster"):
            opened = QgsRasterLayer(self.address, self.title)
        else:
            opened = QgsVectorLayer(self.address, self.title, "ogr")
        if opened.isValid():
            layers.style(opened, self.kind, largest=self.largest)
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
        factors, frame = metre_factors(crs), layers.crs_of(crs)
        places = {way: cloud.coordinates for way, cloud in clouds.items()}
        metres = {way: np.asarray(c.attributes["distance_m"], float) for way, c in clouds.items()}
        grid = plan.grid_over(np.concatenate(list(places.values())), cell)
        share = plan.completeness_pct(places["completeness"], metres["completeness"], grid, within)
        error = plan.rmse_m(places["accuracy"], metres["accuracy"], grid)
        package = folder / f"{name}.gpkg"
        package.unlink(missing_ok=True)
        for title, kind, values, largest in (
            (f"{name}: completeness within {within:g} m (%)", "completeness", share, 100.0),
            (f"{name}: error (RMSE, m)", "error", error, plan.most(error)),
        ):
            poll()
            path = folder / f"{name}-{kind}.tif"
            layers.write_raster(path, values, grid, frame.toWkt(), factors, title)
            drawn.append(Drawn(title, str(path), kind, largest))
        outline = layers.footprint_feature(places["accuracy"], grid, factors)
        address = layers.write_features(package, "footprint", [outline], layers.POLYGONS, frame)
        drawn.append(Drawn(f"{name}: footprint", address, "footprint"))
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
                drawn.append(Drawn(title, address, layer))
    return drawn


def outline_of(cloud: Path, *, cell: float = CELL_M) -> list[Drawn]:
    """Write the footprint of a georeferenced cloud beside it."""
    deps.load()
    from trigpoint.crs import metre_factors
    from trigpoint.files import stream

    taken: dict[tuple[int, int], None] = {}
    crs = None
    for chunk in stream(cloud, attributes=False):
        crs = chunk.crs
        cells = np.unique(np.floor((chunk.xyz + chunk.origin)[:, :2] / cell), axis=0)
        taken.update(dict.fromkeys(map(tuple, cells.tolist())))
    middles = (np.array(list(taken)) + 0.5) * cell
    points = np.column_stack([middles, np.zeros(len(middles))])
    path = cloud.with_name(f"{cloud.stem}-footprint.gpkg")
    grid, factors = plan.grid_over(points, cell), metre_factors(crs)
    path.unlink(missing_ok=True)
    feature = layers.footprint_feature(points, grid, factors)
    address = layers.write_features(
        path, "footprint", [feature], layers.POLYGONS, layers.crs_of(crs)
    )
    return [Drawn(f"{cloud.name}: footprint", address, "footprint")]


def show(drawn: list[Drawn], group: str) -> None:
    """Add layers to the map in a group, those drawn last on top."""
    project = QgsProject.instance()
    place = project.layerTreeRoot().insertGroup(0, group)
    for each in drawn:
        layer = each.layer()
        if layer.isValid():
            project.addMapLayer(layer, False)
            place.insertLayer(0, layer)


def add(path: Path, kind: str, failed: Callable[[str], None] = lambda _: None) -> None:
    """Draw a result in a task of QGIS and add it to the map when it is drawn.

    Parameters
    ----------
    path : Path
    kind : {"bundle", "cloud", "raster", "vector"}
    failed : callable
        Told in one sentence what went wrong.
    """
    if kind in ("raster", "vector"):
        show([Drawn(path.stem, str(path), kind)], path.stem)
        return
    work = draw if kind == "bundle" else outline_of

    def run(_task: QgsTask) -> list[Drawn]:
        return work(path)

    def finished(error: Exception | None, drawn: list[Drawn] | None = None) -> None:
        _running.remove(task)
        if error is not None:
            message = f"{path.name} can't be put on the map: {error}"
            QgsApplication.messageLog().logMessage(message, "Trigpoint", Qgis.MessageLevel.Warning)
            failed(message)
        elif drawn:
            show(drawn, f"Trigpoint {path.name}")

    task = QgsTask.fromFunction(f"Trigpoint: map of {path.name}", run, on_finished=finished)
    # Nobody else holds it while it runs.
    _running.append(task)
    QgsApplication.taskManager().addTask(task)


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
