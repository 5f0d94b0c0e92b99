"""The spatial block bootstrap: how else a measure might have come out on such a building."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from trigpoint.similarity import Points
from trigpoint.tallies import Tallies

# Neighbouring points err together: they miss the same balcony. Blocks are resampled as they are,
# and must be longer than what is missed together, and more than a few.
BLOCK_M = 2.0
# Where more would be occupied, their edge is doubled: on a large site nothing is lost by it.
MOST_BLOCKS = 4096
# An interval from fewer blocks than these would only seem to be one.
FEWEST_BLOCKS = 10


@dataclass(frozen=True, slots=True, eq=False)
class Blocks:
    """Points sorted into cubic blocks.

    Attributes
    ----------
    edge_m : float
    of : ndarray of shape (n,)
        Each point's block, from 0.
    count : int
        Occupied blocks.
    """

    edge_m: float
    of: NDArray[np.intp]
    count: int


def blocks_of(points: Points, corner: NDArray[np.float64]) -> Blocks:
    """Sort points into cubes of 2 m, or twice that, and so on, until there are at most 4096.

    Parameters
    ----------
    points : ndarray of shape (n, 3)
    corner : ndarray of shape (3,)
        Where a corner of a block lies: of the reference, so that all its clouds share blocks.
    """
    edge = BLOCK_M
    steps = np.floor((points - corner) / edge).astype(np.int64)
    cells, of = _numbered(steps)
    while len(cells) > MOST_BLOCKS:
        edge *= 2
        # Halving whole numbers keeps each larger block a union of smaller ones.
        cells, own = _numbered(cells // 2)
        of = own[of]
    return Blocks(edge, of, len(cells))


def resampled(tallies: Tallies, *, draws: int, random: np.random.Generator) -> Tallies:
    """Draw as many blocks as there are, with replacement, and add up their tallies, many times.

    Parameters
    ----------
    tallies : ndarray of shape (blocks, ...)
    draws : int
    random : Generator

    Returns
    -------
    ndarray of shape (draws, ...)

    References
    ----------
    Lahiri (2003), Resampling Methods for Dependent Data, doi:10.1007/978-1-4757-3803-2,
    chapter 12 (spatial data).
    """
    blocks = len(tallies)
    times = random.multinomial(blocks, np.full(blocks, 1 / blocks), size=draws).astype(np.float64)
    # einsum: a matrix product may round by the number of threads.
    flat = np.ascontiguousarray(tallies.reshape(blocks, -1).T)
    found: Tallies = np.einsum("db,tb->dt", times, flat)
    return found.reshape(draws, *tallies.shape[1:])


def too_few(tallies: Tallies) -> NDArray[np.bool_]:
    """Tell where fewer than 10 blocks hold any points, from tallies (blocks, zones, ...)."""
    occupied: NDArray[np.intp] = np.count_nonzero(tallies[..., 0], axis=0)
    return occupied < FEWEST_BLOCKS


def _numbered(steps: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.intp]]:
    cells, of = np.unique(steps, axis=0, return_inverse=True)
    return cells, of.reshape(-1)  # NumPy 2.0 alone gives it a second axis
