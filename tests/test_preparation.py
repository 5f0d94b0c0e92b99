"""Clouds made ready: cropped, on one lattice, every loss counted."""

import sys

import numpy as np
import pyproj
import pytest
import shapely

from trigpoint import preparation as room
from trigpoint.cloud import PointCloud, cloud_from
from trigpoint.errors import CloudError, CrsError, RegionError
from trigpoint.files import write
from trigpoint.preparation import prepare, thin
from trigpoint.similarity import Similarity
from trigpoint.zones import Outline

FILES = sys.modules["trigpoint.files"]


def facade(n, seed, noise=0.02):
    rng = np.random.default_rng(seed)
    points = rng.uniform(0, 1, (n, 3)) * [12, 0, 20]
    return points + rng.normal(0, noise, (n, 3))


def test_a_reference_is_thinned_and_all_of_it_is_counted(offset):
    points = facade(20_000, 1) + offset
    reference = prepare(cloud_from(points))
    assert reference.points == reference.counts.sum() == 20_000
    assert len(reference.cloud) == len(reference.counts) < 20_000
    np.testing.assert_allclose(reference.low, points.min(axis=0), atol=1e-8)
    np.testing.assert_allclose(reference.high, points.max(axis=0), atol=1e-8)
    low, high = reference.low[2], reference.high[2]
    np.testing.assert_allclose(
        reference.zones.edges_m, low + (high - low) * np.r_[0, 0.33, 0.66, 1]
    )


def test_voxel_zero_thins_nothing():
    points = facade(3_000, 2)
    reference = prepare(cloud_from(points), voxel=0)
    np.testing.assert_allclose(reference.cloud.coordinates, points, atol=1e-9)
    assert (reference.counts == 1).all()
    reconstruction = thin(cloud_from(points), reference)
    np.testing.assert_allclose(reconstruction.cloud.coordinates, points, atol=1e-9)


def test_files_and_clouds_in_memory_give_the_same(tmp_path, offset):
    points = np.round(facade(20_000, 3) + offset, 3)
    path = tmp_path / "reference.las"
    write(path, cloud_from(points))
    from_file, from_memory = prepare(path), prepare(cloud_from(points))
    np.testing.assert_allclose(
        from_file.cloud.coordinates, from_memory.cloud.coordinates, atol=2e-9
    )
    np.testing.assert_array_equal(from_file.counts, from_memory.counts)
    np.testing.assert_allclose(from_file.floor_rmse_m, from_memory.floor_rmse_m, rtol=1e-6)


@pytest.mark.parametrize("voxel", [0.1, 0])
def test_the_size_of_the_chunks_changes_no_bit(monkeypatch, tmp_path, voxel):
    path = tmp_path / "cloud.las"
    write(path, cloud_from(facade(30_000, 4)))
    results = []
    for chunk in (1_000_000, 7_001):
        monkeypatch.setattr(room, "stream", lambda p, n=chunk, **k: FILES.stream(p, chunk=n, **k))
        reference = prepare(path, voxel=voxel)
        results.append((reference, thin(path, reference)))
    (one, moved_one), (other, moved_other) = results
    assert one.cloud.xyz.tobytes() == other.cloud.xyz.tobytes()
    assert moved_one.cloud.xyz.tobytes() == moved_other.cloud.xyz.tobytes()
    np.testing.assert_array_equal(one.floor_rmse_m, other.floor_rmse_m)


def test_the_floor_is_what_two_samplings_of_one_wall_measure():
    # Halves of 50 points a square metre lie as far apart as random points do: the mean square
    # distance to the nearest of a density d is 1 / (pi d).
    rng = np.random.default_rng(5)
    wall = np.column_stack(
        [rng.uniform(0, 40, 160_000), np.zeros(160_000), rng.uniform(0, 40, 160_000)]
    )
    floor = prepare(cloud_from(wall), voxel=0).floor_rmse_m
    assert floor.index.tolist() == ["all", "lower", "middle", "upper"]
    np.testing.assert_allclose(floor, 1 / np.sqrt(np.pi * 50), rtol=0.02)


def test_the_floor_depends_on_the_seed_and_on_nothing_else():
    cloud = cloud_from(facade(10_000, 6))
    once, again, other = (prepare(cloud, seed=seed).floor_rmse_m for seed in (42, 42, 43))
    np.testing.assert_array_equal(once, again)
    assert (once != other).all()
    np.testing.assert_allclose(once, other, rtol=0.1)


def test_the_floor_of_one_point_is_unknown():
    assert prepare(cloud_from([[1.0, 2.0, 3.0]])).floor_rmse_m.isna().all()


def test_every_point_lost_to_the_region_is_counted():
    reference = prepare(cloud_from(facade(5_000, 7)), margin=1.0)
    points = np.vstack([facade(5_000, 8), facade(2_000, 9) + np.array([0, 1.5, 0])])
    found = thin(cloud_from(points), reference)
    assert found.points == 7_000
    kept = ((points >= reference.low - 1) & (points <= reference.high + 1)).all(axis=1).sum()
    assert found.points_in_region == found.counts.sum() == kept < 7_000
    assert not found.cautions
    assert thin(cloud_from(points), prepare(cloud_from(points), margin=None)).counts.sum() == 7_000


def test_a_region_that_keeps_little_is_a_caution():
    reference = prepare(cloud_from(facade(5_000, 10)))
    for shift, kept in ((8.0, True), (500.0, False)):
        found = thin(cloud_from(facade(5_000, 11) + np.array([shift, 0, 0])), reference)
        assert (found.points_in_region > 0) == kept
        assert [caution.code for caution in found.cautions] == ["region_mostly_empty"]


def test_an_outline_crops_reconstructions_and_never_the_reference():
    outline = Outline(shapely.box(0, -1, 6, 1))
    cloud = cloud_from(facade(10_000, 12))
    reference = prepare(cloud, region=outline)
    assert reference.points == 10_000
    assert reference.counts.sum() == 10_000
    found = thin(cloud, reference)
    assert (
        found.points_in_region
        == ((cloud.coordinates >= [0, -1, -9]).all(axis=1) & (cloud.coordinates[:, 0] <= 6)).sum()
    )


@pytest.mark.parametrize(
    ("outline", "share"),
    [
        (shapely.box(-1, -1, 13, 1), 0.0),
        (shapely.box(-1, -1, 11.98, 1), 0.0),  # the border cuts off next to nothing
        (shapely.box(-1, -1, 6, 1), 0.5),
        (shapely.box(-1, -1, 13, 1).difference(shapely.box(3, -1, 6, 1)), 0.25),  # a hole
    ],
)
def test_a_region_that_leaves_out_some_of_the_reference_is_a_caution(outline, share):
    reference = prepare(cloud_from(facade(10_000, 12)), region=Outline(outline))
    assert reference.points == reference.counts.sum() == 10_000
    codes = [caution.code for caution in reference.cautions]
    assert codes == (["region_leaves_out_reference"] if share else [])
    if share:
        count = int(reference.cautions[0].message.split()[0].replace(",", ""))
        assert count == pytest.approx(10_000 * share, rel=0.05)


def test_a_similarity_carries_the_reconstruction_onto_the_references_lattice(
    offset, similarity_from
):
    points = facade(10_000, 13) + offset
    reference = prepare(cloud_from(points))
    fit = similarity_from(3, offset)
    found = thin(cloud_from(fit.inverse()(points)), reference, similarity=fit)
    assert abs(len(found.cloud) - len(reference.cloud)) <= 2
    assert reference.tree.query(found.cloud.xyz)[0].max() < 0.1
    assert np.median(reference.tree.query(found.cloud.xyz)[0]) < 1e-6


def test_a_reconstruction_can_be_moved_after_thinning(offset):
    points = facade(5_000, 14) + offset
    reference = prepare(cloud_from(points))
    still = thin(cloud_from(points), reference)
    moved = still.moved(Similarity(1.0, np.eye(3), np.array([0.3, 0.2, -0.1])))
    np.testing.assert_allclose(
        moved.cloud.xyz - still.cloud.xyz, [[0.3, 0.2, -0.1]] * len(still.cloud), atol=2e-9
    )
    np.testing.assert_allclose(moved.raw - still.raw, [[0.3, 0.2, -0.1]] * 5_000, atol=2e-9)
    assert moved.points == still.points


def test_unthinned_points_are_kept_only_while_they_are_few(monkeypatch):
    cloud, more = cloud_from(facade(1_000, 15)), cloud_from(facade(1_001, 15))
    monkeypatch.setattr(room, "RAW_LIMIT", 1_000)
    few, many = prepare(cloud), prepare(more)
    assert len(few.raw) == 1_000
    assert many.raw is None
    assert thin(cloud, few).raw is not None
    assert thin(more, few).raw is None
    assert thin(cloud, many).raw is None


def test_another_crs_is_refused_unless_a_similarity_leads_to_it():
    points = facade(1_000, 16)
    reference = prepare(cloud_from(points, crs=pyproj.CRS("EPSG:32615+5703")))
    same = cloud_from(points, crs=pyproj.CRS("EPSG:32615"))
    other = cloud_from(points, crs=pyproj.CRS("EPSG:32616"))
    assert thin(same, reference).points == 1_000
    assert (
        thin(other, reference, similarity=Similarity(1.0, np.eye(3), np.zeros(3))).points == 1_000
    )
    with pytest.raises(CrsError, match=r"EPSG:32616.*EPSG:32615.*bring one to the other's"):
        thin(other, reference)


def test_what_can_not_be_prepared_is_refused():
    with pytest.raises(CloudError, match="holds no points"):
        prepare(PointCloud(np.empty((0, 3)), np.zeros(3)))
    cloud = cloud_from(facade(10, 17))
    with pytest.raises(RegionError, match="voxel"):
        prepare(cloud, voxel=-1)
    with pytest.raises(RegionError, match="margin"):
        prepare(cloud, margin=-1)


def test_arguments_are_left_as_they_were():
    cloud = cloud_from(facade(2_000, 18))
    before = cloud.xyz.copy()
    thin(cloud, prepare(cloud))
    np.testing.assert_array_equal(cloud.xyz, before)
