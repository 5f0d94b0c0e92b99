import time

import numpy as np
import pytest

from trigpoint.propagation import sigma_at


@pytest.mark.benchmark
def test_sigma_of_ten_million_points_takes_less_than_ten_seconds():
    rng = np.random.default_rng(1)
    root = rng.normal(0, 0.01, (7, 7))
    points = rng.normal(0, 30, (10_000_000, 3))
    start = time.perf_counter()
    sigma_at(points, np.zeros(3), root @ root.T)
    seconds = time.perf_counter() - start
    print(f"sigma of 10 million points: {seconds:.2f} s")
    assert seconds < 10
