"""Which way is up in a cloud that no CRS describes: guessed from its largest plane."""

from __future__ import annotations

import numpy as np

from trigpoint.similarity import Points
from trigpoint_panel.camera import Position

SAMPLE, TRIPLES = 40_000, 600
# Cells across the cloud: one point of each is looked at, so that what counts is area.
CELLS = 60
# Width of a plane, as a share of the cloud's size.
BAND = 0.006
# Share of what is not in the plane that lies on one side, and of all that lies in the plane.
ONE_SIDED, WIDE = 0.9, 0.1


def guess_up(points: Points) -> Position:
    """Guess which way is up, for looking only: nothing that is measured depends on it.

    The ground is the largest plane that has nearly everything else on one side. Where there is
    none, up is along z.

    Parameters
    ----------
    points : ndarray of shape (n, 3)
    """
    rng = np.random.default_rng(0)
    if len(points) < 100:
        return 0.0, 0.0, 1.0
    sample = points[rng.integers(0, len(points), SAMPLE)]
    low, high = np.percentile(sample, [2, 98], axis=0)
    sample = sample[((sample >= low) & (sample <= high)).all(axis=1)]
    size = float(np.linalg.norm(high - low))
    _, first = np.unique(np.floor(sample * (CELLS / size)), axis=0, return_index=True)
    sample, band = sample[first], BAND * size
    corners = sample[rng.integers(0, len(sample), (TRIPLES, 3))]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = np.linalg.norm(normals, axis=1)
    normals, corners = normals[length > band**2], corners[length > band**2]
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    away = sample @ normals.T - (normals * corners[:, 0]).sum(axis=1)
    inside = np.abs(away) <= band
    above = (away > band).sum(axis=0) / np.maximum((~inside).sum(axis=0), 1)
    is_ground = (above > ONE_SIDED) | (above < 1 - ONE_SIDED)
    is_ground &= inside.mean(axis=0) > WIDE
    if not is_ground.any():
        return 0.0, 0.0, 1.0
    best = int(np.argmax(np.where(is_ground, inside.sum(axis=0), -1)))
    centred = sample[inside[:, best]]
    centred = centred - centred.mean(axis=0)
    normal = np.linalg.svd(centred, full_matrices=False)[2][2]
    upward = normals[best] if above[best] > ONE_SIDED else -normals[best]
    x, y, z = map(float, normal if normal @ upward > 0 else -normal)
    return x, y, z
