"""What one view shows, without Qt: a cloud, its colours, markers, an overlay and a camera."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from trigpoint.cloud import PointCloud
from trigpoint.similarity import Similarity

Position = tuple[float, float, float]
Kind = Literal["control", "check", "off", "ghost", "next"]
ColourMode = Literal["rgb", "height", "intensity", "class", "distance"]
Face = Literal["front", "back", "left", "right", "top"]


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


@dataclass(frozen=True, slots=True)
class Camera:
    """Where a view is seen from, in absolute coordinates of its cloud's frame."""

    position: Position
    focal_point: Position
    up: Position
    view_angle: float = 30.0
    parallel: bool = False
    parallel_scale: float = 1.0

    def through(self, similarity: Similarity) -> Camera:
        """Return the camera that sees the carried cloud as this one sees the cloud itself."""
        raise NotImplementedError


@dataclass(frozen=True, slots=True)
class Legend:
    """How to read a view's colours: a ramp between two values, or named swatches."""

    title: str
    ramp: tuple[str, ...] = ()
    low: str = ""
    high: str = ""
    swatches: tuple[tuple[str, str], ...] = ()


class Scene:
    """What one view shows; drawn by any PyVista plotter, and kept when that one is replaced.

    Nothing renders here: whoever owns the plotter does, once for each action of the user.
    """

    def attach(self, plotter: Any, *, ratio: float = 1.0) -> None:
        """Draw everything with a plotter from now on; `ratio` is device pixels per pixel."""
        raise NotImplementedError

    def show(self, cloud: PointCloud | None) -> None:
        """Show a cloud in place of the one before, and look at all of it."""
        raise NotImplementedError

    @property
    def modes(self) -> tuple[ColourMode, ...]:
        """What the cloud can be coloured by."""
        raise NotImplementedError

    def colour_by(self, mode: ColourMode) -> None:
        """Colour the cloud."""
        raise NotImplementedError

    def legend(self) -> Legend | None:
        """Say how to read the colours."""
        raise NotImplementedError

    def set_distances(self, distances: NDArray[np.float64] | None) -> None:
        """Give each shown point a distance in metres to be coloured by."""
        raise NotImplementedError

    def isolate(self, mask: NDArray[np.bool_] | None) -> None:
        """Show only some of the points; None shows all."""
        raise NotImplementedError

    def set_markers(self, markers: Sequence[Marker]) -> None:
        """Show these markers in place of those before."""
        raise NotImplementedError

    def pick_at(self, x: float, y: float, *, tolerance: float = 5.0) -> int | None:
        """Return the row of the point seen at a device pixel counted from the bottom left."""
        raise NotImplementedError
