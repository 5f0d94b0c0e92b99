"""Compare: accuracy and completeness of one georeferenced cloud, with maps of both."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from qgis.core import (
    QgsFeature,
    QgsFeatureSink,
    QgsProcessingContext,
    QgsProcessingException,
    QgsProcessingOutputNumber,
    QgsProcessingParameterBoolean,
    QgsProcessingParameterCrs,
    QgsProcessingParameterFeatureSink,
    QgsProcessingParameterFile,
    QgsProcessingParameterFileDestination,
    QgsProcessingParameterNumber,
    QgsProcessingParameterRasterDestination,
    QgsProcessingParameterString,
)

from trigpoint_qgis import layers, plan
from trigpoint_qgis.algorithms.base import (
    DOUBLE,
    TYPES,
    TrigpointAlgorithm,
    crs_text,
    sayer,
    warn,
)


class Compare(TrigpointAlgorithm):
    """Measure a reconstruction against a reference, and map where it is near and where it lacks."""

    NAME = "compare"
    TITLE = "Compare: accuracy and completeness"
    HELP = (
        "Measures distances between a georeferenced reconstruction and a reference cloud both "
        "ways, over all and by height zone, after thinning both on one lattice.\n\n"
        "Maps: completeness is the share of the reference's voxels in a cell that the "
        "reconstruction comes within the last threshold of; error is the RMSE of the "
        "reconstruction's voxels in a cell. Both count all heights above a cell."
    )

    def initAlgorithm(self, _configuration: Any = None) -> None:
        """Declare what goes in and what comes out."""
        self.addParameter(
            QgsProcessingParameterFile(
                "RECONSTRUCTION", self.tr("Reconstruction, in the frame of the reference")
            )
        )
        self.addParameter(QgsProcessingParameterFile("REFERENCE", self.tr("Reference (LiDAR)")))
        self.addParameter(
            QgsProcessingParameterCrs(
                "CRS", self.tr("CRS of both, in place of what the files say"), optional=True
            )
        )
        for name, title, default in (
            ("VOXEL", "Voxel (m; 0: no thinning)", 0.10),
            ("CELL", "Cell of the maps (m)", 0.50),
        ):
            self.addParameter(
                QgsProcessingParameterNumber(name, self.tr(title), DOUBLE, default, minValue=0.0)
            )
        for name, title, default in (
            ("WITHIN", "Completeness thresholds (m); the last one is mapped", "0.05, 0.10, 0.20"),
            ("ZONES", "Cuts of the height zones (shares of the reference's height)", "0.33, 0.66"),
        ):
            self.addParameter(QgsProcessingParameterString(name, self.tr(title), default))
        self.addParameter(
            QgsProcessingParameterNumber(
                "MARGIN",
                self.tr("Margin around the reference that counts (m); empty: no crop"),
                DOUBLE,
                1.0,
                optional=True,
                minValue=0.0,
            )
        )
        self.addParameter(
            QgsProcessingParameterBoolean(
                "ICP", self.tr("Refine the pose by rigid ICP first"), False
            )
        )
        self.addParameter(
            QgsProcessingParameterFileDestination("RESULTS", self.tr("Results"), "JSON (*.json)")
        )
        for name, title in (("COMPLETENESS", "Completeness (%)"), ("ERROR", "Error (RMSE, m)")):
            self.addParameter(
                QgsProcessingParameterRasterDestination(
                    name, self.tr(title), optional=True, createByDefault=True
                )
            )
        self.addParameter(
            QgsProcessingParameterFeatureSink(
                "FOOTPRINT",
                self.tr("Footprint of the reconstruction"),
                TYPES.TypeVectorPolygon,
                optional=True,
                createByDefault=True,
            )
        )
        for name, title in (
            ("ACCURACY_RMSE", "Accuracy: RMSE from the reconstruction to the reference (m)"),
            (
                "COMPLETENESS_RMSE",
                "Completeness: RMSE from the reference to the reconstruction (m)",
            ),
            ("COMPLETENESS_PCT", "Share of the reference within the last threshold (%)"),
        ):
            self.addOutput(QgsProcessingOutputNumber(name, self.tr(title)))

    def work(
        self, parameters: dict[str, Any], context: QgsProcessingContext, feedback: Any
    ) -> dict[str, Any]:
        """Read, thin, measure, and map."""
        from trigpoint.canonical import plain, to_json, write_text
        from trigpoint.comparison import measure
        from trigpoint.pipeline import try_icp
        from trigpoint.preparation import prepare, thin
        from trigpoint.results import comparison_results, trial_results, warning_results
        from trigpoint.surface import Surface

        say = sayer(feedback)
        crs = crs_text(self.parameterAsCrs(parameters, "CRS", context)) or None
        within = self.numbers_of(self.parameterAsString(parameters, "WITHIN", context), "WITHIN")
        zones = self.numbers_of(self.parameterAsString(parameters, "ZONES", context), "ZONES")
        if not within:
            message = "WITHIN is empty; it must be numbers separated by commas."
            raise QgsProcessingException(message)
        given = parameters.get("MARGIN")
        margin = (
            None if given in (None, "") else self.parameterAsDouble(parameters, "MARGIN", context)
        )
        say("reading the reference")
        reference = prepare(
            self.parameterAsFile(parameters, "REFERENCE", context),
            crs=crs,
            voxel=self.parameterAsDouble(parameters, "VOXEL", context),
            zones=zones,
            margin=margin,
        )
        feedback.setProgress(25)
        say("reading the reconstruction")
        source = thin(
            self.parameterAsFile(parameters, "RECONSTRUCTION", context), reference, crs=crs
        )
        feedback.setProgress(50)
        trial = None
        if self.parameterAsBool(parameters, "ICP", context):
            say("refining by ICP")
            trial = try_icp(source, Surface(reference.cloud.coordinates))
            source = source.moved(trial.refinement.similarity)
        say("measuring accuracy and completeness")
        comparison = measure(source, reference, within=within)
        feedback.setProgress(80)
        cautions = (*comparison.cautions, *(trial.cautions if trial else ()))
        results = plain(
            comparison_results(comparison)
            | {"icp": trial_results(trial), "warnings": warning_results(cautions)}
        )
        path = self.parameterAsFileOutput(parameters, "RESULTS", context)
        write_text(Path(path), to_json(results))
        warn(feedback, cautions)
        say("drawing the maps")
        maps = self._maps(parameters, context, comparison, within[-1])
        overall = results["completeness"]["all"]
        return {
            "RESULTS": path,
            **maps,
            "ACCURACY_RMSE": results["accuracy"]["all"]["rmse_m"],
            "COMPLETENESS_RMSE": overall["rmse_m"],
            "COMPLETENESS_PCT": overall["within"][-1]["pct"],
        }

    def _maps(
        self,
        parameters: dict[str, Any],
        context: QgsProcessingContext,
        comparison: Any,
        within: float,
    ) -> dict[str, Any]:
        from trigpoint.crs import metre_factors

        crs = comparison.reference.crs
        factors = metre_factors(crs)
        both = [comparison.reconstruction.coordinates, comparison.reference.coordinates]
        size = self.parameterAsDouble(parameters, "CELL", context)
        grid = plan.grid_over(np.concatenate(both), size)
        error = plan.rmse_m(both[0], comparison.accuracy_m, grid)
        top = plan.most(error)
        told: dict[str, Any] = {}
        for name, kind, title, values, largest in (
            (
                "COMPLETENESS",
                "completeness",
                f"Completeness within {within:g} m (%)",
                plan.completeness_pct(both[1], comparison.completeness_m, grid, within),
                100.0,
            ),
            ("ERROR", "error", "Error (RMSE, m)", error, top),
        ):
            path = self.parameterAsOutputLayer(parameters, name, context)
            if not path:
                continue
            wkt = layers.crs_of(crs).toWkt()
            layers.write_raster(path, values, grid, wkt, factors, title)
            self.loaded(path, self.tr(title), kind, context, largest=largest)
            told[name] = path
        if len(both[0]):
            feature = layers.footprint_feature(both[0], grid, factors)
            told |= self._footprint(parameters, context, feature, crs)
        return told

    def _footprint(
        self,
        parameters: dict[str, Any],
        context: QgsProcessingContext,
        feature: QgsFeature,
        crs: Any,
    ) -> dict[str, Any]:
        sink, identity = self.parameterAsSink(
            parameters,
            "FOOTPRINT",
            context,
            layers.footprint_fields(),
            layers.POLYGONS,
            layers.crs_of(crs),
        )
        if sink is None:
            return {}
        sink.addFeature(feature, QgsFeatureSink.Flag.FastInsert)
        del sink
        self.loaded(identity, self.tr("Footprint"), "footprint", context)
        return {"FOOTPRINT": identity}
