import io
from dataclasses import replace

import numpy as np
import pytest
from PIL import Image

from trigpoint_reporting.sheet import HATCH, PER_MM, WIDTH, Legend, Panel, draw, lay_out, to_png

BLUE, RED = np.array([0, 34, 78], np.uint8), np.array([213, 94, 0], np.uint8)
LEGEND = Legend("Distance", np.array([BLUE]), ("0", "1"), ((RED, "beyond"),))


def panel(width, height, *, low=100.0):
    return Panel("From the south", np.array([-3.0, low, width - 3.0, low + height]))


def opened(content):
    return np.array(Image.open(io.BytesIO(content)).convert("RGB"))


def test_the_scale_is_the_largest_round_one_that_fits():
    plan = lay_out([panel(50, 60)] * 4)
    assert plan.scale == 750
    assert plan.pixel == pytest.approx(0.75 / PER_MM)
    assert all(size == (667, 800) for size in plan.sizes)


def test_panels_stay_on_the_sheet_and_off_each_other():
    plan = lay_out([panel(w, h) for w, h in ((50, 60), (20, 60), (50, 5), (48, 60), (51, 49))])
    taken = np.zeros((plan.height, WIDTH), int)
    for (left, top), (width, height) in zip(plan.corners, plan.sizes, strict=True):
        assert left + width <= WIDTH
        assert top + height <= plan.height
        taken[top : top + height, left : left + width] += 1
    assert taken.max() == 1


def test_what_is_too_wide_for_any_scale_is_refused():
    with pytest.raises(ValueError, match="too wide for any scale"):
        lay_out([panel(1e9, 1)])


def test_pixels_reach_the_file_unchanged_and_the_legend_has_their_colours():
    panels = [panel(20, 30)]
    plan = lay_out(panels)
    width, height = plan.sizes[0]
    picture = np.full((height, width, 3), 255, np.uint8)
    picture[: height // 2] = BLUE
    picture[5, 7] = RED
    sheet = opened(
        draw(panels, plan, [picture], LEGEND, zones=[("lower", 100.0), ("upper", 110.0)])
    )
    (left, top), _ = plan.corners[0], None
    np.testing.assert_array_equal(sheet[top + 5, left + 7], RED)
    np.testing.assert_array_equal(sheet[top + 1, left + 9], BLUE)
    below = sheet[top + height + 40 :].reshape(-1, 3)
    for colour in (BLUE, RED):
        assert (below == colour).all(axis=1).sum() >= 34 * 34
    others = sheet.reshape(-1, 3)[
        ~((sheet.reshape(-1, 3) == BLUE) | (sheet.reshape(-1, 3) == RED)).all(1)
    ]
    assert (np.ptp(others.astype(int), axis=1) == 0).all()  # all else is grey: nothing blended


def test_a_zone_is_drawn_at_its_height():
    panels = [panel(20, 30)]
    plan = lay_out(panels)
    width, height = plan.sizes[0]
    picture = np.full((height, width, 3), 200, np.uint8)
    sheet = opened(
        draw(panels, plan, [picture], LEGEND, zones=[("lower", 100.0), ("upper", 112.0)])
    )
    left, top = plan.corners[0]
    dark = np.flatnonzero((sheet[top : top + height, left] == 0).all(axis=1))
    assert dark.mean() * plan.pixel == pytest.approx(130 - 112, abs=2 * plan.pixel)


def test_a_sheet_is_the_same_bytes_and_states_its_size_and_nothing_else():
    panels = [panel(20, 30)]
    plan = lay_out(panels)
    pictures = [np.zeros((*plan.sizes[0][::-1], 3), np.uint8)]
    content = draw(panels, plan, pictures, LEGEND)
    assert draw(panels, plan, pictures, LEGEND) == content
    image = Image.open(io.BytesIO(content))
    assert image.info["dpi"][0] == pytest.approx(254, abs=0.01)
    assert set(image.info) <= {"dpi"}
    assert image.size[0] == WIDTH


def test_few_colours_get_a_palette_and_many_survive():
    rng = np.random.default_rng(1)
    for colours in (3, 256, 300):
        table = rng.choice(2**24, colours, replace=False)
        table = np.stack([table >> 16, table >> 8 & 255, table & 255], 1).astype(np.uint8)
        pixels = np.concatenate([table, table[rng.integers(0, colours, 900)]])
        pixels = pixels[: len(pixels) // 10 * 10].reshape(10, -1, 3)
        content = to_png(pixels)
        assert (Image.open(io.BytesIO(content)).mode == "P") == (colours <= 256)
        np.testing.assert_array_equal(opened(content), pixels)


def test_a_hatched_colour_is_crossed_by_lines_and_no_other_is():
    panels = [panel(20, 30)]
    plan = lay_out(panels)
    width, height = plan.sizes[0]
    picture = np.full((height, width, 3), BLUE, np.uint8)
    picture[: height // 2] = RED
    sheet = opened(draw(panels, plan, [picture], replace(LEGEND, hatched=np.array(RED))))
    left, top = plan.corners[0]
    place = sheet[top : top + height, left : left + width]
    black = (place == 0).all(axis=2)
    assert black[: height // 2].mean() == pytest.approx(2 / HATCH, rel=0.05)
    assert not black[height // 2 :].any()
