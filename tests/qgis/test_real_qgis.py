"""The plugin in QGIS as a user starts it: no network, a display of its own, and the way out."""

import json
import shutil
import subprocess
from pathlib import Path

import pytest

pytestmark = pytest.mark.qgis

CORNERS = [[-91, 38], [-90, 38], [-90, 39], [-91, 39], [-91, 38]]
REGION = {
    "type": "FeatureCollection",
    "features": [
        {
            "type": "Feature",
            "properties": {},
            "geometry": {"type": "Polygon", "coordinates": [CORNERS]},
        }
    ],
}


@pytest.fixture(scope="session")
def tower(tmp_path_factory):
    """The clock tower's project, without its audit."""
    from trigpoint.synthetic import clock_tower, write_project

    return write_project(tmp_path_factory.mktemp("tower"), clock_tower())


def test_from_the_zip_to_quitting_with_the_dock_open(
    run_qgis, profile, archive, real_qgis, tower, tmp_path
):
    profile(python_env=real_qgis)
    region = tmp_path / "region.geojson"
    region.write_text(json.dumps(REGION))
    said = run_qgis("lifecycle", archive=archive, project=tower, region=region)
    names = ("align", "apply", "audit", "compare")
    assert said["algorithms"] == [f"trigpoint:{name}" for name in names]
    assert said["imported_early"] == []
    assert said["floating"]
    assert said["seconds_to_panel"] < 30
    assert min(said["colours_at_first"].values()) > 2000, "a cloud is not to be seen"
    assert said["picked"] >= 5
    assert said["scale"] == pytest.approx(3.26, rel=0.02)
    assert said["rmse_m"] < 0.5
    assert said["pairs_after_undo"] == said["picked"] - 1
    for state, seen in said["colours"].items():
        assert min(seen) > 2000, f"a cloud is not to be seen once {state}"
    assert said["pairs_kept"] == said["picked"]
    # Trap: QGIS's own GEOS and GDAL come first, and calling both crashes.
    assert said["region"] == [True, False]
    assert said["unloaded"]
    assert not any(said["left_behind"].values()), said["left_behind"]
    assert said["reloaded"]
    assert min(said["colours_after_reload"]) > 2000


@pytest.mark.parametrize(
    ("screen", "theme"), [("1366x768", "Night Mapping"), ("1920x1080", "default")]
)
def test_from_the_project_to_the_report_and_the_map(
    run_qgis, profile, archive, real_qgis, small, screen, theme
):
    profile(python_env=real_qgis, installed=archive)
    said = run_qgis("story", screen=screen, seconds=400, project=small, theme=theme)
    assert said["rmse_m"] < 0.1
    assert said["clipped"] == []
    assert said["bold"] == [True], "headings look like what they head"
    # Docked, the views have a height; floated again, all of the panel is in reach.
    assert said["docked_view_px"] > 150
    assert said["on_screen"]
    assert said["menu_seen"]
    assert said["menu_seen_docked"]
    assert said["tasks"] == ["Trigpoint: Audit"]
    assert said["verdict"] == "NOT TESTED"
    assert said["offered"] == ["Open HTML", "Open PDF", "Details", "Copy", "✕"]
    assert [Path(path).name for path in said["opened"]] == ["report.html"]
    assert len(said["layers"]) == 8
    assert all(layer["valid"] and layer["crs"] == "EPSG:32615" for layer in said["layers"])
    assert said["project_crs"] == "EPSG:32615"
    assert said["drawn"] > 5000, "the map is empty"
    assert said["unloaded"]
    frame = "EPSG:32615"
    assert said["loaded"] == {
        "Picks": ["categorizedSymbol", frame],
        "Residuals x 20": ["singleSymbol", frame],
        "Completeness within 0.2 m (%)": ["singlebandpseudocolor", frame],
        "Error (RMSE, m)": ["singlebandpseudocolor", frame],
        "Footprint": ["singleSymbol", frame],
    }
    # Whatever layer is selected: Processing's own order would lay rasters over what they show.
    for pile in (
        ("Picks", "Residuals x 20"),
        ("Footprint", "Error (RMSE, m)", "Completeness within 0.2 m (%)"),
    ):
        assert [name for name in said["from_the_top"] if name in pile] == list(pile)
    assert said["layers_after"] == 13, "what was measured stays on the map when the plugin goes"


def test_the_packages_are_installed_beside_qgis_and_the_panel_opens(
    run_qgis, profile, archive, real_qgis, tmp_path
):
    pip = [real_qgis / "bin" / "python", "-m", "pip"]
    found = subprocess.run(
        [*pip, "download", "-q", "--no-deps", "--no-cache-dir", "--retries=0", "qtpy"],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    if found.returncode != 0:
        pytest.skip(f"no package index is reachable: {found.stderr.strip()[-120:]}")
    folder = profile(installed=archive)
    said = run_qgis("installing", alone=False, seconds=500, profile=folder)
    assert said["own"], "the packages are not where the profile is"
    assert said["fault"] == ""
    assert said["numpy_of_qgis"]
    assert said["can_execute"]
    assert said["panel"]


def test_without_the_packages_there_is_a_card_and_three_ways_out(
    run_qgis, profile, archive, real_qgis
):
    folder = profile(installed=archive)
    said = run_qgis("card", archive=archive, environment=real_qgis, profile=folder)
    assert "Missing: pandas" in said["text"]
    assert ", vtk," in said["text"]
    assert not said["panel"]
    assert not said["modal"]
    assert not said["can_execute"]
    assert "-m venv" in said["clipboard"]
    assert "package index" in said["fault"], said["log"]
    assert not said["left"], "what was not finished stayed behind"


def results(ended):
    assert ended.returncode == 0, ended.stderr[-3000:] + ended.stdout[-3000:]
    return json.loads(ended.stdout)["results"]


@pytest.fixture
def small(small_project, real_qgis):  # noqa: ARG001
    return small_project()[0]


def test_align_then_apply_through_qgis_process(qgis_process, small, tmp_path):
    fit, carried = tmp_path / "fit.json", tmp_path / "nerf.laz"
    found = results(
        qgis_process(
            "trigpoint:align",
            f"--PICKS={small.with_name('picks.csv')}",
            "--CRS=EPSG:32615",
            f"--SIMILARITY={fit}",
            f"--POINTS={tmp_path / 'points.gpkg'}",
            f"--VECTORS={tmp_path / 'vectors.gpkg'}",
        )
    )
    assert found["SCALE"] == pytest.approx(3.26, rel=0.01)
    assert found["INLIERS"] == 6
    assert found["GEOMETRY"] == "sound"
    assert (tmp_path / "vectors.gpkg").is_file()
    found = results(
        qgis_process(
            "trigpoint:apply",
            f"--SIMILARITY={fit}",
            f"--INPUT={small.with_name('nerf.ply')}",
            f"--OUTPUT={carried}",
        )
    )
    assert found == {"COUNT": 8000, "OUTPUT": str(carried)}


def test_compare_through_qgis_process(qgis_process, small, tmp_path):
    found = results(
        qgis_process(
            "trigpoint:compare",
            f"--RECONSTRUCTION={small.with_name('sfm.laz')}",
            f"--REFERENCE={small.with_name('lidar.laz')}",
            "--VOXEL=0.2",
            f"--RESULTS={tmp_path / 'results.json'}",
            f"--COMPLETENESS={tmp_path / 'completeness.tif'}",
            f"--ERROR={tmp_path / 'error.tif'}",
            f"--FOOTPRINT={tmp_path / 'footprint.gpkg'}",
        )
    )
    assert 0 < found["ACCURACY_RMSE"] < 1
    assert 0 < found["COMPLETENESS_PCT"] <= 100
    for name in ("completeness.tif", "error.tif", "footprint.gpkg"):
        assert (tmp_path / name).stat().st_size > 0


def test_audit_through_qgis_process(qgis_process, small, tmp_path):
    found = results(
        qgis_process("trigpoint:audit", f"--PROJECT={small}", f"--FOLDER={tmp_path / 'audit'}")
    )
    assert found["VERDICT"] == "NOT TESTED"
    bundle = Path(found["BUNDLE"])
    assert (bundle / "data" / "results.json").is_file()
    assert Path(found["REPORT"]).is_file()
    drawn = {path.name for path in Path(found["MAP_FOLDER"]).iterdir()}
    assert {"nerf.gpkg", "nerf-error.tif", "sfm-completeness.tif"} <= drawn


def test_what_is_refused_is_a_sentence_and_exit_code_1(qgis_process, small, tmp_path):
    shutil.copy(small.with_name("lidar.laz"), tmp_path / "picks.csv")
    ended = qgis_process(
        "trigpoint:align", f"--PICKS={tmp_path / 'picks.csv'}", f"--SIMILARITY={tmp_path / 's'}"
    )
    assert ended.returncode == 1
    assert "picks.csv" in ended.stderr
    assert "Traceback" not in ended.stderr
