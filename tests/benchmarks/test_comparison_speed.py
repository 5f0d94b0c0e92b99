"""A whole comparison: time beside decoding and searching alone, growth, and memory."""

import json
import subprocess
import sys

import pytest

from trigpoint import preparation
from trigpoint.comparison import compare
from trigpoint.nearest import nearest

pytestmark = pytest.mark.benchmark

CHILD = """
import json, resource, sys
from trigpoint.comparison import compare
counts = compare(*sys.argv[1:]).counts
peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024
print(json.dumps(dict(counts) | {"peak": peak}))
"""


def test_comparing_costs_little_more_than_decoding_and_searching(laz, decode, seconds, line):
    paths = [laz(10_000_000, seed, edge=62) for seed in (1, 2)]
    found = compare(*paths)
    voxels = found.reconstruction.xyz, found.reference.xyz
    whole, decoding, searching = seconds(
        lambda: compare(*paths),
        lambda: [decode(path) for path in paths],
        lambda: (nearest(*voxels), nearest(*voxels[::-1])),
        runs=4,
    )
    ratio = whole / (decoding + searching)
    line(
        f"compare two LAZ of 10 M points, {len(voxels[0]) / 1e6:.1f} M voxels each: {whole:.2f} s; "
        f"decoding {decoding:.2f} s, both searches {searching:.2f} s: {ratio:.2f} times as long "
        "(allowed: 1.5)"
    )
    assert ratio <= 1.5


def test_time_grows_linearly_in_points(laz, seconds, line, monkeypatch):
    # Unthinned shares stop at four million points: without them the work is the same at any size.
    monkeypatch.setattr(preparation, "RAW_LIMIT", 0)
    sizes = {1: 15, 4: 30, 16: 60}
    pairs = [[laz(m * 1_000_000, seed, edge=edge) for seed in (1, 2)] for m, edge in sizes.items()]
    works = [lambda pair=pair: compare(*pair) for pair in pairs]
    took = dict(zip(sizes, seconds(*works, runs=3), strict=True))
    line(
        "compare two LAZ of 1, 4, 16 M points: "
        + ", ".join(f"{value:.2f} s" for value in took.values())
        + f"; per million {', '.join(f'{value / m:.2f} s' for m, value in took.items())}"
    )
    assert took[16] / took[4] < 4 * 1.3


def test_fifty_million_points_take_less_than_two_gigabytes(laz, line):
    paths = [str(laz(50_000_000, seed, edge=108)) for seed in (1, 2)]
    child = subprocess.run(
        [sys.executable, "-c", CHILD, *paths], check=True, capture_output=True, text=True
    )
    found = json.loads(child.stdout)
    voxels = found["reference_voxels"], found["reconstruction_voxels"]
    line(
        f"compare two LAZ of 50 M points, {voxels[0] / 1e6:.1f} and {voxels[1] / 1e6:.1f} M "
        f"voxels: peak memory {found['peak'] / 1e9:.2f} GB (allowed: 2)"
    )
    assert max(voxels) <= 5_000_000
    assert found["peak"] < 2e9
