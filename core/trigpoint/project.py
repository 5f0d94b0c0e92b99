"""project.toml, read into a frozen and checked Project."""

from __future__ import annotations

import datetime as dt
import tomllib
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from trigpoint.consensus import Method
from trigpoint.entries import BAR_ENDS, Place, check_name, fail, fill, refuse_unknown
from trigpoint.errors import ProjectError


@dataclass(frozen=True, slots=True)
class About:
    """Who made this, what of, and for what: the ``[project]`` table."""

    id: str
    title: str = ""
    site: str = ""
    client: str = ""
    surveyor: str = ""
    organisation: str = ""
    purpose: str = ""
    limitations: str = ""
    status: str = "draft"
    revision: int = 1
    date: dt.date | None = None


@dataclass(frozen=True, slots=True)
class ReferenceInput:
    """The georeferenced cloud that everything is measured against."""

    path: Path
    name: str = "reference"
    crs: str = ""
    vertical_crs: str = ""
    captured: str = ""
    accuracy_m: float | None = None
    accuracy_source: str = ""
    region: Path | None = None


@dataclass(frozen=True, slots=True)
class ReconstructionInput:
    """A cloud to judge: in its own frame if it has picks, else in the reference's CRS."""

    name: str
    path: Path
    kind: str = "neural"
    picks: Path | None = None
    picks_repeated: tuple[Path, ...] = ()


@dataclass(frozen=True, slots=True)
class AlignmentSettings:
    """How the similarity is fitted, and whether each georeferenced point is given its sigma."""

    method: Method = "ransac"
    threshold_m: float = 0.50
    trials: int = 10_000
    seed: int = 42
    weighted: bool = False
    sigma: bool = False


@dataclass(frozen=True, slots=True)
class ComparisonSettings:
    """How the clouds are compared; a margin of None crops nothing."""

    voxel_m: float = 0.10
    within_m: tuple[float, ...] = (0.05, 0.10, 0.20)
    zones: tuple[float, ...] = (0.33, 0.66)
    margin_m: float | None = 1.0
    icp: bool = True
    intervals: bool = True


@dataclass(frozen=True, slots=True)
class ScaleBar:
    """Two source points a known length apart; it enters no fit."""

    start: Place
    end: Place
    length_m: float
    sigma_m: float
    of: str = ""

    @property
    def table(self) -> dict[str, Any]:
        """As it stands in the file."""
        start, end, *rest = _written(self).items()
        return {"kind": "scale_bar", "from": start[1], "to": end[1], **dict(rest)}


@dataclass(frozen=True, slots=True)
class UpDirection:
    """A source direction that is known to point up; it enters no fit."""

    up: Place
    sigma_deg: float
    of: str = ""

    @property
    def table(self) -> dict[str, Any]:
        """As it stands in the file."""
        return {"kind": "up_direction", **_written(self)}


@dataclass(frozen=True, slots=True)
class CameraPositions:
    """Camera centres in the source frame, and where GNSS had them; they enter no fit."""

    source: tuple[Place, ...]
    target_m: tuple[Place, ...]
    sigma_m: Place
    of: str = ""

    @property
    def table(self) -> dict[str, Any]:
        """As it stands in the file."""
        return {"kind": "camera_positions", **_written(self)}


Check = ScaleBar | UpDirection | CameraPositions
CHECKS = ("scale_bar", "up_direction", "camera_positions")


@dataclass(frozen=True, slots=True)
class Limit:
    """One of the user's own limits: the quantity is a path into a reconstruction's results."""

    quantity: str
    of: str
    source: str
    max: float | None = None
    min: float | None = None


@dataclass(frozen=True, slots=True)
class Project:
    """A whole project, checked; every path is absolute."""

    path: Path
    about: About
    reference: ReferenceInput
    reconstructions: tuple[ReconstructionInput, ...]
    alignment: AlignmentSettings
    comparison: ComparisonSettings
    cross_checks: tuple[Check, ...]
    limits: tuple[Limit, ...]


def read_project(path: str | Path) -> Project:
    """Read and check a project file.

    Parameters
    ----------
    path : path
        A project.toml, or the folder that holds it. Paths inside it are relative to its folder and
        stay in it, or are absolute.

    Raises
    ------
    ProjectError
        If the file is missing, is not TOML, or holds an unknown key, a wrong type, a value out of
        range or a path that leaves its folder. The message names the table and the key.
    """
    path = Path(path).absolute()
    if path.is_dir():
        path /= "project.toml"
    try:
        tables = tomllib.loads(path.read_text(encoding="utf-8-sig"))
    except (OSError, UnicodeDecodeError) as error:
        reason = error.strerror if isinstance(error, OSError) else "it is not UTF-8 text"
        message = f"{path.name} can't be read: {reason}."
        raise ProjectError(message) from error
    except tomllib.TOMLDecodeError as error:
        message = f"{path.name} is not valid TOML: {error}."
        raise ProjectError(message) from error
    except (RecursionError, ValueError) as error:
        # Python's own limits, which its TOML reader lets through.
        depth = isinstance(error, RecursionError)
        reason = "brackets too deep" if depth else "a number or a date that can't be"
        message = f"{path.name} can't be read: it holds {reason}."
        raise ProjectError(message) from error

    return project_from(tables, path)


def project_from(tables: Mapping[str, Any], path: str | Path) -> Project:
    """Check the tables of a project file, read or made, as `read_project` does.

    Parameters
    ----------
    tables : mapping
        As TOML has them.
    path : path
        Of the file that they are, or are to be, in: its folder is what paths are relative to.

    Raises
    ------
    ProjectError
        As `read_project` does, but for reading the file.
    """
    path = Path(path).absolute()
    known = (
        "project",
        "reference",
        "reconstruction",
        "alignment",
        "comparison",
        "cross_check",
        "limit",
    )
    refuse_unknown(tables, known, "the file")
    folder = path.parent
    about = fill(About, tables.get("project", {}), "project", folder)
    check_name(about.id, "[project] id")
    reconstructions = tuple(
        fill(ReconstructionInput, table, "reconstruction", folder)
        for table in _tables(tables, "reconstruction")
    )
    project = Project(
        path,
        about,
        fill(ReferenceInput, tables.get("reference", {}), "reference", folder),
        reconstructions,
        fill(AlignmentSettings, tables.get("alignment", {}), "alignment", folder),
        fill(ComparisonSettings, tables.get("comparison", {}), "comparison", folder),
        tuple(_cross_check(table, folder) for table in _tables(tables, "cross_check")),
        tuple(fill(Limit, table, "limit", folder) for table in _tables(tables, "limit")),
    )
    _check_whole(project)
    return project


def _tables(tables: Mapping[str, Any], name: str) -> list[dict[str, Any]]:
    value = tables.get(name, [])
    if not isinstance(value, list) or not all(isinstance(table, dict) for table in value):
        message = f"[{name}] must be written [[{name}]]: there may be several."
        raise ProjectError(message)
    return value


def _written(check: Check) -> dict[str, Any]:
    def listed(value: Any) -> Any:
        return [listed(item) for item in value] if isinstance(value, tuple) else value

    return {key: listed(value) for key, value in asdict(check).items()}


def _cross_check(table: Mapping[str, Any], folder: Path) -> Check:
    values = {key: value for key, value in table.items() if key != "kind"}
    kind = table.get("kind")
    if kind not in CHECKS:
        fail("[cross_check] kind", kind, f"one of {', '.join(CHECKS)}")
    if kind == "scale_bar":
        known = ("kind", "from", "to", "length_m", "sigma_m", "of")
        refuse_unknown(table, known, "[cross_check]")
        values = {BAR_ENDS.get(key, key): value for key, value in values.items()}
        bar = fill(ScaleBar, values, "cross_check", folder)
        if bar.start == bar.end:
            fail("[cross_check] to", list(bar.end), "another point than 'from'")
        return bar
    if kind == "up_direction":
        found = fill(UpDirection, values, "cross_check", folder)
        if not any(found.up):
            fail("[cross_check] up", list(found.up), "a direction: not zero")
        return found
    if not isinstance(values.get("sigma_m", []), list):  # one for all three axes
        values["sigma_m"] = [values["sigma_m"]] * 3
    cameras = fill(CameraPositions, values, "cross_check", folder)
    if len(cameras.source) != len(cameras.target_m):
        message = (
            f"[cross_check] has {len(cameras.source)} places in 'source' and "
            f"{len(cameras.target_m)} in 'target_m': they must be the same cameras."
        )
        raise ProjectError(message)
    return cameras


def _check_whole(project: Project) -> None:
    """Check what no single value shows."""
    if not project.reconstructions:
        message = "The project has no [[reconstruction]]; it needs at least one."
        raise ProjectError(message)
    names = [each.name for each in project.reconstructions]
    for name in names:
        check_name(name, "[reconstruction] name")
        if names.count(name) > 1:
            message = f"Two [[reconstruction]] tables are named '{name}'; names must differ."
            raise ProjectError(message)
    within, zones = project.comparison.within_m, project.comparison.zones
    if len(set(within)) < len(within):
        fail("[comparison] within_m", list(within), "thresholds that differ")
    if list(zones) != sorted(set(zones)) or zones[-1] >= 1:
        fail("[comparison] zones", list(zones), "fractions between 0 and 1 that rise")
    if project.about.status == "issued" and project.about.date is None:
        message = "[project] date is missing; an issued project states its date."
        raise ProjectError(message)
    for each in project.reconstructions:
        if each.picks_repeated and not each.picks:
            message = f"[reconstruction] {each.name} has picks_repeated and no picks: give both."
            raise ProjectError(message)
    picked = [each.name for each in project.reconstructions if each.picks]
    for check in project.cross_checks:
        if check.of not in picked and (check.of or len(picked) != 1):
            wanted = f"a reconstruction that has picks: {', '.join(picked)}"
            fail("[cross_check] of", check.of, wanted)
    for limit in project.limits:
        if limit.of not in names:
            fail("[limit] of", limit.of, f"one of {', '.join(names)}")
        if (limit.max is None) == (limit.min is None):
            message = f"[limit] on {limit.quantity} needs either 'max' or 'min', and not both."
            raise ProjectError(message)
