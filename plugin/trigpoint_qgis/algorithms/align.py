"""Align: one similarity from picks, its residuals on the map."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from qgis.core import (
    QgsProcessingContext,
    QgsProcessingOutputNumber,
    QgsProcessingOutputString,
    QgsProcessingParameterBoolean,
    QgsProcessingParameterCrs,
    QgsProcessingParameterEnum,
    QgsProcessingParameterFeatureSink,
    QgsProcessingParameterFile,
    QgsProcessingParameterFileDestination,
    QgsProcessingParameterNumber,
)

from trigpoint_qgis import layers
from trigpoint_qgis.algorithms.base import (
    DOUBLE,
    INTEGER,
    TYPES,
    TrigpointAlgorithm,
    crs_text,
    warn,
)

METHODS = ("ransac", "exhaustive", "all")


class Align(TrigpointAlgorithm):
    """Fit one similarity to picked pairs and say what it is worth."""

    NAME = "align"
    TITLE = "Align: fit one similarity to picks"
    HELP = (
        "Fits one scale, rotation and translation to at least three pairs of points and says what "
        "they are worth: residuals, leave-one-out, reliability and geometry.\n\n"
        "Picks: a CSV with the columns id, source_x, source_y, source_z, target_x, target_y, "
        "target_z, and optionally role (control, check or off), sigma_source and sigma_target.\n\n"
        "Consensus: ransac draws sets of three picks, exhaustive tries every set; picks that do "
        "not agree with the best one are rejected. With all, none is. Check picks are never "
        "fitted.\n\n"
        "CRS: of the target's coordinates, a projected one. Without it the layers have none.\n\n"
        "A residual vector runs from where the fit puts a pick to where it was picked, drawn "
        "longer than it is; d_m in its table is its true length.\n\n"
        "The similarity (JSON) is what Apply needs."
    )

    def initAlgorithm(self, _configuration: Any = None) -> None:
        """Declare what goes in and what comes out."""
        self.addParameter(
            QgsProcessingParameterFile("PICKS", self.tr("Picks"), fileFilter="CSV (*.csv)")
        )
        self.addParameter(
            QgsProcessingParameterCrs("CRS", self.tr("CRS of the target"), optional=True)
        )
        self.addParameter(
            QgsProcessingParameterNumber(
                "THRESHOLD",
                self.tr("A pick agrees up to this residual (m)"),
                DOUBLE,
                0.50,
                minValue=0.0,
            )
        )
        self.addParameter(
            QgsProcessingParameterEnum(
                "METHOD",
                self.tr("Consensus (all: every control pick is fitted, none is rejected)"),
                METHODS,
                defaultValue="ransac",
                usesStaticStrings=True,
            )
        )
        self.number("TRIALS", "Sets of three picks drawn by ransac", INTEGER, 10_000, minValue=1)
        self.number("SEED", "Seed of the draws", INTEGER, 42, minValue=0)
        self.addParameter(
            QgsProcessingParameterBoolean("WEIGHTED", self.tr("Weight by the picks' sigmas"), False)
        )
        self.number(
            "EXAGGERATION",
            "Residual vectors are drawn so many times longer",
            DOUBLE,
            20.0,
            minValue=0.01,
        )
        self.addParameter(
            QgsProcessingParameterFileDestination(
                "SIMILARITY", self.tr("Similarity"), "JSON (*.json)"
            )
        )
        for name, title, kind in (
            ("POINTS", "Picks on the map", TYPES.TypeVectorPoint),
            ("VECTORS", "Residual vectors", TYPES.TypeVectorLine),
        ):
            self.addParameter(
                QgsProcessingParameterFeatureSink(
                    name, self.tr(title), kind, optional=True, createByDefault=True
                )
            )
        for name, title in (
            ("SCALE", "Scale"),
            ("RMSE", "RMSE of the picks that are fitted (m)"),
            ("LOOCV", "Leave-one-out RMSE (m)"),
            ("INLIERS", "Picks that are fitted"),
        ):
            self.addOutput(QgsProcessingOutputNumber(name, self.tr(title)))
        for name, title in (
            ("GEOMETRY", "Whether the picks pin the similarity down"),
            ("SUSPECTED", "Picks that do not fit the others"),
        ):
            self.addOutput(QgsProcessingOutputString(name, self.tr(title)))

    def work(
        self, parameters: dict[str, Any], context: QgsProcessingContext, feedback: Any
    ) -> dict[str, Any]:
        """Fit, write the similarity, and put the picks on the map."""
        from trigpoint.alignment import align
        from trigpoint.canonical import plain, to_json, write_text
        from trigpoint.crs import metre_factors, parse_crs
        from trigpoint.picks import read_picks
        from trigpoint.results import alignment_results

        stated = crs_text(self.parameterAsCrs(parameters, "CRS", context))
        crs = parse_crs(stated)
        alignment = align(
            read_picks(self.parameterAsFile(parameters, "PICKS", context), crs=crs),
            method=self.parameterAsEnumString(parameters, "METHOD", context),
            threshold=self.parameterAsDouble(parameters, "THRESHOLD", context),
            trials=self.parameterAsInt(parameters, "TRIALS", context),
            seed=self.parameterAsInt(parameters, "SEED", context),
            weighted=self.parameterAsBool(parameters, "WEIGHTED", context),
        )
        results = plain(alignment_results(alignment))
        path = self.parameterAsFileOutput(parameters, "SIMILARITY", context)
        write_text(Path(path), to_json({**results["alignment"], "crs": stated or None}))
        warn(feedback, alignment.cautions)
        feedback.pushInfo(results["reliability"]["statement"])

        factors, rows = metre_factors(crs), layers.pick_rows(alignment)
        exaggeration = self.parameterAsDouble(parameters, "EXAGGERATION", context)
        made = {
            "POINTS": (layers.POINTS, layers.pick_features(rows, factors)),
            "VECTORS": (layers.LINES, layers.vector_features(rows, factors, exaggeration)),
        }
        told: dict[str, Any] = {"SIMILARITY": path}
        for name, (kind, features) in made.items():
            sink, told[name] = self.parameterAsSink(
                parameters, name, context, layers.pick_fields(), kind, layers.crs_of(crs)
            )
            if sink is None:
                del told[name]
                continue
            sink.addFeatures(list(features))
            del sink
            style = layers.PICKS if name == "POINTS" else layers.VECTORS
            title = "Picks" if name == "POINTS" else f"Residuals x {exaggeration:g}"
            heights = layers.heights_of(crs)
            self.loaded(told[name], self.tr(title), style, context, vertical=heights)
        fit, worth = results["alignment"], results["reliability"]
        suspected = [pick["id"] for pick in worth["picks"] if pick["suspected"]]
        return told | {
            "SCALE": fit["scale"],
            "RMSE": fit["rmse_m"],
            "LOOCV": results["loocv"]["rmse_m"],
            "INLIERS": fit["n"],
            "GEOMETRY": worth["geometry"],
            "SUSPECTED": ", ".join(suspected),
        }
