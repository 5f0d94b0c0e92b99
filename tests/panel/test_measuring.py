"""What the bench keeps is what was asked, and never what was asked before."""

import json

import numpy as np
import pyproj
import pytest

from trigpoint.cloud import cloud_from
from trigpoint.files import write
from trigpoint_panel import measuring
from trigpoint_panel.measuring import Bench
from trigpoint_panel.model import Model
from trigpoint_panel.opening import open_cloud

CORNERS = np.array([[0, 0, 0], [8, 0, 0], [8, 8, 1], [0, 8, 2], [4, 4, 6]], float)
AT = np.array([741_000.0, 4_279_000.0, 150.0])


@pytest.fixture
def model(tmp_path):
    """A hilly field on disk twice, the second time lifted by half a metre, and five pairs."""
    rng = np.random.default_rng(1)
    plan = rng.uniform(0, 8, (20_000, 2))
    points = np.column_stack([plan, np.sin(plan[:, 0]) + np.cos(plan[:, 1] / 2)])
    write(tmp_path / "own.ply", cloud_from(points))
    for name, lift in (("low.laz", 0), ("high.laz", 0.5)):
        there = cloud_from(points + AT + [0, 0, lift], crs=pyproj.CRS("EPSG:32615"))
        write(tmp_path / name, there)
    made = Model()
    made.open_cloud("source", tmp_path / "own.ply")
    made.open_cloud("target", tmp_path / "low.laz")
    made.set_comparison(voxel_m=0.2)
    for k, place in enumerate(CORNERS):
        made.place("source", place)
        made.place("target", place + AT + [0.01 * (k % 3), 0.01 * (k % 2), 0.005 * k])
    return made


def keep_going(_fraction, _text=""):
    pass


def draw_region(path, reach):
    x, y = AT[:2]
    ring = [[x, y], [x + reach, y], [x + reach, y + reach], [x, y + reach], [x, y]]
    crs = {"type": "name", "properties": {"name": "urn:ogc:def:crs:EPSG::32615"}}
    path.write_text(json.dumps({"type": "Polygon", "coordinates": [ring], "crs": crs}))


def test_a_region_that_was_drawn_anew_is_read_anew(model, tmp_path):
    path = tmp_path / "region.geojson"
    shown = [open_cloud(tmp_path / name).cloud for name in ("own.ply", "low.laz")]
    bench, kept = Bench(), []
    for reach in (8, 4):
        draw_region(path, reach)
        model.set_reference(region=path)
        found = bench.compare(keep_going, model.state, model.similarity, *shown)
        kept.append(found.comparison.counts["reconstruction_in_region"])
    assert kept[1] < 0.5 * kept[0]


def test_icp_never_runs_on_the_reference_of_a_trial_that_was_given_up(model, tmp_path, monkeypatch):
    bench, alignment, surface = Bench(), model.fit.alignment, measuring.Surface
    heights, made = [], []

    def slow(points):
        """While the first surface is made its trial is given up, and the next one overtakes it."""
        made.append(points)
        if len(made) == 1:
            model.open_cloud("target", tmp_path / "high.laz")
            bench.try_icp(keep_going, model.state, alignment)
        return surface(points)

    monkeypatch.setattr(measuring, "Surface", slow)
    monkeypatch.setattr(
        measuring, "try_icp", lambda _, target, __: heights.append(target.centre[2])
    )
    bench.try_icp(keep_going, model.state, alignment)
    bench.try_icp(keep_going, model.state, alignment)
    assert np.subtract(heights, heights[1]).tolist() == pytest.approx([0.5, 0, 0.5], abs=0.05)
