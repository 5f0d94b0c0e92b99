"""README.txt: what a bundle is, how to check it, what its files are and what stands in them."""

from __future__ import annotations

import csv
from collections.abc import Iterator, Mapping
from fnmatch import fnmatchcase
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np

import trigpoint
from trigpoint.canonical import write_text
from trigpoint_reporting.dictionary import NAMES, describe_file
from trigpoint_reporting.manifest import MANIFEST, RECORD, list_files

README = "README.txt"
SCHEMA = "data/results.schema.json"
# Made after the record, and so not there yet when this file lists what is.
LATER = (
    "report.html",
    "report.pdf",
    "audit.ipynb",
    "audit.py",
    "figures/*",
    "ro-crate-metadata.json",
    RECORD,
    MANIFEST,
)
UNITS = """\
Coordinates are easting, northing and height in metres, in the frame that data/results.json names
under "crs"; a name that begins with source_ is in the reconstruction's own frame. Lengths are in
metres, and every distance is to the nearest point, without a sign. In every table and in
data/results.json the end of a name states its unit: _m metres, _pct percent, _deg degrees, _ppm
parts per million; any other number has none. Text is UTF-8, tables are CSV with commas and decimal
points, and what is missing is empty, or null in JSON. An interval holds 95 %.
"""


def write_readme(folder: Path, results: Mapping[str, Any]) -> None:
    """Write README.txt, and the schema of results.json beside that.

    Parameters
    ----------
    folder : Path
        The bundle, with all that its record will list.
    results : dict
        As in results.json.
    """
    schema = files("trigpoint").joinpath("results.schema.json").read_text("utf-8")
    write_text(folder / SCHEMA, schema)
    write_text(folder / README, "".join(f"{line}\n" for line in _lines(folder, results)))


def names_in(path: Path) -> list[str]:
    """Return the columns of a CSV, the keys of an NPZ, or the attributes of a cloud's points."""
    if path.suffix == ".csv":
        with path.open(encoding="utf-8", newline="") as file:
            return next(csv.reader(file), [])
    if path.suffix == ".npz":
        with np.load(path, allow_pickle=False) as stored:
            return list(stored.files)
    return list(trigpoint.describe(path).attributes)


def _lines(folder: Path, results: Mapping[str, Any]) -> Iterator[str]:
    about = results["project"]
    bundle = f"{about['id']}-r{about['revision']}"
    title = f"{bundle}: an audit by trigpoint {results['environment']['trigpoint']}"
    yield from (title, "=" * len(title), "")
    yield "Each reconstruction that came in a frame of its own was carried into a geodetic frame by"
    yield "one similarity, fitted to picked points. This bundle says what that is worth and how far"
    yield f"each lies from the reference. Status: {about['status']}. Begin with report.html."
    yield from _titled("To check it")
    yield "Inside this folder, that no file was changed since it was sealed:"
    yield f"    sha256sum -c {MANIFEST}"
    yield "Inside this folder, recompute the numbers, with Python and NumPy alone:"
    yield "    python verify/verify.py"
    yield "Beside it, do both with trigpoint, and if wanted run the audit again:"
    yield f"    trigpoint verify {bundle}.zip"
    yield f"    trigpoint verify {bundle}.zip --again --inputs FOLDER"
    names = sorted({*list_files(folder), README})
    yield from _titled("Files")
    yield from _listed({name: describe_file(name) for name in names})
    yield from ("", "Made from these afterwards, the first five where a report could be made:", "")
    yield from _listed({name: describe_file(name) for name in LATER})
    yield from _titled("Units")
    yield from UNITS.splitlines()
    for pattern, meanings in NAMES.items():
        found = {
            key for name in names if fnmatchcase(name, pattern) for key in names_in(folder / name)
        }
        if told := {key: text for key, text in meanings.items() if key in found}:
            yield from _titled(pattern.replace("*", "NAME"))
            yield from _listed(told)


def _titled(text: str) -> tuple[str, ...]:
    return ("", text, "-" * len(text))


def _listed(told: Mapping[str, str]) -> Iterator[str]:
    width = max(map(len, told))
    yield from (f"{name:{width}}  {text}".rstrip() for name, text in told.items())
