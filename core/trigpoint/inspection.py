"""What a file is: a cloud or picks, with what is doubtful about it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from trigpoint.crs import describe_crs, parse_crs
from trigpoint.files import describe
from trigpoint.picks import examine, read_picks
from trigpoint.results import warning_results

# Columns that only a pick file has; a file of points may be CSV as well.
PICK_COLUMNS = ("source_x", "target_x")


def inspect(path: str | Path, *, crs: str | None = None) -> dict[str, Any]:
    """Say what a file is, as `trigpoint info` prints it.

    Parameters
    ----------
    path : path
        A cloud, or a pick file.
    crs : str, optional
        Assigned in place of what the file says; of a pick file, the CRS of its targets.

    Raises
    ------
    TrigpointError
        If it is neither; the message says what it is instead, where that is known.
    """
    path = Path(path)
    return _picks(path, crs) if _has_pick_columns(path) else _cloud(path, crs)


def _cloud(path: Path, crs: str | None) -> dict[str, Any]:
    info = describe(path, crs=crs)
    report = describe_crs(info.crs, at=(info.low + info.high) / 2)
    # A format that could hold a CRS has said already that there is none.
    said = {caution.code for caution in info.cautions}
    doubts = (*info.cautions, *(new for new in report.cautions if new.code not in said))
    return {
        "path": path.name,
        "kind": "cloud",
        "format": info.format,
        "points": info.points,
        "scans": info.scans,
        "low": info.low,
        "high": info.high,
        "crs": report.name if info.crs is not None else None,
        "crs_code": report.code,
        "units": list(report.units),
        "vertical_datum": report.vertical_datum,
        "attributes": list(info.attributes),
        "warnings": warning_results(doubts),
    }


def _picks(path: Path, crs: str | None) -> dict[str, Any]:
    picks = read_picks(path, crs=parse_crs(crs))
    roles = {role: int((picks.roles == role).sum()) for role in ("control", "check", "off")}
    return {
        "path": path.name,
        "kind": "picks",
        "picks": len(picks),
        **roles,
        "source_low": picks.source.min(axis=0) if len(picks) else None,
        "source_high": picks.source.max(axis=0) if len(picks) else None,
        "target_low_m": picks.target.min(axis=0) if len(picks) else None,
        "target_high_m": picks.target.max(axis=0) if len(picks) else None,
        "other_columns": [str(name) for name in picks.extra],
        "warnings": warning_results((*picks.cautions, *examine(picks))),
    }


def _has_pick_columns(path: Path) -> bool:
    if path.suffix.lower() not in {".csv", ".txt"} or not path.is_file():
        return False
    with path.open(encoding="utf-8-sig", errors="replace") as file:
        header = file.readline(10_000).lower()
    return any(name in header for name in PICK_COLUMNS)
