"""Overlay: another cloud in a scene, carried through a similarity into its frame."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from trigpoint.cloud import PointCloud
from trigpoint.similarity import Similarity
from trigpoint_panel.colouring import coloured, modes_of
from trigpoint_panel.layer import Layer, localised


class Overlay:
    """What is laid over a scene's own cloud, and which of both is shown.

    Attributes
    ----------
    cloud : PointCloud or None
    layer : Layer or None
        The cloud, uploaded once; another similarity only moves it.
    similarity : Similarity or None
    opacity : float
        From 0 (not shown) to 1, while the scene's own cloud is shown too.
    shows_own, shows_other : bool
        Whether the scene's own cloud is shown, and this one.
    """

    def __init__(self) -> None:
        self.similarity: Similarity | None = None
        self.opacity = 1.0
        self.carry(None)

    def carry(self, cloud: PointCloud | None) -> None:
        """Take another cloud, or none; both are shown."""
        self.cloud = cloud
        self.layer: Layer | None = None
        self.shows_own = self.shows_other = True
        if cloud is not None:
            colours, _ = coloured(cloud, modes_of(cloud)[0], up=np.array([0.0, 0.0, 1.0]))
            self._local, self._origin = localised(cloud)
            self.layer = Layer(self._local, colours)

    def swap(self) -> str:
        """Show only the own cloud, then only this, then both again; say which: A, B, or A+B."""
        if self.cloud is not None:
            now = self.shows_own, self.shows_other
            order = {(True, True): (True, False), (True, False): (False, True)}
            self.shows_own, self.shows_other = order.get(now, (True, True))
        names = {(True, False): "A", (False, True): "B"}
        return names.get((self.shows_own, self.shows_other), "A+B")

    def place(self, origin: NDArray[np.float64]) -> None:
        """Carry the layer into the frame of a scene that counts about another origin."""
        if self.layer is None:
            return
        self.layer.set_matrix(self._matrix(origin))
        self.layer.set_opacity(self.opacity if self.shows_own else 1.0)
        self.layer.set_visible(self.shows_other)

    def columns(self, origin: NDArray[np.float64], most: int) -> NDArray[np.float32]:
        """Return by axes where about so many of the points that are seen lie, shape (3, m)."""
        if self.layer is None or not self.shows_other or (self.shows_own and not self.opacity):
            return np.empty((3, 0), np.float32)
        matrix = self._matrix(origin).astype(np.float32)
        some = self._local[:: -(-len(self._local) // most)]
        return np.asarray(matrix[:3, :3] @ some.T + matrix[:3, 3:], np.float32)

    def _matrix(self, origin: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return what carries the layer into a frame about another origin, shape (4, 4)."""
        similarity = self.similarity or Similarity(1.0, np.eye(3), np.zeros(3))
        matrix = np.eye(4)
        matrix[:3, :3] = similarity.scale * similarity.rotation
        # Between the two origins, so that nothing large is left for float32.
        matrix[:3, 3] = similarity(self._origin[None, :])[0] - origin
        return matrix
