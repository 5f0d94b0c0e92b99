"""What a revision changed, as its reader asks: what went in, then what came out, as printed."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Mapping
from typing import Any

from trigpoint_reporting.blocks import Block, Cell, Passage, Table
from trigpoint_reporting.evidence import Evidence
from trigpoint_reporting.numbers import declared_digits, number_text
from trigpoint_reporting.revisions import leaves, leaves_before
from trigpoint_reporting.wording import mark_of, quantity_label

NONE = "\N{EN DASH}"
# Rows that a table prints; data/changes.json holds what is beyond them.
MOST = 30
# What stands on the first page, under the names of results.json, and what that leaves out of it.
HEADLINES: Mapping[str, str] = {
    "alignment.n": "",
    "alignment.scale": "Scale",
    "alignment.rmse_m": "",
    "alignment.rmse_dof_m": "",
    "loocv.rmse_m": "",
    "loocv.max_scale_change_pct": "",
    "checks.n": "",
    "checks.rmse_m": "",
    "reliability.geometry": "Geometry of the picks",
    "icp.retained": "ICP retained",
    "comparison.delivered.accuracy.all.rmse_m": "",
    "comparison.delivered.completeness.all.rmse_m": "",
}
# A revision is a new one, and its status and date say so; they are on the first page.
PLAIN = ("project.revision", "project.status", "project.date")

Leaves = Mapping[str, Any]
Row = tuple[str, str, str, str]


def changes(evidence: Evidence) -> list[Block]:
    """Return what changed since the revision before; the full list stays in data/changes.json."""
    path = evidence.folder / "data" / "changes.json"
    revision = evidence.results["project"]["revision"]
    if not path.is_file():
        first = "This is the first revision." if revision <= 1 else "No record of changes is here."
        return [Passage((first,), "note")]
    stored = json.loads(path.read_text("utf-8"))
    against, rows = stored["against"], stored["changes"]
    if against is None:
        return [
            Passage(("No earlier revision lay beside this one: changes are not known.",), "warning")
        ]
    if not rows:
        return [Passage((f"Nothing differs from {against}.",))]
    before, after = leaves_before(evidence.results, rows), leaves(evidence.results)
    went_in = [*_inputs(before, after), *_limits(before, after), *_settings(before, after)]
    came_out = [
        *_verdict(before, after),
        *_criteria(before, after),
        *(row for name in evidence.names for row in _headlines(evidence, name, before, after)),
    ]
    return [
        *_shown(f"Inputs and settings that changed since {against}", went_in),
        *_shown(f"Findings that changed since {against}", came_out),
        Passage(
            (
                f"{number_text(len(rows))} values of data/results.json differ from {against} in "
                "all, single picks and zones and what prints alike included: data/changes.json has "
                "each as it was and as it is.",
            ),
            "note",
        ),
    ]


def replaced(evidence: Evidence) -> str:
    """Say which revision this one replaces, its status and verdict, and if limits have changed.

    A verdict can turn because a limit did: who reads the two verdicts has to know. Of a first
    revision nothing is said.
    """
    about = evidence.results["project"]
    path = evidence.folder / "data" / "changes.json"
    if about["revision"] <= 1:
        return ""
    stored: dict[str, Any] = json.loads(path.read_text("utf-8")) if path.is_file() else {}
    if stored.get("against") is None:
        return "not known: no earlier revision lay beside this one"
    before = leaves_before(evidence.results, stored["changes"])
    status = before.get("project.status", NONE)
    told = f"revision {before.get('project.revision', NONE)}, {status}, {_word(before)}"
    moved = sum(1 for _ in _limits(before, leaves(evidence.results)))
    return told + (f"; {number_text(moved)} limit{'s' * (moved > 1)} changed since" * bool(moved))


def _shown(caption: str, rows: list[Row]) -> Iterator[Block]:
    if not rows:
        yield Passage((f"{caption}: none, as printed.",))
        return
    left = "" if len(rows) <= MOST else f"The first {MOST} of {len(rows)}."
    kept = [tuple[Cell, ...](row) for row in rows[:MOST]]
    yield Table(caption, ("What", "Of", "Before", "After"), kept, (left,) if left else ())


def _inputs(before: Leaves, after: Leaves) -> Iterator[Row]:
    old, new = _files(before), _files(after)
    for name, role, number in dict.fromkeys([*new, *old]):
        place = name, role, number
        if old.get(place) != new.get(place):
            yield f"Input: {role}", name, old.get(place, NONE), new.get(place, NONE)


def _files(found: Leaves) -> dict[tuple[str, str, int], str]:
    """Return what is said of each file, by what it is for: by its hash no two would compare."""
    told: dict[tuple[str, str, int], str] = {}
    for digest, row in _rows(found, "inputs").items():
        number = sum(place[:2] == (row["name"], row["role"]) for place in told)
        said = f"{row['path']}, {number_text(row['bytes'])} bytes"
        if row.get("points") is not None:
            said += f", {number_text(row['points'])} points"
        sha = str(row.get("sha256", digest))
        told[row["name"], row["role"], number] = f"{said}, SHA-256 {sha[:16]}…"
    return told


def _limits(before: Leaves, after: Leaves) -> Iterator[Row]:
    old, new = _judged(before), _judged(after)
    for key in dict.fromkeys([*new, *old]):
        was, now = (found[key][0] if key in found else NONE for found in (old, new))
        if was != now:
            yield f"Limit: {quantity_label(key[1])}", key[0], was, now


def _settings(before: Leaves, after: Leaves) -> Iterator[Row]:
    for title, start in (("Setting", "project."), ("Version", "environment.")):
        old, new = _joined(before, start), _joined(after, start)
        for path in dict.fromkeys([*new, *old]):
            if path not in PLAIN and old.get(path, NONE) != new.get(path, NONE):
                name = path.removeprefix("project.settings.").removeprefix(start)
                yield title, name, old.get(path, NONE), new.get(path, NONE)


def _joined(found: Leaves, start: str) -> dict[str, str]:
    """Return values as printed, by path, a list in one piece."""
    told: dict[str, list[str]] = {}
    for path, value in found.items():
        if path.startswith(start):
            told.setdefault(re.sub(r"(\[\d+\])+$", "", path), []).append(_told(path, value))
    return {path: ", ".join(values) for path, values in told.items()}


def _verdict(before: Leaves, after: Leaves) -> Iterator[Row]:
    for title, told in (("Verdict", _word), ("In doubt", _doubts)):
        # In which order codes stand is no change.
        if sorted(told(before).split(", ")) != sorted(told(after).split(", ")):
            yield title, "", told(before), told(after)


def _word(found: Leaves) -> str:
    return str(found.get("verdict", NONE))


def _doubts(found: Leaves) -> str:
    codes = dict.fromkeys(row["code"] for row in _rows(found, "warnings").values())
    return ", ".join(codes) or "nothing"


def _criteria(before: Leaves, after: Leaves) -> Iterator[Row]:
    old, new = _judged(before), _judged(after)
    for key in dict.fromkeys([*new, *old]):
        # That only the limit moved is no finding: what was found of it is as it was.
        if key not in old or key not in new or old[key][1] != new[key][1]:
            was, now = (": ".join(found.get(key, (NONE,))) for found in (old, new))
            yield f"Criterion: {quantity_label(key[1])}", key[0], was, now


def _judged(found: Leaves) -> dict[tuple[str, str, str, int], tuple[str, str]]:
    """Return limit and finding of each criterion, by what it is about, which way, and which one."""
    told: dict[tuple[str, str, str, int], tuple[str, str]] = {}
    for label, row in _rows(found, "criteria").items():
        quantity = str(row.get("quantity", label))
        value = _told(f"reconstructions.{row['of']}.{quantity}", row["found"])
        met = "met" if row["met"] else "not met"
        way = str(row["limit"]).partition(" ")[0]
        place = row["of"], quantity, way
        told[*place, sum(each[:3] == place for each in told)] = str(row["limit"]), f"{value}, {met}"
    return told


def _headlines(evidence: Evidence, name: str, before: Leaves, after: Leaves) -> Iterator[Row]:
    quantities = dict(HEADLINES)
    delivered = evidence.results["reconstructions"][name]["comparison"]["delivered"]
    for direction in ("accuracy", "completeness"):
        within = delivered[direction]["all"]["within"]
        if within:
            mark = within[mark_of(within)]["threshold_m"]
            quantities[f"comparison.delivered.{direction}.all.within[{mark}].pct"] = ""
    for quantity, label in quantities.items():
        path = f"reconstructions.{name}.{quantity}"
        was, now = (_told(path, found.get(path)) for found in (before, after))
        if was != now:
            yield label or quantity_label(quantity), name, was, now


def _rows(found: Leaves, table: str) -> dict[str, dict[str, Any]]:
    """Return the rows of a list by the label that their paths have."""
    rows: dict[str, dict[str, Any]] = {}
    for path, value in found.items():
        if path.startswith(f"{table}["):
            label, _, key = path.removeprefix(f"{table}[").rpartition("].")
            rows.setdefault(label, {})[key] = value
    return rows


def _told(path: str, value: Any) -> str:
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, int | float):
        return number_text(value, declared_digits(path))
    return NONE if value is None or value == "" else str(value)
