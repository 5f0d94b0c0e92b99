"""Up, guessed from the ground."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

ground = pytest.importorskip(
    "trigpoint_panel.ground", reason="the panel's packages are not installed", exc_type=ImportError
)


@pytest.mark.parametrize("seed", range(6))
def test_up_is_found_however_the_cloud_is_turned(opened_tower, seed):
    turn = Rotation.random(random_state=seed)
    rng = np.random.default_rng(seed)
    points = opened_tower(20_000, crs=None).cloud.coordinates + rng.normal(
        scale=0.02, size=(20_000, 3)
    )
    found = ground.guess_up(turn.apply(points) * 0.3)
    assert np.dot(found, turn.apply([0, 0, 1])) > 0.999


def test_without_a_ground_up_is_along_z():
    ball = np.random.default_rng(0).normal(size=(5000, 3))
    assert ground.guess_up(ball) == (0.0, 0.0, 1.0)
    assert ground.guess_up(ball[:10]) == (0.0, 0.0, 1.0)
