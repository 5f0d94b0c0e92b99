"""Builds the archive of the QGIS plugin, and refuses it where the plugin repository would.

::

    python plugin/make_zip.py [--out FOLDER] [--publish]
    python plugin/make_zip.py --requirements

The archive holds the plugin and, below `_vendor`, the pure-Python packages of this project. What is
compiled is never in it: `requirements.txt`, written from pyproject.toml, lists it for the
environment beside QGIS. The same checkout gives the same bytes.
"""

from __future__ import annotations

import argparse
import configparser
import hashlib
import re
import sys
import tomllib
import zipfile
from collections.abc import Iterator
from pathlib import Path, PurePosixPath

ROOT = Path(__file__).resolve().parents[1]
PACKAGE = "trigpoint_qgis"
VENDORED = (
    "core/trigpoint",
    "reporting/trigpoint_reporting",
    "plugin/trigpoint_panel",
    "templates/trigpoint_templates",
)
# A zip can't hold an earlier date; none at all would be the day of the build.
EPOCH = (1980, 1, 1, 0, 0, 0)

# What the repository asks of metadata.txt and of the files.
REQUIRED = (
    "name",
    "description",
    "about",
    "version",
    "qgisMinimumVersion",
    "author",
    "email",
    "tracker",
    "repository",
)
# Older ones crash QGIS when it quits. A window of its own does not mind them.
VTK = "vtk>=9.4.2"
LARGEST = 25 * 1024 * 1024
NEVER = ("__pycache__", ".git", "__MACOSX")
FLAGGED = (".so", ".dll", ".dylib", ".exe", ".bat", ".sh", ".ps1", ".cmd", ".pyc", ".pyd")
# Addresses that stand for those of a project that has no home yet.
PLACEHOLDER = re.compile(r"\bexample\.(org|com|net)\b|\.(example|invalid|test)\b")


def main(arguments: list[str] | None = None) -> int:
    """Run as a command: 0 built, 1 refused."""
    parser = argparse.ArgumentParser(description="Build the archive of the QGIS plugin.")
    parser.add_argument("--out", type=Path, default=ROOT / "dist", help="its folder; default dist")
    parser.add_argument("--publish", action="store_true", help="refuse placeholder addresses too")
    parser.add_argument("--requirements", action="store_true", help="print those and stop")
    given = parser.parse_args(arguments)
    if given.requirements:
        print("\n".join(requirements()))
        return 0
    archive = build(given.out)
    faults = refusals(archive, publish=given.publish)
    for fault in faults:
        print(f"make_zip: {fault}", file=sys.stderr)
    if faults:
        archive.unlink()
        return 1
    digest = hashlib.sha256(archive.read_bytes()).hexdigest()
    print(f"{archive}  {archive.stat().st_size:,} bytes  sha256 {digest}")
    return 0


def build(folder: Path) -> Path:
    """Write the archive into a folder and return its path.

    Parameters
    ----------
    folder : Path
        Made where it is missing.
    """
    folder.mkdir(parents=True, exist_ok=True)
    archive = folder / f"{PACKAGE}-{metadata(ROOT / 'plugin' / PACKAGE)['version']}.zip"
    with zipfile.ZipFile(archive, "w", zipfile.ZIP_DEFLATED, compresslevel=9) as file:
        for name, content in sorted(contents()):
            entry = zipfile.ZipInfo(f"{PACKAGE}/{name}", EPOCH)
            entry.compress_type = zipfile.ZIP_DEFLATED
            entry.create_system = 3
            entry.external_attr = 0o100644 << 16
            file.writestr(entry, content)
    return archive


def contents() -> Iterator[tuple[str, bytes]]:
    """Yield every file of the archive: its name below the package's folder, and what is in it."""
    yield from _files(ROOT / "plugin" / PACKAGE, "")
    for package in VENDORED:
        yield from _files(ROOT / package, f"_vendor/{PurePosixPath(package).name}/")
    yield "_vendor/LICENSE", (ROOT / "LICENSE").read_bytes()
    yield "requirements.txt", ("\n".join(requirements()) + "\n").encode()


def requirements() -> list[str]:
    """Return what the environment beside QGIS must hold, as pyproject.toml says it, sorted."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]
    found, extras = set(project["dependencies"]), ["panel"]
    for extra in extras:
        for line in project["optional-dependencies"][extra]:
            own = re.fullmatch(r"trigpoint\[(\w+)\]", line)
            if own is None:
                found.add(line)
            else:
                extras.append(own[1])
    # QGIS brings its own Qt: a second one in the same process would crash it.
    found.add(VTK)
    return sorted(line for line in found if not re.match(r"py(qt|side)\d", line, re.IGNORECASE))


def metadata(folder: Path) -> dict[str, str]:
    """Read the metadata.txt of a plugin's folder."""
    return _parsed((folder / "metadata.txt").read_text("utf-8"))


def refusals(archive: Path, *, publish: bool = False) -> list[str]:
    """Say why the plugin repository would refuse an archive, a sentence each; empty if it takes it.

    Parameters
    ----------
    archive : Path
    publish : bool
        Also ask for the addresses of a published project. That they answer is not asked here.
    """
    with zipfile.ZipFile(archive) as file:
        names = file.namelist()
        faults = [*_name_faults(names)]
        if archive.stat().st_size > LARGEST:
            faults.append(f"it has {archive.stat().st_size:,} bytes; at most {LARGEST:,} are taken")
        for needed in ("metadata.txt", "__init__.py", "LICENSE"):
            if f"{PACKAGE}/{needed}" not in names:
                faults.append(f"it has no {PACKAGE}/{needed}")
        if f"{PACKAGE}/metadata.txt" in names:
            text = file.read(f"{PACKAGE}/metadata.txt").decode("utf-8")
            faults += _metadata_faults(text, names, publish=publish)
    return faults


def _files(folder: Path, prefix: str) -> Iterator[tuple[str, bytes]]:
    for path in folder.rglob("*"):
        inside = path.relative_to(folder)
        if path.is_file() and "__pycache__" not in inside.parts:
            yield f"{prefix}{inside.as_posix()}", path.read_bytes()


def _name_faults(names: list[str]) -> Iterator[str]:
    tops = sorted({name.split("/")[0] for name in names})
    if tops != [PACKAGE]:
        yield f"its files lie in {', '.join(tops)}; one folder {PACKAGE} must hold them all"
    for name in names:
        path = PurePosixPath(name)
        hidden = any(part.startswith(".") for part in path.parts)
        if hidden or "\\" in name or path.is_absolute() or set(NEVER) & set(path.parts):
            yield f"{name} may not be in it"
        elif path.suffix.lower() in FLAGGED:
            yield f"{name} is a binary or a script of a shell"
    if len(set(names)) < len(names):
        yield "a file is in it twice"


def _metadata_faults(text: str, names: list[str], *, publish: bool) -> Iterator[str]:
    said = _parsed(text)
    for key in REQUIRED:
        if not said.get(key, "").strip():
            yield f"metadata.txt has no {key}"
    if "plugin" in said.get("name", "").lower():
        yield "its name holds the word plugin"
    description = said.get("description", "")
    if "\n" in description or re.search(r"<\w+", description):
        yield "its description is not one line of plain text"
    if "/" in said.get("author", ""):
        yield "its author holds a slash"
    if "supportsQt6" in said:
        yield "supportsQt6 is no longer read; qgisMaximumVersion=4.99 says it"
    if not re.fullmatch(r"\d+\.\d+(\.\d+)?", said.get("qgisMinimumVersion", "")):
        yield f"qgisMinimumVersion is {said.get('qgisMinimumVersion')!r}"
    if f"{PACKAGE}/{said.get('icon', '')}" not in names:
        yield f"there is no icon {said.get('icon')!r}"
    for key in ("tracker", "repository", "homepage", "email"):
        value = said.get(key, "")
        if key != "email" and value and not value.startswith("https://"):
            yield f"{key} is {value!r}, which is no https address"
        if publish and PLACEHOLDER.search(value):
            yield f"{key} is {value!r}, a placeholder"


def _parsed(text: str) -> dict[str, str]:
    parser = configparser.ConfigParser(interpolation=None)
    parser.optionxform = str  # type: ignore[method-assign,assignment]
    parser.read_string(text)
    return dict(parser["general"]) if parser.has_section("general") else {}


if __name__ == "__main__":
    sys.exit(main())
