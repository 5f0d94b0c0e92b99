"""A bundle verified: its hashes, its numbers recomputed, and if wanted its audit run again."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import trigpoint
from trigpoint_reporting.manifest import BundleError
from trigpoint_reporting.rerun import Rerun, find_inputs, rerun
from trigpoint_reporting.sealing import verifier_source
from trigpoint_reporting.unpacking import opened
from trigpoint_reporting.verifier import verify as verifier

REPORT = ("audit.ipynb", "audit.py", "report.html", "report.pdf")


@dataclass(frozen=True, slots=True, eq=False)
class Verification:
    """What verifying a bundle showed.

    Attributes
    ----------
    bundle : str
        Its name.
    report : verifier.Report
        Every comparison made.
    rerun : Rerun or None
        None where the audit was not run again.
    """

    bundle: str
    report: verifier.Report
    rerun: Rerun | None = None

    @property
    def holds(self) -> bool:
        """Whether nothing differs. What other versions compute differently is drift, no fault."""
        faults = self.rerun is not None and self.rerun.moved and not self.rerun.versions
        return not self.report.differences and not faults

    def results(self) -> dict[str, Any]:
        """Return what `trigpoint verify --json` prints."""
        rows = self.report.rows
        return {
            "bundle": self.bundle,
            "verified": self.holds,
            "record_sha256": self.report.record,
            "manifest_sha256": self.report.manifest,
            "checks": len(rows),
            "held": len(rows) - len(self.report.differences),
            "differences": [asdict(row) for row in self.report.differences],
            "not_recomputed": verifier.NOT_RECOMPUTED,
            "notes": self.report.notes,
            "rerun": None if self.rerun is None else asdict(self.rerun),
        }

    def text(self) -> str:
        """Say the same to people."""
        said = verifier.summary(self.report)
        if self.rerun is None:
            return said
        lines = [f"  {row['path']}: {row['before']} -> {row['after']}" for row in self.rerun.moved]
        if self.rerun.versions:
            changed = ", ".join(
                row["path"].removeprefix("environment.") for row in self.rerun.versions
            )
            first = f"run again with other versions ({changed}): {len(lines)} values drifted"
        else:
            first = f"run again with the same versions: {len(lines)} values differ"
        return said + "\n".join([first, *lines]) + "\n"


def verify(
    path: str | Path,
    *,
    inputs: str | Path | None = None,
    again: bool = False,
    say: Callable[[str], None] = lambda _: None,
) -> Verification:
    """Verify a bundle: its hashes, and every number that its evidence determines.

    Nothing in the bundle is executed: the verifier that runs is this package's own, and that the
    bundle carries the same one is among the checks.

    Parameters
    ----------
    path : path
        A bundle's folder or zip.
    inputs : path, optional
        A folder with the files that were audited: their hashes are compared too.
    again : bool
        Run the audit again from those inputs.
    say : callable, optional
        Told each step as it begins.

    Returns
    -------
    Verification

    Raises
    ------
    BundleError
        If it is no bundle, its zip is not safe to unpack, or inputs are missing to run again.
    """
    path = Path(path)
    with opened(path) as folder:
        say("hashing and recomputing")
        try:
            report = verifier.check(folder)
        except verifier.UnreadableError as error:
            message = f"{path.name} can't be verified: {error}"
            raise BundleError(message) from error
        results = json.loads((folder / "data" / "results.json").read_text("utf-8"))
        _compare_verifiers(report, folder, results)
        why_not = _why_not_remade(results)
        _check_page(report, folder, why_not)
        if inputs is None:
            if again:
                message = "Running the audit again needs its inputs: --inputs says where they lie."
                raise BundleError(message)
            return Verification(path.name, report)
        found, other, missing = find_inputs(results, Path(inputs))
        for stated in found:
            report.holds(f"inputs: {stated} is the file that was audited", True)
        for each in other:
            report.equal(
                f"inputs: {each['path']} is the file that was audited",
                each["stored"],
                each["found"],
            )
        report.notes.extend(f"{stated} is not at hand and was not compared." for stated in missing)
        if not again or other:
            return Verification(path.name, report)
        run = rerun(folder, results, found, say=say)
        if (folder / "audit.ipynb").is_file() and not why_not:
            _check_report(report, folder, say)
        return Verification(path.name, report, run)


def _check_page(report: verifier.Report, folder: Path, why_not: str) -> None:
    """Compare the page with the notebook, as far as there are both and this trigpoint made them."""
    missing = [name for name in REPORT if not (folder / name).is_file()]
    if missing == list(REPORT):
        report.notes.append("The bundle holds no report.")
        return
    for name in missing:
        if name == "report.pdf":
            report.notes.append("The bundle holds no report.pdf.")
        else:
            report.holds(f"{name} is in the bundle", False)
    if not set(missing) <= {"report.pdf"}:
        return
    if why_not:
        report.notes.append(f"The report was not compared with what trigpoint makes: {why_not}.")
        return
    from trigpoint_reporting.remade import check_page

    verifier.attempt(report, "report.html", lambda: check_page(report, folder))


def _check_report(report: verifier.Report, folder: Path, say: Callable[[str], None]) -> None:
    from trigpoint_reporting.remade import check_report

    verifier.attempt(
        report, "the report, made again", lambda: check_report(report, folder, say=say)
    )


def _why_not_remade(results: dict[str, Any]) -> str:
    """Say why the report can't be compared with what is made here; empty where it can."""
    made_by = str(results.get("environment", {}).get("trigpoint"))
    if made_by != trigpoint.__version__:
        return f"it was made by trigpoint {made_by}, and this is {trigpoint.__version__}"
    try:
        import trigpoint_reporting.remade  # noqa: F401
    except ImportError as error:
        return f"what makes reports is not installed here ({error})"
    return ""


def _compare_verifiers(report: verifier.Report, folder: Path, results: dict[str, Any]) -> None:
    own = hashlib.sha256(verifier_source()).hexdigest()
    path = folder / "verify" / "verify.py"
    carried = verifier.sha256(path) if path.is_file() else "missing"
    made_by = str(results.get("environment", {}).get("trigpoint"))
    if made_by == trigpoint.__version__:
        report.equal("verify/verify.py is trigpoint's own", carried, own)
    elif carried != own:
        report.notes.append(
            f"The bundle was made by trigpoint {made_by} and carries another verifier than "
            f"{trigpoint.__version__} has; that of {trigpoint.__version__} was run."
        )
