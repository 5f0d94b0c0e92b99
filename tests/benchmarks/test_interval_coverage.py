"""How often the intervals of zone shares hold the share at the true pose, on the demo's tower."""

import numpy as np
import pytest

from trigpoint.clocktower import SITE, build_tower
from trigpoint.cloud import cloud_from
from trigpoint.comparison import WITHIN_M, measure
from trigpoint.intervals import estimate
from trigpoint.preparation import prepare, thin
from trigpoint.reliability import assess
from trigpoint.sensors import photographs
from trigpoint.similarity import umeyama
from trigpoint.synthetic import CONTROL, PICK_SOURCE, PICK_TARGET, clock_tower

pytestmark = pytest.mark.benchmark

RUNS, DENSITY, PRINTED = 60, 0.3, 0.05  # shares are printed to a tenth of a percent
KEYS = ["direction", "zone", "threshold_m"]


@pytest.fixture(scope="module")
def scene():
    return clock_tower(density=DENSITY)


@pytest.fixture(scope="module")
def reference(scene):
    return prepare(scene.reference)


def perfect():
    """What the photographs show, without noise or loss."""
    seen = [photograph.points for photograph in photographs(build_tower(), DENSITY, seed=7)]
    return cloud_from(np.concatenate(seen) + SITE)


def repicked(scene, seed):
    """Pick the six control points again: the similarity, and what it is worth."""
    rng = np.random.default_rng([9, seed])
    places = np.array([scene.corners[name] for name in CONTROL])
    source = scene.truth.inverse()(places) + rng.normal(0, PICK_SOURCE, places.shape)
    target = places + rng.normal(0, PICK_TARGET, places.shape)
    fit = umeyama(source, target)
    sigmas = {"sigma_source": np.full(6, PICK_SOURCE), "sigma_target": np.full(6, PICK_TARGET)}
    return fit, assess(source, target, fit, **sigmas)


@pytest.mark.parametrize("kind", ["perfect", "neural", "photogrammetry"])
def test_zone_shares_at_the_true_pose_lie_in_their_intervals(kind, scene, reference, line):
    if kind == "neural":
        local = scene.neural
    else:
        cloud = perfect() if kind == "perfect" else scene.photogrammetry
        local = cloud.transformed(scene.truth.inverse())
    truth = measure(thin(local, reference, similarity=scene.truth), reference).within["pct"]
    held, width = 0.0, 0.0
    for seed in range(RUNS):
        fit, worth = repicked(scene, seed)
        comparison = measure(thin(local, reference, similarity=fit), reference)
        shares = estimate(comparison, reliability=worth, draws=200, seed=seed).shares
        low, high = shares["low_pct"] - PRINTED, shares["high_pct"] + PRINTED
        held = held + ((low <= truth) & (truth <= high)) / RUNS
        width = width + (shares["high_pct"] - shares["low_pct"]) / RUNS
    table = shares[KEYS].assign(truth=truth, held=100 * held, width=width)
    line(f"\n{kind}, {RUNS} times picked: share at the true pose, how often held, mean width, %")
    for (direction, zone), rows in table.groupby(KEYS[:2], sort=False):
        cells = [
            f"{row.threshold_m:.2f} m: {row.truth:5.1f} {row.held:4.0f} {row.width:4.0f}"
            for row in rows.itertuples()
        ]
        line(f"  {direction:<12} {zone:<7} {'    '.join(cells)}")
    # A share that is nearly all can't be missed above it.
    inner = table[(table["truth"] > 2) & (table["truth"] < 98) & (table["zone"] != "all")]
    line(f"  zone shares between 2 and 98 %: held {inner['held'].mean():.1f} % of the time")
    assert len(WITHIN_M) * 8 == len(table)
    assert 88 <= inner["held"].mean() <= 98
    assert inner["held"].min() >= 80
