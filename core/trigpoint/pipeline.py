"""The method, read top to bottom: one call a step, one Audit out."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from trigpoint.alignment import Alignment, align
from trigpoint.comparison import measure
from trigpoint.criteria import check_quantities
from trigpoint.crs import describe_crs, parse_crs
from trigpoint.files import describe
from trigpoint.flawless import flawless
from trigpoint.intervals import estimate
from trigpoint.picks import Picks, read_picks
from trigpoint.preparation import Reference, Thinned, prepare, thin
from trigpoint.project import AlignmentSettings, Project, ReconstructionInput, read_project
from trigpoint.record import Audit, Judged
from trigpoint.repeats import Frame, Repeats, repicked
from trigpoint.surface import Surface
from trigpoint.trial import Trial, judge

Say = Callable[[str], None]


def audit(project: Project | str | Path, *, say: Say = lambda _: None) -> Audit:
    """Align, validate and compare everything a project names.

    The method is that of Shrestha et al. (2026): a similarity from structural correspondences by
    RANSAC and Umeyama's closed form; residuals, leave-one-out and rigid ICP as three views of it;
    then, as a separate question, accuracy and completeness by height zone against the reference.

    Parameters
    ----------
    project : Project or path
        A project.toml, read or not.
    say : callable, optional
        Told each step as it begins.

    Returns
    -------
    Audit

    Raises
    ------
    TrigpointError
        If an input is unusable.
    """
    if not isinstance(project, Project):
        project = read_project(project)
    check_quantities(project)
    given, settings = project.reference, project.comparison
    say("reference: reading")
    frame = parse_crs(given.crs or describe(given.path).crs, vertical=given.vertical_crs or None)
    info = describe(given.path, crs=frame)
    reference = prepare(
        given.path,
        voxel=settings.voxel_m,
        zones=settings.zones,
        margin=settings.margin_m,
        region=given.region,
        crs=frame,
    )
    report = describe_crs(frame, at=(reference.low + reference.high) / 2)
    surface = Surface(reference.cloud.coordinates)
    judged = [_judge(each, project, reference, surface, say) for each in project.reconstructions]
    return Audit(project, reference, info, report, tuple(judged))


def _judge(
    given: ReconstructionInput,
    project: Project,
    reference: Reference,
    surface: Surface,
    say: Say,
) -> Judged:
    """Take one reconstruction through the method."""
    settings, within = project.comparison, project.comparison.within_m
    info = describe(given.path)
    alignment = None
    repeats: dict[Frame, Repeats] = {}
    if given.picks is not None:
        say(f"{given.name}: fitting one similarity to its picks")
        picks = read_picks(given.picks, crs=reference.cloud.crs)
        again = [read_picks(path, crs=reference.cloud.crs) for path in given.picks_repeated]
        if again:
            picks, repeats = repicked(picks, again)
        alignment = _align(picks, project.alignment, reference)
    worth = None if alignment is None else alignment.reliability

    say(f"{given.name}: reading")
    similarity = None if alignment is None else alignment.similarity
    thinned = thin(given.path, reference, similarity=similarity)
    say(f"{given.name}: measuring accuracy and completeness")
    delivered = measure(thinned, reference, within=within)
    judged = Judged(given, info, alignment, thinned, delivered, repeats)
    if settings.intervals:
        say(f"{given.name}: working out intervals")
        perfect = None
        if worth is not None:
            perfect = flawless(worth, surface, reference.zones, within=within)
        spread = estimate(delivered, reliability=worth)
        judged = replace(judged, intervals=spread, perfect=perfect)
    if settings.icp:
        say(f"{given.name}: putting rigid ICP on trial")
        trial = try_icp(thinned, surface, alignment)
        after = measure(thinned.moved(trial.refinement.similarity), reference, within=within)
        spread_after = estimate(after) if settings.intervals else None
        judged = replace(judged, trial=trial, after_icp=after, intervals_after_icp=spread_after)
    return judged


def _align(picks: Picks, settings: AlignmentSettings, reference: Reference) -> Alignment:
    return align(
        picks,
        method=settings.method,
        threshold=settings.threshold_m,
        trials=settings.trials,
        seed=settings.seed,
        weighted=settings.weighted,
        extent=np.array([reference.low, reference.high]),
    )


def try_icp(thinned: Thinned, surface: Surface, alignment: Alignment | None = None) -> Trial:
    """Refine a reconstruction by ICP, and ask the picks, where there are any, what that was worth.

    Parameters
    ----------
    thinned : Thinned
        In the reference's frame.
    surface : Surface
        Of the reference.
    alignment : Alignment, optional
        What carried the reconstruction there.
    """
    if alignment is None:
        return judge(thinned.cloud.coordinates, surface)
    inliers, checks = alignment.inliers, alignment.picks.check
    return judge(
        thinned.cloud.coordinates,
        surface,
        similarity=alignment.similarity,
        controls=(inliers.source, inliers.target),
        checks=(checks.source, checks.target),
        weights=alignment.weights,
    )
