"""Accuracy and completeness of a reconstruction against a reference, zone by zone."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd
import pyproj
from numpy.typing import NDArray

from trigpoint.cautions import Caution
from trigpoint.cloud import PointCloud
from trigpoint.errors import RegionError
from trigpoint.files import PathLike
from trigpoint.nearest import nearest
from trigpoint.preparation import (
    ALL,
    MARGIN_M,
    RAW_LIMIT,
    SEED,
    VOXEL_M,
    Cloud,
    Reference,
    Thinned,
    prepare,
    thin,
)
from trigpoint.similarity import Points, Similarity
from trigpoint.threads import worked
from trigpoint.voxels import Lattice
from trigpoint.zones import FRACTIONS, HeightZones, Outline

WITHIN_M = (0.05, 0.10, 0.20)
# NMAD times this is the standard deviation of normal errors.
NMAD = 1.4826

STATISTICS = ("n", "mean_m", "median_m", "rmse_m", "nmad_m", "p95_m", "max_m")
SHARES = ("direction", "zone", "threshold_m", "pct", "low_pct", "high_pct", "raw_pct")

Distances = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class Comparison:
    """How near a reconstruction is to the reference, and the reference to it.

    A statistic over no points, or of distances to a cloud of no points, is NaN, and its share
    within any threshold 0 %.

    Attributes
    ----------
    accuracy : DataFrame
        Distances from the reconstruction's points to the reference's; a row for ``all`` and one
        for every zone. Columns n, mean_m, median_m, rmse_m, nmad_m, p95_m, max_m, floor_rmse_m.
    completeness : DataFrame
        The same from the reference's points to the reconstruction's.
    within : DataFrame
        Columns direction (accuracy or completeness), zone, threshold_m; pct, the share of
        distances ``<=`` the threshold; low_pct and high_pct, its interval, NaN until one is
        worked out; raw_pct, the share before thinning, NaN where it was not measured.
    accuracy_m, completeness_m : ndarray of shape (n,) and (m,)
        The distances, one for each point of `reconstruction` and of `reference`.
    reconstruction, reference : PointCloud
        The thinned points between which they were measured.
    counts : dict of str to int
        Points kept and lost at every step.
    zones : HeightZones
    voxel_m : float
        Edge of the cells that both were thinned to; 0 where neither was.
    cautions : tuple of Caution
    """

    accuracy: pd.DataFrame
    completeness: pd.DataFrame
    within: pd.DataFrame
    accuracy_m: Distances
    completeness_m: Distances
    reconstruction: PointCloud
    reference: PointCloud
    counts: Mapping[str, int]
    zones: HeightZones
    voxel_m: float
    cautions: tuple[Caution, ...]


def compare(
    source: Cloud,
    target: Cloud,
    *,
    voxel: float = VOXEL_M,
    within: Sequence[float] = WITHIN_M,
    zones: Sequence[float] = FRACTIONS,
    margin: float | None = MARGIN_M,
    region: PathLike | Outline | None = None,
    similarity: Similarity | None = None,
    crs: str | pyproj.CRS | None = None,
    seed: int = SEED,
) -> Comparison:
    """Measure a reconstruction against a reference, both ways.

    Parameters
    ----------
    source : PointCloud or path-like
        The reconstruction.
    target : PointCloud or path-like
        The reference.
    voxel : float
        Edge of the cells that both clouds are thinned to, in metres; 0 thins neither.
    within : sequence of float
        Thresholds in metres.
    zones : sequence of float
        Fractions of the reference's height range at which it is cut.
    margin : float or None
        The reconstruction is cropped to the reference's extent padded by this, in metres. None
        keeps all of it.
    region : path-like or Outline, optional
        Polygons in plan to crop the reconstruction to instead.
    similarity : Similarity, optional
        Carries the reconstruction into the reference's frame; by default it is there already.
    crs : str or pyproj.CRS, optional
        Assigned to files in place of what they say.
    seed : int
        Of the two halves that measure the floor.

    Returns
    -------
    Comparison

    Raises
    ------
    CloudError, CrsError, RegionError
        If a cloud, its CRS, the region or a threshold can't be used.

    Examples
    --------
    >>> from trigpoint.cloud import cloud_from
    >>> wall = np.array([[x, 0.0, z] for x in range(8) for z in range(10)])
    >>> found = compare(cloud_from(wall[10:] + [0, 0.06, 0]), cloud_from(wall))
    >>> found.accuracy.loc["all", ["n", "rmse_m"]].round(3).tolist()
    [70.0, 0.06]
    >>> found.within[found.within.direction == "completeness"].pct.tolist()[:3]
    [0.0, 87.5, 87.5]
    """
    _refuse_thresholds(within)
    reference = prepare(
        target, voxel=voxel, zones=zones, margin=margin, region=region, crs=crs, seed=seed
    )
    reconstruction = thin(source, reference, similarity=similarity, crs=crs)
    return measure(reconstruction, reference, within=within)


def measure(
    reconstruction: Thinned, reference: Reference, *, within: Sequence[float] = WITHIN_M
) -> Comparison:
    """Measure a reconstruction that was made ready against its reference.

    Parameters
    ----------
    reconstruction : Thinned
        As `thin` made it, or moved since.
    reference : Reference
    within : sequence of float
        Thresholds in metres.
    """
    _refuse_thresholds(within)
    source, target = reconstruction.cloud.xyz, reference.cloud.xyz
    # The second tree grows while the first is asked.
    asked: list[Callable[[], Distances]] = [
        lambda: reference.tree.query(source)[0],
        lambda: nearest(target, source),
    ]
    accuracy_m, completeness_m = worked(_answered, asked)
    accuracy = _by_zone(accuracy_m, source, reference)
    completeness = _by_zone(completeness_m, target, reference)
    raw_accuracy = raw_completeness = None
    if reference.lattice is None:  # what was measured is raw
        raw_accuracy, raw_completeness = accuracy, completeness
    elif reconstruction.raw is not None and reference.raw is not None:
        source, target = reconstruction.raw, reference.raw
        raw_accuracy = _by_zone(nearest(source, target), source, reference)
        raw_completeness = _by_zone(nearest(target, source), target, reference)
    shares = [
        *_shares("accuracy", accuracy, raw_accuracy, within),
        *_shares("completeness", completeness, raw_completeness, within),
    ]
    tables = worked(_statistics, (accuracy, completeness))
    accuracy_table, completeness_table = (
        table.assign(floor_rmse_m=reference.floor_rmse_m) for table in tables
    )
    return Comparison(
        accuracy=accuracy_table,
        completeness=completeness_table,
        within=pd.DataFrame(shares, columns=list(SHARES)),
        accuracy_m=accuracy_m,
        completeness_m=completeness_m,
        reconstruction=reconstruction.cloud,
        reference=reference.cloud,
        counts={
            "reference_points": reference.points,
            "reference_voxels": len(reference.cloud),
            "reconstruction_points": reconstruction.points,
            "reconstruction_outside_region": (
                reconstruction.points - reconstruction.points_in_region
            ),
            "reconstruction_in_region": reconstruction.points_in_region,
            "reconstruction_voxels": len(reconstruction.cloud),
        },
        zones=reference.zones,
        voxel_m=0.0 if reference.lattice is None else reference.lattice.voxel,
        cautions=(
            *reference.cautions,
            *reconstruction.cautions,
            *_thresholds_on_the_lattice(reference.lattice, within),
            *_empty_zones("reconstruction", accuracy),
            *_empty_zones("reference", completeness),
            *_unmeasured(raw_accuracy),
        ),
    )


def _answered(question: Callable[[], Distances]) -> Distances:
    return question()


def _by_zone(distances: Distances, points: Points, reference: Reference) -> dict[str, Distances]:
    zones = reference.zones
    own = zones.of(points[:, 2] + reference.cloud.origin[2])
    return {ALL: distances} | {name: distances[own == k] for k, name in enumerate(zones.names)}


def _statistics(by_zone: Mapping[str, Distances]) -> pd.DataFrame:
    rows = [_summary(distances) for distances in by_zone.values()]
    return pd.DataFrame(rows, columns=list(STATISTICS), index=pd.Index(by_zone, name="zone"))


def _summary(d: Distances) -> tuple[float, ...]:
    # To a cloud of no points every distance is infinite: it was not measured.
    if not len(d) or not math.isfinite(d[0]):
        return (len(d), *[math.nan] * (len(STATISTICS) - 1))
    median, p95 = np.percentile(d, [50, 95])
    nmad = NMAD * np.median(np.abs(d - median))
    return (len(d), d.mean(), median, np.sqrt((d**2).mean()), nmad, p95, d.max())


def _shares(
    direction: str,
    by_zone: Mapping[str, Distances],
    raw: Mapping[str, Distances] | None,
    within: Sequence[float],
) -> Iterator[tuple[str, str, float, float, float, float, float]]:
    for zone, distances in by_zone.items():
        for threshold in within:
            raw_pct = math.nan if raw is None else _pct(raw[zone], threshold)
            pct = _pct(distances, threshold)
            yield direction, zone, float(threshold), pct, math.nan, math.nan, raw_pct


def _pct(distances: Distances, threshold: float) -> float:
    return 100 * int(np.count_nonzero(distances <= threshold)) / max(len(distances), 1)


def _refuse_thresholds(within: Sequence[float]) -> None:
    bad = [threshold for threshold in within if not (math.isfinite(threshold) and threshold > 0)]
    if bad:
        message = f"The thresholds {', '.join(map(str, bad))} must be above zero, in metres."
        raise RegionError(message)
    if len(set(within)) < len(within):
        message = f"The thresholds {', '.join(map(str, within))} hold one twice; name each once."
        raise RegionError(message)


def _thresholds_on_the_lattice(
    lattice: Lattice | None, within: Sequence[float]
) -> Iterator[Caution]:
    low = [threshold for threshold in within if lattice is not None and threshold <= lattice.voxel]
    if lattice is not None and low:
        listed = ", ".join(f"{threshold:g}" for threshold in low)
        which = f"The threshold {listed} m is" if len(low) == 1 else f"Thresholds {listed} m are"
        message = (
            f"{which} not above the voxel of {lattice.voxel:g} m: the share within depends on "
            "where the lattice starts. Read the unthinned share (in the report's table; raw_pct in "
            "results.json), or take a smaller voxel."
        )
        yield Caution("threshold_below_voxel", message)


def _empty_zones(name: str, by_zone: Mapping[str, Distances]) -> Iterator[Caution]:
    empty = [zone for zone, distances in by_zone.items() if not len(distances)]
    if empty:
        where = "in any zone" if ALL in empty else f"in these zones: {', '.join(empty)}"
        message = (
            f"The {name} has no points {where}. Nothing is measured from there, and 0 % is within "
            "any threshold."
        )
        yield Caution("zone_empty", message)


def _unmeasured(raw: Mapping[str, Distances] | None) -> Iterator[Caution]:
    if raw is None:
        message = (
            f"A cloud has more than {RAW_LIMIT:,} points: shares before thinning were not measured."
        )
        yield Caution("raw_not_measured", message)
