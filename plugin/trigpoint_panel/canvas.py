"""What a scene is drawn on: an OpenGL widget, or a painted image where those cannot run."""

from __future__ import annotations

from typing import Any, Literal

CanvasKind = Literal["auto", "gl", "image"]


def make_canvas(parent: Any, kind: CanvasKind = "auto") -> Any:
    """Make the canvas that runs here."""
    raise NotImplementedError
