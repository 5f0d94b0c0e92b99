"""The files that the audit read, each with its hash."""

from __future__ import annotations

from trigpoint_reporting.blocks import Block, Table
from trigpoint_reporting.evidence import Evidence
from trigpoint_reporting.numbers import Numbers


def inputs(evidence: Evidence) -> list[Block]:
    """Return what was read: what for, in which format and frame, how large, and its SHA-256."""
    rows = Numbers(evidence.results).rows("inputs")
    return [
        Table(
            "Inputs",
            ("Name", "Role", "File", "Format", "Points", "Bytes", "CRS in the file"),
            [
                (
                    row["name"],
                    row["role"],
                    row["path"],
                    row["format"],
                    row.value("points") if row["points"] is not None else "\N{EN DASH}",
                    row.value("bytes"),
                    row["crs"] or "none",
                )
                for row in rows
            ],
            (
                "Of files outside the project's folder only the name is kept. A cloud in its own "
                "frame has no CRS, and needs none.",
            ),
        ),
        Table(
            "SHA-256 of the inputs",
            ("File", "SHA-256"),
            [(row["path"], row["sha256"]) for row in rows],
            ("Compare with: sha256sum FILE. Of an EPT folder, ept.json is hashed.",),
        ),
    ]
