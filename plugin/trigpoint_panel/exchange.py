"""Pairs from files and to files: the engine's, CloudCompare's picking lists, QGIS's points."""

from __future__ import annotations

import csv
import io
import re
from dataclasses import dataclass
from pathlib import Path

import pyproj

from trigpoint.canonical import write_text
from trigpoint.errors import PicksError
from trigpoint.picks import FARTHEST, examine, read_picks, write_picks
from trigpoint_panel.model import Model
from trigpoint_panel.pairs import (
    SIDES,
    Pair,
    Pairs,
    Place,
    Side,
    complete,
    exchanged,
    find,
    from_picks,
    next_id,
    to_picks,
)
from trigpoint_panel.projects import reference_crs


@dataclass(frozen=True, slots=True)
class Point:
    """A point of a list: its name, empty where the list has none, and its place."""

    name: str
    xyz: Place


def import_picks(model: Model, path: Path | str, *, replacing: bool = False) -> tuple[str, ...]:
    """Add the pairs of a picks.csv, or take them in place of the current ones; return doubts.

    See `with_picks`, also for what is refused.
    """
    model.refuse_second_operator()
    crs = reference_crs(model.state.project)
    kept = () if replacing else model.state.pairs
    pairs, doubts = with_picks(kept, path, crs=crs)
    model.step(f"Import {Path(path).name}", pairs=pairs)
    return doubts


def import_points(model: Model, path: Path | str, side: Side) -> tuple[str, ...]:
    """Fill the halves of one side from a CloudCompare picking list; return the ids filled.

    See `with_points`, also for what is refused.
    """
    model.refuse_second_operator()
    pairs, filled = with_points(model.state.pairs, path, side)
    model.step(f"Import {Path(path).name} as {side}", pairs=pairs)
    return filled


def export_picks(model: Model, path: Path | str) -> tuple[Path, ...]:
    """Write the complete pairs as the path's ending says, and return the files written.

    See `export_pairs`, also for what is refused.
    """
    pairs = model.state.first or model.state.pairs
    return export_pairs(pairs, Path(path), crs=reference_crs(model.state.project))


def with_picks(
    pairs: Pairs, path: Path | str, *, crs: pyproj.CRS | None
) -> tuple[Pairs, tuple[str, ...]]:
    """Return the pairs with those of a picks.csv added, and doubts, a sentence each.

    Raises
    ------
    TrigpointError
        In a sentence, also for what another program's list is; or if an id is taken.
    """
    picks = read_picks(path, crs=crs)
    added = from_picks(picks)
    if not added:
        message = f"{Path(path).name} holds a header and no picks: there is nothing to take."
        raise PicksError(message)
    taken = sorted({pair.id for pair in pairs} & {pair.id for pair in added})
    if taken:
        message = (
            f"{', '.join(taken[:5])} {'is' if len(taken) == 1 else 'are'} there already: rename, "
            f"or import in place of the current pairs."
        )
        raise PicksError(message)
    return (*pairs, *added), tuple(each.message for each in (*picks.cautions, *examine(picks)))


def with_points(pairs: Pairs, path: Path | str, side: Side) -> tuple[Pairs, tuple[str, ...]]:
    """Return the pairs with one side filled from a picking list, and the ids filled, in its order.

    A point goes to the pair of its name, or without a name to the first pair whose half is open;
    else it begins a pair.

    Raises
    ------
    PicksError
        In a sentence, if the file is no such list.
    """
    filled = []
    for point in read_point_list(path):
        pair = find(pairs, point.name)
        if pair is None and not point.name:
            pair = next((each for each in pairs if each.at(side) is None), None)
        if pair is None:
            pair = Pair(point.name or next_id(pairs))
            pairs = (*pairs, pair)
        placed = pair.placed(side, point.xyz, note=f"from {Path(path).name}")
        pairs = exchanged(pairs, pair.id, placed)
        filled.append(pair.id)
    return pairs, tuple(filled)


def export_pairs(pairs: Pairs, path: Path, *, crs: pyproj.CRS | None) -> tuple[Path, ...]:
    """Write the complete pairs: .csv for the engine, .points for QGIS, .txt for CloudCompare.

    Parameters
    ----------
    pairs : tuple of Pair
    path : Path
        Of .txt two lists are written, with the side in their names.
    crs : pyproj.CRS or None
        Of the target.

    Returns
    -------
    tuple of Path
        The files written.

    Raises
    ------
    PicksError
        If there is nothing to write, or no way to.
    """
    kind = path.suffix.lower()
    if not complete(pairs):
        message = "There is no complete pair to export."
        raise PicksError(message)
    if kind == ".csv":
        write_picks(path, to_picks(pairs), crs=crs)
        return (path,)
    if kind == ".points":
        write_points_file(path, pairs, crs)
        return (path,)
    if kind != ".txt":
        message = (
            f"Pairs are written as .csv (trigpoint), .points (QGIS) or .txt (CloudCompare), not "
            f"as {path.suffix or path.name}."
        )
        raise PicksError(message)
    written = tuple(path.with_stem(f"{path.stem}-{side}") for side in SIDES)
    for side, each in zip(SIDES, written, strict=True):
        write_point_list(each, pairs, side)
    return written


def read_point_list(path: Path | str) -> tuple[Point, ...]:
    """Read a picking list of CloudCompare: ``name,x,y,z`` or ``x,y,z`` a line.

    Separated by commas, semicolons, tabs or blanks; a header and comments (``//``, ``#``) are
    passed over.

    Raises
    ------
    PicksError
        If the file can't be read, a line is no point, or two lines give one name.
    """
    path = Path(path)
    try:
        text = path.read_bytes().decode("utf-8-sig")
    except OSError as error:
        message = f"{path.name} can't be read: {error.strerror or error}."
        raise PicksError(message) from error
    except UnicodeDecodeError as error:
        message = f"{path.name} is not UTF-8 text (at byte {error.start})."
        raise PicksError(message) from error
    points: list[Point] = []
    lines: dict[str, int] = {}
    for number, line in enumerate(text.splitlines(), start=1):
        bare = line.strip()
        if not bare or bare.startswith(("//", "#")):
            continue
        cells = _cells(bare)
        place = _place(cells[-3:]) if len(cells) in (3, 4) else None
        if place is not None:
            name = cells[0] if len(cells) == 4 else ""
            if name and lines.setdefault(name, number) != number:
                message = (
                    f"{path.name} names two points {name!r}, in lines {lines[name]} and {number}: "
                    f"rename one of them, or take it out."
                )
                raise PicksError(message)
            points.append(Point(name, place))
        elif points or not _is_header(cells):
            message = f"{path.name}, line {number} is no point: it needs a name, x, y and z."
            raise PicksError(message)
    if not points:
        message = f"{path.name} holds no points."
        raise PicksError(message)
    return tuple(points)


def write_point_list(path: Path, pairs: Pairs, side: Side) -> None:
    """Write one side of the complete pairs as a list that CloudCompare opens: ``name,x,y,z``.

    Raises
    ------
    PicksError
        If the file can't be written.
    """
    rows = [(re.sub(r"[\s,;]+", "_", pair.id), *(pair.at(side) or ())) for pair in complete(pairs)]
    _write(path, "".join(f"{name},{x!r},{y!r},{z!r}\n" for name, x, y, z in rows))


def write_points_file(path: Path, pairs: Pairs, crs: pyproj.CRS | None) -> None:
    """Write the complete pairs as QGIS's georeferencer has them: the plan only, heights are lost.

    Raises
    ------
    PicksError
        If the file can't be written.
    """
    lines = [] if crs is None else [f"#CRS: {' '.join(crs.to_wkt().split())}"]
    lines.append("mapX,mapY,sourceX,sourceY,enable,dX,dY,residual")
    for pair in complete(pairs):
        if pair.source is not None and pair.target is not None:
            place = (*pair.target[:2], *pair.source[:2])
            enabled = int(pair.role == "control")
            lines.append(f"{','.join(repr(value) for value in place)},{enabled},0,0,0")
    _write(path, "\n".join(lines) + "\n")


def _cells(line: str) -> list[str]:
    """Split a line at the mark that makes three or four cells of it."""
    for mark in ",;\t":
        cells = [cell.strip() for cell in next(csv.reader(io.StringIO(line), delimiter=mark))]
        if len(cells) in (3, 4):
            return cells
    return line.split()


def _is_header(cells: list[str]) -> bool:
    return [cell.lower() for cell in cells[-3:]] == ["x", "y", "z"]


def _place(cells: list[str]) -> Place | None:
    try:
        x, y, z = (float(cell) for cell in cells)
    except ValueError:
        return None
    # NaN is not below anything either.
    return (x, y, z) if all(abs(value) <= FARTHEST for value in (x, y, z)) else None


def _write(path: Path, text: str) -> None:
    try:
        write_text(path, text)
    except OSError as error:
        message = f"{path.name} can't be written: {error.strerror or error}."
        raise PicksError(message) from error
