"""trigpoint in QGIS: a dock to pick and review in, and four Processing algorithms."""

from __future__ import annotations

from typing import Any


def classFactory(iface: Any) -> Any:
    """Return the plugin; QGIS calls this. Nothing heavy is imported before it is used."""
    from trigpoint_qgis.plugin import TrigpointPlugin

    return TrigpointPlugin(iface)
