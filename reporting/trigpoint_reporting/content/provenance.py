"""What made this report, how to make it again, how to check it, and what a revision changed."""

from __future__ import annotations

from collections.abc import Iterator

from trigpoint_reporting.blocks import Block, Cell, Table
from trigpoint_reporting.content.changes import changes
from trigpoint_reporting.evidence import Evidence
from trigpoint_reporting.numbers import Numbers

# What the report is made with; the numbers do not depend on it.
STACK = ("nbconvert", "jinja2", "matplotlib", "pyvista", "vtk", "weasyprint")


def provenance(evidence: Evidence) -> list[Block]:
    """Return versions, commands and the history of revisions."""
    about, numbers = evidence.results["project"], Numbers(evidence.results)
    bundle = f"{about['id']}-r{about['revision']}"
    return [
        Table(
            "Software and platform",
            ("Component", "Version"),
            [
                *((name, part.value()) for name, part in numbers.items("environment")),
                *_stack(evidence),
            ],
            (
                "Every package, pinned: env/requirements.lock. No time, user name, host or path "
                "of a machine is recorded: the same inputs and versions give the same bytes. "
                "Source in git is known where trigpoint runs from its own checkout.",
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
        *changes(evidence),
    ]


def _stack(evidence: Evidence) -> Iterator[tuple[Cell, Cell]]:
    """Yield what drew and set the report, as the bundle's lock has it, and where the source was."""
    lock = evidence.folder / "env" / "requirements.lock"
    if lock.is_file():
        pins = dict(line.partition("==")[::2] for line in lock.read_text("utf-8").splitlines())
        yield from ((name, pins[name]) for name in STACK if name in pins)
    source = evidence.folder / "env" / "source.txt"
    if source.is_file():
        yield "source in git", source.read_text("utf-8").strip()
