"""What every test may ask for: the two offsets, seeded scenes, and the folder of real data."""

import os
from pathlib import Path

import numpy as np
import pyproj
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


def box_building(seed, count, *, roof=12.0):
    """Points on the walls, roof and surroundings of a building of 8 x 6 m, in its own frame."""
    rng = np.random.default_rng(seed)
    u, v, side = rng.random(count), rng.random(count), rng.integers(0, 6, count)
    faces = [
        (8 * u, 0 * u, roof * v),
        (8 * u, 0 * u + 6, roof * v),
        (0 * u, 6 * u, roof * v),
        (0 * u + 8, 6 * u, roof * v),
        (8 * u, 6 * v, 0 * u + roof),
        (16 * u - 4, 14 * v - 4, 0 * u),
    ]
    return np.choose(side[:, None], [np.column_stack(face) for face in faces])


@pytest.fixture
def small_project(tmp_path):
    """A whole project of a small building: reference, a neural cloud in its own frame, and SfM."""
    from trigpoint.cloud import cloud_from
    from trigpoint.files import write
    from trigpoint.picks import picks_from, write_picks

    def make(folder=tmp_path / "small", *, noise=0.02, extra=""):
        folder.mkdir(parents=True, exist_ok=True)
        truth = Similarity(3.26, Rotation.from_rotvec([0.3, -1.1, 2.0]).as_matrix(), OFFSETS["utm"])
        crs = pyproj.CRS("EPSG:32615")
        rng = np.random.default_rng(7)

        def georeferenced(seed, count):
            points = box_building(seed, count) + OFFSETS["utm"]
            return points + rng.normal(scale=0.01, size=points.shape)

        write(folder / "lidar.laz", cloud_from(georeferenced(1, 6000), crs=crs))
        write(folder / "sfm.laz", cloud_from(georeferenced(2, 5000), crs=crs))
        local = truth.inverse()(georeferenced(3, 8000))
        write(folder / "nerf.ply", cloud_from(local, attributes={"red": np.arange(8000) % 256}))
        corners = np.array([[x, y, z] for z in (0, 12) for y in (0, 6) for x in (0, 8)], float)
        target = corners + OFFSETS["utm"]
        picks = picks_from(
            [f"c{i}" for i in range(8)],
            truth.inverse()(target),
            target + rng.normal(scale=noise, size=target.shape),
            roles=["control"] * 6 + ["check"] * 2,
        )
        write_picks(folder / "picks.csv", picks)
        (folder / "project.toml").write_text(
            '[project]\nid = "small"\ntitle = "<script>"\n'
            '[reference]\npath = "lidar.laz"\nvertical_crs = "EPSG:5703"\naccuracy_m = 0.02\n'
            '[[reconstruction]]\nname = "nerf"\npath = "nerf.ply"\npicks = "picks.csv"\n'
            '[[reconstruction]]\nname = "sfm"\nkind = "photogrammetry"\npath = "sfm.laz"\n'
            f"[comparison]\nvoxel_m = 0.2\n{extra}",
            encoding="utf-8",
        )
        return folder / "project.toml", truth

    return make
