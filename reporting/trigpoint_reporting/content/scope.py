"""What the report is for, what it does not test, and how independent its evidence is."""

from __future__ import annotations

from collections.abc import Iterator

from trigpoint_reporting import standards, wording
from trigpoint_reporting.blocks import Block, Cell, Passage, Table
from trigpoint_reporting.evidence import Evidence
from trigpoint_reporting.numbers import Numbers, derived

SIGN_OFF = ("Surveyed by", "Reviewed by", "Accepted by")


def purpose(evidence: Evidence) -> list[Block]:
    """Return purpose, scope, statement of independence and a block to sign."""
    about = evidence.results["project"]
    stated = about["purpose"] or "No purpose was stated: whether this suits a use is open."
    return [
        Passage((f"Purpose of use: {stated}",)),
        Passage(
            (
                "Scope: one similarity per reconstruction, fitted to picked correspondences, and "
                "the distances between each reconstruction and the reference. Nothing non-rigid "
                "was fitted. Not tested: the reference itself, colour, anything outside the "
                "evaluation region, and change between the dates of capture.",
            )
        ),
        *[Passage(tuple(_independence(evidence, name))) for name in evidence.names],
        _reference_rule(evidence),
        standards.wording_source(),
        Table(
            "Sign-off",
            ("Role", "Name", "Date", "Comment"),
            [(role, "", "", "") for role in SIGN_OFF],
        ),
    ]


def _independence(evidence: Evidence, name: str) -> Iterator[Cell]:
    found = Numbers(evidence.results).below("reconstructions", name)
    yield f"Independence of {name}: "
    if found["alignment"] is None:
        yield "it came georeferenced by means that this report does not see, and has no picks."
        return
    yield from (
        "the ",
        found.value("alignment", "n"),
        " picks of the fit were read from the clouds that it aligns: how well they fit is no "
        "independent test, and leaving one out at a time is internal validation. ",
    )
    if found["checks"]["n"]:
        yield found.value("checks", "n")
        yield (
            f" check {wording.picks(found['checks']['n'])} entered neither fit, consensus, "
            "leave-one-out nor ICP: an error found there is independent of the fit, and not of the "
            "reference."
        )
    else:
        yield "There are no check picks."


def _reference_rule(evidence: Evidence) -> Table:
    numbers = Numbers(evidence.results)
    reference = numbers.below("project", "settings", "reference")
    rows: list[tuple[Cell, ...]] = []
    for name in evidence.names:
        rule = standards.twice_rule(evidence, name)
        ratio = rule.judged_m / rule.reference_m if rule.judged_m and rule.reference_m else None
        rows.append(
            (
                name,
                "not stated" if rule.accuracy_m is None else reference.value("accuracy_m"),
                "not stated" if rule.picking_m is None else derived(rule.picking_m, 3),
                derived(rule.reference_m, 3),
                derived(rule.judged_m, 3),
                rule.basis or "nothing: no picks",
                derived(ratio, 1),
                {True: "✓ holds", False: "✗ does not hold", None: "can't be told"}[rule.holds],
            )
        )
    source = reference["accuracy_source"] or "not stated"
    return Table(
        "Is the reference twice as accurate as what it judges?",
        (
            "Reconstruction",
            "Reference, per axis (m)",
            "Picking, per axis (m)",
            "Together in space (m)",
            "Compared with (m)",
            "Which is",
            "Ratio",
            "Twice as accurate",
        ),
        rows,
        (
            f"Source of the reference's accuracy: {source}. Picking: the sigma that the check "
            "picks state in the reference. In space: √3 times both together along one axis. "
            "Where the ratio is below 2, errors of the reference are a large part of what is "
            "found, and agreement with it is all that can be stated.",
        ),
    )
