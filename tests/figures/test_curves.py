import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from trigpoint_reporting import curves
from trigpoint_reporting.blocks import Picture
from trigpoint_reporting.curves import (
    _by_own_zone,
    accuracy_by_zone,
    accuracy_curves,
    completeness_by_zone,
    completeness_curves,
    share_within,
)
from trigpoint_reporting.style import canvas

LIMIT_M = 0.5
LIMITS = np.linspace(0, LIMIT_M, 11)


@given(st.lists(st.floats(0, 2) | st.sampled_from([0.05, 0.1, 0.5, np.inf]), min_size=1))
def test_a_share_counts_what_is_within_or_at_the_limit(distances):
    counted = [100 * sum(d <= limit for d in distances) / len(distances) for limit in LIMITS]
    np.testing.assert_allclose(share_within(np.array(distances), LIMITS), counted, atol=1e-12)


def test_the_share_of_nothing_is_unknown_and_not_zero():
    assert np.isnan(share_within(np.empty(0), LIMITS)).all()


@pytest.mark.parametrize("direction", ["accuracy", "completeness"])
def test_the_curves_pass_through_the_numbers_of_the_tables(evidence, direction):
    rows = evidence.results["reconstructions"]["nerf"]["comparison"]["delivered"][direction]
    split = _by_own_zone(evidence, "nerf", direction, [zone for zone in rows if zone != "all"])
    for zone, row in rows.items():
        assert len(split[zone]) == row["n"]
        limits = np.array([each["threshold_m"] for each in row["within"]])
        expected = [each["pct"] for each in row["within"]]
        np.testing.assert_allclose(share_within(split[zone], limits), expected, atol=1e-9)


def test_an_empty_zone_is_drawn_as_empty(changed):
    def emptied(results):
        for found in results["reconstructions"].values():
            for direction in ("accuracy", "completeness"):
                row = found["comparison"]["delivered"][direction]["upper"]
                row |= dict.fromkeys(row) | {"n": 0, "within": row["within"]}
                for each in row["within"]:
                    each |= {"pct": 0.0, "low_pct": None, "high_pct": None, "raw_pct": None}

    bare = changed(emptied)
    for figure in (accuracy_by_zone, completeness_by_zone, accuracy_curves, completeness_curves):
        block = figure(bare)
        assert isinstance(block, Picture)
        assert "upper" not in block.alt


def test_intervals_are_drawn_where_there_are_any(changed):
    def interval(results):
        for found in results["reconstructions"].values():
            for row in found["comparison"]["delivered"]["accuracy"].values():
                for each in row["within"]:
                    each |= {"low_pct": each["pct"] - 3, "high_pct": each["pct"] + 4}

    def none(results):
        for found in results["reconstructions"].values():
            for row in found["comparison"]["delivered"]["accuracy"].values():
                for each in row["within"]:
                    each |= {"low_pct": None, "high_pct": None}

    with_bars, without = accuracy_by_zone(changed(interval)), accuracy_by_zone(changed(none))
    assert "95 % intervals" in with_bars.caption
    assert "interval" not in without.caption
    assert with_bars.content != without.content


def test_a_share_below_its_own_interval_says_why_and_is_written_within_the_frame(changed):
    def lowered(results):
        for found in results["reconstructions"].values():
            for row in found["comparison"]["delivered"]["accuracy"].values():
                for each in row["within"]:
                    each |= {"pct": 5.0, "low_pct": 8.0, "high_pct": 96.0}

    def held(results):
        lowered(results)
        for found in results["reconstructions"].values():
            for row in found["comparison"]["delivered"]["accuracy"].values():
                for each in row["within"]:
                    each["low_pct"] = 4.0

    assert "the share at the true pose" in accuracy_by_zone(changed(lowered)).caption
    assert "true pose" not in accuracy_by_zone(changed(held)).caption


@pytest.mark.parametrize(("left", "right", "inside"), [(50, 60, "right"), (50, 96, "left")])
def test_a_share_is_written_where_the_frame_leaves_room(left, right, inside):
    with canvas(40) as figure:
        axes = figure.subplots()
        curves._beside(axes, 55.0, left, right, 0.0)
        (text,) = axes.texts
        assert (text.get_ha() == "left") == (inside == "right")
        curves._beside(axes, 10.5, 10.0, 96.0, 1.0)  # room on neither side
        assert axes.texts[1].get_ha() == "left"
        assert axes.texts[1].xy[0] == 10.5
        assert axes.texts[1].get_bbox_patch() is not None


def test_trap_11_the_voxel_band_is_shown_and_said(evidence, changed):
    assert "below the voxel size of 0.2 m, not resolvable" in accuracy_curves(evidence).caption

    def unthinned(results):
        results["project"]["settings"]["comparison"]["voxel_m"] = 0

    assert "voxel" not in accuracy_curves(changed(unthinned)).caption


def test_another_set_of_thresholds_moves_the_mark(changed):
    def coarse(results):
        results["project"]["settings"]["comparison"]["within_m"] = [0.2, 0.3, 0.4]
        for found in results["reconstructions"].values():
            for row in found["comparison"]["delivered"]["completeness"].values():
                for each, threshold in zip(row["within"], (0.2, 0.3, 0.4), strict=True):
                    each["threshold_m"] = threshold

    assert completeness_curves(changed(coarse)).alt.startswith("Within 0.3 m lie")
