"""What the comparison and ICP find, worked out by the engine as an audit would."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from trigpoint.alignment import Alignment
from trigpoint.cloud import PointCloud
from trigpoint.comparison import Comparison, measure
from trigpoint.errors import ProjectError
from trigpoint.nearest import nearest
from trigpoint.pipeline import try_icp
from trigpoint.preparation import Reference, Thinned, prepare, thin
from trigpoint.similarity import Similarity
from trigpoint.surface import Surface
from trigpoint.trial import Trial
from trigpoint_panel.fingerprints import content_of
from trigpoint_panel.jobs import Tick
from trigpoint_panel.projects import reference_crs
from trigpoint_panel.state import State
from trigpoint_reporting.elevations import limit_within


@dataclass(frozen=True, slots=True, eq=False)
class Findings:
    """A comparison, and what the points on the screen have to do with it.

    Attributes
    ----------
    comparison : Comparison
    source_m, target_m : ndarray of shape (n,) and (m,)
        Distance of each shown point to the other cloud; NaN where none was asked for, outside the
        region.
    source_zone, target_zone : ndarray of shape (n,) and (m,)
        Position of each shown point's zone in `comparison.zones.names`.
    """

    comparison: Comparison
    source_m: NDArray[np.float64]
    target_m: NDArray[np.float64]
    source_zone: NDArray[np.intp]
    target_zone: NDArray[np.intp]

    @property
    def limit_m(self) -> float:
        """Up to where distances are told apart: as in a report of the same thresholds."""
        return limit_within(self.comparison.within["threshold_m"].tolist())


class Bench:
    """Where clouds are measured; what was made ready stays as long as the same is asked again."""

    def __init__(self) -> None:
        # Each beside what it was made of: a thread that nobody waits for any more may store late.
        self._made: tuple[object, Reference] | None = None
        self._surface: tuple[Reference, Surface] | None = None

    def compare(
        self,
        tick: Tick,
        state: State,
        similarity: Similarity,
        shown_source: PointCloud,
        shown_target: PointCloud,
    ) -> Findings:
        """Measure accuracy and completeness, and give every shown point its distance.

        Raises
        ------
        TrigpointError
            If a cloud can't be used.
        CancelledError
            If the user gave up.
        """
        reference, thinned = self._ready(tick, state, similarity)
        tick(0.6, "Measuring accuracy and completeness")
        comparison = measure(thinned, reference, within=state.comparison.within_m)
        tick(0.8, "Colouring the views")
        origin = reference.cloud.origin
        carried = PointCloud(similarity(shown_source.coordinates) - origin, origin)
        source_m = reference.tree.query(carried.xyz)[0]
        if reference.region is not None:
            source_m[~reference.region.contains(carried)] = np.nan
        tick(0.9, "Colouring the views")
        local = shown_target.about(origin).xyz
        target_m = nearest(local, thinned.cloud.xyz)
        target_m[~np.isfinite(target_m)] = np.nan
        zones = reference.zones
        return Findings(
            comparison,
            source_m,
            target_m,
            zones.of(carried.xyz[:, 2] + origin[2]),
            zones.of(local[:, 2] + origin[2]),
        )

    def try_icp(self, tick: Tick, state: State, alignment: Alignment) -> Trial:
        """Put ICP on trial, as the audit does.

        Raises
        ------
        TrigpointError
            If a cloud can't be used, or the clouds do not overlap.
        CancelledError
            If the user gave up.
        """
        reference, thinned = self._ready(tick, state, alignment.similarity)
        tick(None, "Putting rigid ICP on trial")
        kept = self._surface
        if kept is None or kept[0] is not reference:
            kept = self._surface = reference, Surface(reference.cloud.coordinates)
        return try_icp(thinned, kept[1], alignment)

    def _ready(self, tick: Tick, state: State, similarity: Similarity) -> tuple[Reference, Thinned]:
        given, settings = state.project.reference, state.comparison
        source, target = state.source_path, state.target_path
        if source is None or target is None:
            message = "Two clouds are needed: open a source and a reference."
            raise ProjectError(message)
        region = None if given.region is None else content_of(given.region)
        asked = (given, settings.voxel_m, settings.zones, settings.margin_m, _age(target), region)
        made = self._made
        if made is None or made[0] != asked:
            tick(0.0, f"Reading {target.name}")
            reference = prepare(
                target,
                voxel=settings.voxel_m,
                zones=settings.zones,
                margin=settings.margin_m,
                region=given.region,
                crs=reference_crs(state.project),
            )
            made = self._made = asked, reference
        reference = made[1]
        tick(0.3, f"Reading {source.name}")
        return reference, thin(source, reference, similarity=similarity)


def _age(path: Path) -> tuple[int, ...]:
    about = path.stat()
    return about.st_mtime_ns, about.st_ctime_ns, about.st_size, about.st_ino
