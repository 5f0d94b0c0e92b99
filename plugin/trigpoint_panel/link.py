"""Link: what ties the cameras of two views through a similarity."""

from __future__ import annotations

from qtpy import QtCore

from trigpoint.similarity import Similarity
from trigpoint_panel.view import CloudView


class Link(QtCore.QObject):
    """Ties the cameras of two views through a similarity; moving either moves the other."""

    def __init__(self, source: CloudView, target: CloudView) -> None:
        super().__init__(target)
        self._source, self._target = source, target
        self._similarity: Similarity | None = None
        source.camera_changed.connect(self._lead_target)
        target.camera_changed.connect(self._lead_source)

    @property
    def is_tied(self) -> bool:
        """Whether the cameras are tied."""
        return self._similarity is not None

    def follow(self, similarity: Similarity | None) -> None:
        """Tie the cameras through this similarity; None unties them.

        The source's camera goes where the target's is, since there up is known.
        """
        self._similarity = similarity
        self._lead_source()

    def _lead_target(self) -> None:
        if self._similarity is not None:
            self._target.set_camera(self._source.camera.through(self._similarity))

    def _lead_source(self) -> None:
        if self._similarity is not None:
            self._source.set_camera(self._target.camera.through(self._similarity.inverse()))
