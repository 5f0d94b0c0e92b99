"""The user's own limits, judged against the results."""

from __future__ import annotations

import difflib
import json
import re
from collections.abc import Iterable, Mapping
from functools import cache
from importlib.resources import files
from typing import Any, Literal

import numpy as np

from trigpoint.errors import ProjectError
from trigpoint.project import Limit, Project
from trigpoint.zones import height_zones

Verdict = Literal["PASS", "CONDITIONAL", "FAIL", "NOT TESTED"]

# Limits that are met under one of these are met on a condition: what they were met in is in doubt.
PRECONDITIONS = frozenset(
    {
        "blunder_suspected",
        "consensus_ambiguous",
        "consensus_disagrees",
        "crs_conflict",
        "crs_doubtful",
        "crs_missing",
        "cross_check_disagrees",
        "picks_mirrored",
        "vertical_datum_unknown",
        "weak_geometry",
    }
)

_STEP = re.compile(r"[^.\[\]]+(?:\[[^\]]*\])?")
_WITHIN = re.compile(r"within\[(\d*\.?\d+)\]")


@cache
def schema() -> dict[str, Any]:
    """Return the JSON Schema of results.json."""
    text = files("trigpoint").joinpath("results.schema.json").read_text("utf-8")
    return json.loads(text)  # type: ignore[no-any-return]


def check_quantities(project: Project) -> None:
    """Raise ProjectError for a limit on what results.json will not hold.

    A quantity is a path below one reconstruction: ``loocv.rmse_m``, ``alignment.mean_m.2``,
    ``comparison.delivered.completeness.upper.within[0.10].pct``. To be called before the work
    starts: hours of it should not end in a spelling mistake.
    """
    zones = ("all", *height_zones(0.0, 1.0, fractions=project.comparison.zones).names)
    for limit in project.limits:
        node = schema()["properties"]["reconstructions"]["additionalProperties"]
        for step in _STEP.findall(limit.quantity):
            node = _schema_below(node, step, limit.quantity, project.comparison.within_m, zones)
        if not {"number", "integer"} & set(np.atleast_1d(_resolved(node).get("type", []))):
            message = f"[limit] quantity '{limit.quantity}' is no number in results.json."
            raise ProjectError(message)


def judge(
    limits: Iterable[Limit],
    reconstructions: Mapping[str, Mapping[str, Any]],
    codes: Iterable[str],
) -> tuple[list[dict[str, Any]], Verdict]:
    """Compare each limit with what was found.

    Parameters
    ----------
    limits : iterable of Limit
    reconstructions : mapping of str to mapping
        As in results.json.
    codes : iterable of str
        Of the cautions met on the way.

    Returns
    -------
    criteria : list of dict
        quantity, of, limit, found, margin (above zero: room to spare), met, source. What could
        not be found is not met.
    verdict : str
        FAIL where a limit is not met; NOT TESTED where there is none; CONDITIONAL where all are
        met although a precondition of theirs is in doubt; else PASS.
    """
    criteria = [_criterion(limit, reconstructions[limit.of]) for limit in limits]
    if not criteria:
        return [], "NOT TESTED"
    if not all(each["met"] for each in criteria):
        return criteria, "FAIL"
    return criteria, "CONDITIONAL" if PRECONDITIONS & set(codes) else "PASS"


def _criterion(limit: Limit, results: Mapping[str, Any]) -> dict[str, Any]:
    found = _find(results, limit.quantity)
    bound, sign, word = (limit.max, 1, "max") if limit.max is not None else (limit.min, -1, "min")
    assert bound is not None  # the project was checked
    margin = None if found is None else sign * (bound - found)
    return {
        "quantity": limit.quantity,
        "of": limit.of,
        "limit": f"{word} {bound:g}",
        "found": found,
        "margin": margin,
        "met": margin is not None and margin >= 0,
        "source": limit.source,
    }


def _find(results: Any, quantity: str) -> float | None:
    for step in _STEP.findall(quantity):
        if results is None:
            return None
        if match := _WITHIN.fullmatch(step):
            threshold = float(match[1])
            results = next(row for row in results["within"] if row["threshold_m"] == threshold)
        elif isinstance(results, list):
            results = results[int(step)]
        else:
            results = results[step]
    return None if results is None else float(results)


def _resolved(node: dict[str, Any]) -> dict[str, Any]:
    """Follow references, and past null to what else may stand there."""
    while "$ref" in node or "anyOf" in node:
        if "anyOf" in node:
            node = node["anyOf"][0]
        else:
            node = schema()["$defs"][node["$ref"].rpartition("/")[2]]
    return node


def _schema_below(
    node: dict[str, Any],
    step: str,
    quantity: str,
    within_m: tuple[float, ...],
    zones: tuple[str, ...],
) -> dict[str, Any]:
    node = _resolved(node)
    properties = dict(node.get("properties", {}))
    if isinstance(node.get("additionalProperties"), dict):
        properties |= dict.fromkeys(zones, node["additionalProperties"])
    if match := _WITHIN.fullmatch(step):
        if float(match[1]) not in within_m:
            message = (
                f"[limit] quantity '{quantity}' asks for {match[1]} m; [comparison] within_m is "
                f"{list(within_m)}."
            )
            raise ProjectError(message)
        return properties["within"]["items"]  # type: ignore[no-any-return]
    if step in properties:
        return properties[step]  # type: ignore[no-any-return]
    if node.get("type") == "array" and step.isdigit() and int(step) < node.get("maxItems", 0):
        return node["items"]  # type: ignore[no-any-return]
    near = difflib.get_close_matches(step, properties, n=1)
    hint = f" Did you mean '{near[0]}'?" if near else f" Known: {', '.join(properties)}."
    message = f"[limit] quantity '{quantity}' has no '{step}' in results.json.{hint}"
    raise ProjectError(message)
