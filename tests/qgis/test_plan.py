import numpy as np
import pytest

from trigpoint_qgis import plan


def test_a_cell_holds_the_mean_of_its_points_and_nan_where_there_is_none(offset):
    points = np.array([[0.1, 0.1, 0], [0.2, 0.2, 9], [1.6, 0.2, 0]]) + offset
    grid = plan.grid_over(points, 0.5)
    found = grid.mean(points, np.array([1.0, 3.0, 7.0]))
    assert grid.shape == (1, 4)
    np.testing.assert_allclose(found, [[2.0, np.nan, np.nan, 7.0]])


def test_rows_run_from_the_north(offset):
    points = np.array([[0.1, 0.1, 0], [0.1, 2.1, 0]]) + offset
    grid = plan.grid_over(points, 1.0)
    found = grid.mean(points, np.array([1.0, 2.0]))
    assert found[:, 0].tolist()[0] == 2.0
    assert found[:, 0].tolist()[-1] == 1.0
    assert grid.north == np.floor(offset[1]) + 3


def test_the_lines_of_a_grid_are_multiples_of_its_cell():
    grid = plan.grid_over(np.array([[741_008.44, 4_279_056.28, 0.0]]), 0.5)
    assert (grid.west, grid.north) == (741_008.0, 4_279_056.5)


def test_completeness_is_the_share_of_reference_points_that_are_near():
    points = np.zeros((4, 3))
    grid = plan.grid_over(points, 1.0)
    distances = np.array([0.1, 0.2, 0.3, np.inf])
    assert plan.completeness_pct(points, distances, grid, 0.2).item() == 50.0
    assert plan.completeness_pct(points, np.full(4, np.nan), grid, 0.2).item() == 0.0


def test_the_error_is_the_root_mean_square():
    points = np.zeros((2, 3))
    grid = plan.grid_over(points, 1.0)
    assert plan.rmse_m(points, np.array([3.0, 4.0]), grid).item() == pytest.approx(np.sqrt(12.5))


@pytest.mark.parametrize("size", [0.0, -1.0, np.nan])
def test_a_cell_without_a_size_is_refused(size):
    with pytest.raises(ValueError, match="larger than zero"):
        plan.grid_over(np.zeros((1, 3)), size)


def test_a_map_of_too_many_cells_is_refused():
    with pytest.raises(ValueError, match="take larger ones"):
        plan.grid_over(np.array([[0, 0, 0], [1e5, 1e5, 0]], float), 0.5)
