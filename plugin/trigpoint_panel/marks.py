"""Numbered places in a view: a shape, a colour and a label each."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, NamedTuple

import matplotlib as mpl
import numpy as np
import pyvista as pv
from numpy.typing import NDArray
from vtkmodules.vtkRenderingCore import (
    vtkActor,
    vtkCoordinate,
    vtkPolyDataMapper,
    vtkRenderer,
    vtkTextActor,
)

from trigpoint_reporting.style import BLUE, GREEN, GREY, ORANGE, PURPLE

Position = tuple[float, float, float]
Kind = Literal["control", "check", "off", "ghost", "next"]


@dataclass(frozen=True, slots=True)
class Marker:
    """A numbered place in a view.

    Attributes
    ----------
    xyz : tuple of float
        Absolute, in the cloud's frame.
    label : str
        Shown beside it, whatever is in front.
    kind : str
        "control", "check", "off", "ghost" (where a pick is expected) or "next" (where to pick).
    selected : bool
    """

    xyz: Position
    label: str
    kind: Kind = "control"
    selected: bool = False


class Look(NamedTuple):
    """How a kind is drawn: never told by its colour alone."""

    colour: str
    ink: str
    is_round: bool
    is_hollow: bool


LOOKS: dict[Kind, Look] = {
    "control": Look(BLUE, "white", True, False),
    "check": Look(GREEN, "white", False, False),
    "off": Look(GREY, "white", True, True),
    "ghost": Look(ORANGE, "black", True, True),
    "next": Look(PURPLE, "black", False, True),
}
# Pixels: a mark, its rim, and the hole of a hollow one.
SIZE, RIM, HOLE = 11.0, 4.0, 5.0
CHOSEN = 1.45
LETTERS = 12
# Nearer by this much of the depth buffer: enough to stand out of a surface, and no more.
LIFT = -60_000.0
# What VTK brings along has no Greek, no Cyrillic and few signs.
FONT = Path(mpl.get_data_path()) / "fonts" / "ttf" / "DejaVuSans-Bold.ttf"


class Marks:
    """The markers of one renderer."""

    def __init__(self, renderer: Any, ratio: float) -> None:
        self._renderer = renderer
        # Labels have a layer of their own: eye-dome lighting would darken them.
        self._layer = vtkRenderer()
        self._layer.SetLayer(1)
        self._layer.InteractiveOff()
        self._layer.SetActiveCamera(renderer.GetActiveCamera())
        window = renderer.GetRenderWindow()
        window.SetNumberOfLayers(2)
        window.AddRenderer(self._layer)
        self._ratio = ratio
        self._actors: list[Any] = []
        self._labels: list[tuple[NDArray[np.float64], Any]] = []

    def draw(self, markers: Sequence[Marker], origin: NDArray[np.float64]) -> None:
        """Draw these markers in place of those before; coordinates are local about `origin`."""
        self.clear()
        parts: dict[tuple[Kind, bool], list[NDArray[np.float64]]] = {}
        for marker in markers:
            place = np.asarray(marker.xyz) - origin
            parts.setdefault((marker.kind, marker.selected), []).append(place)
            self._labels.append((place, self._label(marker, place)))
        for (kind, selected), places in parts.items():
            look = LOOKS[kind]
            size = SIZE * (CHOSEN if selected else 1.0)
            rings = [(size + RIM, "black" if selected else "white"), (size, look.colour)]
            if look.is_hollow:
                rings.append((HOLE * size / SIZE, "white"))
            for depth, (width, colour) in enumerate(rings):
                self._spots(np.array(places), width, colour, LIFT - 4000.0 * depth, look.is_round)

    def clear(self) -> None:
        """Remove all markers."""
        for actor in self._actors:
            self._renderer.RemoveActor(actor)
        for _, label in self._labels:
            self._layer.RemoveViewProp(label)
        self._actors, self._labels = [], []

    def close(self) -> None:
        """Remove all markers, and the layer of their labels."""
        self.clear()
        window = self._renderer.GetRenderWindow()
        if window is not None:
            window.RemoveRenderer(self._layer)

    def hide_behind(self, is_ahead: Callable[[NDArray[np.float64]], NDArray[np.bool_]]) -> None:
        """Hide the labels of places behind the camera, which would show mirrored."""
        if self._labels:
            ahead = is_ahead(np.array([place for place, _ in self._labels]))
            for (_, label), visible in zip(self._labels, ahead, strict=True):
                label.SetVisibility(bool(visible))

    def _spots(
        self, places: NDArray[np.float64], width: float, colour: str, lift: float, is_round: bool
    ) -> None:
        mapper = vtkPolyDataMapper()
        mapper.SetInputData(pv.PolyData(places.astype(np.float32)))
        mapper.SetResolveCoincidentTopologyToPolygonOffset()
        mapper.SetRelativeCoincidentTopologyPointOffsetParameter(lift)
        actor = vtkActor()
        actor.SetMapper(mapper)
        actor.PickableOff()
        look = actor.GetProperty()
        look.SetColor(*pv.Color(colour).float_rgb)
        look.LightingOff()
        look.SetPointSize(width * self._ratio)
        look.SetRenderPointsAsSpheres(is_round)
        self._renderer.AddActor(actor)
        self._actors.append(actor)

    def _label(self, marker: Marker, place: NDArray[np.float64]) -> Any:
        there = vtkCoordinate()
        there.SetCoordinateSystemToWorld()
        there.SetValue(*place)
        label = vtkTextActor()
        label.SetInput(f" {marker.label} ")
        label.PickableOff()
        at = label.GetPositionCoordinate()
        at.SetCoordinateSystemToViewport()
        at.SetReferenceCoordinate(there)
        away = (SIZE * (CHOSEN if marker.selected else 1.0) / 2 + RIM + 1) * self._ratio
        at.SetValue(away, away)
        look = LOOKS[marker.kind]
        text = label.GetTextProperty()
        if FONT.exists():
            text.SetFontFamily(4)  # VTK_FONT_FILE
            text.SetFontFile(str(FONT))
        text.SetFontSize(LETTERS + 1 if marker.selected else LETTERS)
        text.SetColor(*pv.Color("white" if marker.selected else look.ink).float_rgb)
        text.SetBackgroundColor(*pv.Color("black" if marker.selected else look.colour).float_rgb)
        text.SetBackgroundOpacity(0.9)
        self._layer.AddViewProp(label)
        return label
