"""One project's audit, delivered: a whole bundle with its report, and the zip beside it."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import trigpoint
from trigpoint.bundle import bundle_folder, bundle_path, fill_bundle
from trigpoint.cautions import Caution
from trigpoint.delivery import check_writable, whole_folder
from trigpoint.errors import ProjectError, TrigpointError
from trigpoint.project import Project
from trigpoint_reporting.sealing import pack, pack_left, seal, write_record

Say = Callable[[str], None]


@dataclass(frozen=True, slots=True, eq=False)
class Delivery:
    """What an audit left on the disk.

    Attributes
    ----------
    folder, archive : Path
        The bundle, and its zip.
    results : dict
        What results.json holds.
    cautions : tuple of Caution
        About the report, if it could not be made, or not whole.
    """

    folder: Path
    archive: Path
    results: dict[str, Any]
    cautions: tuple[Caution, ...]


def check_places(projects: Sequence[Project], out: Path | None) -> None:
    """Raise ProjectError where a bundle can't be written, or two would be written into one."""
    places = [bundle_path(project, out) for project in projects]
    for place, project in zip(places, projects, strict=True):
        if places.count(place) > 1:
            message = (
                f"Two projects would be written to {place}: give them another [project] id or "
                f"revision; both are {project.about.id}, revision {project.about.revision}."
            )
            raise ProjectError(message)
        check_writable(place)


def deliver(project: Project, out: Path | None, *, say: Say) -> Delivery:
    """Audit a project and write its bundle, report and zip.

    An issued bundle that lacks only its zip, because the run that made it was stopped, gets it.

    Parameters
    ----------
    project : Project
    out : Path or None
        Folder of the bundle; by default the folder `audit` beside the project file.
    say : callable
        Told each step as it begins.

    Raises
    ------
    ProjectError
        If this revision is there already and is not a draft.
    BundleError
        If an issued bundle without its zip is not what was sealed.
    """
    folder = bundle_path(project, out)
    left = pack_left(folder)
    if left is not None:
        results = json.loads((folder / "data" / "results.json").read_text("utf-8"))
        return Delivery(folder, left, results, ())
    bundle_folder(project, out)
    audit = trigpoint.audit(project, say=say)
    say("hashing the inputs")
    results = audit.results()
    with whole_folder(folder) as draft:
        fill_bundle(draft, audit, results, say=say)
        write_record(draft, audit, results)
        cautions = report(draft, say)
        seal(draft)
    return Delivery(folder, pack(folder), results, cautions)


def report(folder: Path, say: Say) -> tuple[Caution, ...]:
    """Write the report into a bundle, as far as what it needs is installed."""
    try:
        from trigpoint_reporting.document import write_report
    except ImportError as error:
        lacking = str(error) if isinstance(error, TrigpointError) else f"{error.name} is missing"
        message = (
            f"There is no report, only results, tables and clouds. {lacking.rstrip('.')}. Install "
            'what reports need with pip install "trigpoint[reporting]".'
        )
        return (Caution("report_not_made", message),)
    return write_report(folder, say=say)
