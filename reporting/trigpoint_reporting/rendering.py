"""The child process that renders: VTK kills its process where OpenGL is missing, so it has its own.

Run as ``python -m trigpoint_reporting.rendering POINTS.npz PICTURES.npz``.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

# Rendered at twice the size and averaged: VTK's own smoothing differs from driver to driver.
SMOOTH = 2


def render(points: Path, pictures: Path) -> None:
    """Render points from several cameras.

    Parameters
    ----------
    points : Path
        Holds xyz (n, 3), colours (n, 3), directions (k, 3) from the points to each camera, size
        (2,) in pixels and width of a point in pixels.
    pictures : Path
        Gets pictures (k, height, width, 3) and renderer, what OpenGL calls itself.
    """
    import pyvista as pv

    with np.load(points, allow_pickle=False) as given:
        cloud = pv.PolyData(given["xyz"])
        cloud["colours"] = given["colours"]
        directions, (width, height) = given["directions"], given["size"].tolist()
        wide = float(given["wide"])
    plotter: Any = pv.Plotter(off_screen=True, window_size=[SMOOTH * width, SMOOTH * height])
    plotter.set_background("white")
    plotter.add_mesh(cloud, scalars="colours", rgb=True, lighting=False, point_size=SMOOTH * wide)
    plotter.disable_anti_aliasing()
    shots = []
    for direction in directions:
        plotter.view_vector(direction, viewup=(0, 0, 1), render=False)
        _fill(plotter, np.asarray(cloud.points, np.float64), width / height)
        # Without this a screenshot shows what the camera before it saw.
        plotter.render()
        shot = np.asarray(plotter.screenshot(return_img=True), np.float64)[..., :3]
        blocks = shot.reshape(height, SMOOTH, width, SMOOTH, 3)
        shots.append(np.round(blocks.mean(axis=(1, 3))).astype(np.uint8))
    said = plotter.render_window.ReportCapabilities().splitlines()
    renderer = [line.split(":", 1)[1].strip() for line in said if "renderer string" in line]
    np.savez(pictures, pictures=np.array(shots), renderer=np.array(renderer[:1]))
    plotter.close()


def _fill(plotter: Any, points: NDArray[np.float64], aspect: float) -> None:
    """Open the camera's angle just so far that every point is in the picture."""
    camera = plotter.camera
    ahead = np.subtract(camera.focal_point, camera.position)
    ahead /= np.sqrt((ahead**2).sum())
    right = np.cross(ahead, camera.up)
    right /= np.sqrt((right**2).sum())
    seen = points - camera.position
    depth = (seen * ahead).sum(axis=1)
    across = np.abs((seen * right).sum(axis=1) / depth).max() / aspect
    upward = np.abs((seen * np.cross(right, ahead)).sum(axis=1) / depth).max()
    camera.view_angle = 2 * np.degrees(np.arctan(1.04 * max(across, upward)))


if __name__ == "__main__":
    render(Path(sys.argv[1]), Path(sys.argv[2]))
