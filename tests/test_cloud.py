import numpy as np
import pyproj
import pytest

import trigpoint
from trigpoint.cloud import cloud_from
from trigpoint.errors import CrsError
from trigpoint.similarity import Similarity

POINTS = np.array([[0.0, 0, 0], [1, 2, 3], [4, 5, 6]])
STILL = Similarity(1.0, np.eye(3), np.zeros(3))


def test_a_crs_may_be_given_as_its_code(tmp_path):
    utm = pyproj.CRS("EPSG:32615")
    assert cloud_from(POINTS, crs="EPSG:32615").crs == utm
    moved = cloud_from(POINTS).transformed(STILL, crs="EPSG:32615")
    assert moved.crs == utm
    trigpoint.write(tmp_path / "moved.laz", moved)
    assert trigpoint.read(tmp_path / "moved.laz").crs == utm


@pytest.mark.parametrize(
    "give", [cloud_from, lambda xyz, crs: cloud_from(xyz).transformed(STILL, crs=crs)]
)
def test_a_crs_that_is_none_is_refused(give):
    with pytest.raises(CrsError, match="EPSG:1"):
        give(POINTS, crs="EPSG:1")
