"""Report templates, style sheets and fonts: data only, behind this one door.

The fonts are IBM Plex Sans and IBM Plex Mono, (c) 2017 IBM Corp., under the SIL Open Font License
1.1, unmodified; the licence lies beside them.
"""

from __future__ import annotations

from pathlib import Path

FOLDER = Path(__file__).parent
NOTEBOOK_TEMPLATE = FOLDER / "trigpoint"
FONTS = FOLDER / "fonts"
PRINT_CSS = FOLDER / "print.css"
