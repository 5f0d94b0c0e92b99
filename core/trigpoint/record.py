"""An audit's findings, and the record of them that results.json holds."""

from __future__ import annotations

import platform
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass, field, fields, replace
from importlib import metadata
from itertools import combinations
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pyproj

import trigpoint
from trigpoint.alignment import Alignment
from trigpoint.canonical import plain
from trigpoint.cautions import Caution
from trigpoint.comparison import Comparison
from trigpoint.criteria import judge
from trigpoint.crosschecks import CrossCheck, camera_positions, scale_bar, up_direction
from trigpoint.crs import CrsReport
from trigpoint.delivery import sha256
from trigpoint.files import CloudInfo
from trigpoint.flawless import Flawless
from trigpoint.intervals import Intervals
from trigpoint.pairing import compare_pair
from trigpoint.placement import next_picks
from trigpoint.preparation import Reference, Thinned
from trigpoint.project import Project, ReconstructionInput, ScaleBar, UpDirection
from trigpoint.repeats import Frame, Repeats
from trigpoint.results import (
    alignment_results,
    comparison_results,
    interval_results,
    trial_results,
    warning_results,
)
from trigpoint.trial import Trial
from trigpoint.zones import outline_format

SCHEMA = "trigpoint-results/1"
PACKAGES = ("numpy", "scipy", "pandas", "laspy", "lazrs", "plyfile", "pykdtree", "shapely")
# The format of pick files, whichever of comma, semicolon and tab is between their cells.
PICKS = "CSV"
# Places on the reference that are judged as the next pick, and how far apart those listed lie, as
# a share of its diagonal.
CANDIDATES = 2_000
APART = 0.1


@dataclass(frozen=True, slots=True, eq=False)
class Judged:
    """One reconstruction and all that was found out about it.

    Attributes
    ----------
    given : ReconstructionInput
    info : CloudInfo
        Of its file.
    alignment : Alignment or None
        None where it came georeferenced.
    repeats : dict of str to Repeats
        What repeated picks showed, by frame; empty without.
    thinned : Thinned
        In the reference's frame, on the reference's lattice.
    delivered : Comparison
        As it is delivered: under the similarity alone.
    intervals : Intervals or None
        Of that comparison; None where the project does not ask for them.
    perfect : Flawless or None
        What a flawless reconstruction would score on these picks; None without picks.
    trial : Trial or None
        ICP as a hypothesis; None where the project does not ask for it.
    after_icp : Comparison or None
        The same comparison after that ICP, whether retained or not.
    intervals_after_icp : Intervals or None
        Of sampling alone: the pose is no longer the similarity's.
    """

    given: ReconstructionInput
    info: CloudInfo
    alignment: Alignment | None
    thinned: Thinned
    delivered: Comparison
    repeats: Mapping[Frame, Repeats] = field(default_factory=dict)
    intervals: Intervals | None = None
    perfect: Flawless | None = None
    trial: Trial | None = None
    after_icp: Comparison | None = None
    intervals_after_icp: Intervals | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Audit:
    """A whole audit.

    Attributes
    ----------
    project : Project
    reference : Reference
    reference_info : CloudInfo
    crs : CrsReport
        What the reference's CRS says, and fails to say, at the site.
    judged : tuple of Judged
        In the project's order.
    """

    project: Project
    reference: Reference
    reference_info: CloudInfo
    crs: CrsReport
    judged: tuple[Judged, ...]

    def results(self) -> dict[str, Any]:
        """Return the whole of results.json: plain values, canonically rounded.

        The same inputs, packages and machine give the same values: there is no time, user or path
        of the machine in it, and nothing that depends on threads.
        """
        return _results(self)


def _results(audit: Audit) -> dict[str, Any]:
    checks = {each.given.name: tuple(_cross_checks(audit.project, each)) for each in audit.judged}
    cautions = tuple(_cautions(audit, checks))
    reconstructions = {
        each.given.name: _reconstruction(each, audit, checks[each.given.name])
        for each in audit.judged
    }
    about = asdict(audit.project.about)
    reconstructions = plain(reconstructions)
    codes = [caution.code for caution in cautions]
    criteria, verdict = judge(audit.project.limits, reconstructions, codes)
    return plain(  # type: ignore[no-any-return]
        {
            "schema": SCHEMA,
            "project": {**about, "settings": _settings(audit.project)},
            "environment": _environment(),
            "inputs": list(_inputs(audit)),
            "crs": _crs(audit),
            "reconstructions": reconstructions,
            "paired": {stage: list(_paired(audit, stage)) for stage in ("delivered", "after_icp")},
            "criteria": criteria,
            "verdict": verdict,
            "warnings": warning_results(cautions),
        }
    )


def _reconstruction(judged: Judged, audit: Audit, checks: tuple[CrossCheck, ...]) -> dict[str, Any]:
    found: dict[str, Any] = dict.fromkeys(("alignment", "loocv", "checks", "reliability"))
    if judged.alignment is not None:
        accuracy = audit.project.reference.accuracy_m
        found = alignment_results(judged.alignment, accuracy=accuracy, repeats=judged.repeats)
        del found["warnings"]
        found["reliability"] |= {
            "zones": _zone_sigmas(judged, audit.reference),
            "next_picks": _next_picks(judged, audit.reference),
            "cross_checks": [asdict(check) for check in checks],
        }
    after = judged.after_icp
    return {
        **found,
        "icp": trial_results(judged.trial),
        "comparison": {
            "delivered": comparison_results(judged.delivered, judged.intervals)
            | {"intervals": interval_results(judged.intervals, judged.perfect)},
            "after_icp": None
            if after is None
            else comparison_results(after, judged.intervals_after_icp)
            | {"intervals": interval_results(judged.intervals_after_icp, None)},
        },
    }


def _paired(audit: Audit, stage: Literal["delivered", "after_icp"]) -> Iterator[dict[str, Any]]:
    """Compare every two reconstructions on the reference's points."""
    for one, other in combinations(audit.judged, 2):
        pair = [getattr(each, stage) for each in (one, other)]
        if None in pair:
            continue
        poses = (one.intervals, other.intervals) if stage == "delivered" else (None, None)
        found = compare_pair(*pair, names=(one.given.name, other.given.name), poses=poses)
        yield {
            "names": list(found.names),
            "statement": found.statement,
            "differences": found.differences,
        }


def _zone_sigmas(judged: Judged, reference: Reference) -> dict[str, dict[str, float]]:
    """Root mean square, over a zone's reference voxels, of the similarity's 3D sigma."""
    assert judged.alignment is not None
    sigmas = judged.alignment.reliability.sigma(reference.cloud.coordinates)
    squares = (sigmas**2).sum(axis=1)
    own = reference.zones.of(reference.cloud.coordinates[:, 2])
    return {
        name: {"sigma_m": np.sqrt(squares[own == k].mean()) if (own == k).any() else np.nan}
        for k, name in enumerate(reference.zones.names)
    }


def _next_picks(judged: Judged, reference: Reference) -> Any:
    assert judged.alignment is not None
    places = reference.cloud.coordinates
    corners = judged.alignment.reliability.corners[["x", "y", "z"]].to_numpy()
    every = max(1, len(places) // CANDIDATES)
    apart = APART * float(np.linalg.norm(reference.high - reference.low))
    return next_picks(judged.alignment.reliability, places[::every], corners, count=3, apart=apart)


def _cross_checks(project: Project, judged: Judged) -> Iterator[CrossCheck]:
    if judged.alignment is None:
        return
    worth = judged.alignment.reliability
    for given in project.cross_checks:
        if given.of not in ("", judged.given.name):
            continue
        if isinstance(given, ScaleBar):
            ends = given.start, given.end
            yield scale_bar(worth, *ends, length=given.length_m, sigma=given.sigma_m)
        elif isinstance(given, UpDirection):
            yield up_direction(worth, given.up, sigma_deg=given.sigma_deg)
        else:
            source, target = np.array(given.source), np.array(given.target_m)
            yield camera_positions(worth, source, target, sigma=given.sigma_m)


def _cautions(audit: Audit, checks: dict[str, tuple[CrossCheck, ...]]) -> Iterator[Caution]:
    yield from audit.reference_info.cautions
    yield from audit.crs.cautions
    own = [tuple(_own_cautions(each, checks[each.given.name])) for each in audit.judged]
    for judged, found in zip(audit.judged, own, strict=True):
        for caution in found:
            # What holds for all is about the reference or a setting.
            if all(caution in each for each in own):
                yield caution
            else:
                yield replace(caution, message=f"{judged.given.name}: {caution.message}")


def _own_cautions(judged: Judged, checks: tuple[CrossCheck, ...]) -> Iterator[Caution]:
    # A cloud in its own frame is not expected to have a CRS.
    own = judged.info.cautions
    yield from (c for c in own if judged.alignment is None or c.code != "crs_missing")
    if judged.alignment is not None:
        yield from judged.alignment.cautions
    yield from judged.delivered.cautions
    if judged.intervals is not None:
        yield from judged.intervals.cautions
    if judged.trial is not None:
        yield from judged.trial.cautions
    yield from (c.caution for c in checks if c.caution is not None)


def _settings(project: Project) -> dict[str, Any]:
    return {
        "alignment": asdict(project.alignment),
        "comparison": asdict(project.comparison),
        "reference": {
            key: value
            for key, value in asdict(project.reference).items()
            if key not in ("path", "region")
        },
    }


def _environment() -> dict[str, str]:
    versions = {"trigpoint": trigpoint.__version__, "python": platform.python_version()}
    for package in PACKAGES:
        try:
            versions[package] = metadata.version(package)
        except metadata.PackageNotFoundError:  # vendored, or not needed here
            continue
    versions["pyproj"], versions["proj"] = pyproj.__version__, pyproj.proj_version_str
    return versions | {"system": platform.system(), "machine": platform.machine()}


def _inputs(audit: Audit) -> Iterator[dict[str, Any]]:
    project = audit.project
    folder, given = project.path.parent, project.reference
    info = audit.reference_info
    yield _input(folder, given.name, "reference", given.path, info.format, info)
    if given.region is not None:
        yield _input(folder, given.name, "region", given.region, outline_format(given.region))
    for judged in audit.judged:
        own = judged.given
        yield _input(folder, own.name, own.kind, own.path, judged.info.format, judged.info)
        if own.picks is not None:
            yield _input(folder, own.name, "picks", own.picks, PICKS)
        for path in own.picks_repeated:
            yield _input(folder, own.name, "repicks", path, PICKS)


def _input(
    folder: Path, name: str, role: str, path: Path, kind: str, info: CloudInfo | None = None
) -> dict[str, Any]:
    # Outside the project's folder only the name is kept: the rest says where, not what, it is.
    stated = path.relative_to(folder) if path.is_relative_to(folder) else Path(path.name)
    hashed = path / "ept.json" if path.is_dir() else path
    return {
        "name": name,
        "role": role,
        "path": stated.as_posix(),
        "format": kind,
        "bytes": hashed.stat().st_size,
        "sha256": sha256(hashed),
        "points": None if info is None else info.points,
        "crs": None if info is None or info.crs is None else info.crs.name,
    }


def _crs(audit: Audit) -> dict[str, Any]:
    report = audit.crs
    said = {each.name: getattr(report, each.name) for each in fields(report)}
    del said["cautions"]
    return said
