import json

import numpy as np
import pandas as pd
import pytest

from trigpoint_reporting.evidence import Evidence
from trigpoint_reporting.recount import recount


def zone(distances, thresholds=(0.05, 0.2)):
    some = len(distances) > 0
    within = [
        {"threshold_m": t, "pct": 100 * float((distances <= t).mean()) if some else 0.0}
        for t in thresholds
    ]
    rmse = float(np.sqrt((distances**2).mean())) if some else None
    return {"n": len(distances), "rmse_m": rmse, "within": within}


@pytest.fixture
def evidence(tmp_path):
    """A bundle of one reconstruction with picks, whose zone in the middle is empty."""
    rng = np.random.default_rng(3)
    data = tmp_path / "data"
    data.mkdir()
    errors = rng.normal(scale=0.1, size=(7, 3))
    lengths = np.linalg.norm(errors, axis=1)
    used = np.arange(7) < 6
    picks = pd.DataFrame(errors, columns=["dx_m", "dy_m", "dz_m"]).assign(d_m=lengths, used=used)
    picks.to_csv(data / "picks-nerf.csv", index=False)
    squares = float((lengths[used] ** 2).sum())
    folds = pd.DataFrame({"d_m": 1.5 * lengths[used], "scale_change_pct": rng.normal(size=6)})
    folds.to_csv(data / "loocv-nerf.csv", index=False)
    pd.DataFrame({"d_m": [0.3, 0.4]}).to_csv(data / "checks-nerf.csv", index=False)
    heights = np.array([-2.0, 1.0, 9.0, 12.0, 30.0])
    distances = np.array([0.01, 0.05, 0.2, 0.3, 0.4])
    lower, upper = heights < 4, heights >= 8
    zones = {
        "all": zone(distances),
        "lower": zone(distances[lower]),
        "middle": zone(distances[:0]),
        "upper": zone(distances[upper]),
    }
    stored = {"zone_edges_m": np.array([0.0, 4.0, 8.0, 12.0])}
    for direction in ("accuracy", "completeness"):
        stored[f"delivered_{direction}_m"] = distances
        stored[f"delivered_{direction}_height_m"] = heights
    np.savez_compressed(data / "distances-nerf.npz", **stored)
    comparison = {"accuracy": zones, "completeness": zones}
    found = {
        "alignment": {"rmse_m": (squares / 6) ** 0.5, "rmse_dof_m": (squares / (6 - 7 / 3)) ** 0.5},
        "loocv": {
            "rmse_m": float(np.sqrt((folds["d_m"] ** 2).mean())),
            "max_scale_change_pct": float(folds["scale_change_pct"].abs().max()),
        },
        "checks": {"n": 2, "rmse_m": 0.125**0.5},
        "comparison": {"delivered": comparison, "after_icp": None},
    }
    return Evidence(tmp_path, json.loads(json.dumps({"reconstructions": {"nerf": found}})))


def test_every_number_that_the_tables_determine_is_counted_again(evidence):
    table = recount(evidence)
    assert [row[0] for row in table.rows] == [
        "RMSE at the picks; the same by degrees of freedom",
        "Leave-one-out RMSE; largest change of scale",
        "RMSE at the check picks",
        "Accuracy by zone, as delivered",
        "Completeness by zone, as delivered",
    ]
    assert [row[1] for row in table.rows] == ["2 of 2", "2 of 2", "1 of 1", "16 of 16", "16 of 16"]


@pytest.mark.parametrize(
    ("path", "words"),
    [
        (("alignment", "rmse_m"), "RMSE at the picks"),
        (("alignment", "rmse_dof_m"), "degrees of freedom"),
        (("loocv", "rmse_m"), "Leave-one-out"),
        (("loocv", "max_scale_change_pct"), "largest change of scale"),
        (("checks", "rmse_m"), "check picks"),
        (("comparison", "delivered", "accuracy", "upper", "rmse_m"), "Accuracy by zone"),
        (("comparison", "delivered", "completeness", "lower", "n"), "Completeness by zone"),
    ],
)
def test_a_number_that_the_tables_contradict_is_named(evidence, path, words):
    row = evidence.results["reconstructions"]["nerf"]
    for key in path[:-1]:
        row = row[key]
    row[path[-1]] += 1e-6
    with pytest.raises(AssertionError, match=words):
        recount(evidence)


def test_a_reconstruction_without_picks_has_its_zones_counted(evidence):
    evidence.results["reconstructions"]["nerf"]["alignment"] = None
    assert len(recount(evidence).rows) == 2
