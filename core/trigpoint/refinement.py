"""Rigid ICP refinement: a hypothesis to put on trial, never a silent fix."""

from __future__ import annotations

from dataclasses import dataclass
from hashlib import sha256
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from trigpoint.cautions import Caution
from trigpoint.errors import RefinementError, SettingError
from trigpoint.similarity import Points, Similarity
from trigpoint.surface import Surface, in_order, thinned

Method = Literal["plane", "point"]

FEWEST = 20  # pairs; fewer are no overlap
STEP = 1e-5  # metres; a smaller movement of the cloud ends the iteration
CIRCLE = 1e-3  # metres; going round in a circle by less than this is good enough

# The part of a movement's mean square that crosses the target's surfaces, from 0 (the cloud slides
# along them) to 1. Below this it may be no more than the noise of the normals: a plane with 5 cm
# of noise, points 10 cm apart, shows 0.009 along itself; real buildings show 0.07 and more.
WEAK = 0.01

_ON_A_LINE = (
    "The {} pairs lie on a line or in one place, so the rotation about it is not known. ICP needs "
    "surfaces in more than one direction."
)


@dataclass(frozen=True, slots=True, eq=False)
class Refinement:
    """What ICP did to a cloud.

    Attributes
    ----------
    similarity : Similarity
        The rigid movement, of scale exactly 1, on absolute target coordinates.
    centre : ndarray of shape (3,)
        The target's centroid, metres.
    translation_m : ndarray of shape (3,)
        How `similarity` moves that centroid, metres. (The translation of `similarity` itself is
        the movement of the frame's far origin, and says nothing.)
    shift_m : float
        Length of `translation_m`.
    rotation_deg : float
        Angle of the rotation.
    iterations : int
        Movements made, the last and negligible one included; at least 1.
    converged : bool
        False where the limit of iterations came first, or the iteration came back to pairs that it
        had before and went round by 1 mm or more; a caution then says so.
    pairs : int
        Pairs in the last iteration, after trimming.
    overlap_pct : float
        Share of the source points that end within `max_distance` of a target point.
    surface_rmse_before_m, surface_rmse_after_m : float
        Root mean square distance to the nearest target point, over the source points that lie
        within `max_distance` before or after: the same points in both, so that neither number can
        fall because pairs dropped out.
    method : str
        "plane" or "point".
    cautions : tuple of Caution
        Directions that the target does not hold, and iterations that ran out.
    """

    similarity: Similarity
    centre: NDArray[np.float64]
    translation_m: NDArray[np.float64]
    shift_m: float
    rotation_deg: float
    iterations: int
    converged: bool
    pairs: int
    overlap_pct: float
    surface_rmse_before_m: float
    surface_rmse_after_m: float
    method: Method
    cautions: tuple[Caution, ...]


def icp(
    source: Points,
    target: Points | Surface,
    *,
    method: Method = "plane",
    max_distance: float = 0.5,
    trim: float = 0.1,
    iterations: int = 200,
) -> Refinement:
    """Move `source` rigidly onto `target` by iterated closest points.

    Every source point is paired with its nearest target point; pairs farther apart than
    `max_distance`, and then the worst share `trim` of the rest, sit the iteration out; the others
    give the next movement in closed form ("point") or by a Gauss-Newton step on the distances to
    the target's tangent planes ("plane"). Scale is never estimated: partial overlap biases it.
    All of it happens about the target's centroid. Above 50,000 source points, every k-th of them
    in lattice order takes part in the iteration; overlap and RMSE are measured on all.

    Where the target does not hold the cloud (it slides along a plane), "plane" makes no movement in
    that direction, and a caution names it. The order of the points changes nothing, to the last
    bit, and neither does the number of threads.

    Parameters
    ----------
    source : ndarray of shape (n, 3)
        Absolute target coordinates, metres: a cloud that is already roughly in place.
    target : ndarray of shape (m, 3) or Surface
        Absolute target coordinates, metres. A Surface spares growing the tree again.
    method : {"plane", "point"}
        What is minimised.
    max_distance : float
        Farthest pair, metres. The default is the consensus threshold: what the picks may miss by.
    trim : float
        Share of the pairs left out, 0 <= trim < 1.
    iterations : int
        Limit.

    Returns
    -------
    Refinement
        Rigid movement and its effect on the surfaces. Whether it is an improvement is not for it
        to say: see `trigpoint.trial.judge`.

    Raises
    ------
    RefinementError
        If the clouds do not overlap, before or after, or cannot hold a movement at all.
    SettingError
        If a setting is out of its range.

    References
    ----------
    Besl and McKay (1992), doi:10.1109/34.121791 (point to point). Chen and Medioni (1992),
    doi:10.1016/0262-8856(92)90066-C (point to plane). Chetverikov et al. (2002),
    doi:10.1109/ICPR.2002.1047997 (trimming). Zhang, Kaess and Singh (2016),
    doi:10.1109/ICRA.2016.7487211 (no movement in weak directions).

    Examples
    --------
    >>> grid = np.mgrid[0:2, 0:12, 0:12].reshape(3, -1).T * 0.5
    >>> corner = np.concatenate([grid, grid[:, [1, 0, 2]], grid[:, [1, 2, 0]]])
    >>> refinement = icp(corner + [0.03, -0.02, 0.01], corner, trim=0)
    >>> refinement.translation_m.round(6).tolist()
    [-0.03, 0.02, -0.01]
    """
    _check_settings(method, max_distance, trim, iterations)
    surface = target if isinstance(target, Surface) else Surface(target)
    ordered = in_order(source) - surface.centre
    if not len(ordered):
        message = "The source has no points."
        raise RefinementError(message)
    sample = thinned(ordered)

    path = _iterate(sample, surface, method, max_distance, trim, iterations)
    movement = path.movement
    kept, rows = _pairs(movement(sample), surface, max_distance, trim)
    cautions = [
        *_slides(movement(sample)[kept], surface.normals(rows), method),
        *_unsettled(path),
    ]
    before, after = surface.nearest(ordered)[0], surface.nearest(movement(ordered))[0]
    measured = (before <= max_distance) | (after <= max_distance)
    return Refinement(
        # About the centroid until here: only this last line meets the large coordinates.
        similarity=Similarity(
            1.0,
            movement.rotation,
            movement.translation + (surface.centre - movement.turn(surface.centre[None, :])[0]),
        ),
        centre=surface.centre,
        translation_m=movement.translation,
        shift_m=float(np.linalg.norm(movement.translation)),
        rotation_deg=float(np.degrees(_angle(movement))),
        iterations=path.iterations,
        converged=path.converged,
        pairs=len(rows),
        overlap_pct=100 * float((after <= max_distance).mean()),
        surface_rmse_before_m=_rms(before[measured]),
        surface_rmse_after_m=_rms(after[measured]),
        method=method,
        cautions=tuple(cautions),
    )


@dataclass(frozen=True, slots=True, eq=False)
class _Path:
    """Where the iteration came to; `step` is how far its last movement went, in metres."""

    movement: Similarity
    iterations: int
    converged: bool
    step: float


def _iterate(
    sample: Points,
    surface: Surface,
    method: Method,
    max_distance: float,
    trim: float,
    iterations: int,
) -> _Path:
    spread = _spread(sample)
    movement = Similarity(1.0, np.eye(3), np.zeros(3))
    seen: list[bytes] = []
    for iteration in range(1, iterations + 1):
        here = movement(sample)
        kept, rows = _pairs(here, surface, max_distance, trim)
        here, there = here[kept], surface.points[rows]
        if method == "plane":
            step = _tangent_step(here, there, surface.normals(rows))
        else:
            step = _closed_form(here, there)
        movement = step @ movement
        middle = here.mean(axis=0)
        moved = float(np.linalg.norm(step(middle[None, :])[0] - middle)) + _angle(step) * spread
        if moved < STEP:
            return _Path(movement, iteration, True, moved)
        # Pairs are discrete: where the same ones come back, it goes round among a few solutions.
        pairs = sha256(kept.tobytes() + rows.tobytes()).digest()
        if pairs in seen[:-1]:
            return _Path(movement, iteration, moved < CIRCLE, moved)
        seen.append(pairs)
    return _Path(movement, iterations, False, moved)


def _pairs(
    here: Points, surface: Surface, max_distance: float, trim: float
) -> tuple[NDArray[np.bool_], NDArray[np.intp]]:
    """Tell which source points are paired, and return the rows of their partners."""
    distances, rows = surface.nearest(here)
    kept = distances <= max_distance
    count = int(kept.sum())
    if count < FEWEST:
        message = (
            f"{count} of {len(here)} source points lie within {max_distance:g} m of the target "
            f"(the nearest at {distances.min():.3g} m): the clouds do not overlap enough for ICP. "
            f"It needs {FEWEST} pairs: check the picks and the frames, or raise max_distance."
        )
        raise RefinementError(message)
    number = max(FEWEST, round((1 - trim) * count))
    kept &= distances <= np.partition(distances[kept], number - 1)[number - 1]
    return kept, rows[kept]


def _closed_form(here: Points, there: Points) -> Similarity:
    """Return the rigid least-squares movement of points onto points."""
    middle, goal = here.mean(axis=0), there.mean(axis=0)
    # einsum: a matrix product of many rows may round by the number of threads.
    u, d, vt = np.linalg.svd(np.einsum("ni,nj->ij", there - goal, here - middle))
    if d[1] <= 1e-9 * d[0]:
        raise RefinementError(_ON_A_LINE.format(len(here)))
    turn = (u * [1.0, 1.0, np.sign(np.linalg.det(u) * np.linalg.det(vt))]) @ vt
    step = Similarity(1.0, turn, np.zeros(3))
    return Similarity(1.0, turn, goal - step(middle[None, :])[0])


def _tangent_step(here: Points, there: Points, normals: Points) -> Similarity:
    """Return the Gauss-Newton movement of points onto tangent planes, none in weak directions."""
    middle, levers = here.mean(axis=0), _levers(here)
    crossings = _crossings(here, normals, levers)
    gaps = ((there - here) * normals).sum(axis=1)
    strengths, directions = _strengths(crossings)
    pull = directions.T @ (np.einsum("ni,n->i", crossings, gaps) / len(crossings))
    firm = strengths >= WEAK
    move = directions[:, firm] @ (pull[firm] / strengths[firm])
    # The exponential map: a rotation that stays one, however large the step.
    turn = Rotation.from_rotvec(levers @ move[:3]).as_matrix()
    step = Similarity(1.0, turn, np.zeros(3))
    return Similarity(1.0, turn, middle + move[3:] - step(middle[None, :])[0])


def _levers(here: Points) -> NDArray[np.float64]:
    """Return the matrix that makes unit numbers rotations which move the points by 1 m RMS.

    So a slender tower's rotation about its own axis counts by what it does to the walls, not by
    the tower's height.
    """
    arms = here - here.mean(axis=0)
    scatter = np.einsum("ni,nj->ij", arms, arms) / len(arms)
    axes, squares, _ = np.linalg.svd(np.trace(scatter) * np.eye(3) - scatter)
    if squares[2] <= 1e-12 * squares[0]:
        raise RefinementError(_ON_A_LINE.format(len(here)))
    levers: NDArray[np.float64] = (axes / np.sqrt(squares)) @ axes.T
    return levers


def _crossings(here: Points, normals: Points, levers: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return how far each point crosses its surface, for six unit movements: shape (n, 6).

    Three rotations about the middle, three translations, each 1 m RMS over the points.
    """
    arms = here - here.mean(axis=0)
    turned = Similarity(1.0, levers, np.zeros(3)).turn(np.cross(arms, normals))
    return np.concatenate([turned, normals], axis=1)


def _strengths(
    crossings: NDArray[np.float64],
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return six independent movements, one a column, and how firmly each is held, 0 to 1."""
    # einsum: a matrix product of many rows may round by the number of threads.
    squares = np.einsum("ni,nj->ij", crossings, crossings) / len(crossings)
    directions, strengths, _ = np.linalg.svd(squares)
    return strengths, directions


def _slides(here: Points, normals: Points, method: Method) -> list[Caution]:
    levers = _levers(here)
    strengths, directions = _strengths(_crossings(here, normals, levers))
    weak = directions[:, strengths < WEAK]
    if not weak.shape[1]:
        return []
    named = [f"along {_named(axis)}" for axis in _axes(weak[3:])]
    named += [f"about {_named(levers @ axis)}" for axis in _axes(weak[:3])]
    outcome = "was left as it was" if method == "plane" else "may have drifted"
    message = (
        f"The reference hardly holds the cloud {', '.join(named)} (easting, northing, height): "
        f"in these directions it {outcome}."
    )
    return [Caution("weak_geometry", message)]


def _unsettled(path: _Path) -> list[Caution]:
    if path.converged:
        return []
    message = (
        f"ICP stopped after {path.iterations} iterations without settling: its last movement was "
        f"{1000 * path.step:.2g} mm."
    )
    return [Caution("icp_not_converged", message)]


def _axes(part: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the axes that lie more inside than outside the weak directions, one a row."""
    axes, shares, _ = np.linalg.svd(part @ part.T)
    inside: NDArray[np.float64] = axes[:, shares > 0.5].T
    return inside


def _named(axis: NDArray[np.float64]) -> str:
    # An axis has no sense: let its largest component be positive.
    axis = axis / axis[np.abs(axis).argmax()]
    rounded = np.round(axis / np.linalg.norm(axis), 2) + 0.0  # no negative zero
    return "({:.2f}, {:.2f}, {:.2f})".format(*rounded)


def _angle(movement: Similarity) -> float:
    return float(Rotation.from_matrix(movement.rotation).magnitude())


def _spread(points: Points) -> float:
    """Root mean square distance from the middle."""
    return float(np.sqrt(((points - points.mean(axis=0)) ** 2).sum(axis=1).mean()))


def _rms(distances: NDArray[np.float64]) -> float:
    return float(np.sqrt((distances**2).mean()))


def _check_settings(method: str, max_distance: float, trim: float, iterations: int) -> None:
    if method not in get_args(Method):
        message = f"method is {method!r}; it must be one of {', '.join(get_args(Method))}."
        raise SettingError(message)
    if not (np.isfinite(max_distance) and max_distance > 0):
        message = f"max_distance is {max_distance}; it must be above zero, in metres."
        raise SettingError(message)
    if not 0 <= trim < 1:
        message = f"trim is {trim}; it is the share of pairs left out, from 0 to below 1."
        raise SettingError(message)
    if iterations < 1:
        message = f"iterations is {iterations}; ICP that makes none has done nothing."
        raise SettingError(message)
