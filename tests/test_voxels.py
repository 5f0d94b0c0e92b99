"""One lattice for all clouds: cells, centroids, and bits that no chunking changes."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from trigpoint import voxels as room
from trigpoint.cloud import PointCloud, cloud_from
from trigpoint.errors import CloudError, RegionError
from trigpoint.voxels import Lattice, centroids, gather, group, thin

NEAR = np.zeros(3)
UTM = np.array([741_000.0, 4_279_000.0, 150.0])


def scatter(n, seed, size=(8, 8, 5)):
    return np.random.default_rng(seed).uniform(-1, 1, (n, 3)) * size


def plainly(points, voxel):
    """Centroids by the definition, the slow way."""
    cells = np.floor(points / voxel + 1e-6).astype(int)
    unique, inverse, counts = np.unique(cells, axis=0, return_inverse=True, return_counts=True)
    sums = np.zeros((len(unique), 3))
    np.add.at(sums, inverse.ravel(), points)
    return sums / counts[:, None], counts


def pieces(points, origin, sizes):
    cuts = np.cumsum(sizes)[:-1]
    return [PointCloud(part, origin) for part in np.split(points, cuts)]


@pytest.mark.parametrize("voxel", [0.05, 0.1, 0.25, 1.0, 3.0])
def test_centroids_and_counts_follow_the_definition(voxel):
    points = scatter(5_000, 1)
    found = thin([PointCloud(points, NEAR)], Lattice(voxel, NEAR))
    expected, counts = plainly(points, voxel)
    np.testing.assert_allclose(found.cloud.xyz, expected, atol=1e-9 * max(voxel, 1))
    np.testing.assert_array_equal(found.counts, counts)


def test_voxels_come_sorted_along_the_lattice():
    found = thin([PointCloud(scatter(20_000, 2), NEAR)], Lattice(0.5, NEAR))
    cells = np.floor(found.cloud.xyz / 0.5)
    assert (np.lexsort(cells.T[::-1]) == np.arange(len(cells))).all()


@given(st.lists(st.integers(0, 900), min_size=1, max_size=8), st.integers(0, 99))
def test_neither_chunks_nor_order_change_a_bit(sizes, seed):
    points = scatter(sum(sizes), 3)
    lattice = Lattice(0.4, UTM)
    once = thin([PointCloud(points, UTM)], lattice)
    mixed = np.random.default_rng(seed).permutation(points)
    chunked = thin(pieces(mixed, UTM, sizes), lattice)
    assert once.cloud.xyz.tobytes() == chunked.cloud.xyz.tobytes()
    assert once.counts.tobytes() == chunked.counts.tobytes()


def test_many_merges_change_no_bit(monkeypatch):
    points = scatter(60_000, 4)
    lattice = Lattice(0.3, NEAR)
    once = thin([PointCloud(points, NEAR)], lattice)
    monkeypatch.setattr(room, "PENDING", 2_000)
    monkeypatch.setattr(room, "PIECE", 1_024)
    chunked = thin(pieces(points, NEAR, [1_000] * 60), lattice)
    assert once.cloud.xyz.tobytes() == chunked.cloud.xyz.tobytes()
    assert once.counts.tobytes() == chunked.counts.tobytes()


def test_trap_1_the_lattice_at_utm_is_the_lattice_near_the_origin():
    # UTM is a whole number of cells away, so every cell and every centroid must move with it.
    points = scatter(50_000, 5)
    near = thin([PointCloud(points, NEAR)], Lattice(0.1, NEAR))
    far = thin([PointCloud(points, UTM)], Lattice(0.1, UTM))
    np.testing.assert_array_equal(near.cloud.xyz, far.cloud.xyz)
    np.testing.assert_array_equal(near.counts, far.counts)
    absolute = thin([cloud_from(points + UTM)], Lattice(0.1, UTM))
    np.testing.assert_allclose(absolute.cloud.coordinates, far.cloud.coordinates, atol=2e-9)


def test_the_origins_of_cloud_and_lattice_move_no_cell():
    points = scatter(20_000, 6)
    lattice = Lattice(0.1, NEAR)
    once = thin([PointCloud(points, NEAR)], lattice)
    for shift in ([0.03, 0.05, 0.07], [1_000.1, -7.77, 12.3]):
        about = thin([PointCloud(points, NEAR).about(np.array(shift))], lattice)
        np.testing.assert_allclose(once.cloud.xyz, about.cloud.xyz, atol=1e-9)
        renumbered = thin([PointCloud(points, NEAR)], Lattice(0.1, np.array(shift)))
        np.testing.assert_allclose(once.cloud.xyz, renumbered.cloud.coordinates, atol=1e-9)


def test_coordinates_on_an_edge_stay_on_one_side_at_utm():
    # Millimetre coordinates on every edge of the lattice: each cell holds its own edge.
    edges = np.round(np.arange(400) * 0.1, 3)
    for axis, start in enumerate(UTM):
        points = np.zeros((400, 3)) + UTM
        points[:, axis] = np.round(start + edges, 3)
        found = thin([cloud_from(points)], Lattice(0.1, UTM))
        assert len(found) == 400
        np.testing.assert_allclose(found.cloud.xyz[:, axis], edges, atol=2e-9)


def test_a_point_alone_in_its_cell_stays_where_it_is(offset):
    points = np.array([[0.123456789, -0.2, 7.9], [5.05, 5.15, 5.25]])
    found = thin([PointCloud(points, offset)], Lattice(0.1, offset))
    np.testing.assert_allclose(found.cloud.xyz, points, atol=1e-10)


def test_halves_are_summed_apart_and_together():
    points = scatter(30_000, 7)
    lattice = Lattice(0.7, NEAR)
    half = np.random.default_rng(8).random(len(points)) < 0.5
    cells = gather(group(PointCloud(points, NEAR), lattice, half=half))
    for chosen, own in ((None, slice(None)), (0, ~half), (1, half)):
        found = centroids(cells, lattice, half=chosen)
        expected = thin([PointCloud(points[own], NEAR)], lattice)
        np.testing.assert_array_equal(found.cloud.xyz, expected.cloud.xyz)
        np.testing.assert_array_equal(found.counts, expected.counts)


def test_nothing_thins_to_nothing():
    lattice = Lattice(0.1, NEAR)
    assert len(thin([], lattice)) == 0
    assert len(thin([PointCloud(np.empty((0, 3)), UTM)], lattice)) == 0


def test_a_point_beyond_the_numbered_cells_is_refused():
    far = PointCloud(np.array([[0.0, 0, 0], [0, 200_000, 0]]), NEAR)
    with pytest.raises(CloudError, match=r"200000 m from .* reaches 104858 m\. Crop the cloud"):
        thin([far], Lattice(0.1, NEAR))
    assert len(thin([far], Lattice(0.2, NEAR))) == 2


def test_a_coordinate_that_is_no_number_is_refused():
    with pytest.raises(CloudError, match="NaN or infinite"):
        thin([PointCloud(np.array([[0.0, np.nan, 0]]), NEAR)], Lattice(0.1, NEAR))


@pytest.mark.parametrize("voxel", [0.0, -0.1, np.nan, np.inf])
def test_a_voxel_without_size_is_refused(voxel):
    with pytest.raises(RegionError, match="must be above zero"):
        Lattice(voxel, NEAR)
