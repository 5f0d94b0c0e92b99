import io
import re
import shutil

import numpy as np
import pyproj
import pytest
from PIL import Image

from trigpoint.cloud import cloud_from
from trigpoint.files import read, write
from trigpoint_reporting.blocks import Passage, Picture
from trigpoint_reporting.elevations import (
    AROUND_M,
    BEYOND,
    COVERED,
    LIMIT_M,
    MISSING,
    NEAR_MISS,
    NOTHING,
    SMALL_MM,
    band_edges,
    bands,
    colour_elevations,
    colour_table,
    distance_bands,
    distance_colours,
    distance_elevations,
    limit_of,
    missing_elevations,
    readme_picture,
    thumbnail,
)
from trigpoint_reporting.evidence import Evidence
from trigpoint_reporting.sheet import PER_MM

# Machado, Oliveira and Fernandes (2009), full severity, doi:10.1109/TVCG.2009.113
BLINDNESS = {
    "none": np.eye(3),
    "protan": [
        [0.152286, 1.052583, -0.204868],
        [0.114503, 0.786281, 0.099216],
        [-0.003882, -0.048116, 1.051998],
    ],
    "deutan": [
        [0.367322, 0.860646, -0.227968],
        [0.280085, 0.672501, 0.047413],
        [-0.011820, 0.042940, 0.968881],
    ],
    "tritan": [
        [1.255528, -0.076749, -0.178779],
        [-0.078411, 0.930809, 0.147602],
        [0.004733, 0.691367, 0.303900],
    ],
}


def lab(colours, kind="none"):
    """CIELAB of sRGB bytes as an eye of some kind sees them."""
    encoded = np.asarray(colours, float) / 255
    linear = np.where(encoded <= 0.04045, encoded / 12.92, ((encoded + 0.055) / 1.055) ** 2.4)
    seen = np.clip(linear @ np.transpose(BLINDNESS[kind]), 0, 1)
    xyz = seen @ np.array(
        [[0.4124, 0.2126, 0.0193], [0.3576, 0.7152, 0.1192], [0.1805, 0.0722, 0.9505]]
    )
    f = np.cbrt(np.maximum(xyz / [0.9505, 1.0, 1.089], 1e-3))
    return np.column_stack(
        [116 * f[:, 1] - 16, 500 * (f[:, 0] - f[:, 1]), 200 * (f[:, 1] - f[:, 2])]
    )


@pytest.mark.parametrize("kind", BLINDNESS)
def test_trap_32_colours_are_told_apart_by_every_eye_and_in_grey(kind):
    seen = lab(bands(), kind)
    assert (np.diff(seen[:, 0]) < -4).all()  # darker band by band
    for colour in (BEYOND, NOTHING):
        assert np.sqrt(((seen - lab(colour[None], kind)) ** 2).sum(axis=1)).min() > 12
    three = lab([COVERED, NEAR_MISS, MISSING], kind)
    assert (np.diff(three[:, 0]) < -20).all()


def test_a_distance_on_an_edge_belongs_to_the_nearer_band():
    distances = np.array([0.0, 0.05, 0.0500001, 0.1, 0.5, 0.51, np.nan, np.inf])
    table = colour_table()
    expected = table[[0, 0, 1, 1, 9, 10, 11, 11]]
    np.testing.assert_array_equal(distance_colours(distances), expected)


def test_the_colours_reach_as_far_as_the_projects_thresholds_ask(evidence, changed):
    assert limit_of(evidence) == LIMIT_M
    within = [0.01, 0.02, 0.05]
    fine = changed(
        lambda results: results["project"]["settings"]["comparison"].update(within_m=within)
    )
    assert limit_of(fine) == 0.125
    assert band_edges(0.125)[:3] == ["0.0000", "0.0125", "0.0250"]
    assert band_edges(2.5)[1::4] == ["0.25", "1.25", "2.25"]
    distances = np.array([0.0125, 0.0126, 0.125, 0.1251])
    assert distance_bands(distances, limit=0.125).tolist() == [0, 1, 9, 10]


def opened(picture):
    return np.array(Image.open(io.BytesIO(picture.content)).convert("RGB"))


def colours_of(sheet):
    """Every colour that is not a grey."""
    codes = np.unique(sheet.astype(np.int64) @ [65536, 256, 1]).tolist()
    found = {(code >> 16, code >> 8 & 255, code & 255) for code in codes}
    return {colour for colour in found if len(set(colour)) > 1}


def test_trap_15_every_colour_on_the_sheet_is_one_of_the_legend(evidence):
    allowed = {tuple(colour) for colour in colour_table().tolist()}
    for figure in (distance_elevations, missing_elevations):
        found = colours_of(opened(figure(evidence, "nerf")))
        assert len(found) > 1 or figure is missing_elevations
        assert found <= allowed
    assert colours_of(opened(readme_picture(evidence))) <= allowed


def test_the_share_out_of_range_is_that_of_the_points(evidence):
    distances = evidence.distances("nerf")["delivered_accuracy_m"]
    share = 100 * (distances > LIMIT_M).mean()
    assert f"{share:.1f} % beyond 0.5 m" in distance_elevations(evidence, "nerf").alt


def test_the_first_pages_picture_is_small_to_scale_and_in_the_same_colours(evidence):
    picture = thumbnail(evidence, "nerf")
    assert picture.small
    scale = float(re.search(r"1:(\d+)", picture.caption)[1])
    sheet = opened(picture)
    reference = read(evidence.folder / "clouds" / "nerf-completeness.laz").coordinates
    shown = np.ptp(reference, axis=0)[[0, 2]] + 2 * AROUND_M
    drawn = np.array(sheet.shape[1::-1]) / PER_MM  # on paper, in millimetres
    np.testing.assert_allclose(drawn * scale / 1000, shown, atol=2 * scale / 1000 / PER_MM)
    assert (drawn <= SMALL_MM).all()
    assert colours_of(sheet) <= {tuple(colour) for colour in colour_table().tolist()}
    assert "within 0.1 m" in picture.alt


def with_cloud(evidence, folder, name, cloud):
    shutil.copytree(evidence.folder, folder)
    (folder / "clouds" / f"{name}.laz").unlink()
    if cloud is not None:
        write(folder / "clouds" / f"{name}.laz", cloud)
    return Evidence(folder, evidence.results)


def test_a_known_point_lands_on_its_pixel_in_every_elevation(evidence, tmp_path):
    reference = read(evidence.folder / "clouds" / "nerf-completeness.laz").coordinates
    low, high = reference.min(axis=0) - 1, reference.max(axis=0) + 1
    # East and north of the middle, two metres below the top: at 0.3 m it has a colour of its own.
    place = np.array([low[0] + 0.7 * (high - low)[0], low[1] + 0.8 * (high - low)[1], high[2] - 2])
    lone = cloud_from(
        [place], attributes={"distance_m": np.array([0.32])}, crs=pyproj.CRS("EPSG:32615")
    )
    lone = with_cloud(evidence, tmp_path / "lone", "nerf-accuracy", lone)
    picture = distance_elevations(lone, "nerf")
    sheet = opened(picture)
    below_legend = sheet.shape[0] - 190
    at = np.argwhere((sheet[:below_legend] == bands()[6]).all(axis=2))
    scale = float(picture.caption.split("1:")[1].split(" ")[0])
    pixel = scale / 1000 / PER_MM
    size = high - low
    # Where the point lies from the left of each panel, panel by panel as they are read.
    shares = [0.3 * size[0], 0.8 * size[1], 0.7 * size[0], 0.2 * size[1]]
    wide = [size[0], size[1]]
    expected, row, left, top = [], [], 90, 0
    for k, along in enumerate(shares):
        width = int(np.ceil(wide[k % 2] / pixel))
        if row and left + width + 50 > 1700:
            top += 60 + int(np.ceil(size[2] / pixel)) + 40
            row, left = [], 90
        row.append(k)
        expected.append((top + 60 + 2 / pixel, left + along / pixel))
        left += width + 45
    for r, c in expected:
        near = at[(abs(at[:, 0] - r) < 2 + 0.2 / pixel) & (abs(at[:, 1] - c) < 2 + 0.2 / pixel)]
        assert len(near) > 0, (r, c)
        assert abs(near[:, 0].mean() - r) < 2
        assert abs(near[:, 1].mean() - c) < 2
    side = round(1.5 * 0.2 / pixel)
    assert len(at) == pytest.approx(4 * side**2, rel=0.2)  # and nowhere else


def test_a_cloud_without_points_leaves_a_box_and_the_whole_reference_missing(evidence, tmp_path):
    bare = with_cloud(evidence, tmp_path / "bare", "nerf-accuracy", None)
    assert isinstance(distance_elevations(bare, "nerf"), Passage)
    assert isinstance(readme_picture(bare), Picture)
    reference = read(evidence.folder / "clouds" / "nerf-completeness.laz")
    nowhere = cloud_from(
        reference.coordinates,
        attributes={"distance_m": np.full(len(reference), np.nan)},
        crs=reference.crs,
    )
    alone = with_cloud(evidence, tmp_path / "alone", "nerf-completeness", nowhere)
    picture = missing_elevations(alone, "nerf")
    assert "lacks 100.0 % of the reference" in picture.alt
    assert not colours_of(opened(picture)[:-190])


def test_own_colours_are_shown_and_their_absence_is_said(evidence, tmp_path):
    assert "it has none" in "".join(colour_elevations(evidence, "nerf").parts)
    assert "no such cloud" in "".join(colour_elevations(evidence, "sfm").parts)
    cloud = read(evidence.folder / "clouds" / "nerf-georeferenced.laz")
    shade = np.where(cloud.xyz[:, 2] > np.median(cloud.xyz[:, 2]), 60000, 20000).astype(np.uint16)
    painted = cloud_from(
        cloud.coordinates,
        attributes={"red": shade, "green": shade // 4, "blue": shade // 8},
        crs=cloud.crs,
    )
    own = with_cloud(evidence, tmp_path / "own", "nerf-georeferenced", painted)
    picture = colour_elevations(own, "nerf")
    assert colours_of(opened(picture)) == {(234, 58, 29), (78, 19, 9)}
    assert colour_elevations(own, "nerf").content == picture.content
