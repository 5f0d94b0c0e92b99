"""Layer: one cloud as VTK draws it, whole, and as a share of its points while the view moves."""

from __future__ import annotations

from typing import Any

import numpy as np
import pyvista as pv
from numpy.typing import NDArray
from vtkmodules.vtkCommonMath import vtkMatrix4x4
from vtkmodules.vtkRenderingCore import vtkActor, vtkPolyDataMapper

Local = NDArray[np.float32]
Colours = NDArray[np.uint8]

# A thinned cloud is drawn with points up to this much wider, so that its surfaces stay closed.
WIDEST = 1.5


class Layer:
    """Points and colours that any number of renderers draw.

    Parameters
    ----------
    local : ndarray of shape (n, 3)
        float32, about an origin near them.
    colours : ndarray of shape (n, 3)
    coarse : int
        Points drawn while the view moves.
    """

    def __init__(self, local: Local, colours: Colours, coarse: int) -> None:
        count = len(local)
        rng = np.random.default_rng(0)
        few = rng.choice(count, coarse, replace=False) if count > 2 * coarse else None
        self._rows = [np.arange(0), np.sort(few)] if few is not None else [np.arange(0)]
        parts = [local] if few is None else [local, local[self._rows[1]]]
        self._data = [_polydata(part) for part in parts]
        self._wider = [1.0, min(WIDEST, (count / coarse) ** 0.5)]
        self._drawn: list[tuple[Any, float, list[Any]]] = []
        self._size, self._opacity, self._matrix = 2.0, 1.0, np.eye(4)
        self._moving, self._visible = False, True
        self.recolour(colours)

    @property
    def is_thinned(self) -> bool:
        """Whether fewer points are drawn while the view moves."""
        return len(self._data) > 1

    def recolour(self, colours: Colours) -> None:
        """Give each point another colour."""
        for data, rows in zip(self._data, self._rows, strict=True):
            data["colours"] = np.ascontiguousarray(colours[rows] if len(rows) else colours)
            data.set_active_scalars("colours")

    def show_in(self, renderer: Any, *, wider: float = 1.0) -> None:
        """Let a renderer draw the layer, with points so much wider than elsewhere."""
        actors = []
        for data in self._data:
            mapper = vtkPolyDataMapper()
            mapper.SetInputData(data)
            mapper.SetColorModeToDirectScalars()
            mapper.SetScalarModeToUsePointData()
            actor = vtkActor()
            actor.SetMapper(mapper)
            actor.GetProperty().LightingOff()
            renderer.AddActor(actor)
            actors.append(actor)
        self._drawn.append((renderer, wider, actors))
        self._apply()

    def leave(self, renderer: Any) -> None:
        """Let a renderer draw it no more."""
        for drawer, _, actors in self._drawn:
            if drawer is renderer:
                for actor in actors:
                    renderer.RemoveActor(actor)
                    actor.ReleaseGraphicsResources(renderer.GetRenderWindow())
        self._drawn = [entry for entry in self._drawn if entry[0] is not renderer]

    def set_moving(self, moving: bool) -> None:
        """Draw the share while the view moves, and everything when it rests."""
        self._moving = moving
        self._apply()

    def set_visible(self, visible: bool) -> None:
        """Show or hide the layer."""
        self._visible = visible
        self._apply()

    def set_size(self, pixels: float) -> None:
        """Set the width of a point in device pixels."""
        self._size = pixels
        self._apply()

    def set_opacity(self, opacity: float) -> None:
        """Set the opacity, 0 to 1."""
        self._opacity = opacity
        self._apply()

    def set_matrix(self, matrix: NDArray[np.float64]) -> None:
        """Carry the layer by a 4x4 matrix between the two local frames."""
        self._matrix = matrix
        self._apply()

    def _apply(self) -> None:
        chosen = int(self._moving and self.is_thinned)
        matrix = vtkMatrix4x4()
        matrix.DeepCopy(self._matrix.ravel().tolist())
        for _, wider, actors in self._drawn:
            for which, actor in enumerate(actors):
                actor.SetVisibility(self._visible and self._opacity > 0 and which == chosen)
                actor.GetProperty().SetPointSize(self._size * self._wider[which] * wider)
                actor.GetProperty().SetOpacity(self._opacity)
                actor.SetUserMatrix(matrix)


def _polydata(local: Local) -> Any:
    # One cell that holds all points: a cell each would take four times the memory.
    verts = np.concatenate([[len(local)], np.arange(len(local))])
    return pv.PolyData(local, verts=verts, deep=False)
