"""Numbered places in a view: a shape, a colour and a label each."""

from __future__ import annotations

from collections.abc import Sequence
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

from trigpoint_panel.sight import Sight
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
# Where a label may stand, the best first: to the right or left, above or below, near or further.
CORNERS = ((1, 1), (1, -1), (-1, 1), (-1, -1), (1, 3), (-1, 3), (1, -3), (-1, -3))
# Nearer by this much of the depth buffer: enough to stand out of a surface, and no more.
LIFT = -60_000.0
# What VTK brings along has no Greek, no Cyrillic and few signs.
FONT = Path(mpl.get_data_path()) / "fonts" / "ttf" / "DejaVuSans-Bold.ttf"


class _Tag:
    """A label, and at which corner of its mark it stands."""

    def __init__(
        self,
        place: NDArray[np.float64],
        actor: Any,
        selected: bool,
        away: float,
        wide: float,
        tall: float,
    ) -> None:
        self.place, self.actor, self.selected = place, actor, selected
        self.corner = CORNERS[0]
        self._away, self._wide, self._tall = away, wide, tall

    def box(
        self, corner: tuple[int, int], pixel: NDArray[np.float64]
    ) -> tuple[float, float, float, float]:
        """Return left, bottom, right and top of the label at a corner, in the picture."""
        x, y = pixel[0] + self._away * corner[0], pixel[1] + self._away * corner[1]
        left = x if corner[0] > 0 else x - self._wide
        bottom = y if corner[1] > 0 else y - self._tall
        return left, bottom, left + self._wide, bottom + self._tall

    def put(self, corner: tuple[int, int]) -> None:
        """Stand at a corner."""
        self.corner = corner
        self.actor.GetPositionCoordinate().SetValue(self._away * corner[0], self._away * corner[1])
        text = self.actor.GetTextProperty()
        text.SetJustification(0 if corner[0] > 0 else 2)
        text.SetVerticalJustification(0 if corner[1] > 0 else 2)


def _meet(one: tuple[float, float, float, float], other: tuple[float, float, float, float]) -> bool:
    return one[0] < other[2] and other[0] < one[2] and one[1] < other[3] and other[1] < one[3]


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
        self._labels: list[_Tag] = []

    def draw(self, markers: Sequence[Marker], origin: NDArray[np.float64]) -> None:
        """Draw these markers in place of those before; coordinates are local about `origin`."""
        self.clear()
        parts: dict[tuple[Kind, bool], list[NDArray[np.float64]]] = {}
        for marker in markers:
            place = np.asarray(marker.xyz) - origin
            parts.setdefault((marker.kind, marker.selected), []).append(place)
            self._labels.append(self._label(marker, place))
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
        for tag in self._labels:
            self._layer.RemoveViewProp(tag.actor)
        self._actors, self._labels = [], []

    def close(self) -> None:
        """Remove all markers, and the layer of their labels."""
        self.clear()
        window = self._renderer.GetRenderWindow()
        if window is not None:
            window.RemoveRenderer(self._layer)

    def arrange(self, seen: Sight) -> None:
        """Put each label where it covers no other, and hide those of places behind the camera."""
        if not self._labels:
            return
        places = np.array([tag.place for tag in self._labels])
        ahead, there = seen.is_ahead(places), seen.project(places)
        taken: list[tuple[float, float, float, float]] = []
        # What is selected has the first choice.
        for k in sorted(range(len(places)), key=lambda k: not self._labels[k].selected):
            tag = self._labels[k]
            tag.actor.SetVisibility(bool(ahead[k]))
            if ahead[k]:
                # The corner it has is tried first, or labels would jump as the view turns.
                corners = sorted(CORNERS, key=lambda corner: corner != tag.corner)
                boxes = [tag.box(corner, there[k]) for corner in corners]
                free = (i for i, box in enumerate(boxes) if not any(_meet(box, b) for b in taken))
                best = next(free, 0)
                taken.append(boxes[best])
                tag.put(corners[best])

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

    def _label(self, marker: Marker, place: NDArray[np.float64]) -> _Tag:
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
        tall = 1.5 * LETTERS * self._ratio
        tag = _Tag(place, label, marker.selected, away, 0.55 * tall * (len(marker.label) + 2), tall)
        tag.put(CORNERS[0])
        return tag
