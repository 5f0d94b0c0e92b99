"""Apply: carries a cloud file into the frame."""

from __future__ import annotations

from typing import Any

from qgis.core import (
    QgsProcessingContext,
    QgsProcessingOutputNumber,
    QgsProcessingParameterBoolean,
    QgsProcessingParameterCrs,
    QgsProcessingParameterFile,
    QgsProcessingParameterFileDestination,
)

from trigpoint_qgis.algorithms.base import TrigpointAlgorithm, crs_text, sayer, warn


class Apply(TrigpointAlgorithm):
    """Carry a cloud through a similarity with everything it holds."""

    NAME = "apply"
    TITLE = "Apply: carry a cloud into the frame"
    HELP = (
        "Carries a LAS, LAZ, PLY, E57, PCD or XYZ cloud through the similarity that Align wrote. "
        "Every attribute is kept, normals are turned, faces are carried.\n\n"
        "The end of the output's name says its format: .laz, .las, .ply, .xyz, .csv or .txt."
    )

    def initAlgorithm(self, _configuration: Any = None) -> None:
        """Declare what goes in and what comes out."""
        self.addParameter(
            QgsProcessingParameterFile(
                "SIMILARITY", self.tr("Similarity that Align wrote"), fileFilter="JSON (*.json)"
            )
        )
        self.addParameter(
            QgsProcessingParameterFile("INPUT", self.tr("Cloud (LAS, LAZ, PLY, E57, PCD or XYZ)"))
        )
        self.addParameter(
            QgsProcessingParameterBoolean(
                "INVERSE", self.tr("Carry it back, from the frame into its own units"), False
            )
        )
        self.addParameter(
            QgsProcessingParameterCrs(
                "CRS", self.tr("CRS of the frame, in place of the similarity's"), optional=True
            )
        )
        self.addParameter(
            QgsProcessingParameterFileDestination(
                "OUTPUT", self.tr("Carried cloud"), "LAZ (*.laz);;LAS (*.las);;PLY (*.ply)"
            )
        )
        self.addOutput(QgsProcessingOutputNumber("COUNT", self.tr("Points")))

    def work(
        self, parameters: dict[str, Any], context: QgsProcessingContext, feedback: Any
    ) -> dict[str, Any]:
        """Read the similarity and carry the file."""
        from trigpoint.files import carry
        from trigpoint.results import read_similarity

        fit, stated = read_similarity(self.parameterAsFile(parameters, "SIMILARITY", context))
        inverse = self.parameterAsBool(parameters, "INVERSE", context)
        source = self.parameterAsFile(parameters, "INPUT", context)
        target = self.parameterAsFileOutput(parameters, "OUTPUT", context)
        crs = crs_text(self.parameterAsCrs(parameters, "CRS", context))
        sayer(feedback)(f"carrying {source} to {target}")
        points, cautions = carry(
            source,
            target,
            fit.inverse() if inverse else fit,
            crs=crs or (None if inverse else stated),
        )
        warn(feedback, cautions)
        return {"OUTPUT": target, "COUNT": int(points)}
