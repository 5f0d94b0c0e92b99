"""Where the panel keeps what the user gave no place: unsaved changes, and the clock tower."""

from __future__ import annotations

import tempfile
from pathlib import Path

from qtpy.QtCore import QStandardPaths


def scratch_folder() -> Path:
    """Return where changes that have no file yet are autosaved."""
    place = QStandardPaths.writableLocation(QStandardPaths.StandardLocation.GenericDataLocation)
    return Path(place or tempfile.gettempdir()) / "trigpoint" / "unsaved"


def demo_folder() -> Path:
    """Return where the clock tower is kept."""
    return scratch_folder().parent / "demo"
