"""Both views side by side, and what ties them to the model: markers, ghost, link, overlay."""

from __future__ import annotations

import math

import numpy as np
from qtpy.QtCore import Qt, Signal
from qtpy.QtWidgets import QSplitter, QWidget

from trigpoint.similarity import Similarity
from trigpoint_panel.camera import Face
from trigpoint_panel.canvas import CanvasKind
from trigpoint_panel.ghosts import Ghost
from trigpoint_panel.link import Link
from trigpoint_panel.marks import Marker
from trigpoint_panel.measuring import Findings
from trigpoint_panel.model import Model
from trigpoint_panel.opening import Opened
from trigpoint_panel.pairs import SIDES, Pair, Place, Side
from trigpoint_panel.snapping import Mode
from trigpoint_panel.view import CloudView

PROMPTS: dict[Side, str] = {
    "source": "Open a source cloud (Ctrl+O), or drop one here.\n\n"
    "To try it all on a made-up project:\nMenu (F10), Open the clock tower.",
    "target": "Open the reference (Ctrl+R), or drop it here.",
}


class TwoViews(QSplitter):
    """The source on the left, the target on the right.

    Attributes
    ----------
    hovered : Signal(str)
        Where the mouse rests, in words; empty: nowhere.
    clouds_changed : Signal()
        Another cloud is shown on one side, or none.
    """

    hovered = Signal(str)
    clouds_changed = Signal()

    def __init__(
        self, model: Model, parent: QWidget | None = None, *, canvas: CanvasKind = "auto"
    ) -> None:
        super().__init__(Qt.Orientation.Horizontal, parent)
        self._model = model
        self.source = CloudView("source", self, canvas=canvas)
        self.target = CloudView("target", self, canvas=canvas)
        self.opened: dict[Side, Opened | None] = {"source": None, "target": None}
        self._link = Link(self.source, self.target)
        self._is_linked = self._is_overlaid = self._magnifies = False
        self._shows_next = True
        self._similarity: Similarity | None = None
        self._snap: tuple[Mode, float | None] = ("point", None)
        self._under: dict[Side, Place | None] = {"source": None, "target": None}
        self.setChildrenCollapsible(False)
        for side in SIDES:
            view = self.view(side)
            self.addWidget(view)
            view.setMinimumSize(220, 160)
            view.set_prompt(PROMPTS[side])
            view.hovered.connect(lambda xyz, side=side: self._hover(side, xyz))
        self.setSizes([500, 500])

    def view(self, side: Side) -> CloudView:
        """Return one of the two."""
        return self.source if side == "source" else self.target

    def set_cloud(self, side: Side, opened: Opened | None) -> None:
        """Show a cloud on one side; None empties it."""
        self.opened[side] = opened
        self.view(side).set_cloud(opened)
        self.view(side).isolate(None)
        self._place_overlay()
        self._set_snap()
        self.refresh()
        self.clouds_changed.emit()

    def refresh(self) -> None:
        """Take over what the model holds now."""
        model = self._model
        similarity = model.similarity
        if not _same(similarity, self._similarity):
            self._similarity = similarity
            if similarity is not None:
                x, y, z = similarity.rotation[2].tolist()  # what the fit turns to the vertical
                self.source.set_up((x, y, z))
            self._link.follow(similarity if self._is_linked else None)
            self._place_overlay()
            self._set_snap()
        red = model.fit.table[model.fit.table["level"] == "red"]
        flags = dict(zip(red["id"], red["flag"], strict=True))
        for side in SIDES:
            markers = [
                Marker(
                    place,
                    pair.id,
                    pair.role,
                    selected=pair.id == model.state.selected,
                    flag=flags.get(pair.id, ""),
                )
                for pair in model.pairs
                if (place := pair.at(side)) is not None
            ]
            if side == "target" and self._shows_next and not model.state.is_second_operator:
                places = model.fit.next_picks[["x", "y", "z"]].to_numpy(np.float64).tolist()
                markers += [
                    Marker((x, y, z), f"next {k}", "next")
                    for k, (x, y, z) in enumerate(places, start=1)
                ]
            self.view(side).set_markers(markers)
        ghost = model.ghost()
        for side in SIDES:
            here = ghost is not None and ghost.side == side
            self.view(side).set_ghost(_ghost_marker(ghost) if ghost and here else None)

    def set_linked(self, on: bool) -> None:
        """Tie the cameras through the similarity."""
        self._is_linked = on
        self._link.follow(self._model.similarity if on else None)

    def set_overlaid(self, on: bool) -> None:
        """Show the source in the target's view as well."""
        self._is_overlaid = on
        self._place_overlay()

    def show_next(self, on: bool) -> None:
        """Show where to pick next."""
        self._shows_next = on
        self.refresh()

    def set_snap(self, mode: Mode, radius_m: float | None) -> None:
        """Set what clicks snap to, and how far around in metres; None: a few pixels."""
        self._snap = (mode, radius_m)
        self._set_snap()

    def set_picking(self, on: bool) -> None:
        """Let clicks pick."""
        for side in SIDES:
            self.view(side).set_picking(on)

    def set_findings(self, findings: Findings | None) -> None:
        """Colour both clouds by their distance to the other; None: no longer."""
        if findings is None:
            self.source.set_distances(None)
            self.target.set_distances(None)
        else:
            self.source.set_distances(findings.source_m, limit=findings.limit_m)
            self.target.set_distances(findings.target_m, limit=findings.limit_m)

    def isolate(self, findings: Findings, zone: str | None) -> None:
        """Show one zone alone in both views; None shows all."""
        names = findings.comparison.zones.names
        for view, own in (
            (self.source, findings.source_zone),
            (self.target, findings.target_zone),
        ):
            if zone is None:
                view.isolate(None, "")
            else:
                # As the table of the zones writes it.
                name = zone.capitalize().replace("_", " ")
                view.isolate(own == names.index(zone), f"zone {name}")

    def fly_to(self, pair: Pair) -> None:
        """Bring a pair to the middle of both views, where it is, or where it should be."""
        for side in SIDES:
            place = pair.at(side)
            if place is None:
                ghost = self._model.ghost(pair)
                place = None if ghost is None else ghost.xyz
            if place is not None:
                self.view(side).fly_to(place)

    def fly_to_target(self, place: Place) -> None:
        """Bring a place of the target, and what is around it, to the middle of both views."""
        self.target.show_place(place)
        similarity = self._model.similarity
        if similarity is not None:
            self.source.set_camera(self.target.camera.through(similarity.inverse()))

    def look(self, face: Face) -> None:
        """Look straight at both clouds."""
        for side in SIDES:
            self.view(side).look(face)

    def fit(self) -> None:
        """Look at the whole of both clouds."""
        for side in SIDES:
            self.view(side).fit_view()

    def set_parallel(self, on: bool) -> None:
        """Switch both between parallel and perspective projection."""
        for side in SIDES:
            self.view(side).set_parallel(on)

    def magnify(self, on: bool) -> None:
        """Show a magnifier at the mouse, and at the same place in the other view."""
        self._magnifies = on
        for side in SIDES:
            if not on:
                self.view(side).magnify(False)
                continue
            other: Side = "target" if side == "source" else "source"
            own, there = self._under[side], self._under[other]
            across = None if there is None else self._across(other, there)
            if own is not None or there is None:
                self.view(side).magnify(True)
            elif across is not None:
                self.view(side).magnify(True, across)

    def shutdown(self) -> None:
        """Free what the views hold; may be called again."""
        self._link.follow(None)
        for side in SIDES:
            self.view(side).shutdown()

    def _place_overlay(self) -> None:
        similarity, source = self._model.similarity, self.opened["source"]
        on = self._is_overlaid and similarity is not None and source is not None
        self.target.set_overlay(source if on else None, similarity if on else None)

    def _set_snap(self) -> None:
        mode, radius = self._snap
        self.target.set_snap(mode, radius)
        self.source.set_snap(mode, None if radius is None else radius / self._metres_per_unit())

    def _metres_per_unit(self) -> float:
        """Of the source: as fitted, else as the sizes of the clouds suggest."""
        if self._model.similarity is not None:
            return self._model.similarity.scale
        source, target = self.opened["source"], self.opened["target"]
        if source is None or target is None:
            return 1.0
        sizes = [float(np.linalg.norm(each.info.high - each.info.low)) for each in (source, target)]
        return sizes[1] / sizes[0] if sizes[0] > 0 and sizes[1] > 0 else 1.0

    def _across(self, side: Side, place: Place) -> Place | None:
        """Return where a place of one side lies on the other."""
        similarity = self._model.similarity
        if similarity is None:
            return None
        carried = similarity if side == "source" else similarity.inverse()
        x, y, z = carried(np.array([place]))[0].tolist()
        return x, y, z

    def _hover(self, side: Side, xyz: Place | None) -> None:
        self._under[side] = xyz
        if self._magnifies:
            self.magnify(True)
        opened = self.opened[side]
        if xyz is None or opened is None:
            self.hovered.emit("")
            return
        names = ("X", "Y", "Z") if side == "source" else ("E", "N", "H")
        said = "   ".join(f"{name} {value:.3f}" for name, value in zip(names, xyz, strict=True))
        self.hovered.emit(f"{said} {opened.unit}")


def _ghost_marker(ghost: Ghost) -> Marker:
    return Marker(ghost.xyz, ghost.label, "ghost")


def _same(one: Similarity | None, other: Similarity | None) -> bool:
    if one is None or other is None:
        return one is other
    return (
        math.isclose(one.scale, other.scale, rel_tol=1e-15)
        and bool((one.rotation == other.rotation).all())
        and bool((one.translation == other.translation).all())
    )
