"""The Processing provider: align, apply, compare and audit, in the toolbox and without a window."""

from __future__ import annotations

from pathlib import Path

from qgis.core import QgsProcessingProvider
from qgis.PyQt.QtGui import QIcon

from trigpoint_qgis import deps
from trigpoint_qgis.algorithms.align import Align
from trigpoint_qgis.algorithms.apply import Apply
from trigpoint_qgis.algorithms.audit import Audit
from trigpoint_qgis.algorithms.compare import Compare

ICON = Path(__file__).with_name("icon.svg")


class TrigpointProvider(QgsProcessingProvider):
    """Four algorithms, listed whether what they need is there or not."""

    def id(self) -> str:
        """Return the prefix of the algorithms' names."""
        return "trigpoint"

    def name(self) -> str:
        """Return the name in the toolbox."""
        return "Trigpoint"

    def icon(self) -> QIcon:
        """Return the icon in the toolbox."""
        return QIcon(str(ICON))

    def loadAlgorithms(self) -> None:
        """Add the algorithms."""
        for kind in (Align, Apply, Compare, Audit):
            self.addAlgorithm(kind())

    def warningMessage(self) -> str:
        """Say in the toolbox what is missing."""
        return deps.explain(deps.lacking(deps.ENGINE))
