"""project.toml, read into a frozen and checked Project."""

from __future__ import annotations

import datetime as dt
import difflib
import math
import tomllib
from collections.abc import Mapping
from dataclasses import MISSING, asdict, dataclass, fields
from pathlib import Path, PurePosixPath, PureWindowsPath
from typing import Any, NoReturn, TypeVar, get_args

from trigpoint.consensus import LAST_SEED, MOST_TRIALS, Method
from trigpoint.errors import ProjectError

Place = tuple[float, float, float]


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


CHOICES = {
    ("project", "status"): ("draft", "issued"),
    ("reconstruction", "kind"): ("neural", "photogrammetry"),
    ("alignment", "method"): get_args(Method),
}
# The smallest value allowed, and whether it is itself allowed.
LOWEST = {
    ("project", "revision"): (1, True),
    ("reference", "accuracy_m"): (0, False),
    ("alignment", "threshold_m"): (0, False),
    ("alignment", "trials"): (1, True),
    ("alignment", "seed"): (0, True),
    ("comparison", "voxel_m"): (0, True),
    ("comparison", "within_m"): (0, False),
    ("comparison", "zones"): (0, False),
    ("comparison", "margin_m"): (0, True),
    ("cross_check", "length_m"): (0, False),
    ("cross_check", "sigma_m"): (0, False),
    ("cross_check", "sigma_deg"): (0, False),
}
# The largest value allowed.
HIGHEST = {
    ("project", "revision"): 999_999_999,
    ("alignment", "trials"): MOST_TRIALS,
    ("alignment", "seed"): LAST_SEED,
}
# Of a name that becomes part of file names, which most systems hold to 255 bytes.
LONGEST = 100
SHOWN = 80
# The ends of a scale bar, as the file names them: 'from' can't be the name of a field.
BAR_ENDS = {"from": "start", "to": "end"}
WRITTEN = {("cross_check", field): key for key, field in BAR_ENDS.items()}
Section = TypeVar("Section")
Number = TypeVar("Number", bound=float)
NAME = "letters, digits, '.', '_' and '-', and starts with a letter or digit"


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
    about = _fill(About, tables.get("project", {}), "project", folder)
    _check_name(about.id, "[project] id")
    reconstructions = tuple(
        _fill(ReconstructionInput, table, "reconstruction", folder)
        for table in _tables(tables, "reconstruction")
    )
    project = Project(
        path,
        about,
        _fill(ReferenceInput, tables.get("reference", {}), "reference", folder),
        reconstructions,
        _fill(AlignmentSettings, tables.get("alignment", {}), "alignment", folder),
        _fill(ComparisonSettings, tables.get("comparison", {}), "comparison", folder),
        tuple(_cross_check(table, folder) for table in _tables(tables, "cross_check")),
        tuple(_fill(Limit, table, "limit", folder) for table in _tables(tables, "limit")),
    )
    _check_whole(project)
    return project


def refuse_unknown(table: Mapping[str, object], known: tuple[str, ...], where: str) -> None:
    """Raise ProjectError for a key that `known` lacks, with the nearest name that it has."""
    for key in table:
        if key not in known:
            near = difflib.get_close_matches(key, known, n=1)
            hint = f" Did you mean '{near[0]}'?" if near else f" Known: {', '.join(known)}."
            message = f"{where} has an unknown key '{key}'.{hint}"
            raise ProjectError(message)


def _tables(tables: Mapping[str, Any], name: str) -> list[dict[str, Any]]:
    value = tables.get(name, [])
    if not isinstance(value, list) or not all(isinstance(table, dict) for table in value):
        message = f"[{name}] must be written [[{name}]]: there may be several."
        raise ProjectError(message)
    return value


def _fill(section: type[Section], table: Mapping[str, Any], name: str, folder: Path) -> Section:
    """Build one table's dataclass, each value checked against its field's type and bounds."""
    if not isinstance(table, dict):
        message = f"[{name}] must be a table, not {table!r}."
        raise ProjectError(message)
    declared = {field.name: field for field in fields(section)}  # type: ignore[arg-type]
    refuse_unknown(table, tuple(declared), f"[{name}]")
    values = {}
    for key, field in declared.items():
        if key in table:
            values[key] = _value(table[key], str(field.type), (name, key), folder)
        elif field.default is MISSING:
            message = f"[{name}] lacks '{WRITTEN.get((name, key), key)}'."
            raise ProjectError(message)
    return section(**values)


def _value(value: Any, kind: str, where: tuple[str, str], folder: Path) -> Any:
    """Check one value against its field's type, and convert it."""
    label = f"[{where[0]}] {WRITTEN.get(where, where[1])}"
    if kind == "float | None" and where == ("comparison", "margin_m") and value == "none":
        return None
    if kind == "bool":
        return _expect(value, bool, label, "true or false")
    if kind == "int":
        if isinstance(value, bool):
            _fail(label, value, "a whole number")
        return _bounded(_expect(value, int, label, "a whole number"), where, label)
    if kind.startswith("float"):
        return _bounded(_number(value, label), where, label)
    if kind == "tuple[Path, ...]":
        texts = _expect(value, list, label, "a list of paths in quotes")
        return tuple(
            _inside(_expect(each, str, label, "paths in quotes"), folder, label) for each in texts
        )
    if kind == "tuple[Place, ...]":
        if not isinstance(value, list) or not value:
            _fail(label, value, "a list of places")
        return tuple(_place(item, where, label) for item in value)
    if kind == "Place":
        return _place(value, where, label)
    if kind.startswith("tuple[float"):
        if not isinstance(value, list) or not value:
            _fail(label, value, "a list of numbers")
        return tuple(_bounded(_number(item, label), where, label) for item in value)
    if kind.startswith("dt.date"):
        if isinstance(value, dt.datetime):
            _fail(label, value, "a date such as 2026-09-21")
        return _expect(value, dt.date, label, "a date such as 2026-09-21, without quotes")
    text: str = _expect(value, str, label, "text in quotes")
    if kind.startswith("Path"):
        if not text and "None" in kind:
            return None
        return _inside(text, folder, label)
    if where in CHOICES and text not in CHOICES[where]:
        _fail(label, text, f"one of {', '.join(CHOICES[where])}")
    return text


def _place(value: Any, where: tuple[str, str], label: str) -> Place:
    if not isinstance(value, list | tuple) or len(value) != 3:
        _fail(label, value, "three numbers")
    x, y, z = (_bounded(_number(item, label), where, label) for item in value)
    return x, y, z


def _expect(value: Any, kind: type, label: str, wanted: str) -> Any:
    if not isinstance(value, kind):
        _fail(label, value, wanted)
    return value


def _number(value: Any, label: str) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float):
        _fail(label, value, "a finite number")
    try:
        number = float(value)
    except OverflowError:  # a whole number of hundreds of digits
        number = math.inf
    if not math.isfinite(number):
        _fail(label, value, "a finite number")
    return number


def _bounded(value: Number, where: tuple[str, str], label: str) -> Number:
    lowest, allowed = LOWEST.get(where, (-math.inf, True))
    if value < lowest or (value == lowest and not allowed):
        _fail(label, value, f"{'at least' if allowed else 'above'} {lowest}")
    if value > (highest := HIGHEST.get(where, math.inf)):
        _fail(label, value, f"at most {highest:,}")
    return value


def _fail(label: str, value: object, wanted: str) -> NoReturn:
    try:
        shown = repr(value)
    except ValueError:  # Python writes no whole number of thousands of digits
        shown = "too large a number"
    shown = shown if len(shown) <= SHOWN else f"{shown[:SHOWN]}..."
    message = f"{label} is {shown}; it must be {wanted}."
    raise ProjectError(message)


def _inside(text: str, folder: Path, label: str) -> Path:
    """Return the absolute path meant; a relative one may not climb out of the project's folder."""
    if not text:
        _fail(label, text, "the path of a file")
    if "\0" in text:
        _fail(label, text, "a path that a file can have, without NUL")
    # A file made on Windows is read on Linux, and the other way round.
    if PureWindowsPath(text).is_absolute() or PurePosixPath(text).is_absolute():
        return Path(text)
    path = Path(text.replace("\\", "/"))
    if not (folder / path).resolve().is_relative_to(folder.resolve()):
        message = (
            f"{label} is {text!r}, which leaves the project's folder. Put the file into the "
            "folder, or give its absolute path."
        )
        raise ProjectError(message)
    return folder / path


def _written(check: Check) -> dict[str, Any]:
    def listed(value: Any) -> Any:
        return [listed(item) for item in value] if isinstance(value, tuple) else value

    return {key: listed(value) for key, value in asdict(check).items()}


def _cross_check(table: Mapping[str, Any], folder: Path) -> Check:
    values = {key: value for key, value in table.items() if key != "kind"}
    kind = table.get("kind")
    if kind == "scale_bar":
        known = ("kind", "from", "to", "length_m", "sigma_m", "of")
        refuse_unknown(table, known, "[cross_check]")
        values = {BAR_ENDS.get(key, key): value for key, value in values.items()}
        bar = _fill(ScaleBar, values, "cross_check", folder)
        if bar.start == bar.end:
            _fail("[cross_check] to", list(bar.end), "another point than 'from'")
        return bar
    if kind == "up_direction":
        found = _fill(UpDirection, values, "cross_check", folder)
        if not any(found.up):
            _fail("[cross_check] up", list(found.up), "a direction: not zero")
        return found
    if kind == "camera_positions":
        if not isinstance(values.get("sigma_m", []), list):  # one for all three axes
            values["sigma_m"] = [values["sigma_m"]] * 3
        cameras = _fill(CameraPositions, values, "cross_check", folder)
        if len(cameras.source) != len(cameras.target_m):
            message = (
                f"[cross_check] has {len(cameras.source)} places in 'source' and "
                f"{len(cameras.target_m)} in 'target_m': they must be the same cameras."
            )
            raise ProjectError(message)
        return cameras
    _fail("[cross_check] kind", kind, "one of scale_bar, up_direction, camera_positions")


def _check_name(name: str, label: str) -> None:
    allowed = set("abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789._-")
    if not name or not set(name) <= allowed or name[0] in "._-":
        # It becomes part of file names, so it is kept to what every system can write.
        _fail(label, name, f"a name of {NAME}")
    if len(name) > LONGEST:
        _fail(label, name, f"at most {LONGEST} characters, not {len(name)}")


def _check_whole(project: Project) -> None:
    """Check what no single value shows."""
    if not project.reconstructions:
        message = "The project has no [[reconstruction]]; it needs at least one."
        raise ProjectError(message)
    names = [each.name for each in project.reconstructions]
    for name in names:
        _check_name(name, "[reconstruction] name")
        if names.count(name) > 1:
            message = f"Two [[reconstruction]] tables are named '{name}'; names must differ."
            raise ProjectError(message)
    within, zones = project.comparison.within_m, project.comparison.zones
    if len(set(within)) < len(within):
        _fail("[comparison] within_m", list(within), "thresholds that differ")
    if list(zones) != sorted(set(zones)) or zones[-1] >= 1:
        _fail("[comparison] zones", list(zones), "fractions between 0 and 1 that rise")
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
            _fail("[cross_check] of", check.of, wanted)
    for limit in project.limits:
        if limit.of not in names:
            _fail("[limit] of", limit.of, f"one of {', '.join(names)}")
        if (limit.max is None) == (limit.min is None):
            message = f"[limit] on {limit.quantity} needs either 'max' or 'min', and not both."
            raise ProjectError(message)
