"""Recognises the point lists of other programs, which are no pairs of picks, by their text."""

from __future__ import annotations

import re

_COLUMNS = "id, source_x, source_y, source_z, target_x, target_y, target_z"


def foreign_picks(text: str) -> str | None:
    r"""Say what a text of another program is, why it can't serve as picks, and what would do.

    Returns
    -------
    str or None
        One sentence or two; None if the text is not recognised.

    Examples
    --------
    >>> foreign_picks("roof,12.5,3.25,8.0\nsill,1.5,3.0,2.0")[:36]
    'it is a CloudCompare picking list: t'
    """
    lines = [line.strip() for line in text.splitlines() if line.strip()][:50]
    if not lines:
        return None
    if lines[0].startswith("#CRS") or {"mapx", "mapy"} <= set(_cells(lines[0].lower())):
        return (
            "it is a QGIS georeferencer file (.points): its pairs are two-dimensional, pixels "
            "against map positions, and a similarity needs heights. Pick in 3D, with columns "
            f"{_COLUMNS}."
        )
    if len(lines) > 1 and _is_observation(lines[1]):
        return (
            "it is an OpenDroneMap ground control list (gcp_list.txt): its points are seen in "
            "images, as pixels, not in the reconstruction. Pick each in the cloud, and write its "
            f"place there beside its ground coordinates, with columns {_COLUMNS}."
        )
    if any(re.match(r"(final rms|transformation matrix)", line, re.I) for line in lines):
        return _result("a CloudCompare registration report")
    if len(lines) == 4 and all(len(line.split()) == 4 and _numbers(line.split()) for line in lines):
        return _result("a 4 x 4 matrix")
    cells = _cells(lines[0])
    if len(cells) in (3, 4) and (_numbers(cells[-3:]) or _names_xyz(cells)):
        return (
            "it is a CloudCompare picking list: the points of one cloud. Pick the same points in "
            "both clouds, and put the two lists side by side, point by point, with columns "
            f"{_COLUMNS}."
        )
    return None


def _result(what: str) -> str:
    return (
        f"it is {what}: the outcome of an alignment, without the pairs that it came from. Give the "
        f"pairs, with columns {_COLUMNS}."
    )


def _cells(line: str) -> list[str]:
    return [cell.strip() for cell in re.split(r"[,;\t]", line)]


def _names_xyz(cells: list[str]) -> bool:
    return [cell.lower() for cell in cells[-3:]] == ["x", "y", "z"]


def _is_observation(line: str) -> bool:
    fields = line.split()
    return len(fields) >= 6 and _numbers(fields[:5]) and not _numbers(fields[5:6])


def _numbers(cells: list[str]) -> bool:
    try:
        [float(cell) for cell in cells]
    except ValueError:
        return False
    return True
