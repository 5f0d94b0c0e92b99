"""The paper's clock tower as results.json, and what makes a report awkward."""

import json
from copy import deepcopy

import numpy as np
import pytest

from trigpoint.canonical import to_json
from trigpoint_reporting.evidence import Evidence

FIT, LOOCV, SCALE = 0.137, 0.205, 3.260
ICP_CONTROL = 0.211
# Within 0.10 m of the reference's points, and RMSE in the upper zone.
COMPLETE = {"nerf": (90.7, 0.077), "sfm": (78.5, 0.175)}
ZONES = ("all", "lower", "middle", "upper")
HOSTILE = '"); import os; <script>alert(1)</script> ${x} {{ 7*7 }} \u202e'
ARABIC = "برج الساعة"


def vectors(count, rmse, seed):
    """Errors without mean whose 3D root mean square is as asked."""
    errors = np.random.default_rng(seed).normal(size=(count, 3))
    errors -= errors.mean(axis=0)
    return errors * rmse / np.sqrt((errors**2).sum(axis=1).mean())


def rows(ids, errors, **extra):
    return [
        {"id": name, "dx_m": x, "dy_m": y, "dz_m": z, "d_m": float(np.hypot(np.hypot(x, y), z))}
        | extra
        for name, (x, y, z) in zip(ids, errors.tolist(), strict=True)
    ]


def picked(ids, *, fit=FIT, loocv=LOOCV, checks=()):
    """What a similarity fitted to picks of these names leaves."""
    count = len(ids)
    dof = 3 * count - 7
    known = count > 3
    sigma = fit * np.sqrt(count / dof)
    folds = [
        {key: row[key] if known else None for key in ("dx_m", "dy_m", "dz_m", "d_m")}
        | {"id": row["id"], "scale": SCALE if known else None}
        | dict.fromkeys(("rotation_change_deg", "shift_m"), 0.1234 if known else None)
        | {"scale_change_pct": 0.2654 - 0.001 * k if known else None}
        | {"inliers_changed": False if known else None}
        for k, row in enumerate(rows(ids, vectors(count, loocv, 2)))
    ]
    errors = vectors(len(checks), 0.15, 3) if checks else np.zeros((0, 3))
    total = float(np.sqrt(0.15**2 + 3 * 0.05**2))
    turn = np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])
    place = [741012.5, 4279060.75, 150.25]
    matrix = np.vstack([np.column_stack([SCALE * turn, place]), [0, 0, 0, 1]])
    residuals = rows(ids, vectors(count, fit, 1), role="control", used=True)
    return {
        "alignment": {
            "method": "ransac",
            "seed": 42,
            "trials": 10000,
            "degenerate_trials": 0,
            "exhaustive_agrees": True,
            "threshold_m": 0.5,
            "weighted": False,
            "n": count,
            "dof": dof,
            "scale": SCALE,
            "rotation": turn,
            "translation": place,
            "matrix": matrix,
            "rmse_m": fit,
            "rmse_dof_m": fit * np.sqrt(count / (count - 7 / 3)),
            "mean_m": [0.0, 0.0, 0.0],
            "inliers": list(ids),
            "outliers": [],
            "residuals": residuals,
        },
        "loocv": {
            "rmse_m": loocv if known else None,
            "rmse_procedure_m": loocv if known else None,
            "max_scale_change_pct": 0.2654 if known else None,
            "closed_form": False,
            "folds": folds,
        },
        "checks": {
            "n": len(checks),
            "mean_m": errors.mean(axis=0) if checks else [None] * 3,
            "rmse_m": 0.15 if checks else None,
            "total_m": total if checks else None,
            "residuals": rows(checks, errors, role="check"),
        },
        "reliability": {
            "noise": "residuals",
            "sigma_m": sigma or 0.0,
            "global_p_value": None,
            "sigma0_m": sigma,
            "sigma0_low_m": 0.7 * sigma,
            "sigma0_high_m": 1.7 * sigma,
            "scale_low": SCALE - 0.01 if known else None,
            "scale_high": SCALE + 0.01 if known else None,
            "centroid_m": [741_010.0, 4_279_010.0, 165.0],
            "covariance": np.diag([1e-6] * 4 + [2e-3] * 3) if known else None,
            "rotation_sigma_deg": [0.4, 0.2, 0.1] if known else [None] * 3,
            "picks": [
                {
                    "id": name,
                    "redundancy": 1.8,
                    "standardised": 1.5 if known else None,
                    "p_value": 0.3 if known else None,
                    "suspected": False if known else None,
                    "detectable_blunder_m": 0.6 if known else None,
                }
                for name in ids
            ],
            "zones": {zone: {"sigma_m": 0.1} for zone in ZONES[1:]},
            "geometry": "sound" if known else "weak",
            "statement": "Sound: as it is." if known else "Weak: too few.",
            "next_picks": [{"x": 741000.5, "y": 4279050.5, "z": 160.5, "gain_m": 0.04}],
            "repeats": [],
            "cross_checks": [],
        },
    }


def zone(n, rmse, share):
    return {
        "n": n,
        "mean_m": rmse if n else None,
        "median_m": rmse if n else None,
        "rmse_m": rmse if n else None,
        "nmad_m": 0.03 if n else None,
        "p95_m": 0.2 if n else None,
        "max_m": 1.5 if n else None,
        "floor_rmse_m": 0.05 if n else None,
        "rmse_low_m": None,
        "rmse_high_m": None,
        "within": [
            {"threshold_m": threshold, "pct": (share + gain) if n else 0.0, "raw_pct": None}
            | dict.fromkeys(("low_pct", "high_pct", "pose_low_pct", "pose_high_pct"))
            | dict.fromkeys(("sampling_low_pct", "sampling_high_pct"))
            for threshold, gain in ((0.05, -30.0), (0.1, 0.0), (0.2, 5.0))
        ],
    }


def compared(name):
    share, upper = COMPLETE[name]
    zones = {each: zone(1000, 0.1, share) for each in ZONES} | {"upper": zone(200, upper, share)}
    counts = {"reference_points": 532598, "reconstruction_voxels": 1000}
    return {"counts": counts, "accuracy": zones, "completeness": deepcopy(zones), "intervals": None}


def tried(has_picks):
    held = (FIT, ICP_CONTROL, LOOCV, 0.22) if has_picks else (None,) * 4
    keys = ("control_rmse_before_m", "control_rmse_after_m", "loocv_rmse_before_m")
    return {
        "translation_m": [0.05, -0.02, 0.01],
        "shift_m": 0.055,
        "rotation_deg": 0.12,
        "iterations": 9,
        "overlap_pct": 93.2,
        "surface_rmse_before_m": 0.12,
        "surface_rmse_after_m": 0.11,
        **dict(zip((*keys, "loocv_rmse_after_m"), held, strict=True)),
        "check_rmse_before_m": None,
        "check_rmse_after_m": None,
        "retained": False,
        "rule": "ICP is retained only if it lowers the leave-one-out error.",
    }


def paper():
    """Six picks, 0.137 m in the fit and 0.205 m left out; NeRF against SfM."""
    ids = [f"p{k}" for k in range(6)]
    nothing = dict.fromkeys(("alignment", "loocv", "checks", "reliability"))
    found = {
        name: (picked(ids) if name == "nerf" else nothing)
        | {
            "icp": tried(name == "nerf"),
            "comparison": {"delivered": compared(name), "after_icp": compared(name)},
        }
        for name in COMPLETE
    }
    return {
        "schema": "trigpoint-results/1",
        "project": {
            "id": "tower",
            "title": "Clock tower",
            "site": "",
            "client": "",
            "surveyor": "",
            "organisation": "",
            "purpose": "",
            "limitations": "",
            "status": "draft",
            "revision": 1,
            "date": None,
            "settings": {
                "alignment": {"method": "ransac", "threshold_m": 0.5, "weighted": False},
                "comparison": {
                    "voxel_m": 0.1,
                    "within_m": [0.05, 0.1, 0.2],
                    "zones": [0.33, 0.66],
                    "margin_m": 1.0,
                    "icp": True,
                },
                "reference": {
                    "name": "ALS",
                    "captured": "",
                    "accuracy_m": None,
                    "accuracy_source": "",
                },
            },
        },
        "environment": {"trigpoint": "0.1.0", "python": "3.11.7"},
        "inputs": [
            {
                "name": "nerf",
                "role": "neural",
                "path": "nerf.ply",
                "format": "PLY 1.0, little endian, float",
                "bytes": 12345678,
                "sha256": "ab" * 32,
                "points": 500000,
                "crs": None,
            }
        ],
        "crs": {
            "name": "WGS 84 / UTM zone 15N",
            "code": "EPSG:32615",
            "units": ["metre"] * 3,
            "to_metre": [1.0] * 3,
            "datum": "World Geodetic System 1984 ensemble",
            "is_ensemble": True,
            "ensemble_accuracy_m": 2.0,
            "vertical_datum": None,
            "longitude_deg": -90.2313797,
            "latitude_deg": 38.6273690,
            "in_area_of_use": True,
            "grid_scale": 1.000313,
            "convergence_deg": 1.727,
            "height_effect_ppm": -28.5,
            "combined_factor": 1.0002845,
            "mm_over_100_m": 28.45,
        },
        "reconstructions": found,
        "paired": {"delivered": [], "after_icp": []},
        "criteria": [],
        "verdict": "NOT TESTED",
        "warnings": [{"code": "vertical_datum_unknown", "message": "Heights count from where?"}],
    }


def limit(quantity, bound, found, *, of="nerf", source="brief, clause 4"):
    margin = None if found is None else bound - found
    return {
        "quantity": quantity,
        "of": of,
        "limit": f"max {bound:g}",
        "found": found,
        "margin": margin,
        "met": margin is not None and margin >= 0,
        "source": source,
    }


def few():
    """Three picks: nothing can be left out, and every statistic is missing that may be."""
    results = paper()
    results["reconstructions"]["nerf"] |= picked(["a", "b", "c"], fit=0.01)
    return results


def many(count=300):
    results = paper()
    results["reconstructions"]["nerf"] |= picked([f"{k}" for k in range(count)])
    results["reconstructions"]["nerf"]["loocv"]["closed_form"] = True
    for fold in results["reconstructions"]["nerf"]["loocv"]["folds"]:
        fold["inliers_changed"] = None
    return results


def rejected():
    """Ten picks of which seven were rejected: no three more agree."""
    results = paper()
    found = results["reconstructions"]["nerf"]
    found |= picked(["a", "b", "c"], fit=0.01)
    out = [f"wrong-{k}" for k in range(7)]
    found["alignment"]["outliers"] = out
    found["alignment"]["residuals"] += rows(out, vectors(7, 4.0, 5), role="control", used=False)
    return results


def unpicked():
    results = paper()
    del results["reconstructions"]["nerf"]
    results["paired"] = {"delivered": [], "after_icp": []}
    return results


def hollow():
    """An empty zone, no ICP, no CRS and no crop."""
    results = paper()
    results["crs"] |= {"name": "none", "code": None, "datum": None, "is_ensemble": False}
    results["crs"] |= dict.fromkeys(
        [
            "ensemble_accuracy_m",
            "longitude_deg",
            "latitude_deg",
            "in_area_of_use",
            "grid_scale",
            "convergence_deg",
            "height_effect_ppm",
            "combined_factor",
            "mm_over_100_m",
        ]
    )
    results["project"]["settings"]["comparison"]["margin_m"] = None
    for found in results["reconstructions"].values():
        found["icp"], found["comparison"]["after_icp"] = None, None
        for direction in ("accuracy", "completeness"):
            found["comparison"]["delivered"][direction]["upper"] = zone(0, None, 0.0)
    results["warnings"] = []
    return results


def hostile():
    """Text that would be code, markup, a path or another direction of writing, in every field."""
    results = paper()
    ids = [HOSTILE, ARABIC, "x" * 60, "NA", "1", "0", "a]b.d_m", "[2]", "2\n3", " ", "0.1", "é"]
    checks = ["<b>", "1", "]"]
    results["reconstructions"]["nerf"] |= picked(ids, checks=checks)
    for key in ("title", "site", "client", "surveyor", "organisation", "purpose", "limitations"):
        results["project"][key] = f"{key} {HOSTILE} {ARABIC}"
    results["project"]["settings"]["reference"] |= dict.fromkeys(
        ("name", "captured", "accuracy_source"), HOSTILE
    )
    results["crs"]["name"] = HOSTILE
    results["criteria"] = [limit("loocv.rmse_m", 0.25, LOOCV, source=HOSTILE)]
    results["verdict"] = "PASS"
    return results


def full():
    """Everything that a project may have: intervals, pairs, checks, cross checks, limits."""
    results = paper()
    found = results["reconstructions"]["nerf"]
    found |= picked([f"p{k}" for k in range(6)], checks=[f"c{k}" for k in range(4)])
    found["reliability"]["cross_checks"] = [
        {
            "kind": "scale_bar",
            "discrepancy": -0.0123,
            "sigma": 0.02,
            "unit": "m",
            "p_value": 0.54,
            "statement": "The scale bar agrees.",
        }
    ]
    results["project"]["settings"]["reference"] |= {"accuracy_m": 0.03, "accuracy_source": "QA 7"}
    delivered = found["comparison"]["delivered"]
    for direction in ("accuracy", "completeness"):
        for part in delivered[direction].values():
            part |= {"rmse_low_m": 0.05, "rmse_high_m": 0.15}
            for share in part["within"]:
                share |= {"low_pct": share["pct"] - 3, "high_pct": share["pct"] + 3}
    delivered["intervals"] = {
        "statement": "Each 95 % interval says where the value at the true pose lies.",
        "has_pose": True,
        "block_m": {"accuracy": 2.0, "completeness": 2.0},
        "draws": 2000,
        "seed": 42,
        "perfect": {"statement": "From picking noise alone, it would be 95 %.", "shares": []},
    }
    difference = {
        "zone": "all",
        "threshold_m": 0.2,
        "one_pct": 90.7,
        "other_pct": 78.5,
        "difference_pct": 12.2,
        "low_pct": 10.0,
        "high_pct": 14.4,
        **dict.fromkeys(("pose_low_pct", "pose_high_pct")),
        **dict.fromkeys(("sampling_low_pct", "sampling_high_pct")),
        "verdict": "better",
        "sentence": "nerf is more complete than sfm.",
    }
    pair = {
        "names": ["nerf", "sfm"],
        "statement": "Over all zones, nerf is more complete than sfm within 0.2 m.",
        "differences": [difference | {"zone": each} for each in ZONES],
    }
    results["paired"] = {"delivered": [pair], "after_icp": [pair]}
    results["criteria"] = [
        limit("loocv.rmse_m", 0.25, LOOCV),
        limit("checks.total_m", 0.2, found["checks"]["total_m"]),
        limit("comparison.delivered.completeness.upper.within[0.10].pct", 95.0, 90.7),
        limit("alignment.mean_m.2", 0.01, 0.0),
    ]
    results["verdict"] = "CONDITIONAL"
    return results


CASES = {each.__name__: each for each in (paper, few, many, rejected, unpicked, hollow, hostile)}
CASES["full"] = full


@pytest.fixture
def make_evidence(tmp_path):
    """Return results as a bundle, by the name of a case or as they are given."""

    def make(case):
        results = CASES[case]() if isinstance(case, str) else case
        results = json.loads(to_json(results))
        data = tmp_path / "data"
        data.mkdir(exist_ok=True)
        for name in results["reconstructions"]:
            edges = np.array([151.9, 171.7, 191.6, 212.0])
            np.savez(data / f"distances-{name}.npz", zone_edges_m=edges)
        return Evidence(tmp_path, results)

    return make


@pytest.fixture(params=list(CASES))
def evidence(request, make_evidence):
    """Every case in turn."""
    return make_evidence(request.param)


@pytest.fixture
def with_limits(make_evidence):
    """Return the paper's results with limits and the verdict that they lead to."""

    def make(*limits, verdict, checks=0, accuracy=None):
        results = paper()
        if checks:
            ids = [f"p{k}" for k in range(6)]
            names = [f"c{k}" for k in range(checks)]
            results["reconstructions"]["nerf"] |= picked(ids, checks=names)
        results["project"]["settings"]["reference"]["accuracy_m"] = accuracy
        results["criteria"] = [limit(*each) for each in limits]
        results["verdict"] = verdict
        return make_evidence(results)

    return make
