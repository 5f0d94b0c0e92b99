"""Colours of a cloud: what is offered, that they order as the values do, and their legend."""

import numpy as np
import pytest

from trigpoint.cloud import cloud_from

colouring = pytest.importorskip(
    "trigpoint_panel.colouring",
    reason="the panel's packages are not installed",
    exc_type=ImportError,
)
UP = np.array([0.0, 0.0, 1.0])


def column(count=1000, **attributes):
    """Points one above the other at UTM, from 150 to 200 m."""
    points = np.tile([741_000.0, 4_279_000.0, 0.0], (count, 1))
    points[:, 2] = np.linspace(150, 200, count)
    return cloud_from(points, attributes=attributes)


def lightness(colours):
    linear = (colours / 255) ** 2.2
    return linear @ [0.2126, 0.7152, 0.0722]


def test_what_tells_nothing_is_not_offered():
    dull = column(intensity=np.zeros(1000, np.uint16), classification=np.ones(1000, np.uint8))
    assert colouring.modes_of(dull) == ("height",)
    rich = column(
        red=np.zeros(1000, np.uint8),
        green=np.zeros(1000, np.uint8),
        blue=np.zeros(1000, np.uint8),
        intensity=np.arange(1000, dtype=np.uint16),
        classification=(np.arange(1000) % 7).astype(np.uint8),
    )
    assert colouring.modes_of(rich, has_distances=True) == (
        "rgb",
        "height",
        "intensity",
        "class",
        "distance",
    )


def test_higher_is_lighter_all_the_way():
    colours, legend = colouring.coloured(column(), "height", up=UP)
    assert (np.diff(lightness(colours)) >= -1e-3).all()
    assert (legend.low, legend.high) == ("150.5 m", "199.5 m")
    assert len(legend.ramp) == 16


def test_heights_count_along_what_is_up():
    colours, _ = colouring.coloured(column(), "height", up=-UP)
    assert lightness(colours[:1]) > lightness(colours[-1:])


def test_a_flyer_does_not_flatten_the_ramp():
    cloud = column()
    cloud.xyz[-1, 2] += 10_000
    _, legend = colouring.coloured(cloud, "height", up=UP)
    assert legend.high == "199.5 m"


def test_a_level_cloud_and_a_single_point_have_colours():
    for count in (1, 50):
        cloud = cloud_from(np.zeros((count, 3)))
        colours, _ = colouring.coloured(cloud, "height", up=UP)
        assert colours.shape == (count, 3)


def test_distances_have_the_bands_of_the_report():
    from trigpoint_reporting.elevations import distance_colours

    distances = np.linspace(0, 0.7, 1000)
    colours, legend = colouring.coloured(column(), "distance", up=UP, distances=distances)
    assert (colours == distance_colours(distances)).all()
    assert (legend.low, legend.high) == ("0 m", "0.50 m")
    assert [name for _, name in legend.swatches] == ["beyond 0.50 m"]


def test_distances_are_told_apart_as_far_as_the_projects_thresholds_ask():
    from trigpoint_reporting.elevations import distance_colours

    distances = np.linspace(0, 0.2, 1000)
    colours, legend = colouring.coloured(
        column(), "distance", up=UP, distances=distances, limit=0.125
    )
    assert (colours == distance_colours(distances, limit=0.125)).all()
    assert [name for _, name in legend.swatches] == [f"beyond {legend.high}"] == ["beyond 0.1250 m"]


def test_intensities_keep_clear_of_any_background():
    cloud = column(intensity=np.arange(1000, dtype=np.uint16))
    colours, _ = colouring.coloured(cloud, "intensity", up=UP)
    assert colours.min() > 30
    assert colours.max() < 235


def test_classes_are_named_and_only_those_there_are():
    cloud = column(classification=np.repeat([2, 6, 64, 2], 250).astype(np.uint8))
    _, legend = colouring.coloured(cloud, "class", up=UP)
    assert [name for _, name in legend.swatches] == ["ground", "building", "class 64"]


def test_points_without_a_distance_are_said_to_have_none():
    distances = np.full(1000, np.nan)
    colours, legend = colouring.coloured(column(), "distance", up=UP, distances=distances)
    assert legend.swatches[-1] == ("#000000", "none measured")
    assert (colours == 0).all()
    assert colouring.distance_legend(0.5).swatches == legend.swatches[:1]
