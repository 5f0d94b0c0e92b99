"""Lighting: edges in depth are drawn dark, and surfaces keep the colours of the legend."""

from __future__ import annotations

from typing import Any

from vtkmodules.vtkFiltersSources import vtkLineSource
from vtkmodules.vtkRenderingCore import vtkActor, vtkPolyDataMapper
from vtkmodules.vtkRenderingOpenGL2 import vtkEDLShading, vtkRenderStepsPass

# How much larger than the cloud VTK is to take the scene for.
SOFTER = 60.0


class EyeDome:
    """Eye-dome lighting for one of VTK's renderers.

    VTK darkens a pixel by how far its neighbours lie before it, as shares of the scene's size. So
    every surface that slopes away is darkened, open ground to less than half its colour, which no
    legend explains. The strength is fixed, but not the scene's size: two points far outside of
    the picture stretch it, until only steps in depth are dark.

    Parameters
    ----------
    renderer : vtkRenderer
    """

    def __init__(self, renderer: Any) -> None:
        self._renderer = renderer
        self._pass = vtkEDLShading()
        self._pass.SetDelegatePass(vtkRenderStepsPass())
        self._ends = vtkLineSource()
        mapper = vtkPolyDataMapper()
        mapper.SetInputConnection(self._ends.GetOutputPort())
        self._far = vtkActor()
        self._far.SetMapper(mapper)
        self._far.GetProperty().SetRepresentationToPoints()
        self._far.PickableOff()
        # The clipping planes stay at the cloud, and clip the two points.
        self._far.UseBoundsOff()
        self.measure(1.0)
        renderer.AddActor(self._far)

    def measure(self, extent: float) -> None:
        """Take note of the cloud's size from corner to corner."""
        half = SOFTER * extent / 2
        self._ends.SetPoint1(-half, 0, 0)
        self._ends.SetPoint2(half, 0, 0)

    def switch(self, on: bool) -> None:
        """Light the next pictures, or do not."""
        self._renderer.SetPass(self._pass if on else None)

    def release(self) -> None:
        """Leave the renderer, and free what VTK holds."""
        self._renderer.SetPass(None)
        self._renderer.RemoveActor(self._far)
        self._pass.ReleaseGraphicsResources(self._renderer.GetRenderWindow())
