"""Values of a project file: each of the right type, in its range, inside the project's folder."""

from __future__ import annotations

import datetime as dt
import difflib
import math
from collections.abc import Mapping
from dataclasses import MISSING, fields
from pathlib import Path, PurePosixPath, PureWindowsPath
from typing import Any, NoReturn, TypeVar, get_args

from trigpoint.consensus import LAST_SEED, MOST_TRIALS, Method
from trigpoint.errors import ProjectError

Place = tuple[float, float, float]

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


def fill(section: type[Section], table: Mapping[str, Any], name: str, folder: Path) -> Section:
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
            fail(label, value, "a whole number")
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
            fail(label, value, "a list of places")
        return tuple(_place(item, where, label) for item in value)
    if kind == "Place":
        return _place(value, where, label)
    if kind.startswith("tuple[float"):
        if not isinstance(value, list) or not value:
            fail(label, value, "a list of numbers")
        return tuple(_bounded(_number(item, label), where, label) for item in value)
    if kind.startswith("dt.date"):
        if isinstance(value, dt.datetime):
            fail(label, value, "a date such as 2026-09-21")
        return _expect(value, dt.date, label, "a date such as 2026-09-21, without quotes")
    text: str = _expect(value, str, label, "text in quotes")
    if kind.startswith("Path"):
        if not text and "None" in kind:
            return None
        return _inside(text, folder, label)
    if where in CHOICES and text not in CHOICES[where]:
        fail(label, text, f"one of {', '.join(CHOICES[where])}")
    return text


def _place(value: Any, where: tuple[str, str], label: str) -> Place:
    if not isinstance(value, list | tuple) or len(value) != 3:
        fail(label, value, "three numbers")
    x, y, z = (_bounded(_number(item, label), where, label) for item in value)
    return x, y, z


def _expect(value: Any, kind: type, label: str, wanted: str) -> Any:
    if not isinstance(value, kind):
        fail(label, value, wanted)
    return value


def _number(value: Any, label: str) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float):
        fail(label, value, "a finite number")
    try:
        number = float(value)
    except OverflowError:  # a whole number of hundreds of digits
        number = math.inf
    if not math.isfinite(number):
        fail(label, value, "a finite number")
    return number


def _bounded(value: Number, where: tuple[str, str], label: str) -> Number:
    lowest, allowed = LOWEST.get(where, (-math.inf, True))
    if value < lowest or (value == lowest and not allowed):
        fail(label, value, f"{'at least' if allowed else 'above'} {lowest}")
    if value > (highest := HIGHEST.get(where, math.inf)):
        fail(label, value, f"at most {highest:,}")
    return value


def fail(label: str, value: object, wanted: str) -> NoReturn:
    """Raise ProjectError: what a value is, and what it must be."""
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
        fail(label, text, "the path of a file")
    if "\0" in text:
        fail(label, text, "a path that a file can have, without NUL")
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


def refuse_unknown(table: Mapping[str, object], known: tuple[str, ...], where: str) -> None:
    """Raise ProjectError for a key that `known` lacks, with the nearest name that it has."""
    for key in table:
        if key not in known:
            near = difflib.get_close_matches(key, known, n=1)
            hint = f" Did you mean '{near[0]}'?" if near else f" Known: {', '.join(known)}."
            message = f"{where} has an unknown key '{key}'.{hint}"
            raise ProjectError(message)


def check_name(name: str, label: str) -> None:
    """Raise ProjectError for a name that can't be part of a file's name on every system."""
    allowed = set("abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789._-")
    if not name or not set(name) <= allowed or name[0] in "._-":
        fail(label, name, f"a name of {NAME}")
    if len(name) > LONGEST:
        fail(label, name, f"at most {LONGEST} characters, not {len(name)}")
