"""The audit run again from a bundle's own recipe, and compared by tolerance classes."""

from __future__ import annotations

import json
import tempfile
import tomllib
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import trigpoint
from trigpoint.canonical import LENGTHS
from trigpoint.delivery import sha256
from trigpoint_reporting.manifest import BundleError
from trigpoint_reporting.recipe import to_toml
from trigpoint_reporting.revisions import compare_results

# How far a number may move where every package is the same, and where one has changed since:
# metres, percent, and a share of anything else.
SAME = {"_m": 2e-9, "_pct": 1e-9, "": 1e-9}
CHANGED = {"_m": 1e-4, "_pct": 1e-2, "": 1e-4}


@dataclass(frozen=True, slots=True, eq=False)
class Rerun:
    """What running an audit again showed.

    Attributes
    ----------
    versions : list of dict
        path, before, after of every package, Python or system that differs. Where there is one,
        `moved` is drift, and not a fault of the bundle.
    moved : list of dict
        path, kind, before, after of every value beyond its tolerance.
    """

    versions: list[dict[str, Any]]
    moved: list[dict[str, Any]]


def find_inputs(
    results: Mapping[str, Any], inputs: Path
) -> tuple[dict[str, Path], list[dict[str, Any]], list[str]]:
    """Look for the audited files in a folder, by the paths stated or else by name.

    Returns
    -------
    found : dict of str to Path
        By the path stated in results.json, those whose bytes are the ones audited.
    other : list of dict
        path, stored, found: hashes of files of that name that are not the ones audited.
    missing : list of str
        Paths of files that are not there.
    """
    found: dict[str, Path] = {}
    other, missing = [], []
    for given in results["inputs"]:
        stated = given["path"]
        places = [inputs / stated, inputs / Path(stated).name]
        at_hand = [place for place in places if place.exists()]
        if not at_hand:
            if given["role"] not in ("picks", "repicks"):  # the bundle has copies
                missing.append(stated)
            continue
        place = at_hand[0]
        digest = sha256(place / "ept.json" if place.is_dir() else place)
        if digest == given["sha256"]:
            found[stated] = place
        else:
            other.append({"path": stated, "stored": given["sha256"], "found": digest})
    return found, other, missing


def rerun(
    folder: Path,
    results: Mapping[str, Any],
    found: Mapping[str, Path],
    *,
    say: Callable[[str], None] = lambda _: None,
) -> Rerun:
    """Run the audit of a bundle again, with the settings in it and inputs that are at hand.

    Parameters
    ----------
    folder : Path
        The bundle.
    results : dict
        Its results.json.
    found : dict of str to Path
        As `find_inputs` finds them; the pick files are in the bundle.
    say : callable, optional
        Told each step as it begins.

    Raises
    ------
    TrigpointError
        If an input is missing, or the audit can't be run.
    """
    tables = tomllib.loads((folder / "config" / "project.toml").read_text("utf-8"))
    reference = tables["reference"]
    reference["path"] = _at_hand(reference["path"], found)
    if reference.get("region"):
        reference["region"] = _at_hand(reference["region"], found)
    for given in tables["reconstruction"]:
        given["path"] = _at_hand(given["path"], found)
        if given.get("picks"):
            copies = sorted((folder / "config").glob(f"picks-{given['name']}.*"))
            given["picks"] = str(copies[0].resolve()) if copies else given["picks"]
        again = given.get("picks_repeated", [])
        for k in range(len(again)):
            copies = sorted((folder / "config").glob(f"repicks-{given['name']}-{k + 1}.*"))
            again[k] = str(copies[0].resolve()) if copies else again[k]
    with tempfile.TemporaryDirectory(prefix="trigpoint-") as temporary:
        path = Path(temporary) / "project.toml"
        path.write_text(to_toml(tables), encoding="utf-8")
        again = trigpoint.audit(path, say=say).results()
    again = json.loads(json.dumps(again))
    rows = compare_results(results, again)
    versions = [row for row in rows if row["path"].startswith("environment.")]
    limits = CHANGED if versions else SAME
    moved = [
        row
        for row in rows
        if row not in versions and not _is_place(row["path"]) and not _is_near(row, limits)
    ]
    return Rerun(versions, moved)


def _at_hand(stated: str, found: Mapping[str, Path]) -> str:
    if stated not in found:
        message = f"{stated} is not at hand as it was audited: the audit can't be run again."
        raise BundleError(message)
    return str(found[stated].resolve())


def _is_place(path: str) -> bool:
    # Where an input lay then says nothing about what it was.
    return path.startswith("inputs[") and path.endswith("].path")


def _is_near(row: Mapping[str, Any], limits: Mapping[str, float]) -> bool:
    before, after = row["before"], row["after"]
    numbers = all(
        isinstance(each, int | float) and not isinstance(each, bool) for each in (before, after)
    )
    if not numbers or row["kind"] != "changed":
        return False
    if isinstance(before, int) and isinstance(after, int):
        return before == after
    steps = row["path"].replace("]", "").replace("[", ".").split(".")
    key = next((step for step in reversed(steps) if not step.isdigit()), "")
    apart = abs(before - after)
    if key.endswith("_m") or key in LENGTHS:
        return bool(apart <= limits["_m"])
    if key.endswith("_pct"):
        return bool(apart <= limits["_pct"])
    return bool(apart <= limits[""] * max(1.0, abs(before)))
