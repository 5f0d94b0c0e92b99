import json
import subprocess
import sys

import numpy as np
import pytest
from numpy.testing import assert_array_equal
from scipy import stats

import trigpoint
from trigpoint.cloud import concatenate
from trigpoint.errors import PicksError
from trigpoint.project import read_project
from trigpoint.similarity import Similarity, umeyama
from trigpoint.synthetic import (
    PICK_SOURCE,
    PICK_TARGET,
    clock_tower,
    stream_neural,
    stream_photogrammetry,
    stream_reference,
    write_project,
)

FEW = 0.01  # a density that makes small clouds quickly
NONE = 1e-6  # and one that makes none
SEEDS = range(20)


@pytest.fixture(scope="module")
def scene():
    return clock_tower(density=0.1)


@pytest.fixture(scope="module")
def picked():
    scenes = [clock_tower(seed=seed, density=NONE) for seed in SEEDS]
    return [(scene.picks, scene.truth, scene.corners) for scene in scenes]


def same(one, other):
    assert_array_equal(one.xyz, other.xyz)
    assert_array_equal(one.origin, other.origin)
    assert list(one.attributes) == list(other.attributes)
    for name, values in one.attributes.items():
        assert values.dtype == other.attributes[name].dtype
        assert_array_equal(values, other.attributes[name])


def test_the_truth_carries_the_neural_cloud_onto_the_others(scene):
    back = scene.neural.transformed(scene.truth)
    tree = trigpoint.nearest.Tree(scene.reference.xyz)
    distance, _ = tree.query(back.about(scene.reference.origin).xyz)
    assert np.median(distance) < 0.25  # at a tenth of the density
    assert scene.truth.scale == 3.260
    assert np.linalg.det(scene.truth.rotation) == pytest.approx(1)


def test_the_neural_frame_is_arbitrary_and_in_float32(scene):
    coordinates = scene.neural.coordinates
    assert scene.neural.crs is None
    assert np.abs(coordinates).max() < 50
    assert_array_equal(coordinates, coordinates.astype(np.float32))


def test_the_georeferenced_clouds_say_where_they_are(scene):
    for cloud in (scene.reference, scene.photogrammetry):
        assert cloud.crs.to_epsg() == 32615
        low, high = cloud.coordinates.min(axis=0), cloud.coordinates.max(axis=0)
        assert (low > [740_000, 4_278_000, 150]).all()
        assert (high < [742_000, 4_280_000, 215]).all()


def test_six_control_and_four_check_picks_lie_low_middle_and_high(scene):
    assert (len(scene.picks.control.ids), len(scene.picks.check.ids)) == (6, 4)
    assert tuple(scene.corners) == scene.picks.ids
    assert all(scene.picks.notes)
    low, high = scene.reference.coordinates[:, 2].min(), scene.reference.coordinates[:, 2].max()
    share = (scene.picks.control.target[:, 2] - low) / (high - low)
    assert np.histogram(share, [0, 0.33, 0.66, 1])[0].tolist() == [2, 3, 1]


def test_picks_miss_the_truth_by_their_sigmas(picked):
    target = np.concatenate([p.target - list(corners.values()) for p, _, corners in picked])
    source = np.concatenate(
        [p.source - truth.inverse()(np.array(list(c.values()))) for p, truth, c in picked]
    )
    for error, sigma in ((target, PICK_TARGET), (source, PICK_SOURCE)):
        chi2 = (error**2).sum() / sigma**2
        assert stats.chi2.cdf(chi2, error.size) == pytest.approx(0.5, abs=0.495)


def test_six_picks_fit_about_as_well_as_the_papers(picked):
    squares = []
    for picks, _, _ in picked:
        control = picks.control
        residuals = control.target - umeyama(control.source, control.target)(control.source)
        squares.append((residuals**2).sum(axis=1).mean())
    assert np.sqrt(np.mean(squares)) == pytest.approx(0.137, abs=0.02)


def test_blunders_are_put_where_asked_and_nowhere_else():
    clean = clock_tower(density=FEW)
    spoilt = clock_tower(density=FEW, blunders={"roof-se": (0.0, 0.7, 0.0), "clock-n": (1, 2, 3)})
    moved = spoilt.picks.target - clean.picks.target
    expected = np.zeros((10, 3))
    expected[clean.picks.ids.index("roof-se")] = 0.0, 0.7, 0.0
    expected[clean.picks.ids.index("clock-n")] = 1, 2, 3
    np.testing.assert_allclose(moved, expected, atol=1e-9)
    assert_array_equal(spoilt.picks.source, clean.picks.source)
    same(spoilt.neural, clean.neural)


def test_a_blunder_at_no_pick_is_refused():
    with pytest.raises(PicksError, match="no picks apex to spoil; the picks are plinth-sw, "):
        clock_tower(density=FEW, blunders={"apex": (0, 0, 1)})


def test_the_same_seed_writes_the_same_bytes(tmp_path):
    one, two = (
        write_project(tmp_path / name, clock_tower(seed=7, density=FEW)) for name in ("one", "two")
    )
    names = sorted(path.name for path in one.parent.iterdir())
    expected = ["lidar.laz", "nerf.ply", "picks.csv", "project.toml", "sfm.laz", "truth.json"]
    assert names == expected
    for name in names:
        assert (one.parent / name).read_bytes() == (two.parent / name).read_bytes(), name


def test_another_seed_makes_another_scene():
    one, two = clock_tower(seed=1, density=FEW), clock_tower(seed=2, density=FEW)
    assert np.abs(one.truth.rotation - two.truth.rotation).max() > 0.01
    assert (one.picks.target != two.picks.target).all()
    for name in ("reference", "neural", "photogrammetry"):
        few = min(len(getattr(one, name)), len(getattr(two, name)))
        assert (getattr(one, name).xyz[:few] != getattr(two, name).xyz[:few]).mean() > 0.99


@pytest.mark.parametrize(
    ("stream", "name"),
    [
        (stream_reference, "reference"),
        (stream_neural, "neural"),
        (stream_photogrammetry, "photogrammetry"),
    ],
)
def test_streams_yield_the_clouds_of_the_scene(scene, stream, name):
    same(concatenate(list(stream(density=0.1))), getattr(scene, name))


@pytest.mark.parametrize("stream", [stream_reference, stream_neural, stream_photogrammetry])
def test_a_denser_stream_begins_as_a_sparser_one_and_holds_no_more_at_a_time(stream):
    first, denser = next(stream(density=1.0)), next(stream(density=1_000.0))
    same(first, denser)
    assert len(first) < 100_000


def test_a_stream_is_written_without_holding_it(tmp_path):
    written = tmp_path / "nerf.ply"
    trigpoint.write(written, stream_neural(density=FEW))
    cloud = trigpoint.read(written)
    expected = concatenate(list(stream_neural(density=FEW)))
    assert_array_equal(cloud.coordinates, expected.coordinates)
    assert set(cloud.attributes) == {"red", "green", "blue"}


def test_a_scene_is_written_as_a_project_that_reads(tmp_path):
    scene = clock_tower(density=FEW)
    path = write_project(tmp_path, scene)
    project = read_project(path)
    assert project.about.id == "tower"
    assert "#" in path.read_text()
    picks = trigpoint.read_picks(tmp_path / "picks.csv")
    assert_array_equal(picks.source, scene.picks.source)
    assert_array_equal(picks.target, scene.picks.target)
    assert picks.notes == scene.picks.notes
    truth = json.loads((tmp_path / "truth.json").read_text())
    again = Similarity(truth["scale"], np.array(truth["rotation"]), np.array(truth["translation"]))
    assert_array_equal(again.matrix, scene.truth.matrix)


def test_the_engine_does_not_know_the_clock_tower():
    asked = "import sys, trigpoint, trigpoint.pipeline; print(*sys.modules)"
    loaded = subprocess.run(
        [sys.executable, "-c", asked], capture_output=True, text=True, check=True
    ).stdout.split()
    scenery = {"synthetic", "sensors", "scanning", "clocktower"}
    assert not {f"trigpoint.{name}" for name in scenery} & set(loaded)
    assert "trigpoint.pipeline" in loaded
