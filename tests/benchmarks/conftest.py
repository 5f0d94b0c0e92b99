"""A survey of any size to measure on, and one line for every ratio."""

import gc
import time

import laspy
import numpy as np
import pytest
from laspy import LazBackend

CORNER = np.array([741_000.0, 4_279_000.0, 150.0])


def survey(n, seed, *, edge, chunk=1_000_000):
    """Yield `n` points about CORNER of ground, two walls and a curved roof, `edge` metres wide.

    In flight lines, as a scanner would: neighbours in the file are near in northing only.
    """
    rng = np.random.default_rng(seed)
    size = np.array([edge, edge, 0.6 * edge])
    for start in range(0, n, chunk):
        count = min(chunk, n - start)
        points = rng.random((count, 3)) * size
        points[:, 1] = (start + np.arange(count)) / n * 8 % 1 * edge
        part = rng.integers(0, 6, count)
        points[part < 2, 2] = 0.04
        walls = (part >= 2) & (part < 4)
        points[walls, 0] = np.where(rng.random(walls.sum()) < 0.5, 0.2, 0.8) * edge + 0.03
        roof = part >= 4
        points[roof, 2] = 0.3 * edge + 5 * np.sin(points[roof, 0] / 5)
        yield points + rng.normal(0, 0.01, points.shape)


@pytest.fixture(scope="session")
def gathered():
    """Return a whole survey, shape (n, 3), about its corner."""

    def gather(n, seed, *, edge):
        return np.concatenate(list(survey(n, seed, edge=edge)))

    return gather


@pytest.fixture(scope="session")
def decode():
    """Decode a LAZ file to coordinates with laspy's fastest backend, and count them."""

    def count(path):
        points = 0
        with laspy.open(path, laz_backend=LazBackend.LazrsParallel) as reader:
            for record in reader.chunk_iterator(1_000_000):
                points += len(np.column_stack([record.x, record.y, record.z]))
        return points

    return count


@pytest.fixture(scope="session")
def laz(tmp_path_factory):
    """Write a survey as LAZ, once, and return its path."""
    folder = tmp_path_factory.mktemp("surveys")

    def write(n, seed, *, edge):
        path = folder / f"{n}-{seed}-{edge}.laz"
        if path.exists():
            return path
        header = laspy.LasHeader(version="1.4", point_format=6)
        header.scales, header.offsets = [1e-4] * 3, CORNER
        with laspy.open(path, "w", header=header, laz_backend=LazBackend.LazrsParallel) as writer:
            for points in survey(n, seed, edge=edge):
                record = laspy.ScaleAwarePointRecord.zeros(len(points), header=header)
                record.x, record.y, record.z = (points + CORNER).T
                writer.write_points(record)
        return path

    return write


@pytest.fixture
def seconds():
    """Time the best of a few runs of each piece of work, taken in turns: a busy spell hits all."""

    def measure(*works, runs=2):
        best = [np.inf] * len(works)
        for _ in range(runs):
            for k, work in enumerate(works):
                gc.collect()
                start = time.perf_counter()
                work()
                best[k] = min(best[k], time.perf_counter() - start)
        return best

    return measure


@pytest.fixture
def line(capsys):
    """Print one line at once, whatever pytest captures."""

    def say(text):
        with capsys.disabled():
            print(text, flush=True)

    return say


@pytest.fixture
def faster(line):
    """Print how many times as fast, and hold it to what is required."""

    def check(what, ours, rival, theirs, *, times):
        line(
            f"{what:<46} {ours:7.2f} s   {rival:<34} {theirs:7.2f} s   "
            f"{theirs / ours:5.2f} times as fast (required: {times:g})"
        )
        assert theirs / ours >= times

    return check
