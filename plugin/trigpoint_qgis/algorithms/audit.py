"""Audit: a whole project, in the interpreter of the environment that holds all it needs."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from qgis.core import (
    QgsProcessingContext,
    QgsProcessingException,
    QgsProcessingOutputFile,
    QgsProcessingOutputFolder,
    QgsProcessingOutputNumber,
    QgsProcessingOutputString,
    QgsProcessingParameterBoolean,
    QgsProcessingParameterFile,
    QgsProcessingParameterFolderDestination,
)

from trigpoint_qgis import auditing, deps
from trigpoint_qgis import results as drawing
from trigpoint_qgis.algorithms.base import StoppedError, Styler, TrigpointAlgorithm


class Audit(TrigpointAlgorithm):
    """Run a project's whole audit, ending in a bundle with its report."""

    NAME = "audit"
    TITLE = "Audit: run a project and write its report"
    HELP = (
        "Runs everything a project.toml names and writes a bundle: results, tables, clouds, and "
        "the report as HTML and PDF. It runs beside QGIS, in the Python environment that holds "
        "trigpoint's packages.\n\n"
        "Verdict: PASS, CONDITIONAL or FAIL by the project's own limits, NOT TESTED without.\n\n"
        "The panel writes a project.toml of what is open in it, and `trigpoint new` of a folder of "
        "clouds."
    )

    def canExecute(self) -> tuple[bool, str]:
        """Say whether the environment holds what a report needs, and what it does not."""
        message = deps.explain(deps.lacking(deps.REPORT, deps.attached()))
        return not message, message

    def initAlgorithm(self, _configuration: Any = None) -> None:
        """Declare what goes in and what comes out."""
        self.addParameter(
            QgsProcessingParameterFile(
                "PROJECT", self.tr("Project (project.toml)"), fileFilter="Project (*.toml)"
            )
        )
        self.addParameter(
            QgsProcessingParameterFolderDestination("FOLDER", self.tr("Folder of the bundle"))
        )
        self.addParameter(
            QgsProcessingParameterBoolean(
                "MAP", self.tr("Draw picks, completeness and error as layers"), True
            )
        )
        for name, title in (
            ("BUNDLE", "Bundle"),
            ("ZIP", "Bundle as a zip"),
            ("REPORT", "Report (HTML)"),
        ):
            self.addOutput(QgsProcessingOutputFile(name, self.tr(title)))
        self.addOutput(QgsProcessingOutputFolder("MAP_FOLDER", self.tr("Folder of the layers")))
        self.addOutput(QgsProcessingOutputString("VERDICT", self.tr("Verdict")))
        self.addOutput(QgsProcessingOutputNumber("WARNINGS", self.tr("Warnings")))

    def work(
        self, parameters: dict[str, Any], context: QgsProcessingContext, feedback: Any
    ) -> dict[str, Any]:
        """Start the audit, tell its steps, and read what it found."""

        def poll() -> None:
            if feedback.isCanceled():
                raise StoppedError

        try:
            audit = auditing.run_audit(
                Path(self.parameterAsFile(parameters, "PROJECT", context)),
                Path(self.parameterAsString(parameters, "FOLDER", context)),
                say=feedback.pushInfo,
                poll=poll,
            )
        except auditing.AuditError as error:
            raise QgsProcessingException(str(error)) from error
        results = audit["results"]
        for warning in results["warnings"]:
            feedback.pushWarning(warning["message"])
        report = Path(audit["path"]) / "report.html"
        told = {}
        if self.parameterAsBool(parameters, "MAP", context):
            drawn = drawing.draw(Path(audit["path"]), poll=poll)
            told["MAP_FOLDER"] = str(drawing.map_folder(Path(audit["path"])))
            for each in drawn:
                details = QgsProcessingContext.LayerDetails(each.title, context.project())
                how = {"largest": each.largest, "vertical": each.vertical}
                # As the panel shows them: of the first reconstruction, and one raster.
                seen = each.of == drawn[0].of and each.kind != "completeness"
                details.setPostProcessor(Styler(each.kind, how, self.pile, seen=seen))
                if hasattr(details, "groupName"):  # QGIS 3.32 and later
                    details.groupName = each.of
                context.addLayerToLoadOnCompletion(each.address, details)
        return told | {
            "FOLDER": str(Path(audit["path"]).parent),
            "BUNDLE": audit["path"],
            "ZIP": audit["zip"],
            "REPORT": str(report) if report.is_file() else "",
            "VERDICT": results["verdict"],
            "WARNINGS": len(results["warnings"]),
        }
