import io
import subprocess
import sys

import numpy as np
import pytest
from PIL import Image

from trigpoint_reporting import perspective
from trigpoint_reporting.blocks import Passage, Picture
from trigpoint_reporting.perspective import perspective_views


def told(block):
    assert isinstance(block, Passage)
    assert block.tone == "warning"
    return "".join(block.parts)


@pytest.fixture
def rendered(evidence):
    block = perspective_views(evidence)
    if isinstance(block, Passage):
        pytest.skip(told(block))
    return block


def test_two_cameras_see_two_sides_the_same_way_each_time(evidence, rendered):
    assert isinstance(rendered, Picture)
    image = np.array(Image.open(io.BytesIO(rendered.content)).convert("RGB"))
    inked = (image != 255).any(axis=2)
    assert 0.05 < inked.mean() < 0.9
    assert not inked[[0, -1]].any()  # nothing is cut off
    assert not inked[:, [0, -1]].any()
    assert perspective_views(evidence).content == rendered.content


@pytest.mark.parametrize(
    ("along", "corners"),
    [((1, 1), 0), ((1, -1), 1), ((1, 0), 0), ((0, 0), 0)],
)
def test_a_facade_is_never_seen_edge_on(along, corners):
    rng = np.random.default_rng(8)
    points = rng.normal(size=(500, 3))
    points[:, :2] += 20 * rng.uniform(-1, 1, (500, 1)) * np.array(along)
    assert perspective._cameras(points) is perspective.CORNERS[corners]


def test_trap_13_a_missing_opengl_is_a_box_and_not_a_crash(evidence, monkeypatch):
    monkeypatch.setenv("__EGL_VENDOR_LIBRARY_FILENAMES", "/nonexistent.json")
    monkeypatch.setenv("LIBGL_DRIVERS_PATH", "/nonexistent")
    monkeypatch.delenv("DISPLAY", raising=False)
    assert "(on Debian: apt-get install libegl1 libgl1-mesa-dri)" in told(
        perspective_views(evidence)
    )


def replaced_child(monkeypatch, code):
    """Run other code in the child's place."""
    run = subprocess.run

    def instead(command, **settings):
        return run([sys.executable, "-c", code, *command[3:]], **settings)

    monkeypatch.setattr(perspective.subprocess, "run", instead)


def test_a_child_that_is_killed_is_a_box(evidence, monkeypatch):
    replaced_child(monkeypatch, "import os; os.kill(os.getpid(), 11)")
    assert "OpenGL did not start" in told(perspective_views(evidence))


def test_a_missing_package_is_named(evidence, monkeypatch):
    replaced_child(monkeypatch, "import no_such_module_as_this")
    assert 'pip install "trigpoint[reporting]"' in told(perspective_views(evidence))


def test_a_child_that_hangs_is_stopped(evidence, monkeypatch):
    monkeypatch.setattr(perspective, "SECONDS", 0.5)
    replaced_child(monkeypatch, "import time; time.sleep(60)")
    assert "more than 0.5 s" in told(perspective_views(evidence))


@pytest.mark.parametrize(
    ("pictures", "why"),
    [
        ("np.zeros((2, 4, 4, 3), np.uint8)", "two cameras gave one picture"),
        ("np.stack([np.zeros((4, 4, 3), np.uint8), np.full((4, 4, 3), 255, np.uint8)])", "empty"),
    ],
)
def test_trap_12_a_stale_or_empty_picture_is_never_shown(evidence, monkeypatch, pictures, why):
    code = (
        f"import sys, numpy as np; "
        f"np.savez(sys.argv[2], pictures={pictures}, renderer=np.array(['x']))"
    )
    replaced_child(monkeypatch, code)
    assert why in told(perspective_views(evidence))
