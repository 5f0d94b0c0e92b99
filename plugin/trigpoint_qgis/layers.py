"""Results as map layers: picks, their residual vectors, a footprint, and rasters of cells."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
from osgeo import gdal
from qgis.core import (
    Qgis,
    QgsCategorizedSymbolRenderer,
    QgsColorRampLegendNodeSettings,
    QgsColorRampShader,
    QgsCoordinateReferenceSystem,
    QgsCoordinateTransformContext,
    QgsFeature,
    QgsField,
    QgsFields,
    QgsFillSymbol,
    QgsGeometry,
    QgsLineString,
    QgsLineSymbol,
    QgsMarkerSymbol,
    QgsPalLayerSettings,
    QgsPoint,
    QgsRasterLayer,
    QgsRasterShader,
    QgsRectangle,
    QgsRendererCategory,
    QgsSingleBandPseudoColorRenderer,
    QgsSingleSymbolRenderer,
    QgsTextBufferSettings,
    QgsTextFormat,
    QgsVectorFileWriter,
    QgsVectorLayerSimpleLabeling,
    QgsWkbTypes,
)
from qgis.PyQt.QtCore import QMetaType, QVariant
from qgis.PyQt.QtGui import QColor

from trigpoint_qgis.plan import PlanGrid

PICKS = "picks"
VECTORS = "residual_vectors"
RASTERS = ("completeness", "error")
# What lies over what on the map, from the bottom up.
PILE = (*RASTERS, "footprint", VECTORS, PICKS)
# A pick's marker by its role, as the panel draws it; one that the others agree without has its own.
MARKERS = (
    ("control", "circle", "#0072b2"),
    ("rejected", "triangle", "#d62718"),
    ("check", "square", "#009e73"),
    ("off", "cross2", "#59616d"),
)
SORT = """if("role" = 'control' and "used" = 'no', 'rejected', "role")"""
INK = "#1b1e23"
# Low to high: good to bad for an error, bad to good for completeness. Seen alike by the colour
# blind, and light to dark in print.
RAMP = ("#fde725", "#5ec962", "#21918c", "#3b528b", "#440154")


def field_list(*named: tuple[str, str]) -> QgsFields:
    """Make fields of names and kinds: text, real or whole."""
    if Qgis.QGIS_VERSION_INT >= 33800:
        kinds = QMetaType.Type
        known = {"text": kinds.QString, "real": kinds.Double, "whole": kinds.Int}
    else:
        older = QVariant.Type
        known = {"text": older.String, "real": older.Double, "whole": older.Int}
    fields = QgsFields()
    for name, kind in named:
        fields.append(QgsField(name, known[kind]))
    return fields


def pick_fields() -> QgsFields:
    """Fields of a pick: its residual in metres, target minus transformed source."""
    numbers = ("dx_m", "dy_m", "dz_m", "d_m", "height_m")
    return field_list(
        ("id", "text"),
        ("role", "text"),
        ("used", "text"),
        *((name, "real") for name in numbers),
    )


def pick_rows(alignment: Any) -> list[dict[str, Any]]:
    """List the picks of an alignment, as the features of its layers need them."""
    used = set(alignment.inliers.ids)
    table = alignment.residuals(alignment.picks)
    table = table.assign(
        used=[name in used for name in alignment.picks.ids],
        **dict(zip(("target_x", "target_y", "target_z"), alignment.picks.target.T, strict=True)),
    )
    return list(table.to_dict(orient="records"))


def pick_features(rows: Iterable[dict[str, Any]], factors: np.ndarray) -> Iterator[QgsFeature]:
    """Yield a point for each pick, where the target has it; heights in metres as a field too."""
    for row in rows:
        yield _feature(_point(_target(row), factors), row)


def vector_features(
    rows: Iterable[dict[str, Any]], factors: np.ndarray, exaggeration: float
) -> Iterator[QgsFeature]:
    """Yield a line for each pick, from where the fit puts the source to the target, lengthened."""
    for row in rows:
        target = _target(row)
        residual = np.array([row["dx_m"], row["dy_m"], row["dz_m"]], float)
        ends = [target - exaggeration * residual, target]
        yield _feature(QgsLineString([_point(end, factors) for end in ends]), row)


def footprint_feature(points: np.ndarray, grid: PlanGrid, factors: np.ndarray) -> QgsFeature:
    """Outline the cells that hold points."""
    cells = np.unique(grid.cell_of(points))
    row, column = np.divmod(cells, grid.shape[1])
    west, north = grid.west + column * grid.size, grid.north - row * grid.size
    corners = np.column_stack(
        [
            west / factors[0],
            (north - grid.size) / factors[1],
            (west + grid.size) / factors[0],
            north / factors[1],
        ]
    )
    # QGIS's own geometry: shapely's belongs to another build of GEOS.
    boxes = [QgsGeometry.fromRect(QgsRectangle(*corner)) for corner in corners.tolist()]
    outline = QgsGeometry.unaryUnion(boxes)
    outline.convertToMultiType()
    feature = QgsFeature(footprint_fields())
    feature.setGeometry(outline)
    feature.setAttributes([len(points), float(len(cells) * grid.size**2)])
    return feature


def footprint_fields() -> QgsFields:
    """Fields of a footprint."""
    return field_list(("points", "whole"), ("area_m2", "real"))


def write_raster(
    path: Path | str, values: np.ndarray, grid: PlanGrid, crs: str, factors: np.ndarray, about: str
) -> None:
    """Write a grid of values as GeoTIFF, NaN where there is none.

    Parameters
    ----------
    path : path-like
    values : ndarray of shape `grid.shape`
    grid : PlanGrid
    crs : str
        WKT; empty for none.
    factors : ndarray of shape (3,)
        Metres per unit of the CRS.
    about : str
        What the values are, with their unit.
    """
    rows, columns = grid.shape
    options = ["COMPRESS=DEFLATE", "PREDICTOR=3", "TILED=YES"]
    file = gdal.GetDriverByName("GTiff").Create(
        str(path), columns, rows, 1, gdal.GDT_Float32, options=options
    )
    if file is None:
        message = f"{path} can't be written."
        raise OSError(message)
    east, north = grid.size / factors[0], grid.size / factors[1]
    west, top = grid.west / factors[0], grid.north / factors[1]
    file.SetGeoTransform((float(west), float(east), 0.0, float(top), 0.0, -float(north)))
    if crs:
        file.SetProjection(crs)
    band = file.GetRasterBand(1)
    band.SetNoDataValue(float("nan"))
    band.SetDescription(about)
    band.WriteArray(values.astype(np.float32))
    band.FlushCache()
    file.FlushCache()


def write_features(
    path: Path, name: str, features: Iterable[QgsFeature], kind: Any, crs: Any
) -> str:
    """Write features as a layer of a GeoPackage, beside its other layers; return its address."""
    kept = list(features)
    options = QgsVectorFileWriter.SaveVectorOptions()
    options.driverName, options.layerName = "GPKG", name
    actions = QgsVectorFileWriter.ActionOnExistingFile
    options.actionOnExistingFile = (
        actions.CreateOrOverwriteLayer if path.exists() else actions.CreateOrOverwriteFile
    )
    writer = QgsVectorFileWriter.create(
        str(path), kept[0].fields(), kind, crs, QgsCoordinateTransformContext(), options
    )
    if writer.hasError() != QgsVectorFileWriter.WriterError.NoError:
        message = f"{path}: {writer.errorMessage()}"
        raise OSError(message)
    writer.addFeatures(kept)
    del writer
    return f"{path}|layername={name}"


def crs_of(crs: Any) -> QgsCoordinateReferenceSystem:
    """Return QGIS's form of the horizontal part of a pyproj CRS; None gives an invalid one."""
    from trigpoint.crsparts import split_crs

    if crs is None:
        return QgsCoordinateReferenceSystem()
    return QgsCoordinateReferenceSystem.fromWkt(split_crs(crs)[0].to_wkt())


def heights_of(crs: Any) -> str:
    """Return the WKT of the vertical part of a pyproj CRS; empty where it has none."""
    from trigpoint.crsparts import split_crs

    vertical = None if crs is None else split_crs(crs)[1]
    return "" if vertical is None else str(vertical.to_wkt())


def style(layer: Any, kind: str, *, largest: float = 0.0, vertical: str = "") -> None:
    """Style a result by its kind: picks, residual_vectors, footprint, completeness or error.

    Parameters
    ----------
    layer : QgsMapLayer
    kind : str
    largest : float
        Where the colours of an error end.
    vertical : str
        WKT of the CRS of its heights; QGIS before 3.38 keeps none.
    """
    if vertical and hasattr(layer, "setVerticalCrs"):
        layer.setVerticalCrs(QgsCoordinateReferenceSystem.fromWkt(vertical))
    if kind == PICKS:
        categories = [
            QgsRendererCategory(role, QgsMarkerSymbol.createSimple(_marker(shape, colour)), role)
            for role, shape, colour in MARKERS
        ]
        layer.setRenderer(QgsCategorizedSymbolRenderer(SORT, categories))
        layer.setLabeling(QgsVectorLayerSimpleLabeling(_labels()))
        layer.setLabelsEnabled(True)
    elif kind == VECTORS:
        symbol = QgsLineSymbol.createSimple({"line_color": "#d62718", "line_width": "0.8"})
        layer.setRenderer(QgsSingleSymbolRenderer(symbol))
    elif kind == "footprint":
        symbol = QgsFillSymbol.createSimple(
            {"color": "0,0,0,0", "outline_color": INK, "outline_width": "0.4"}
        )
        layer.setRenderer(QgsSingleSymbolRenderer(symbol))
    elif isinstance(layer, QgsRasterLayer):
        if kind == "completeness":
            _colour(layer, RAMP[::-1], 100.0, "{:g} %")
        else:
            # The largest are drawn as what the colours end at.
            _colour(layer, RAMP, largest or 1.0, "{:g} m", beyond="≥ ")
    layer.triggerRepaint()


def _marker(shape: str, colour: str) -> dict[str, str]:
    cross = shape.startswith("cross")
    return {
        "name": shape,
        "size": "3",
        "color": colour,
        "outline_color": colour if cross else "#ffffff",
        "outline_width": "0.6" if cross else "0.4",
    }


def _labels() -> QgsPalLayerSettings:
    """Return labels that are read on light and on dark cells alike."""
    halo = QgsTextBufferSettings()
    halo.setEnabled(True)
    halo.setSize(0.8)
    halo.setColor(QColor("#ffffff"))
    written = QgsTextFormat()
    written.setSize(9)
    written.setColor(QColor(INK))
    written.setBuffer(halo)
    labels = QgsPalLayerSettings()
    labels.fieldName = "id"
    labels.dist = 1.5
    labels.setFormat(written)
    return labels


def _colour(
    layer: QgsRasterLayer, shades: tuple[str, ...], top: float, written: str, beyond: str = ""
) -> None:
    steps = [top * k / (len(shades) - 1) for k in range(len(shades))]
    ramp = QgsColorRampShader(0.0, top)
    ramp.setColorRampItemList(
        [
            QgsColorRampShader.ColorRampItem(step, QColor(shade), written.format(step))
            for step, shade in zip(steps, shades, strict=True)
        ]
    )
    legend = QgsColorRampLegendNodeSettings()
    legend.setMinimumLabel(written.format(0))
    legend.setMaximumLabel(beyond + written.format(top))
    ramp.setLegendSettings(legend)
    shader = QgsRasterShader()
    shader.setRasterShaderFunction(ramp)
    renderer = QgsSingleBandPseudoColorRenderer(layer.dataProvider(), 1, shader)
    renderer.setClassificationMin(0.0)
    renderer.setClassificationMax(top)
    layer.setRenderer(renderer)


def _feature(geometry: Any, row: dict[str, Any]) -> QgsFeature:
    feature = QgsFeature(pick_fields())
    feature.setGeometry(QgsGeometry(geometry))
    numbers = [row[name] for name in ("dx_m", "dy_m", "dz_m", "d_m", "target_z")]
    word = "yes" if row["used"] else "no"
    feature.setAttributes([str(row["id"]), str(row["role"]), word, *map(float, numbers)])
    return feature


def _target(row: dict[str, Any]) -> np.ndarray:
    return np.array([row["target_x"], row["target_y"], row["target_z"]], float)


def _point(xyz: np.ndarray, factors: np.ndarray) -> QgsPoint:
    return QgsPoint(*(xyz / factors).tolist())


POINTS, LINES, POLYGONS = (
    QgsWkbTypes.Type.PointZ,
    QgsWkbTypes.Type.LineStringZ,
    QgsWkbTypes.Type.MultiPolygon,
)
