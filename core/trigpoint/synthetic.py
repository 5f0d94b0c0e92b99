"""A scene with known truth: the clock tower, three simulated sensors and the picks between them."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation

from trigpoint.canonical import write_text
from trigpoint.clocktower import SITE, build_tower
from trigpoint.cloud import PointCloud, concatenate
from trigpoint.errors import PicksError
from trigpoint.files import write
from trigpoint.picks import Picks, picks_from, write_picks
from trigpoint.sensors import generator, photogrammetry, photographs, radiance, strips
from trigpoint.similarity import Similarity
from trigpoint.starter import project_text

SCALE = 3.260  # metres per unit of the neural frame, whose origin is near this:
MIDDLE = np.array([0.0, 0.0, 25.0])
# Control picks, then check picks: id, and what a person would have pointed at.
CONTROL = {
    "plinth-sw": "plinth, top, south-west corner",
    "course1-se": "lower string course, top, south-east corner",
    "course2-nw": "upper string course, top, north-west corner",
    "clock-s": "south clock, lower left corner of the recess",
    "cornice-ne": "cornice, top, north-east corner",
    "roof-se": "roof, top of the south-east hip",
}
CHECK = {
    "plinth-nw": "plinth, top, north-west corner",
    "course2-ne": "upper string course, top, north-east corner",
    "clock-n": "north clock, upper right corner of the recess",
    "cornice-sw": "cornice, top, south-west corner",
}
PICK_SOURCE = 0.0215  # one sigma per axis: units of the neural frame
PICK_TARGET = 0.070  # and metres
FRAME, NEURAL, PICKED, MATCHED = 0, 3, 4, 5  # random streams of a seed; `sensors` has the others


@dataclass(frozen=True, slots=True, eq=False)
class Scene:
    """What the sensors saw, what was picked, and the truth.

    Attributes
    ----------
    reference : PointCloud
        Airborne LiDAR in EPSG:32615.
    neural : PointCloud
        In its own frame, its coordinates rounded to float32 as nerfstudio exports them.
    photogrammetry : PointCloud
        In EPSG:32615.
    picks : Picks
        Six control and four check picks.
    truth : Similarity
        Maps the neural frame to EPSG:32615.
    corners : dict of str to ndarray of shape (3,)
        True places of the picks in EPSG:32615, by id.
    """

    reference: PointCloud
    neural: PointCloud
    photogrammetry: PointCloud
    picks: Picks
    truth: Similarity
    corners: dict[str, NDArray[np.float64]]


def clock_tower(
    *, seed: int = 42, density: float = 1.0, blunders: Mapping[str, ArrayLike] | None = None
) -> Scene:
    """Simulate the clock tower.

    Parameters
    ----------
    seed : int
        Of everything random; the same seed gives the same bytes.
    density : float
        Times the default number of points of every cloud: some 280,000 of the reference, 500,000
        of the neural cloud and 400,000 of the photogrammetric one. Below 1 the photographs are
        coarser, so photogrammetry loses more edges as well.
    blunders : mapping of str to array_like of shape (3,), optional
        Pick ids, and how far the target of each is wrong, metres.

    Returns
    -------
    Scene

    Raises
    ------
    PicksError
        If a blunder is asked for at a pick that there is not.
    ValueError
        If the density is not above zero.
    """
    tower, truth = build_tower(), _truth(seed)
    corners = {name: SITE + tower.corners[name] for name in (*CONTROL, *CHECK)}
    picks = _picks(corners, truth, seed, blunders or {})
    back, neural, matched = truth.inverse(), [], []
    for number, photograph in enumerate(photographs(tower, density, seed=seed)):
        neural.append(radiance(tower, photograph, back, generator(seed, NEURAL, number)))
        matched.append(photogrammetry(tower, photograph, generator(seed, MATCHED, number)))
    return Scene(
        concatenate(list(strips(tower, density, seed=seed))),
        concatenate(neural),
        concatenate(matched),
        picks,
        truth,
        corners,
    )


def stream_reference(*, seed: int = 42, density: float = 1.0) -> Iterator[PointCloud]:
    """Yield the reference of `clock_tower` piece by piece, to write it without holding it."""
    yield from strips(build_tower(), density, seed=seed)


def stream_neural(*, seed: int = 42, density: float = 1.0) -> Iterator[PointCloud]:
    """Yield the neural cloud of `clock_tower` piece by piece: 10^7 points at density 20."""
    tower, back = build_tower(), _truth(seed).inverse()
    for number, photograph in enumerate(photographs(tower, density, seed=seed)):
        yield radiance(tower, photograph, back, generator(seed, NEURAL, number))


def stream_photogrammetry(*, seed: int = 42, density: float = 1.0) -> Iterator[PointCloud]:
    """Yield the photogrammetric cloud of `clock_tower` piece by piece."""
    tower = build_tower()
    for number, photograph in enumerate(photographs(tower, density, seed=seed)):
        yield photogrammetry(tower, photograph, generator(seed, MATCHED, number))


def write_project(folder: str | Path, scene: Scene) -> Path:
    """Write a scene as a project to audit, over one that is there, and return its project.toml.

    Beside the project's own files ``truth.json`` holds the similarity that the audit should find.
    """
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    write(folder / "lidar.laz", scene.reference)
    write(folder / "nerf.ply", scene.neural)
    write(folder / "sfm.laz", scene.photogrammetry)
    write_picks(folder / "picks.csv", scene.picks)
    write_text(folder / "truth.json", _truth_json(scene.truth))
    project = folder / "project.toml"
    write_text(project, project_text(PROJECT) + LIMITS)
    return project


PROJECT = {
    'id = "my-building"': 'id = "tower"',
    'title = ""': 'title = "Clock tower"',
    'site = ""': 'site = "A simulated campus in EPSG:32615"',
    'client = ""': 'client = "Example Heritage Trust"',
    'surveyor = ""': 'surveyor = "Example Surveys"',
    'limitations = ""': 'limitations = "Simulated: no place, sensor or person is behind it."',
    'purpose = ""': 'purpose = "Demonstration on simulated data whose truth is known"',
    "# date = 2026-09-21": "date = 2026-09-21",
    'path = "reference.laz"': 'path = "lidar.laz"',
    'crs = ""': 'crs = "EPSG:32615"',
    "# accuracy_m = 0.05": "accuracy_m = 0.05",
    'accuracy_source = ""': 'accuracy_source = "simulated: range noise and strip offsets"',
    "# [[reconstruction]]": "[[reconstruction]]",
    '# name = "sfm"': 'name = "sfm"',
    '# kind = "photogrammetry"': 'kind = "photogrammetry"',
    '# path = "sfm.laz"': 'path = "sfm.laz"',
}

# What a client may ask for; nothing else in trigpoint states a limit.
LIMITS = """
[[limit]]
quantity = "loocv.rmse_m"
of = "nerf"
max = 0.30
source = "example brief, 4.1"

[[limit]]
quantity = "checks.rmse_m"
of = "nerf"
max = 0.25
source = "example brief, 4.2"

[[limit]]
quantity = "comparison.delivered.completeness.all.within[0.10].pct"
of = "nerf"
min = 80
source = "example brief, 5.1"

[[limit]]
quantity = "comparison.delivered.completeness.all.within[0.10].pct"
of = "sfm"
min = 75
source = "example brief, 5.1"
"""


def _truth(seed: int) -> Similarity:
    rng = generator(seed, FRAME)
    rotation = Rotation.from_quat(rng.normal(size=4)).as_matrix()
    centre = np.array([[1.3, -0.9, 2.1]]) + rng.normal(0, 0.5, (1, 3))
    about = Similarity(SCALE, rotation, np.zeros(3))
    return Similarity(SCALE, rotation, SITE + MIDDLE - about(centre)[0])


def _picks(
    corners: Mapping[str, NDArray[np.float64]],
    truth: Similarity,
    seed: int,
    blunders: Mapping[str, ArrayLike],
) -> Picks:
    ids, notes = list(corners), CONTROL | CHECK
    unknown = [name for name in blunders if name not in corners]
    if unknown:
        message = (
            f"There are no picks {', '.join(unknown)} to spoil; the picks are {', '.join(ids)}."
        )
        raise PicksError(message)
    rng, places = generator(seed, PICKED), np.array(list(corners.values()))
    source = truth.inverse()(places) + rng.normal(0, PICK_SOURCE, places.shape)
    target = places + rng.normal(0, PICK_TARGET, places.shape)
    for name, error in blunders.items():
        target[ids.index(name)] += np.asarray(error, np.float64)
    n = len(ids)
    return picks_from(
        ids,
        source,
        target,
        roles=["control"] * len(CONTROL) + ["check"] * len(CHECK),
        sigma_source=np.full(n, PICK_SOURCE),
        sigma_target=np.full(n, PICK_TARGET),
        notes=[notes[name] for name in ids],
    )


def _truth_json(truth: Similarity) -> str:
    values = {
        "scale": truth.scale,
        "rotation": truth.rotation.tolist(),
        "translation": truth.translation.tolist(),
    }
    return json.dumps(values, indent=1) + "\n"
