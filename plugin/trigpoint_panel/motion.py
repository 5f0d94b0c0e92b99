"""Motion: what a scene draws of its layers while the view moves."""

from __future__ import annotations

from collections.abc import Callable
from time import perf_counter
from typing import Any

from trigpoint_panel.layer import Layer
from trigpoint_panel.lighting import EyeDome
from trigpoint_panel.pace import Pace


class Motion:
    """Draws what there is time for while a view moves, and everything when it rests.

    Parameters
    ----------
    layers : callable
        Returns the layers that are drawn now.
    first : int
        Points of a layer drawn while the view first moves; then the pictures' times tell.

    Attributes
    ----------
    eye_dome : bool
        Whether edges in depth are darkened.
    pace : Pace
    """

    def __init__(self, layers: Callable[[], list[Layer]], first: int) -> None:
        self.eye_dome = True
        self.pace = Pace(first)
        self._layers = layers
        self._moving = False
        self._begun = 0.0
        self._renderer: Any = None
        self._lighting: EyeDome | None = None
        self._extent = 1.0
        self._observers: list[int] = []

    def attach(self, renderer: Any) -> None:
        """Light one of VTK's renderers from now on, and time the pictures of its window."""
        self._renderer, self._lighting = renderer, EyeDome(renderer)
        self._lighting.measure(self._extent)
        window = renderer.GetRenderWindow()
        self._observers = [
            window.AddObserver("StartEvent", self._begin),
            window.AddObserver("EndEvent", self._end),
        ]
        self.apply()

    def detach(self) -> None:
        """Let go of the renderer."""
        window = self._renderer.GetRenderWindow()
        for observer in self._observers:
            window.RemoveObserver(observer)
        if self._lighting is not None:
            self._lighting.release()
        self._renderer = self._lighting = None

    def measure(self, extent: float) -> None:
        """Take note of the cloud's size from corner to corner."""
        self._extent = extent
        if self._lighting is not None:
            self._lighting.measure(extent)

    def set_moving(self, moving: bool) -> None:
        """Say that the view moves, or rests."""
        if moving != self._moving:
            self._moving = moving
            if not moving:
                self.pace.rested()
            self.apply()

    @property
    def is_thinned(self) -> bool:
        """Whether less is drawn than there is, since the view moves."""
        return self._is_unlit or any(layer.is_thinned for layer in self._layers())

    def apply(self) -> None:
        """Draw of each layer, and of the lighting, what is to be drawn now."""
        for layer in self._layers():
            layer.draw_at_most(self.pace.count if self._moving else None)
        if self._lighting is not None:
            self._lighting.switch(self.eye_dome and not self._is_unlit)

    @property
    def _is_unlit(self) -> bool:
        return self.eye_dome and self._moving and not self.pace.is_lit

    def _begin(self, *_: object) -> None:
        self._begun = perf_counter()

    def _end(self, window: Any, _: object) -> None:
        layers = self._layers()
        if self._moving and layers:
            # A graphics card may not even have begun.
            window.WaitForCompletion()
            took = perf_counter() - self._begun
            if self.pace.took(took, max(layer.drawn for layer in layers)):
                self.apply()
