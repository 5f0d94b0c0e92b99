"""What every test may ask for: the two offsets, seeded scenes, and the folder of real data."""

import os
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from trigpoint.similarity import Similarity

OFFSETS = {"near": np.zeros(3), "utm": np.array([741_000.0, 4_279_000.0, 150.0])}


@pytest.fixture(params=list(OFFSETS))
def offset(request):
    """Near the origin, then at UTM coordinates."""
    return OFFSETS[request.param]


@pytest.fixture
def similarity_from():
    """Make a seeded similarity whose target lies about `offset`."""

    def make(seed, offset=OFFSETS["near"]):
        rng = np.random.default_rng(seed)
        return Similarity(
            rng.uniform(0.2, 5), Rotation.random(random_state=seed).as_matrix(), offset
        )

    return make


@pytest.fixture(scope="session")
def real_data():
    """Return the path of a folder of real data, or skip with the reason."""
    root = os.environ.get("TRIGPOINT_TEST_DATA")

    def find(name):
        if not root:
            pytest.skip(
                "TRIGPOINT_TEST_DATA is not set: it names the folder of real clouds and picks"
            )
        path = Path(root) / name
        if not path.exists():
            pytest.skip(f"TRIGPOINT_TEST_DATA holds no {name}")
        return path

    return find
