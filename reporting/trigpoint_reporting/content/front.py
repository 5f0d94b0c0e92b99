"""The first page: verdict, result, what was judged, and the accuracy that may be stated."""

from __future__ import annotations

import re
from collections.abc import Iterator

from trigpoint_reporting import standards, wording
from trigpoint_reporting.blocks import Block, Cell, Passage, Table, Value
from trigpoint_reporting.content.changes import replaced
from trigpoint_reporting.elevations import thumbnail
from trigpoint_reporting.evidence import Evidence
from trigpoint_reporting.numbers import Numbers, declared_digits, number_text

NOT_STATED = "not stated"
NONE = "\N{EN DASH}"
# Reported of every similarity, whether a limit is set on it or not.
ALWAYS = ("alignment.rmse_m", "loocv.rmse_m", "loocv.max_scale_change_pct")


def result(evidence: Evidence) -> list[Block]:
    """Return what must stand alone if the first page is torn off."""
    blocks: list[Block] = [wording.verdict(evidence)]
    blocks += [wording.result(evidence, name) for name in evidence.names]
    picture = thumbnail(evidence, evidence.names[0])
    blocks += [picture] if picture else []
    # The first two stand side by side where there is room.
    blocks += [_title_block(evidence), *_plot_scales(evidence), _criteria(evidence)]
    for name in evidence.names:
        blocks += standards.accuracy_statement(evidence, name)
    return [*blocks, standards.agreement(evidence), _in_doubt(evidence), _check_it(evidence)]


def _in_doubt(evidence: Evidence) -> Passage:
    codes = dict.fromkeys(each["code"] for each in evidence.results["warnings"])
    told = ", ".join(codes) if codes else "nothing; no warning was raised"
    return Passage((f"In doubt (section Limitations and warnings): {told}.",), "note")


def _check_it(evidence: Evidence) -> Passage:
    about = evidence.results["project"]
    bundle = f"{about['id']}-r{about['revision']}.zip"
    return Passage((f"Check it yourself: trigpoint verify {bundle}, or see Provenance.",), "note")


def _title_block(evidence: Evidence) -> Table:
    numbers = Numbers(evidence.results)
    about = evidence.results["project"]
    reference = about["settings"]["reference"]
    people = ", ".join(filter(None, (about["surveyor"], about["organisation"])))
    captured = f", captured {reference['captured']}" if reference["captured"] else ""
    vertical = evidence.results["crs"]["vertical_datum"]
    rows: list[tuple[Cell, Cell]] = [
        ("Report", f"{about['id']}, revision {about['revision']}, {about['status']}"),
        *([("Replaces", before)] if (before := replaced(evidence)) else []),
        ("Site", about["site"]),
        ("Client", about["client"]),
        ("Surveyor", people),
        ("Date of report", about["date"] or ""),
        ("Measured", f"{', '.join(evidence.names)}, against {reference['name']}{captured}"),
        ("Reference system", numbers.value("crs", "name")),
        ("Vertical datum", vertical or ""),
        (
            "Software",
            f"trigpoint {evidence.results['environment']['trigpoint']} "
            f"on Python {evidence.results['environment']['python']}",
        ),
    ]
    stated = [(item, value or NOT_STATED) for item, value in rows]
    return Table("This report", ("Item", "As stated by the project"), stated)


def _criteria(evidence: Evidence) -> Table:
    limits = list(_judged(evidence))
    rest = list(_reported(evidence))
    note = (
        "Limits are the project's own, each with the source that it names. Margin: room to spare; "
        "below zero, the excess."
    )
    if not limits:
        note = "The project states no limit: what is found is reported, and nothing is judged."
    return Table(
        "Criteria and findings",
        ("Criterion", "Of", "Finding", "Found", "Limit", "Margin", "Source"),
        [*limits, *rest],
        (note,),
    )


def _judged(evidence: Evidence) -> Iterator[tuple[Cell, ...]]:
    for row in Numbers(evidence.results).rows("criteria"):
        found = _found(row["of"], row["quantity"], row["found"])
        yield (
            wording.quantity_label(row["quantity"]),
            row["of"],
            "✓ met" if row["met"] else "✗ not met",
            found,
            _limit(row),
            _margin(row, declared_digits(found.path)),
            row["source"] or NOT_STATED,
        )


def _limit(row: Numbers) -> Value:
    """Print a limit without an exponent; as it is stored, where it has none."""
    word, _, bound = row["limit"].partition(" ")
    stored = row.value("limit")
    return Value(f"{word} {number_text(float(bound))}") if "e" in bound else stored


def _reported(evidence: Evidence) -> Iterator[tuple[Cell, ...]]:
    """Yield what has no limit, so that no number is silently left out of the judgement."""
    limited = {(row["of"], _plain(row["quantity"])) for row in evidence.results["criteria"]}
    for name, found in Numbers(evidence.results).items("reconstructions"):
        shares = found["comparison"]["delivered"]["completeness"]["all"]["within"]
        position = wording.mark_of(shares)
        threshold = shares[position]["threshold_m"]
        quantities = []
        if found["alignment"] is not None:
            quantities = [(each, _stored(found, each)) for each in ALWAYS]
            if found["checks"]["n"]:
                quantities.append(("checks.rmse_m", found["checks"]["rmse_m"]))
        share = f"comparison.delivered.completeness.all.within[{threshold!r}].pct"
        quantities.append((share, shares[position]["pct"]))
        for quantity, value in quantities:
            if (name, _plain(quantity)) not in limited:
                shown = _found(name, quantity, value)
                label = wording.quantity_label(quantity)
                yield (label, name, "no limit set", shown, NONE, NONE, NONE)


def _stored(found: Numbers, quantity: str) -> float | None:
    part, _, key = quantity.partition(".")
    stored: float | None = found[part][key]
    return stored


def _found(name: str, quantity: str, value: float | None) -> Value:
    path = f"reconstructions.{name}.{quantity}"
    return Value(number_text(value, declared_digits(path)), path)


def _plain(quantity: str) -> str:
    """Write thresholds the same way, whoever typed them."""
    return re.sub(r"\[([\d.]+)\]", lambda found: f"[{float(found[1])!r}]", quantity)


def _margin(row: Numbers, declared: int | None) -> Value:
    margin, digits = row["margin"], declared
    # A limit that is missed by less than the last digit must not read as missed by nothing.
    while digits is not None and margin and not round(margin, digits):
        digits += 1
    return Value(number_text(margin, digits), f"{row.path}.margin" if digits == declared else "")


def _plot_scales(evidence: Evidence) -> Iterator[Table]:
    rows = list(_scales(evidence))
    if rows:
        yield Table(
            "Largest plot scale that each RMSE supports",
            ("Of", "Error", "3D (m)", "Scale"),
            rows,
            (
                f"A line of {wording.LINE_MM:g} mm at scale 1:n covers n times as much on the "
                "ground; n = error / line width. The error at picks that the fit did not see is "
                "the one to plan with.",
            ),
        )


def _scales(evidence: Evidence) -> Iterator[tuple[Cell, ...]]:
    for name, found in Numbers(evidence.results).items("reconstructions"):
        if found["alignment"] is None:
            continue
        for label, part in (
            ("Fit, at its own picks", "alignment"),
            ("Leave-one-out", "loocv"),
            ("Check picks", "checks"),
        ):
            error = found[part]["rmse_m"]
            if error is not None:
                yield name, label, found.value(part, "rmse_m"), wording.plot_scale_text(error)
