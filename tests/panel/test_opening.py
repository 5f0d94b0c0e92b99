"""Clouds as they are opened for the screen: thinned evenly, at full precision, or refused."""

import numpy as np
import pytest

from trigpoint.cloud import cloud_from
from trigpoint.errors import CloudError, CrsError
from trigpoint.files import write
from trigpoint_panel import opening
from trigpoint_panel.opening import open_cloud

CORNER = np.array([741_000.0, 4_279_000.0, 150.0])


@pytest.fixture
def survey(tmp_path):
    """Write a cloud of 20,000 points, as LAZ in UTM or as PLY without a CRS."""

    def make(name="survey.laz", crs="EPSG:32615", count=20_000):
        rng = np.random.default_rng(0)
        points = np.round(rng.random((count, 3)) * 50, 3) + CORNER
        attributes = {
            "intensity": rng.integers(0, 1000, count).astype(np.uint16),
            "gps_time": rng.random(count),
        }
        path = tmp_path / name
        write(path, cloud_from(points, attributes=attributes, crs=crs and crs_of(crs)))
        return path, points

    return make


def crs_of(code):
    from trigpoint.crs import parse_crs

    return parse_crs(code)


def test_a_small_cloud_is_shown_whole_and_to_the_last_digit(survey):
    path, points = survey()
    found = open_cloud(path)
    assert len(found.cloud) == found.total == 20_000
    assert not found.is_thinned
    assert np.abs(found.cloud.coordinates - points).max() < 1e-4
    assert found.unit == "m"
    assert found.path == path


def test_a_large_cloud_is_thinned_evenly_and_says_so(survey):
    path, points = survey()
    found = open_cloud(path, most=5000)
    assert found.is_thinned
    assert found.total == 20_000
    assert len(found.cloud) == pytest.approx(5000, rel=0.05)
    shown = found.cloud.coordinates
    # Every fourth point or so of each eighth of the file, and of each side of the box.
    counts = np.histogram(shown[:, 0], bins=8, range=(CORNER[0], CORNER[0] + 50))[0]
    assert counts.min() > 0.85 * len(shown) / 8
    rows = np.round(shown - CORNER, 3)
    assert {tuple(row) for row in rows} <= {tuple(row) for row in np.round(points - CORNER, 3)}


def test_the_points_shown_do_not_depend_on_the_chunks(survey, monkeypatch):
    path, _ = survey()
    whole = open_cloud(path, most=3000)
    monkeypatch.setattr(opening, "CHUNK", 777)
    pieces = open_cloud(path, most=3000)
    assert (whole.cloud.coordinates == pieces.cloud.coordinates).all()


def test_only_what_can_be_shown_is_kept(survey):
    path, _ = survey()
    assert "intensity" in open_cloud(path).cloud.attributes
    assert "gps_time" not in open_cloud(path).cloud.attributes


def test_progress_is_told_and_may_stop_the_reading(survey, monkeypatch):
    path, _ = survey()
    monkeypatch.setattr(opening, "CHUNK", 5000)
    told = []
    open_cloud(path, progress=lambda share, text: told.append((share, text)))
    shares = [share for share, _ in told]
    assert shares == sorted(shares)
    assert shares[-1] == 1.0
    assert told[-1][1] == "Reading survey.laz"

    def stop(share, _):
        if share > 0.4:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        open_cloud(path, progress=stop)


def test_a_reference_without_a_crs_is_refused_until_one_is_named(survey):
    path, _ = survey("bare.ply", crs=None)
    with pytest.raises(CrsError, match=r"bare\.ply has no CRS: choose one"):
        open_cloud(path, needs_crs=True)
    assert open_cloud(path).unit == "units"
    assert open_cloud(path, needs_crs=True, crs="EPSG:32615").unit == "m"


def test_degrees_are_refused(survey):
    path, _ = survey()
    with pytest.raises(CrsError, match="degree"):
        open_cloud(path, crs="EPSG:4326")


def test_a_cloud_cut_short_is_refused(survey):
    path, _ = survey()
    content = path.read_bytes()
    path.write_bytes(content[: len(content) // 2])
    with pytest.raises(CloudError, match=r"survey\.laz"):
        open_cloud(path)


def test_a_missing_an_empty_and_a_foreign_file_are_refused(tmp_path):
    with pytest.raises(CloudError, match="no such file"):
        open_cloud(tmp_path / "nowhere.laz")
    empty = tmp_path / "empty.ply"
    empty.write_text(
        "ply\nformat ascii 1.0\nelement vertex 0\nproperty double x\nproperty double y\n"
        "property double z\nend_header\n"
    )
    with pytest.raises(CloudError, match=r"empty\.ply"):
        open_cloud(empty)
    photo = tmp_path / "photo.png"
    photo.write_bytes(b"\x89PNG\r\n\x1a\n")
    with pytest.raises(CloudError, match=r"photo\.png"):
        open_cloud(photo)


def test_every_refusal_is_one_line(survey, tmp_path):
    path, _ = survey("bare.ply", crs=None)
    for work in (
        lambda: open_cloud(path, needs_crs=True),
        lambda: open_cloud(path, crs="EPSG:4326"),
        lambda: open_cloud(tmp_path),
    ):
        with pytest.raises((CloudError, CrsError)) as refusal:
            work()
        assert "\n" not in str(refusal.value)


@pytest.mark.parametrize("height", [1e13, 1e300])
def test_coordinates_beyond_what_a_pick_may_have_are_refused(tmp_path, height):
    path = tmp_path / "far.xyz"
    path.write_text(f"0 0 0\n1 1 {height}\n2 2 2\n")
    with pytest.raises(CloudError, match=r"^far.xyz has coordinates of up to 1e\+"):
        open_cloud(path)
