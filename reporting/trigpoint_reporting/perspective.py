"""Perspective views, for the eye and not for measuring; where OpenGL is missing, a box says so."""

from __future__ import annotations

import hashlib
import os
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from trigpoint.files import describe, stream
from trigpoint.similarity import Points
from trigpoint_reporting import rendering
from trigpoint_reporting.blocks import Passage, Picture
from trigpoint_reporting.elevations import AROUND_M, distance_colours, limit_of
from trigpoint_reporting.evidence import Evidence
from trigpoint_reporting.photo import fewer_colours, photo_colours
from trigpoint_reporting.sheet import Colours, to_png
from trigpoint_reporting.style import metres

# Towards the cameras, from above the horizon: two opposite corners, or the other two where what
# stands there shows more of itself.
CORNERS = (
    {"the south-east": (1.0, -1.3, 0.55), "the north-west": (-1.0, 1.3, 0.55)},
    {"the north-east": (1.3, 1.0, 0.55), "the south-west": (-1.3, -1.0, 0.55)},
)
MORE = 1.1
SIZE = (700, 600)
GAP = 20
MOST = 800_000
SECONDS = 180
INSTALL = "libegl1 libgl1-mesa-dri"


class _RenderError(Exception):
    """A view could not be rendered; the message says why."""


def perspective_views(evidence: Evidence) -> Picture | Passage:
    """Render the first reconstruction that has colours, or else the first by its distances."""
    name, points, colours, own = _shown(evidence)
    if not len(points):
        return _unavailable("no point of the reconstruction lies in the evaluation region")
    try:
        cameras = _cameras(points)
        pictures, renderer = _rendered(points, colours, list(cameras.values()))
    except _RenderError as error:
        return _unavailable(str(error))
    row = np.concatenate(_trimmed(pictures), axis=1)
    content = to_png(fewer_colours([row])[0])
    how = "in its own colours" if own else "coloured by distance to the reference"
    caption = (
        f"{name} {how}, in perspective from {' and from '.join(cameras)}: not to scale. "
        f"{len(points):,} points, drawn by {renderer}."
    )
    extent = np.ptp(points, axis=0)
    alt = (
        f"{name}, {' by '.join(metres(side, 0) for side in extent[:2])} in plan and "
        f"{metres(extent[2], 0)} high, {how}, seen from two opposite corners."
    )
    return Picture("perspective", caption, alt, content, "png")


def _shown(evidence: Evidence) -> tuple[str, Points, Colours, bool]:
    """Choose the cloud to show: its name, points, colours, and whether those are its own."""
    for name in evidence.names:
        path = evidence.folder / "clouds" / f"{name}-georeferenced.laz"
        if path.exists() and {"red", "green", "blue"} <= set(describe(path).attributes):
            return name, *_photographed(evidence, name, path), True
    name = evidence.names[0]
    cloud = evidence.cloud(name, "accuracy")
    if cloud is None:
        return name, np.empty((0, 3)), np.empty((0, 3), np.uint8), False
    every = -(-len(cloud) // MOST)
    distances = cloud.attributes["distance_m"][::every].astype(np.float64)
    return name, cloud.xyz[::every], distance_colours(distances, limit=limit_of(evidence)), False


def _photographed(evidence: Evidence, name: str, path: Path) -> tuple[Points, Colours]:
    """Read points and colours within the reference's extent: a stray one would move the camera."""
    reference = describe(evidence.folder / "clouds" / f"{name}-completeness.laz")
    low, high = reference.low - AROUND_M, reference.high + AROUND_M
    every = -(-describe(path).points // MOST)
    points, colours = [np.empty((0, 3))], [np.empty((0, 3), np.uint8)]
    for piece in stream(path):
        near = ((piece.coordinates >= low) & (piece.coordinates <= high)).all(axis=1)
        kept = piece.take(np.flatnonzero(near)[::every])
        points.append(kept.coordinates - low)
        colours.append(photo_colours(kept))
    return np.concatenate(points), np.concatenate(colours)


def _cameras(points: Points) -> dict[str, tuple[float, float, float]]:
    """Choose the corners that see the points' broad side: a facade seen edge-on is a line."""
    spreads = []
    for corners in CORNERS:
        x, y, _ = next(iter(corners.values()))
        spreads.append(float(np.std(points[:, 0] * y - points[:, 1] * x)))
    return CORNERS[1] if spreads[1] > MORE * spreads[0] else CORNERS[0]


def _rendered(
    points: Points, colours: Colours, cameras: Sequence[tuple[float, float, float]]
) -> tuple[Colours, str]:
    """Render in a child process, and be sure of what it returns."""
    middle = (points.min(axis=0) + points.max(axis=0)) / 2
    with tempfile.TemporaryDirectory() as folder:
        given, made = Path(folder, "points.npz"), Path(folder, "pictures.npz")
        np.savez(
            given,
            xyz=(points - middle).astype(np.float32),
            colours=colours,
            directions=np.array(cameras),
            size=np.array(SIZE),
            wide=np.array(1.6),
        )
        command = [sys.executable, "-m", rendering.__name__, str(given), str(made)]
        # Naming EGL keeps VTK from looking for a display, and from writing that there is none.
        egl = {"VTK_DEFAULT_OPENGL_WINDOW": "vtkEGLRenderWindow"}
        try:
            child = subprocess.run(
                command, env=os.environ | egl, capture_output=True, timeout=SECONDS, check=False
            )
        except subprocess.TimeoutExpired as error:
            message = f"it took more than {SECONDS} s"
            raise _RenderError(message) from error
        if b"ModuleNotFoundError" in child.stderr:
            message = 'pyvista is missing: pip install "trigpoint[reporting]"'
            raise _RenderError(message)
        if child.returncode or not made.exists():
            message = f"OpenGL did not start (on Debian: apt-get install {INSTALL})"
            raise _RenderError(message)
        with np.load(made, allow_pickle=False) as stored:
            pictures, renderer = stored["pictures"], stored["renderer"]
    if len({hashlib.sha256(picture.tobytes()).digest() for picture in pictures}) < len(pictures):
        message = "two cameras gave one picture, so it is not the cloud from both"
        raise _RenderError(message)
    if any((picture == 255).all() for picture in pictures):
        message = "the picture is empty"
        raise _RenderError(message)
    return pictures, str(renderer[0]) if len(renderer) else "OpenGL"


def _trimmed(pictures: Colours) -> list[Colours]:
    """Cut the white at the sides of each picture."""
    inked = (pictures != 255).any(axis=(1, 3))
    ends = [np.flatnonzero(columns)[[0, -1]] for columns in inked]
    return [
        picture[:, max(0, left - GAP) : right + GAP]
        for picture, (left, right) in zip(pictures, ends, strict=True)
    ]


def _unavailable(why: str) -> Passage:
    return Passage((f"Perspective view unavailable: {why}.",), "warning")
