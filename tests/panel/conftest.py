"""Where the panel's tests run, and the small clouds that they show."""

import os
import sys
from pathlib import Path

import numpy as np
import pyproj
import pytest

from trigpoint.cloud import cloud_from
from trigpoint.files import CloudInfo


@pytest.hookimpl(trylast=True)
def pytest_configure():
    """Take the offscreen platform, unless a display is there or pytest-xvfb has made one."""
    if sys.platform.startswith("linux") and not os.environ.get("DISPLAY"):
        os.environ.setdefault("QT_QPA_PLATFORM", "offscreen")
        # VTK would look for a display first, and write that there is none. Not beside one: where
        # VTK has used EGL, Qt's GLX contexts can't be made current.
        os.environ.setdefault("VTK_DEFAULT_OPENGL_WINDOW", "vtkEGLRenderWindow")


@pytest.fixture(scope="session")
def qapp(qapp):
    """Write with letters of a desktop's size.

    Qt 5's offscreen platform has no desktop to ask, and takes 12 points where desktops have 9.
    """
    if qapp.platformName() == "offscreen":
        letters = qapp.font()
        letters.setPointSize(9)
        qapp.setFont(letters)
    return qapp


# Not tests: a hand that works the panel, and a driver that takes pictures of it.
collect_ignore = ["hand.py", "shots.py"]

UTM = np.array([741_000.0, 4_279_000.0, 150.0])


def tower(count, seed=0):
    """Points on a square tower of 4 x 4 x 20 and on the ground around it."""
    rng = np.random.default_rng(seed)
    u, v, part = rng.random(count), rng.random(count), rng.integers(0, 6, count)
    flat = np.zeros(count)
    faces = [
        (4 * u - 2, flat - 2, 20 * v),
        (4 * u - 2, flat + 2, 20 * v),
        (flat - 2, 4 * u - 2, 20 * v),
        (flat + 2, 4 * u - 2, 20 * v),
        (4 * u - 2, 4 * v - 2, flat + 20),
        (24 * u - 12, 24 * v - 12, flat),
    ]
    return np.choose(part[:, None], [np.column_stack(face) for face in faces])


@pytest.fixture
def opened_tower():
    """Make a tower as `open_cloud` returns one, in UTM or in a frame of its own."""
    from trigpoint_panel.opening import Opened

    def make(count=30_000, *, crs="EPSG:32615", total=None, coordinates=None, **attributes):
        points = tower(count) + (UTM if crs else 0) if coordinates is None else coordinates
        frame = pyproj.CRS(crs) if crs else None
        given = attributes or {
            "red": (points[:, 2] * 3 % 256).astype(np.uint8),
            "green": np.full(len(points), 90, np.uint8),
            "blue": np.arange(len(points)).astype(np.uint8),
        }
        cloud = cloud_from(points, attributes=given, crs=frame)
        low, high = points.min(axis=0), points.max(axis=0)
        names = tuple(given)
        info = CloudInfo(
            Path("tower.laz"), "LAZ", total or len(points), low, high, frame, names, 1, ()
        )
        return Opened(info, cloud)

    return make
