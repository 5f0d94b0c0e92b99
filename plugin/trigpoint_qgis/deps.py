"""The Python packages that QGIS does not bring: where they are, and what is missing and why."""

from __future__ import annotations

import os
import re
import site
import sys
from collections.abc import Iterable
from dataclasses import dataclass
from importlib import import_module, invalidate_caches, metadata
from importlib.util import find_spec
from pathlib import Path

HERE = Path(__file__).resolve().parent
VENDOR = HERE / "_vendor"
REQUIREMENTS = HERE / "requirements.txt"
# Below the profile and not below the plugin: Windows locks what is loaded, and a locked plugin
# can be neither updated nor removed.
OWN = Path("python") / "trigpoint-env"

ENGINE = {
    "numpy": "1.24",
    "scipy": "1.10",
    "pandas": "2.0",
    "pyproj": "3.4",
    "shapely": "2.0",
    "laspy": "2.5",
    "lazrs": "0.5",
    "plyfile": "1.0",
    "pykdtree": "1.4",
}
VIEWS = {"vtk": "9.4.2", "pyvista": "0.44", "pyvistaqt": "0.13", "qtpy": "2.4"}
PANEL = ENGINE | VIEWS
REPORT = ENGINE | {
    "typer": "0.20",
    "rich": "13",
    "pyogrio": "0.8",
    "ipykernel": "6.29",
    "jinja2": "3.1",
    "jupyter-client": "8",
    "matplotlib": "3.8",
    "mistune": "3",
    "nbclient": "0.10",
    "nbconvert": "7.16",
    "nbformat": "5.10",
    "packaging": "23",
    "pillow": "10",
    "pyvista": "0.44",
    "traitlets": "5.14",
    "weasyprint": "70",
}
# What the least version is for, where it is not just what was tested.
REASONS = {"vtk": "an older one crashes QGIS when it quits"}
# They bring GEOS, GDAL and PROJ.
BOUND = ("shapely", "pyogrio", "pyproj")
SIZE = "about 1.2 GB"


@dataclass(frozen=True)
class Lack:
    """A package that is missing or too old.

    Attributes
    ----------
    name : str
    least : str
        The version needed.
    found : str or None
        The version there is.
    """

    name: str
    least: str
    found: str | None

    def __str__(self) -> str:
        """Say it in a few words."""
        if self.found is None:
            return f"{self.name} is missing"
        reason = REASONS.get(self.name)
        because = f": {reason}" if reason else ""
        return f"{self.name} is {self.found} and must be {self.least} or later{because}"


class FolderError(Exception):
    """A folder can't serve as the environment; the message says why."""


@dataclass(frozen=True)
class Environment:
    """A folder of packages beside QGIS.

    Attributes
    ----------
    packages : Path
        The folder that modules are imported from.
    python : Path or None
        Its own interpreter; None for a bare folder of packages.
    """

    packages: Path
    python: Path | None


def lacking(packages: dict[str, str], first: Environment | None = None) -> tuple[Lack, ...]:
    """Say which packages are missing or too old; nothing is imported.

    Parameters
    ----------
    packages : dict of str to str
        The least version of each.
    first : Environment, optional
        Asked before QGIS's own, as its own interpreter does.
    """
    invalidate_caches()
    found = ((name, least, _version(name, first)) for name, least in packages.items())
    return tuple(
        Lack(name, least, version)
        for name, least, version in found
        if version is None or (version and _older(version, least))
    )


def listed(lacks: Iterable[Lack]) -> str:
    """Name what is missing, and what is too old with the reason; a line each."""
    every = tuple(lacks)
    missing = ", ".join(lack.name for lack in every if lack.found is None)
    old = [f"{lack}." for lack in every if lack.found is not None]
    return "\n".join([f"Missing: {missing}."] * bool(missing) + old)


def explain(lacks: Iterable[Lack]) -> str:
    """Put what is missing and what to do about it in some sentences; empty if nothing is."""
    said = listed(lacks).replace("\n", " ")
    if not said:
        return ""
    # What to do comes first: a dialog's bar shows a line and a half.
    return (
        "Open Plugins > Trigpoint > Trigpoint panel to install Python packages that QGIS does not "
        f"bring. {said}"
    )


def find_environment(folder: Path) -> Environment:
    """Find the packages in a virtual environment, or take a folder of packages as it is.

    Raises
    ------
    FolderError
        If the folder is neither, or belongs to another Python than the one running.
    """
    if not folder.is_dir():
        message = f"{folder} is not a folder."
        raise FolderError(message)
    running = f"{sys.version_info.major}.{sys.version_info.minor}"
    settings = folder / "pyvenv.cfg"
    if not settings.is_file():
        if any(folder.glob("*.dist-info")):
            return Environment(folder, None)
        message = f"{folder} is neither a virtual environment nor a folder of Python packages."
        raise FolderError(message)
    stated = re.search(r"^version(?:_info)?\s*=\s*(\d+\.\d+)", settings.read_text("utf-8"), re.M)
    if stated is not None and stated[1] != running:
        message = f"{folder} belongs to Python {stated[1]} and QGIS runs {running}: make it anew."
        raise FolderError(message)
    for packages, python in (
        (folder / "lib" / f"python{running}" / "site-packages", folder / "bin" / "python"),
        (folder / "Lib" / "site-packages", folder / "Scripts" / "python.exe"),
    ):
        if packages.is_dir() and python.exists():
            return Environment(packages, python)
    message = f"{folder} holds no packages for Python {running}: make it anew."
    raise FolderError(message)


def locate(chosen: str, profile: Path) -> Environment | None:
    """Return the environment that the user chose, else the one made in the profile, else None.

    Raises
    ------
    FolderError
        If it can't be used.
    """
    if chosen:
        return find_environment(Path(chosen))
    own = profile / OWN
    return find_environment(own) if own.is_dir() else None


_attached: list[Environment] = []
# What they put on sys.path.
_added: list[str] = []


def attached() -> Environment | None:
    """Return the environment that was attached last."""
    return _attached[-1] if _attached else None


def attach(environment: Environment | None) -> None:
    """Let the plugin's own packages and those of the environment be imported.

    They come after everything that QGIS brings: another numpy in front of QGIS's own would break
    its scipy and its GDAL bindings. An environment that was attached before makes room.
    """
    if VENDOR.is_dir() and str(VENDOR) not in sys.path:
        sys.path.append(str(VENDOR))
    if environment != attached():
        sys.path[:] = [entry for entry in sys.path if entry not in _added]
        _added.clear()
        _attached[:] = [] if environment is None else [environment]
    if environment is not None and str(environment.packages) not in sys.path:
        before = list(sys.path)
        site.addsitedir(str(environment.packages))
        # What its .pth files put in front goes to the end too.
        _added[:] = [entry for entry in sys.path if entry not in before]
        sys.path[:] = before + _added
    invalidate_caches()


def load() -> None:
    """Import what brings its own build of a library that QGIS has loaded too, bound to its own.

    QGIS puts its GEOS and GDAL where every module loaded after them finds them first. A shapely
    that was built for another GEOS then calls both, and takes QGIS down with it.
    """
    deep = getattr(os, "RTLD_DEEPBIND", 0)
    before = sys.getdlopenflags() if deep else 0
    if deep:
        sys.setdlopenflags(before | deep)
    try:
        for name in BOUND:
            if find_spec(name) is not None:
                import_module(name)
    finally:
        if deep:
            sys.setdlopenflags(before)


def detach() -> None:
    """Forget the plugin's own packages, so that its next version is not mixed with this one."""
    attach(None)
    inside = str(VENDOR)
    own = f"{__name__.partition('.')[0]}."
    for name, module in list(sys.modules.items()):
        # QGIS itself forgets most of the plugin's modules, and leaves some of its packages.
        place = str(getattr(module, "__file__", None) or "")
        if place.startswith(inside) or name.startswith(own):
            del sys.modules[name]
    if inside in sys.path:
        sys.path.remove(inside)


def _version(name: str, first: Environment | None = None) -> str | None:
    """Return the version of a package, empty if it has none, None if it is missing."""
    if first is not None:
        for there in metadata.distributions(name=name, path=[str(first.packages)]):
            return there.version
    try:
        return metadata.version(name)
    except metadata.PackageNotFoundError:
        return "" if find_spec(name.replace("-", "_")) is not None else None


def _older(version: str, least: str) -> bool:
    one, other = (
        [int(part) for part in re.findall(r"\d+", text.split("+")[0])[:3]]
        for text in (version, least)
    )
    return one < other
