"""Picks: named pairs of points, with the files that they come in."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
import pyproj
from numpy.typing import ArrayLike, NDArray

from trigpoint.canonical import write_text
from trigpoint.cautions import Caution
from trigpoint.crs import conversion_cautions, metre_factors
from trigpoint.errors import PicksError
from trigpoint.foreign_picks import foreign_picks
from trigpoint.picktable import (
    SIGMAS,
    SOURCE,
    TARGET,
    PickTable,
    format_columns,
    parse_numbers,
    parse_table,
    refuse_extra,
)
from trigpoint.similarity import Points, are_coplanar, are_mirrored

ROLES = ("control", "check", "off")
# A plane and the scale need three; `reliability` says what more are worth.
FEWEST = 3

# Beyond this a float64 no longer holds tenths of a millimetre: it is no coordinate.
FARTHEST = 1e12
# Coordinates this large are a map's; a reconstruction's own frame stays near its origin.
GEOREFERENCED = 1e4
# A nanometre, and a pick that is not known at all: far beyond, weights no longer fit a float64.
SMALLEST_SIGMA, LARGEST_SIGMA = 1e-9, 1e6


@dataclass(frozen=True, slots=True, eq=False)
class Picks:
    """Pairs of points picked in a source and a target frame; `picks_from` builds and checks them.

    Attributes
    ----------
    ids : tuple of str
    source : ndarray of shape (n, 3)
        Source units.
    target : ndarray of shape (n, 3)
        Metres.
    roles : ndarray of shape (n,)
        ``control``, ``check`` or ``off``.
    sigma_source, sigma_target : ndarray of shape (n,)
        Standard deviation per axis in source units and in metres; NaN where it is not known.
    notes : tuple of str
    extra : DataFrame
        Other columns of the file, as text.
    cautions : tuple of Caution
        Doubts from reading; `examine` finds those in the picks themselves.
    """

    ids: tuple[str, ...]
    source: Points
    target: Points
    roles: NDArray[np.str_]
    sigma_source: NDArray[np.float64]
    sigma_target: NDArray[np.float64]
    notes: tuple[str, ...]
    extra: pd.DataFrame
    cautions: tuple[Caution, ...] = ()

    def __len__(self) -> int:
        """Count the picks, whatever their role."""
        return len(self.ids)

    @property
    def control(self) -> Picks:
        """The picks that a similarity is fitted to."""
        return self.take(self.roles == "control")

    @property
    def check(self) -> Picks:
        """The picks that enter nothing and test the fit."""
        return self.take(self.roles == "check")

    def take(self, index: NDArray[np.bool_] | NDArray[np.intp]) -> Picks:
        """Keep some picks, by mask or by position."""
        rows = np.arange(len(self))[index]
        return Picks(
            tuple(self.ids[row] for row in rows),
            self.source[rows],
            self.target[rows],
            self.roles[rows],
            self.sigma_source[rows],
            self.sigma_target[rows],
            tuple(self.notes[row] for row in rows),
            self.extra.iloc[rows].reset_index(drop=True),
            self.cautions,
        )


def picks_from(
    ids: Sequence[str],
    source: ArrayLike,
    target: ArrayLike,
    *,
    roles: Sequence[str] | None = None,
    sigma_source: ArrayLike | None = None,
    sigma_target: ArrayLike | None = None,
    notes: Sequence[str] | None = None,
    extra: pd.DataFrame | None = None,
    cautions: tuple[Caution, ...] = (),
) -> Picks:
    """Build Picks from arrays, checked; what is omitted is control, unknown or empty.

    Raises
    ------
    PicksError
        For an id that is empty or given twice, an unknown role, a coordinate that is not finite
        or not a coordinate, and a sigma outside 1e-9 to a million.

    Examples
    --------
    >>> corners = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]])
    >>> picks = picks_from(["a", "b", "c"], corners, 2 * corners, roles=["control", "check", "off"])
    >>> picks.control.ids, picks.check.target.tolist()
    (('a',), [[2.0, 0.0, 0.0]])
    """
    n = len(ids)
    picks = Picks(
        tuple(ids),
        np.array(source, np.float64) if n else np.zeros((0, 3)),
        np.array(target, np.float64) if n else np.zeros((0, 3)),
        np.array(["control"] * n if roles is None else roles, np.str_),
        _sigmas(sigma_source, n),
        _sigmas(sigma_target, n),
        ("",) * n if notes is None else tuple(notes),
        pd.DataFrame(index=range(n)) if extra is None else extra.reset_index(drop=True),
        cautions,
    )
    refuse_extra([str(name) for name in picks.extra])
    _refuse(picks)
    return picks


def require_control(picks: Picks) -> None:
    """Raise PicksError unless at least three picks are control.

    Reading a file with fewer is no error, so that it can be looked at and added to; a fit needs
    them.
    """
    found = {role: int((picks.roles == role).sum()) for role in ROLES}
    if found["control"] < FEWEST:
        message = (
            f"{found['control']} control picks ({found['check']} check, {found['off']} off): a "
            f"similarity needs at least {FEWEST}. Add control picks."
        )
        raise PicksError(message)


def examine(picks: Picks) -> tuple[Caution, ...]:
    """Say what is doubtful in the picks themselves; never raises, however degenerate they are.

    Returns
    -------
    tuple of Caution
        `picks_equal` and `picks_swapped`, over all picks that are not off; `picks_coplanar` and
        `picks_mirrored`, over the control picks.

    Examples
    --------
    >>> square = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]])
    >>> [caution.code for caution in examine(picks_from(list("abcd"), square, square))]
    ['picks_coplanar']
    """
    used, control = picks.take(picks.roles != "off"), picks.control
    cautions = [*_equal(used.ids, used.source, "source"), *_equal(used.ids, used.target, "target")]
    source_size, target_size = _distance(used.source), _distance(used.target)
    if source_size >= GEOREFERENCED > target_size and source_size > 10 * target_size:
        message = (
            f"source coordinates lie {source_size:,.0f} from their origin and target coordinates "
            f"{target_size:,.0f} m from theirs: the columns look swapped."
        )
        cautions.append(Caution("picks_swapped", message))
    if len(control) >= FEWEST and (are_coplanar(control.source) or are_coplanar(control.target)):
        weakness = (
            "as three always do: errors across it show in no residual"
            if len(control) == FEWEST
            else "and errors across it are poorly controlled"
        )
        message = (
            f"the {len(control)} control picks lie in one plane, {weakness}, and a mirrored frame "
            f"can't be told. Add a pick well off the plane."
        )
        cautions.append(Caution("picks_coplanar", message))
    if are_mirrored(control.source, control.target):
        message = (
            f"a mirror image fits the {len(control)} control picks far better: the source frame "
            f"looks mirrored (left-handed axes, or one axis with its sign changed)."
        )
        cautions.append(Caution("picks_mirrored", message))
    return tuple(cautions)


def read_picks(path: Path | str, *, crs: pyproj.CRS | None = None) -> Picks:
    """Read a pick file: CSV with a header, columns in any order.

    Needs ``id``, ``source_x`` to ``source_z`` and ``target_x`` to ``target_z``; may have ``role``
    (control, check or off; control if empty), ``sigma_source``, ``sigma_target`` and ``note``;
    keeps other columns as text. UTF-8, separated by commas, semicolons or tabs; decimal commas
    are read where no number in a file without comma separators has a point.

    Parameters
    ----------
    path : path
    crs : pyproj.CRS, optional
        Of the target. Targets in feet become metres; ``sigma_target`` is in metres already.

    Raises
    ------
    PicksError
        If the file can't be read as picks; says the row and column, or whose file it is.
    CrsError
        If the CRS is not fit for metric work.
    """
    path = Path(path)
    factors = metre_factors(crs)
    try:
        text = path.read_bytes().decode("utf-8-sig")
        table = _parse(text)
        numbers = parse_numbers(table)
        columns, blank = dict(table.columns), [""] * len(table.rows)
        return picks_from(
            columns.pop("id"),
            np.column_stack([numbers[name] for name in SOURCE]),
            np.column_stack([numbers[name] for name in TARGET]) * factors,
            roles=[role.strip().lower() or "control" for role in columns.pop("role", blank)],
            sigma_source=numbers.get("sigma_source"),
            sigma_target=numbers.get("sigma_target"),
            notes=columns.pop("note", blank),
            extra=pd.DataFrame(
                {name: cells for name, cells in columns.items() if name not in numbers},
                index=range(len(blank)),
                dtype=object,
            ),
            cautions=conversion_cautions(crs),
        )
    except OSError as error:
        message = f"{path.name} can't be read: {error.strerror or error}."
    except UnicodeDecodeError as error:
        message = f"{path.name} is not UTF-8 text (at byte {error.start}): save it as CSV UTF-8."
    except PicksError as error:
        message = f"{path.name}: {error}"
    raise PicksError(message)


def write_picks(path: Path | str, picks: Picks, *, crs: pyproj.CRS | None = None) -> None:
    """Write picks as CSV that `read_picks` reads back to the same bits.

    Parameters
    ----------
    path : path
        Replaced in one step.
    picks : Picks
    crs : pyproj.CRS, optional
        Of the target; targets are written in its units. Where no number of feet gives exactly
        the metres, the nearest is written.

    Raises
    ------
    PicksError
        If the file can't be written.
    CrsError
        If the CRS is not fit for metric work.
    """
    path = Path(path)
    factors = metre_factors(crs)
    columns = {"id": list(picks.ids)}
    for axis, name in enumerate(SOURCE):
        columns[name] = [repr(value) for value in picks.source[:, axis].tolist()]
    for axis, name in enumerate(TARGET):
        metres = picks.target[:, axis].tolist()
        columns[name] = [_in_units(value, float(factors[axis])) for value in metres]
    are_told = (picks.roles != "control").any()
    optional = {"role": picks.roles.tolist() if are_told else []}
    for name, sigmas in zip(SIGMAS, (picks.sigma_source, picks.sigma_target), strict=True):
        optional[name] = ["" if np.isnan(sigma) else repr(sigma) for sigma in sigmas.tolist()]
    optional["note"] = list(picks.notes)
    columns |= {name: cells for name, cells in optional.items() if any(cells)}
    columns |= {str(name): picks.extra[name].astype(str).tolist() for name in picks.extra}
    try:
        write_text(path, format_columns(columns))
    except OSError as error:
        message = f"{path.name} can't be written: {error.strerror or error}."
        raise PicksError(message) from None


def _parse(text: str) -> PickTable:
    try:
        return parse_table(text)
    except PicksError:
        # Only what is no pick file is looked at as something else.
        if (foreign := foreign_picks(text)) is None:
            raise
    raise PicksError(foreign)


def _refuse(picks: Picks) -> None:
    n = len(picks)
    lengths = [len(picks.roles), len(picks.notes), len(picks.extra)]
    if {picks.source.shape, picks.target.shape} != {(n, 3)} or set(lengths) != {n}:
        message = (
            f"{n} ids with source {picks.source.shape}, target {picks.target.shape} and {lengths} "
            f"roles, notes and rows of other columns: they must match."
        )
        raise PicksError(message)
    seen: dict[str, int] = {}
    for position, name in enumerate(picks.ids, start=1):
        if not name.strip():
            message = f"pick {position} has no id. Give each an id of its own."
            raise PicksError(message)
        first = seen.setdefault(name.strip(), position)
        if first != position:
            message = f"picks {first} and {position} share the id {name.strip()!r}. Rename one."
            raise PicksError(message)
    for name, role in zip(picks.ids, picks.roles.tolist(), strict=True):
        if role not in ROLES:
            message = f"pick {name!r} has the unknown role {role!r}: give control, check or off."
            raise PicksError(message)
    coordinates = np.column_stack([picks.source, picks.target])
    for column, values in zip((*SOURCE, *TARGET), coordinates.T, strict=True):
        # NaN is not below anything either.
        for bad in np.flatnonzero(~(np.abs(values) <= FARTHEST))[:1]:
            message = f"pick {picks.ids[bad]!r}: {column} is {values[bad]:g}, no coordinate."
            raise PicksError(message)
    for column, values in zip(SIGMAS, (picks.sigma_source, picks.sigma_target), strict=True):
        for bad in np.flatnonzero(
            ~(np.isnan(values) | ((values >= SMALLEST_SIGMA) & (values <= LARGEST_SIGMA)))
        )[:1]:
            message = (
                f"pick {picks.ids[bad]!r}: {column} is {values[bad]:g}; give a number above zero, "
                f"{SMALLEST_SIGMA:g} to {LARGEST_SIGMA:,.0f}, or nothing where it is not known."
            )
            raise PicksError(message)


def _sigmas(values: ArrayLike | None, n: int) -> NDArray[np.float64]:
    return np.array(np.broadcast_to(np.nan if values is None else values, n), np.float64)


def _equal(ids: Sequence[str], points: Points, frame: str) -> list[Caution]:
    names = defaultdict(list)
    for name, point in zip(ids, points.tolist(), strict=True):
        names[tuple(point)].append(repr(name))
    groups = [" and ".join(group) for group in names.values() if len(group) > 1]
    if not groups:
        return []
    more = f" and {len(groups) - 3} more such groups" if len(groups) > 3 else ""
    message = f"{'; '.join(groups[:3])}{more} have the same {frame} coordinates: one place each."
    return [Caution("picks_equal", message)]


def _distance(points: Points) -> float:
    return float(np.abs(np.median(points, axis=0)).max()) if len(points) else 0.0


def _in_units(metres: float, factor: float) -> str:
    """Write metres in another unit with the fewest digits that give the same metres back."""
    if factor == 1:
        return repr(metres)
    tries = (repr(float(f"{metres / factor:.{digits}g}")) for digits in range(1, 18))
    return next((text for text in tries if float(text) * factor == metres), repr(metres / factor))
