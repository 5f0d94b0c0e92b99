"""Numbers as they are printed: one rounding for each path of results.json, wherever it appears."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from trigpoint.canonical import to_json, write_text
from trigpoint_reporting.blocks import Value

NOT_AVAILABLE = "not available"
MINUS = "\N{MINUS SIGN}"

# Decimals of the paths that a pattern fits whole; the first that fits decides. None: as many as
# the number has. What no pattern fits is a count or is printed with all its decimals.
RULES: tuple[tuple[str, int | None], ...] = (
    (r"project\.settings\.(?s:.*)", None),  # as a person set them
    (r"criteria\.\d+\.(found|margin)", None),  # as the quantity that they are about
    (r"(?s:.*)\.threshold_m", None),
    (r"(?s:.*)\.block_m\.\w+", None),
    (r"(?s:.*)\.to_metre\.\d", None),
    (r"(?s:.*)\.alignment\.rotation(\.\d){2}", 9),
    (r"(?s:.*)\.alignment\.matrix\.\d\.[012]", 9),
    (r"(?s:.*)\.alignment\.(translation|matrix\.\d)\.\d", 3),
    (r"(?s:.*)\.(scale|scale_low|scale_high|grid_scale|combined_factor)", 6),
    (r"(?s:.*)\.(longitude|latitude)_deg", 6),
    (r"(?s:.*)\.(height_effect_ppm|mm_over_100_m)", 1),
    (r"(?s:.*)\.cross_checks\.\d+\.(discrepancy|sigma)", 4),
    (r"(?s:.*)\.repeats\.\d+\.(sigma|sigma_low|sigma_high)", 4),
    (r"(?s:.*)\.(global_|bias_)?p_value", 4),
    (r"(?s:.*)\.(redundancy|standardised)", 2),
    (r"(?s:.*)\.(max_scale_change_pct|scale_change_pct)", 3),
    (r"(?s:.*)_deg(\.\d)?", 3),
    (r"(?s:.*)[._]pct", 1),
    (r"(?s:.*)\.next_picks\.\d+\.[xyz]", 3),
    (r"(?s:.*)_m(\.\d)?", 3),
)
_COMPILED = tuple((re.compile(pattern), digits) for pattern, digits in RULES)


@lru_cache(maxsize=4096)
def declared_digits(path: str) -> int | None:
    """Return how many decimals the number at a path is printed with; None: all that it has.

    Examples
    --------
    >>> declared_digits("reconstructions.nerf.alignment.rmse_m")
    3
    >>> declared_digits("project.settings.comparison.voxel_m") is None
    True
    """
    return next((digits for rule, digits in _COMPILED if rule.fullmatch(path)), None)


def write_rounding(path: Path) -> None:
    """Write the declared rounding as ``rounding.json``, for a verifier that knows nothing of us."""
    rules = [{"pattern": pattern, "digits": digits} for pattern, digits in RULES]
    write_text(path, to_json({"rules": rules}))


def number_text(value: float | None, digits: int | None = None) -> str:
    """Write a number: counts in groups of three, a true minus, never an exponent.

    Parameters
    ----------
    value : int, float or None
    digits : int or None, optional
        Decimals; by default all that the number has. A count has none.

    Examples
    --------
    >>> number_text(-0.1374, 3), number_text(532598), number_text(1.5e-7), number_text(None)
    ('−0.137', '532,598', '0.00000015', 'not available')
    """
    if value is None or not np.isfinite(value):
        return NOT_AVAILABLE
    if isinstance(value, int):
        text = f"{value:,}"
    elif digits is None:
        text = np.format_float_positional(value, trim="-")
    else:
        text = f"{round(value, digits) + 0.0:.{digits}f}"  # no negative zero
    return text.replace("-", MINUS)


def derived(value: float | None, digits: int) -> Value:
    """Print a number that is worked out from what results.json holds, and stands nowhere in it."""
    return Value(number_text(value, digits))


@dataclass(frozen=True, slots=True, eq=False)
class Numbers:
    """Part of results.json, which prints what it holds with the path where that stands.

    Attributes
    ----------
    stored : object
        The part: a mapping, a list or a single value.
    path : str
        Where it stands; None where no path can say so, such as a row whose id holds a bracket.

    Examples
    --------
    >>> found = Numbers({"nerf": {"rmse_m": 0.13712, "n": 6}}).below("nerf")
    >>> found.value("rmse_m")
    Value(text='0.137', path='nerf.rmse_m')
    """

    stored: Any
    path: str | None = ""

    def __getitem__(self, key: str) -> Any:
        """Return a value as it is stored."""
        return self.stored[key]

    def below(self, *keys: str | int) -> Numbers:
        """Return the part under these keys; an integer is a row's position."""
        part = self
        for key in keys:
            part = part._row(key) if isinstance(key, int) else part._entry(key)
        return part

    def value(self, *keys: str | int) -> Value:
        """Print the number or word under these keys; what is missing is not available."""
        part = self.below(*keys)
        path, value = part.path or "", part.stored
        if isinstance(value, str):
            # A path promises that the text is what is stored, and not every text can be printed.
            return Value(value, path if value.isprintable() and value == value.strip() else "")
        rounded_as = path or "".join(f".{key}" for key in keys)
        return Value(number_text(value, declared_digits(rounded_as)), path)

    def rows(self, *keys: str | int) -> list[Numbers]:
        """Return the rows of the list under these keys."""
        part = self.below(*keys)
        return [part._row(position) for position in range(len(part.stored or ()))]

    def items(self, *keys: str | int) -> Iterator[tuple[str, Numbers]]:
        """Yield the names and parts of the mapping under these keys."""
        part = self.below(*keys)
        yield from ((name, part._entry(name)) for name in part.stored or ())

    def _entry(self, key: str) -> Numbers:
        value = self.stored.get(key) if isinstance(self.stored, Mapping) else None
        known = isinstance(self.stored, Mapping) and key in self.stored and self.path is not None
        return Numbers(value, f"{self.path}.{key}".lstrip(".") if known else None)

    def _row(self, position: int) -> Numbers:
        if self.stored is None:
            return Numbers(None, None)
        row = self.stored[position]
        label = _label(self.stored, position)
        return Numbers(row, None if label is None or self.path is None else self.path + label)


def _label(rows: Sequence[Any], position: int) -> str | None:
    """Return how a path names a row: by id or threshold where it has one, else by position."""
    row = rows[position]
    names = [str(position)]
    if isinstance(row, Mapping):
        stated = row.get("id", row.get("threshold_m"))
        names = names if stated is None else [f"{stated}", *names]
    for name in names:
        safe = name.isprintable() and name == name.strip() and "]" not in name
        if safe and _found(rows, name) is row:
            return f".{name}" if name == str(position) else f"[{name}]"
    return None


def _found(rows: Sequence[Any], label: str) -> Any:
    """Return the row that a path means by a label: its id first, then its threshold."""
    number = float(label) if re.fullmatch(r"\d+(\.\d+)?", label) else None
    for row in rows:
        if isinstance(row, Mapping) and (
            row.get("id") == label or (number is not None and row.get("threshold_m") == number)
        ):
            return row
    return rows[int(label)] if label.isdigit() and int(label) < len(rows) else None
