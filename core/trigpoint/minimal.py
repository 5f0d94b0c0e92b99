"""Minimal sets: similarities fitted to three picks each, many at once, and scored."""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from trigpoint.similarity import LINE, Points

# A least-squares scale falls short of the ratio of the two spreads where shapes differ. Below this
# share three quarters of the target's spread is left over as residual: the fit has shrunk towards
# a point, which lies near every pick that is near every other. A bound on the scale itself could
# not say so: the source's units are arbitrary, and millimetres make a sound scale of 0.001.
COLLAPSED = 0.5

# Picks times sets scored in one step: small enough to stay in the processor's cache.
BATCH = 65_536


@dataclass(frozen=True, slots=True, eq=False)
class MinimalFits:
    """Similarities fitted to triples of picks, about the first pick of either frame.

    Attributes
    ----------
    sound : ndarray of shape (triples,)
        False where a triple was on a line or in one place, in either frame, or its two triangles
        so unlike that the fit collapsed. The other arrays hold the m sound ones.
    matrix : ndarray of shape (m, 3, 3)
        Scale times rotation.
    shift : ndarray of shape (m, 3)
        Metres.
    misfit : ndarray of shape (m, 3)
        Residual distances at the triple's own picks, metres.
    """

    sound: NDArray[np.bool_]
    matrix: NDArray[np.float64]
    shift: NDArray[np.float64]
    misfit: NDArray[np.float64]


def all_triples(count: int) -> NDArray[np.int64]:
    """Return every set of three of `count` picks, shape (sets, 3), in order."""
    return np.array(list(itertools.combinations(range(count), 3)), np.int64).reshape(-1, 3)


def draw_triples(count: int, trials: int, rng: np.random.Generator) -> NDArray[np.int64]:
    """Draw sets of three distinct picks, all equally likely, shape (trials, 3), rows sorted.

    Drawn row by row: more trials begin with the same rows.
    """
    # Each draw is among those left, and steps over the ones taken.
    first, second, third = rng.integers(0, [count, count - 1, count - 2], size=(trials, 3)).T
    second = second + (second >= first)
    third = third + (third >= np.minimum(first, second))
    third = third + (third >= np.maximum(first, second))
    return np.sort(np.column_stack([first, second, third]), axis=1)


def fit_triples(source: Points, target: Points, triples: NDArray[np.int64]) -> MinimalFits:
    """Fit a similarity to each triple in closed form.

    Parameters
    ----------
    source, target : ndarray of shape (n, 3)
        Matching picks; `target` in metres.
    triples : ndarray of shape (triples, 3)
        Rows of positions in them.

    References
    ----------
    Umeyama (1991), doi:10.1109/34.88573, as in `similarity.umeyama`; equation numbers are his.
    """
    line = _are_lines(source, triples) | _are_lines(target, triples)
    corners = triples[~line]
    a, b = source[corners] - source[0], target[corners] - target[0]
    source_mean, target_mean = a.mean(axis=1), b.mean(axis=1)
    a, b = a - source_mean[:, None], b - target_mean[:, None]
    u, d, vt = np.linalg.svd(np.einsum("mki,mkj->mij", b, a))  # (38)
    sign = np.sign(np.linalg.det(u) * np.linalg.det(vt))  # (43)
    u[:, :, 2] *= sign[:, None]
    d[:, 2] *= sign
    squares = (a**2).sum(axis=(1, 2))
    scale = d.sum(axis=1) / squares  # (42)
    matrix = scale[:, None, None] * np.einsum("mij,mjk->mik", u, vt)  # (40)
    shift = target_mean - np.einsum("mij,mj->mi", matrix, source_mean)  # (41)
    misfit = np.sqrt(((b - np.einsum("mij,mkj->mki", matrix, a)) ** 2).sum(axis=2))

    held = scale * np.sqrt(squares) >= COLLAPSED * np.sqrt((b**2).sum(axis=(1, 2)))
    sound = ~line
    sound[sound] = held
    return MinimalFits(sound, matrix[held], shift[held], misfit[held])


def score(
    source: Points, target: Points, fits: MinimalFits, *, threshold: float
) -> tuple[NDArray[np.uint8], NDArray[np.intp], NDArray[np.float64]]:
    """Return each fit's inliers as packed bits, their number, and their sum of squares in m².

    Parameters
    ----------
    source, target : ndarray of shape (n, 3)
        The picks that the triples were taken from.
    fits : MinimalFits
    threshold : float
        Metres; a pick is an inlier where its 3D residual is at most this.
    """
    x, y = (source - source[0]).T.copy(), (target - target[0]).T.copy()
    sets, counts, squares = [], [], []
    step = max(1, BATCH // len(source))
    for start in range(0, len(fits.matrix), step):
        matrix = fits.matrix[start : start + step, :, :, None]
        shift = fits.shift[start : start + step, :, None]
        # Element by element, not a matrix product, whose rounding depends on threads and batches.
        square = np.zeros((len(matrix), len(source)))
        for i in range(3):
            e = matrix[:, i, 0] * x[0]
            e += matrix[:, i, 1] * x[1]
            e += matrix[:, i, 2] * x[2]
            e += shift[:, i] - y[i]
            e *= e
            square += e
        inside = np.sqrt(square) <= threshold
        sets.append(np.packbits(inside, axis=1))
        counts.append(np.count_nonzero(inside, axis=1))
        squares.append(np.where(inside, square, 0.0).sum(axis=1))
    return np.concatenate(sets), np.concatenate(counts), np.concatenate(squares)


def _are_lines(points: Points, triples: NDArray[np.int64]) -> NDArray[np.bool_]:
    corners = points[triples]
    sides = corners - np.roll(corners, 1, axis=1)
    longest = np.sqrt((sides**2).sum(axis=2).max(axis=1))
    doubled_area = np.sqrt((np.cross(sides[:, 0], sides[:, 1]) ** 2).sum(axis=1))
    rounding = 64 * float(np.spacing(np.abs(points).max()))
    # The height over the longest side is a small share of it, or rounding, or there is no side.
    return np.asarray(doubled_area <= np.maximum(LINE * longest, rounding) * longest)
