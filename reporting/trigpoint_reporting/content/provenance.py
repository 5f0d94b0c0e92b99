"""What made this report, how to make it again, how to check it, and what a revision changed."""

from __future__ import annotations

import json
from typing import Any

from trigpoint_reporting.blocks import Block, Cell, Passage, Table
from trigpoint_reporting.content.residuals import MOST
from trigpoint_reporting.evidence import Evidence
from trigpoint_reporting.numbers import Numbers, declared_digits, number_text


def provenance(evidence: Evidence) -> list[Block]:
    """Return versions, commands and the history of revisions."""
    about, numbers = evidence.results["project"], Numbers(evidence.results)
    bundle = f"{about['id']}-r{about['revision']}"
    return [
        Table(
            "Software and platform",
            ("Component", "Version"),
            [(name, part.value()) for name, part in numbers.items("environment")],
            (
                "Every package, pinned: env/requirements.lock. No time, user name, host or path "
                "of a machine is recorded: the same inputs and versions give the same bytes.",
            ),
        ),
        Table(
            "To check it, and to make it again",
            ("To", "Command"),
            [
                ("Check every file, without Python", "sha256sum -c manifest-sha256.txt"),
                ("Recompute every number, NumPy alone", "python verify/verify.py"),
                ("Do both, and compare what is printed", f"trigpoint verify {bundle}.zip"),
                (
                    "Make it again from the inputs, and compare",
                    f"trigpoint verify {bundle}.zip --again --inputs FOLDER",
                ),
            ],
            (
                "The first two inside the unpacked bundle, the others beside it. FOLDER: where the "
                "inputs lie; they are known by their SHA-256.",
            ),
        ),
        *_changes(evidence),
    ]


def _changes(evidence: Evidence) -> list[Block]:
    path = evidence.folder / "data" / "changes.json"
    revision = evidence.results["project"]["revision"]
    if not path.is_file():
        first = "This is the first revision." if revision <= 1 else "No record of changes is here."
        return [Passage((first,), "note")]
    stored = json.loads(path.read_text("utf-8"))
    if stored["against"] is None:
        return [
            Passage(("No earlier revision lay beside this one: changes are not known.",), "warning")
        ]
    rows = stored["changes"]
    if not rows:
        return [Passage((f"Nothing differs from {stored['against']}.",))]
    left = "" if len(rows) <= MOST else f" The first {MOST}; all: data/changes.json."
    return [
        Table(
            f"What changed since {stored['against']}",
            ("Where", "Kind", "Before", "After"),
            [
                (row["path"], row["kind"], _told(row, "before"), _told(row, "after"))
                for row in rows[:MOST]
            ],
            (f"{number_text(len(rows))} values of data/results.json differ.{left}",),
        )
    ]


def _told(row: dict[str, Any], key: str) -> Cell:
    value = row[key]
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, int | float):
        return number_text(value, declared_digits(row["path"]))
    return "\N{EN DASH}" if value is None else str(value)
