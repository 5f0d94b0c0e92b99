"""Files that are met beside clouds and are none: what each is, in a sentence."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from trigpoint.formats.rows import fields, head, is_number

_EXPORT = "export its points as PLY (colmap model_converter --output_type PLY)"
_COLMAP = ("cameras", "images", "points3D", "frames", "rigs")
_TEXT = frozenset({".txt", ".csv", ".xyz", ".asc", ".log", ".tum", ".points", ".json", ".dat", ""})


def recognised(path: Path) -> str | None:
    """Say what a file is if it is known and not a point cloud."""
    if path.is_dir():
        is_model = any((path / f"cameras{end}").exists() for end in (".bin", ".txt"))
        return f"a COLMAP model folder: {_EXPORT}" if is_model else "a folder"
    if path.stem in _COLMAP and path.suffix in (".bin", ".txt"):
        return f"part of a COLMAP model: {_EXPORT}"
    if path.suffix.lower() not in _TEXT:
        return None
    if path.suffix.lower() == ".json":
        return _json(path)
    lines = [line for line in head(path) if line.strip()]
    return _text(lines) if lines else None


def _json(path: Path) -> str | None:
    try:
        content = json.loads(path.read_text(encoding="utf-8-sig"))
    except ValueError:
        return "JSON that can't be parsed"
    first = content[0] if isinstance(content, list) and content else content
    if not isinstance(first, dict):
        return "JSON of an unknown kind"
    if {"hierarchyType", "schema"} <= set(first):
        return None  # EPT
    if _some(first, "frames", "transform_matrix"):
        return "a nerfstudio or instant-ngp camera file: export the scene as a point cloud"
    if {"cameras", "shots"} <= set(first):
        return "an OpenSfM reconstruction: export its points as PLY (opensfm export_ply)"
    if _some(first, "points", "observations"):
        return "OpenSfM's ground control points: they are image observations"
    if {"scale", "rotation", "translation"} <= set(first) or "alignment" in first:
        return "a similarity, as `trigpoint align` writes it: `trigpoint apply` takes it"
    return "JSON of an unknown kind"


def _some(content: dict[str, Any], rows: str, key: str) -> bool:
    found = content.get(rows)
    return isinstance(found, list) and any(isinstance(row, dict) and key in row for row in found)


def _text(lines: list[str]) -> str | None:
    rows = [fields(line) for line in lines if not line.startswith(("#", "//"))]
    widths = [len(row) for row in rows[:8]]
    first = [name.lower() for name in rows[0]] if rows else []
    if lines[0].startswith("#CRS:") or {"mapx", "mapy"} <= set(first):
        return "QGIS georeferencer points, which are two-dimensional"
    if {"source_x", "target_x"} <= set(first):
        return "a file of picks: `trigpoint align` takes it"
    starts = ("WGS84", "EPSG:", "+proj", "GEOGCS", "PROJCS")
    if lines[0].startswith(starts) and len(rows) > 1 and len(rows[1]) >= 6:
        return "a list of ground control points (gcp_list.txt): they are image observations"
    if not all(is_number(field) for row in rows[:8] for field in row):
        return None
    numbers = [[float(field.replace(",", ".")) for field in row] for row in rows[:8]]
    if len(rows) == 4 and widths == [4] * 4 and numbers[3] == [0, 0, 0, 1]:
        return "a 4x4 transformation matrix"
    if widths == [3, 3, 3, 3, 1]:
        return "the parameters of a similarity: rotation, translation and scale"
    if widths[:6] == [3, 4, 4, 4, 4, 3]:
        return "a camera trajectory (.log, as Redwood and Tanks and Temples write it)"
    if set(widths) == {8} and _is_trajectory(numbers):
        return "a trajectory (TUM: time, position, quaternion)"
    if widths[:2] == [1, 1] and set(widths[2:]) == {2}:
        return "a table of image numbers, as Tanks and Temples writes it"
    return None


def _is_trajectory(rows: list[list[float]]) -> bool:
    times = [row[0] for row in rows]
    lengths = [sum(part**2 for part in row[4:]) for row in rows]
    return times == sorted(times) and all(abs(length - 1) < 1e-3 for length in lengths)
