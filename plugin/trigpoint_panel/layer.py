"""Layer: one cloud as VTK draws it, whole, and as a share of its points while the view moves."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from vtkmodules.util.numpy_support import numpy_to_vtk
from vtkmodules.vtkCommonCore import vtkPoints
from vtkmodules.vtkCommonDataModel import vtkCellArray, vtkPolyData
from vtkmodules.vtkCommonMath import vtkMatrix4x4
from vtkmodules.vtkRenderingCore import vtkActor, vtkPolyDataMapper

from trigpoint.cloud import PointCloud
from trigpoint_panel.pace import STEPS

Local = NDArray[np.float32]
Colours = NDArray[np.uint8]

# A thinned cloud is drawn with points up to this much wider, so that its surfaces stay closed.
WIDEST = 2.0


class Layer:
    """Points and colours that any number of renderers draw.

    The points are dealt at random to parts, and the first few parts are a thinned cloud. All parts
    share one array of points and one of colours, which VTK uploads once.

    Parameters
    ----------
    local : ndarray of shape (n, 3)
        float32, about an origin near them.
    colours : ndarray of shape (n, 3)
    """

    def __init__(self, local: Local, colours: Colours) -> None:
        count = len(local)
        self._ends = [*(step for step in STEPS if step < count), count]
        # VTK reads these bytes as long as it draws them.
        self._local = np.ascontiguousarray(local)
        points = vtkPoints()
        points.SetData(_array(self._local))
        dealt = np.random.default_rng(0).permutation(np.arange(count, dtype=np.int32))
        # In the order of the file neighbours are drawn together, which is faster.
        self._parts = [_part(points, np.sort(rows)) for rows in np.split(dealt, self._ends[:-1])]
        self._most = count
        self._drawn: list[tuple[Any, float, list[Any]]] = []
        self._size, self._opacity, self._matrix = 2.0, 1.0, np.eye(4)
        self._visible = True
        self.recolour(colours)

    @property
    def drawn(self) -> int:
        """How many points are drawn."""
        return max((end for end in self._ends if end <= self._most), default=self._ends[0])

    @property
    def is_thinned(self) -> bool:
        """Whether fewer points are drawn than there are."""
        return self.drawn < self._ends[-1]

    def recolour(self, colours: Colours) -> None:
        """Give each point another colour."""
        # What VTK would make of three bytes, for each part anew.
        self._colours = np.full((len(colours), 4), 255, np.uint8)
        self._colours[:, :3] = colours
        shared = _array(self._colours)
        for part in self._parts:
            part.GetPointData().SetScalars(shared)

    def show_in(self, renderer: Any, *, wider: float = 1.0) -> None:
        """Let a renderer draw the layer, with points so much wider than elsewhere."""
        actors = []
        for part in self._parts:
            mapper = vtkPolyDataMapper()
            mapper.SetInputData(part)
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

    def draw_at_most(self, count: int | None) -> None:
        """Draw a share of the points, at most so many; None draws all."""
        self._most = self._ends[-1] if count is None else count
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
        shown = self._visible and self._opacity > 0
        size = self._size * min(WIDEST, (self._ends[-1] / self.drawn) ** 0.5)
        matrix = vtkMatrix4x4()
        matrix.DeepCopy(self._matrix.ravel().tolist())
        for _, wider, actors in self._drawn:
            for end, actor in zip(self._ends, actors, strict=True):
                actor.SetVisibility(shown and end <= self.drawn)
                actor.GetProperty().SetPointSize(size * wider)
                actor.GetProperty().SetOpacity(self._opacity)
                actor.SetUserMatrix(matrix)


def localised(cloud: PointCloud) -> tuple[Local, NDArray[np.float64]]:
    """Return a cloud's points about an origin in its middle, and that origin."""
    middle = np.floor(cloud.xyz.mean(axis=0))
    local = np.empty(cloud.xyz.shape, np.float32)
    for axis in range(3):
        # The difference in float64 first: at UTM coordinates float32 has steps of half a metre.
        local[:, axis] = cloud.xyz[:, axis] - middle[axis]
    return local, np.asarray(cloud.origin + middle, np.float64)


def _part(points: Any, rows: NDArray[np.int32]) -> Any:
    # One cell that holds all points: a cell each would take four times the memory.
    cell = vtkCellArray()
    cell.SetData(_array(np.array([0, len(rows)], np.int32), deep=1), _array(rows, deep=1))
    part = vtkPolyData()
    part.SetPoints(points)
    part.SetVerts(cell)
    return part


def _array(values: NDArray[Any], *, deep: int = 0) -> Any:
    return numpy_to_vtk(values, deep=deep)  # type: ignore[no-untyped-call]
