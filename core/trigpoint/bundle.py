"""An audit as files: results.json, tables, matrices and clouds, in one folder."""

from __future__ import annotations

import json
import zipfile
from pathlib import Path
from typing import Any

import numpy as np

from trigpoint.canonical import to_json, write_text
from trigpoint.cloud import PointCloud
from trigpoint.delivery import archive_of, write_csv
from trigpoint.errors import ProjectError
from trigpoint.files import carry, write
from trigpoint.pipeline import Say
from trigpoint.project import Project
from trigpoint.record import Audit, Judged


def bundle_path(project: Project, out: str | Path | None = None) -> Path:
    """Return where a project's bundle belongs, ``<out>/<id>-r<revision>``, whatever is there."""
    parent = project.path.parent / "audit" if out is None else Path(out)
    return parent / f"{project.about.id}-r{project.about.revision}"


def bundle_folder(project: Project, out: str | Path | None = None) -> Path:
    """Return where a project's bundle may be written: `bundle_path`, if no more than a draft is.

    Parameters
    ----------
    project : Project
    out : path, optional
        By default the folder `audit` beside the project file.

    Raises
    ------
    ProjectError
        If this revision is there already, as a folder or a zip, and is not a draft.
    """
    folder = bundle_path(project, out)
    for found in (folder, archive_of(folder)):
        status = _stored_status(found, folder.name) if found.exists() else "draft"
        if status != "draft":
            why = "is issued" if status == "issued" else "is no draft"
            message = (
                f"{found} is there already and {why}: only a draft is ever overwritten. Raise "
                f"[project] revision above {project.about.revision}, or choose another folder."
            )
            raise ProjectError(message)
    return folder


def _stored_status(bundle: Path, name: str) -> str | None:
    """Read what a bundle, folder or zip, says of itself; None where it is no bundle."""
    results = "data/results.json"
    try:
        if bundle.is_dir():
            text = (bundle / results).read_bytes()
        else:
            with zipfile.ZipFile(bundle) as archive:
                text = archive.read(f"{name}/{results}")
        return str(json.loads(text)["project"]["status"])
    except (OSError, ValueError, KeyError, TypeError, zipfile.BadZipFile):
        return None


def fill_bundle(
    folder: Path, audit: Audit, results: dict[str, Any], *, say: Say = lambda _: None
) -> None:
    """Write an audit's results, tables, matrices and clouds into an empty folder.

    Parameters
    ----------
    folder : Path
        As `delivery.whole_folder` yields it.
    audit : Audit
    results : dict
        `audit.results()`.
    say : callable, optional
        Told each step as it begins.
    """
    for name in ("data", "transform", "clouds"):
        (folder / name).mkdir()
    say("writing the tables")
    write_text(folder / "data" / "results.json", to_json(results))
    for name, found in results["reconstructions"].items():
        _tables(folder / "data", name, found)
        if found["alignment"] is not None:
            _transform(folder / "transform", name, found, results)
    for judged in audit.judged:
        say(f"{judged.given.name}: writing its clouds")
        _distances(folder / "data" / f"distances-{judged.given.name}.npz", judged)
        _clouds(folder / "clouds", judged, audit)


def _tables(folder: Path, name: str, found: dict[str, Any]) -> None:
    if found["alignment"] is not None:
        write_csv(folder / f"picks-{name}.csv", found["alignment"]["residuals"])
        write_csv(folder / f"loocv-{name}.csv", found["loocv"]["folds"])
        write_csv(folder / f"reliability-{name}.csv", found["reliability"]["picks"])
        write_csv(folder / f"next-picks-{name}.csv", found["reliability"]["next_picks"])
        if found["checks"]["n"]:
            write_csv(folder / f"checks-{name}.csv", found["checks"]["residuals"])
    zones, shares = [], []
    for stage, comparison in found["comparison"].items():
        if comparison is None:
            continue
        for direction in ("accuracy", "completeness"):
            for zone, row in comparison[direction].items():
                place = {"stage": stage, "direction": direction, "zone": zone}
                zones.append(place | {k: v for k, v in row.items() if k != "within"})
                shares += [place | share for share in row["within"]]
    write_csv(folder / f"zones-{name}.csv", zones)
    write_csv(folder / f"within-{name}.csv", shares)


def _transform(folder: Path, name: str, found: dict[str, Any], results: dict[str, Any]) -> None:
    """Write the similarity twice: for `trigpoint apply`, and as the 4 x 4 that archives ask for."""
    crs = results["crs"]["code"]
    write_text(folder / f"{name}.json", to_json({**found["alignment"], "crs": crs}))
    rows = [" ".join(f"{value!r}" for value in row) for row in found["alignment"]["matrix"]]
    write_text(folder / f"{name}_matrix.txt", "\n".join(rows) + "\n")


def _distances(path: Path, judged: Judged) -> None:
    """Write every distance with the height that gives its zone: what the zone tables follow from.

    NumPy's own format, because reading it needs NumPy alone; it stores no date.
    """
    arrays: dict[str, Any] = {}
    for stage, comparison in (("delivered", judged.delivered), ("after_icp", judged.after_icp)):
        if comparison is not None:
            for direction, cloud, distances in (
                ("accuracy", comparison.reconstruction, comparison.accuracy_m),
                ("completeness", comparison.reference, comparison.completeness_m),
            ):
                arrays[f"{stage}_{direction}_m"] = distances
                arrays[f"{stage}_{direction}_height_m"] = cloud.xyz[:, 2] + cloud.origin[2]
    arrays["zone_edges_m"] = judged.delivered.zones.edges_m
    np.savez_compressed(path, **arrays)


def _clouds(folder: Path, judged: Judged, audit: Audit) -> None:
    name, crs = judged.given.name, audit.reference.cloud.crs
    if judged.alignment is not None:
        target = folder / f"{name}-georeferenced.laz"
        sigma = judged.alignment.reliability.sigma if audit.project.alignment.sigma else None
        carry(judged.given.path, target, judged.alignment.similarity, crs=crs, sigma=sigma)
    delivered, after = judged.delivered, judged.after_icp
    for direction, cloud, before, later in (
        (
            "accuracy",
            delivered.reconstruction,
            delivered.accuracy_m,
            None if after is None else after.accuracy_m,
        ),
        (
            "completeness",
            delivered.reference,
            delivered.completeness_m,
            None if after is None else after.completeness_m,
        ),
    ):
        distances = {"distance_m": before}
        if later is not None:
            distances["distance_after_icp_m"] = later
        _write_distances(folder / f"{name}-{direction}.laz", cloud, distances)


def _write_distances(
    path: Path, cloud: PointCloud, distances: dict[str, np.ndarray[Any, Any]]
) -> None:
    if not len(cloud):
        return
    # A distance to a cloud of no points is infinite: NaN says in a file that there is none.
    finite = {
        name: np.where(np.isfinite(values), values, np.nan) for name, values in distances.items()
    }
    write(path, PointCloud(cloud.xyz, cloud.origin, finite, cloud.crs))
