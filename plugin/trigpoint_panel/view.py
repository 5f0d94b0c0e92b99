"""CloudView: one cloud in a window, with its header, mouse and picks."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from qtpy import QtCore, QtGui, QtWidgets

from trigpoint.similarity import Similarity
from trigpoint_panel.canvas import CanvasKind
from trigpoint_panel.opening import Opened
from trigpoint_panel.scene import Camera, ColourMode, Face, Marker, Position
from trigpoint_panel.snapping import Mode

Side = Literal["source", "target"]


@dataclass(frozen=True, slots=True)
class Picked:
    """A pick in one view.

    Attributes
    ----------
    xyz : tuple of float
        Where it was snapped to: absolute, float64, in the cloud's frame.
    sigma : float
        One standard deviation along each axis, in the cloud's units.
    note : str
        How it was snapped and where the click was; empty where the point itself was taken.
    raw : tuple of float
        The clicked point of the cloud.
    """

    xyz: Position
    sigma: float
    note: str
    raw: Position


class CloudView(QtWidgets.QWidget):
    """One cloud, seen and picked in.

    Made of a header and a canvas; the canvas is made when the view is first shown, and whatever
    was set before is shown then. Everything else may be called at any time.

    Signals
    -------
    picked (Picked)
    hovered (tuple of float or None)
        The point under the mouse, a moment after it rests.
    refused (str)
        One sentence: why a click made no pick.
    camera_changed ()
    dropped (str)
        Path of a file dropped on the view.
    """

    picked = QtCore.Signal(object)
    hovered = QtCore.Signal(object)
    refused = QtCore.Signal(str)
    camera_changed = QtCore.Signal()
    dropped = QtCore.Signal(str)

    def __init__(
        self,
        side: Side,
        parent: QtWidgets.QWidget | None = None,
        *,
        canvas: CanvasKind = "auto",
    ) -> None:
        super().__init__(parent)
        self.side = side

    def set_cloud(self, opened: Opened | None) -> None:
        """Show a cloud; None empties the view."""

    def set_prompt(self, text: str) -> None:
        """Say in an empty view what to do, such as "Open a source cloud (Ctrl+O)"."""

    def set_markers(self, markers: Sequence[Marker]) -> None:
        """Show the picks and where to pick next, in place of the markers before."""

    def set_ghost(self, ghost: Marker | None) -> None:
        """Show where an open pair's other half is expected; it is drawn orange."""

    def set_overlay(self, opened: Opened | None, similarity: Similarity | None = None) -> None:
        """Show another cloud too, carried through `similarity` into this frame; None removes it."""

    def set_overlay_opacity(self, opacity: float) -> None:
        """Show the overlay from 0 (not at all) to 1 (fully)."""

    def swap(self) -> None:
        """Show only the cloud, then only the overlay, then the cloud again."""

    def set_distances(self, distances: NDArray[np.float64] | None) -> None:
        """Give each shown point its distance in metres, shape (n,), and colour by it."""

    def isolate(self, mask: NDArray[np.bool_] | None) -> None:
        """Show only some of the shown points, such as a zone; None shows all."""

    def colour_by(self, mode: ColourMode) -> None:
        """Colour the cloud."""

    def set_point_size(self, pixels: float) -> None:
        """Set the size of the points."""

    def set_eye_dome(self, on: bool) -> None:
        """Turn eye-dome lighting on or off."""

    def set_up(self, up: Position) -> None:
        """Say which way is up in this cloud's frame."""

    def set_picking(self, on: bool) -> None:
        """Let clicks pick; drags turn the view whether or not they do."""

    def set_snap(self, mode: Mode, radius: float) -> None:
        """Set what picks snap to, and how far around the click, in the cloud's units."""

    @property
    def camera(self) -> Camera:
        """Where the view is seen from."""
        raise NotImplementedError

    def set_camera(self, camera: Camera) -> None:
        """See the view from elsewhere; does not emit `camera_changed`."""

    def fit_view(self) -> None:
        """Look at the whole cloud."""

    def look(self, face: Face) -> None:
        """Look straight at the front, back, left, right or top."""

    def set_parallel(self, on: bool) -> None:
        """Switch between parallel and perspective projection."""

    def fly_to(self, xyz: Position) -> None:
        """Bring a place to the middle of the view, near enough to pick there."""

    def magnify(self, on: bool, at: Position | None = None) -> None:
        """Show a 4x inset: around the mouse, or around a place."""

    def screenshot(self) -> QtGui.QImage:
        """Return what the canvas shows."""
        raise NotImplementedError

    def shutdown(self) -> None:
        """Stop timers and free what VTK holds; may be called again."""


class Link(QtCore.QObject):
    """Ties the cameras of two views through a similarity; moving either moves the other."""

    def __init__(self, source: CloudView, target: CloudView) -> None:
        super().__init__(target)

    def follow(self, similarity: Similarity | None) -> None:
        """Tie the cameras through this similarity, the target's view first; None unties them."""


_ = Any
