"""What turns an audit's files into a bundle that can be checked: its record, its seal, its zip."""

from __future__ import annotations

import json
import zipfile
from collections.abc import Mapping
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from trigpoint.canonical import to_json, write_text
from trigpoint.delivery import archive_of
from trigpoint.picktable import format_columns
from trigpoint.record import Audit, Judged
from trigpoint_reporting.crate import CRATE, describe_crate
from trigpoint_reporting.lockfile import write_lock
from trigpoint_reporting.manifest import (
    MANIFEST,
    RECORD,
    BundleError,
    hash_files,
    list_files,
    read_manifest,
    write_manifest,
)
from trigpoint_reporting.numbers import write_rounding
from trigpoint_reporting.quality import quality_report
from trigpoint_reporting.readme import write_readme
from trigpoint_reporting.recipe import write_recipe
from trigpoint_reporting.revisions import write_changes

# Already compressed: deflating them again costs time and gains nothing.
COMPRESSED = frozenset({".laz", ".npz", ".pdf", ".png"})
# The earliest date that a zip can state: it says that none is stated.
NO_DATE = (1980, 1, 1, 0, 0, 0)


def write_record(folder: Path, audit: Audit, results: Mapping[str, Any]) -> None:
    """Complete what the report will rest on, and list it with its hashes.

    To be called after `fill_bundle` and before the report is written, so that the report can
    state `record_hash`. Writes config/, env/, quality/, verify/, the correspondences of each
    similarity, how numbers are rounded in print, what changed since the last revision, README.txt
    with the schema of results.json, and ``record-sha256.txt``.

    Parameters
    ----------
    folder : Path
        As `fill_bundle` left it, beside the bundles of earlier revisions.
    audit : Audit
    results : dict
        `audit.results()`.
    """
    for name in ("config", "env", "quality", "verify"):
        (folder / name).mkdir()
    write_recipe(folder / "config", audit.project)
    write_lock(folder / "env")
    write_text(folder / "quality" / "iso19157.json", to_json(quality_report(results)))
    (folder / "verify" / "verify.py").write_bytes(verifier_source())
    for judged in audit.judged:
        _correspondences(folder / "data", judged)
        _repeats(folder / "data", judged)
    write_rounding(folder / "data" / "rounding.json")
    write_changes(folder / "data" / "changes.json", results, folder.parent)
    write_readme(folder, results)
    write_manifest(folder / RECORD, hash_files(folder))


def seal(folder: Path) -> None:
    """Describe every file of a bundle in its crate, and list it in its manifest.

    To be called when the report is written: whatever changes later no longer fits.
    """
    results = json.loads((folder / "data" / "results.json").read_text("utf-8"))
    for name in (CRATE, MANIFEST):
        (folder / name).unlink(missing_ok=True)
    hashes = hash_files(folder)
    write_text(folder / CRATE, to_json(describe_crate(folder, results, hashes)))
    write_manifest(folder / MANIFEST, hash_files(folder))


def pack(folder: Path) -> Path:
    """Write a sealed bundle as a zip beside it: the same files are the same bytes.

    Returns
    -------
    Path
        ``<folder>.zip``.

    Raises
    ------
    BundleError
        If the zip is there already and what it holds was issued.
    """
    target = archive_of(folder)
    results = json.loads((folder / "data" / "results.json").read_text("utf-8"))
    if target.exists() and results["project"]["status"] == "issued":
        message = f"{target.name} is there already and is issued: it is never overwritten."
        raise BundleError(message)
    beside = target.with_name(f".{target.name}.part")
    try:
        with zipfile.ZipFile(beside, "w") as archive:
            for name in list_files(folder):
                _pack_one(archive, folder / name, f"{folder.name}/{name}")
        beside.replace(target)
    finally:
        beside.unlink(missing_ok=True)
    return target


def pack_left(folder: Path) -> Path | None:
    """Pack an issued bundle that was left without its zip, such as by a run that was killed.

    An issued bundle is never made again, so that its zip could not be had otherwise.

    Parameters
    ----------
    folder : Path
        Where the bundle would be.

    Returns
    -------
    Path or None
        The zip; None where there is nothing to finish: no such folder, a draft, or a zip already.

    Raises
    ------
    BundleError
        If the folder is not, file by file, what was sealed.
    """
    if archive_of(folder).exists() or not _is_issued(folder):
        return None
    sealed, found = read_manifest(folder / MANIFEST), hash_files(folder)
    found.pop(MANIFEST, None)
    if odd := sorted(dict(sealed.items() ^ found.items())):
        message = (
            f"{folder.name} has no zip and can't be given one: {odd[0]} is not what was sealed"
            f"{f', nor are {len(odd) - 1} more' if len(odd) > 1 else ''}."
        )
        raise BundleError(message)
    return pack(folder)


def verifier_source() -> bytes:
    """Return the verifier that bundles carry, byte for byte."""
    return files("trigpoint_reporting").joinpath("verifier", "verify.py").read_bytes()


def _is_issued(folder: Path) -> bool:
    try:
        results = json.loads((folder / "data" / "results.json").read_text("utf-8"))
        return bool(results["project"]["status"] == "issued")
    except (OSError, ValueError, KeyError, TypeError):
        return False  # no bundle: nothing of it can be finished


def _pack_one(archive: zipfile.ZipFile, path: Path, name: str) -> None:
    entry = zipfile.ZipInfo(name, NO_DATE)
    entry.create_system = 3  # the same bytes from Windows
    entry.external_attr = 0o100644 << 16
    stored = path.suffix in COMPRESSED
    entry.compress_type = zipfile.ZIP_STORED if stored else zipfile.ZIP_DEFLATED
    entry.file_size = path.stat().st_size
    with path.open("rb") as source, archive.open(entry, "w") as target:
        while block := source.read(2**20):
            target.write(block)


def _correspondences(folder: Path, judged: Judged) -> None:
    """Write the coordinates that the similarity was fitted to, to the last bit, in metres."""
    alignment = judged.alignment
    if alignment is None:
        return
    picks = alignment.picks
    weights: dict[str, float] = {}
    if alignment.weights is not None:
        weights = dict(zip(alignment.inliers.ids, alignment.weights.tolist(), strict=True))
    columns = {
        "id": list(picks.ids),
        "role": picks.roles.tolist(),
        **{f"source_{axis}": _exact(picks.source[:, k]) for k, axis in enumerate("xyz")},
        **{f"target_{axis}": _exact(picks.target[:, k]) for k, axis in enumerate("xyz")},
        "sigma_source": _exact(picks.sigma_source),
        "sigma_target": _exact(picks.sigma_target),
        "weight": [repr(weights[name]) if name in weights else "" for name in picks.ids],
    }
    write_text(folder / f"correspondences-{judged.given.name}.csv", format_columns(columns))


def _repeats(folder: Path, judged: Judged) -> None:
    """Write the places that were picked again, in each session; the first holds those fitted to."""
    if judged.alignment is None or not judged.repeats:
        return
    picks = judged.alignment.picks
    ids = picks.take(picks.roles != "off").ids
    rows = [
        (frame, str(session), ids[place], *_exact(points[place]))
        for frame, found in judged.repeats.items()
        for session, points in enumerate(found.points, 1)
        for place in np.flatnonzero(np.isfinite(points).all(axis=1))
    ]
    columns = zip(("frame", "session", "id", "x", "y", "z"), zip(*rows, strict=True), strict=True)
    text = format_columns({name: list(values) for name, values in columns})
    write_text(folder / f"repeats-{judged.given.name}.csv", text)


def _exact(values: NDArray[np.float64]) -> list[str]:
    return ["" if np.isnan(value) else repr(value) for value in values.tolist()]
