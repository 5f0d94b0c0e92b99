"""The findings as data-quality elements in the shape of ISO 19157-1."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

POSITION = "absolute external positional accuracy"
OMISSION = "completeness: omission"
COMMISSION = "completeness: commission"


def quality_report(results: Mapping[str, Any]) -> dict[str, Any]:
    """Return element, measure, evaluation method, results and metaquality for each finding.

    Every quantitative result names where in results.json it stands. The measures carry no
    registered identifiers, and nothing here has been validated against the standard's own schema.

    Parameters
    ----------
    results : dict
        As in results.json.
    """
    about = results["project"]
    return {
        "shape": "ISO 19157-1:2023, element / measure / evaluation method / result / metaquality; "
        "not validated against the standard's schema",
        "dataset": {"identifier": f"{about['id']}-r{about['revision']}", "title": about["title"]},
        "reports": [
            {
                "scope": {"level": "dataset", "name": name},
                "elements": [
                    *_positional(results, name, found),
                    *_completeness(results, name, found),
                    *_conformance(results, name),
                ],
            }
            for name, found in results["reconstructions"].items()
        ],
    }


def _positional(
    results: Mapping[str, Any], name: str, found: Mapping[str, Any]
) -> Iterator[dict[str, Any]]:
    place = f"reconstructions.{name}"
    if found["alignment"] is not None:
        count, checks = found["alignment"]["n"], found["checks"]["n"]
        yield _element(
            POSITION,
            "root mean square 3D residual at the control picks",
            "direct internal: the picks that the similarity was fitted to",
            f"{place}.alignment.rmse_m",
            found["alignment"]["rmse_m"],
            f"{count} control picks; a fit is always nearer to its own picks than to others",
        )
        yield _element(
            POSITION,
            "root mean square 3D error of leave-one-out prediction",
            "direct internal: each control pick predicted by a fit to the others",
            f"{place}.loocv.rmse_m",
            found["loocv"]["rmse_m"],
            f"{count} control picks, which are not independent check points",
        )
        if checks:
            yield _element(
                POSITION,
                "root mean square 3D error at check picks",
                "direct external: picks that entered nothing",
                f"{place}.checks.rmse_m",
                found["checks"]["rmse_m"],
                f"{checks} check picks",
            )
    row = found["comparison"]["delivered"]["accuracy"]["all"]
    accuracy = results["project"]["settings"]["reference"]["accuracy_m"]
    stated = "not stated" if accuracy is None else f"{accuracy:g} m per axis"
    yield _element(
        POSITION,
        "root mean square distance from the reconstruction to the nearest reference point",
        "direct external: the reference cloud",
        f"{place}.comparison.delivered.accuracy.all.rmse_m",
        row["rmse_m"],
        f"{row['n']} thinned points; the reference's own accuracy is {stated}",
    )


def _completeness(
    results: Mapping[str, Any], name: str, found: Mapping[str, Any]
) -> Iterator[dict[str, Any]]:
    region = f"margin {results['project']['settings']['comparison']['margin_m']} m"
    for direction, element, subject in (
        ("completeness", OMISSION, "reference points without a reconstruction point"),
        ("accuracy", COMMISSION, "reconstruction points without a reference point"),
    ):
        row = found["comparison"]["delivered"][direction]["all"]
        for share in row["within"]:
            path = f"reconstructions.{name}.comparison.delivered.{direction}.all.within"
            value = None if share["pct"] is None else 100 - share["pct"]
            yield _element(
                element,
                f"rate of {subject} within {share['threshold_m']:g} m",
                "direct external: the reference cloud",
                f"100 - {path}[{share['threshold_m']!r}].pct",
                value,
                f"{row['n']} thinned points; {region}",
                unit="percent",
            )


def _conformance(results: Mapping[str, Any], name: str) -> Iterator[dict[str, Any]]:
    for position, row in enumerate(results["criteria"]):
        if row["of"] != name:
            continue
        covers = ".completeness." in row["quantity"]
        yield {
            "element": OMISSION if covers else POSITION,
            "measure": {"name": row["quantity"]},
            "evaluationMethod": {"type": "as for the quantity itself"},
            "result": {
                "type": "conformance",
                "specification": row["source"],
                "explanation": f"limit {row['limit']}",
                "pass": row["met"],
                "path": f"criteria.{position}.met",
            },
        }


def _element(
    element: str,
    measure: str,
    method: str,
    path: str,
    value: float | None,
    confidence: str,
    *,
    unit: str = "metre",
) -> dict[str, Any]:
    kind, _, description = method.partition(": ")
    return {
        "element": element,
        "measure": {"name": measure},
        "evaluationMethod": {"type": kind, "description": description},
        "result": {"type": "quantitative", "value": value, "unit": unit, "path": path},
        "metaquality": {"representativity": confidence},
    }
