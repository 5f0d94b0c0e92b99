import json
import subprocess
import sys
import zipfile

import jsonschema
import laspy
import numpy as np
import pytest
from plyfile import PlyData

import trigpoint
from trigpoint.bundle import bundle_folder, fill_bundle
from trigpoint.criteria import schema
from trigpoint.delivery import whole_folder
from trigpoint.errors import CrsError, ProjectError
from trigpoint.project import read_project


@pytest.fixture
def bundle(small_project):
    """Audit the small project and write its bundle."""

    def make(**settings):
        path, truth = small_project(**settings)
        audit = trigpoint.audit(path)
        folder = bundle_folder(audit.project)
        with whole_folder(folder) as draft:
            fill_bundle(draft, audit, audit.results())
        return folder, truth

    return make


def read_results(folder):
    return json.loads((folder / "data" / "results.json").read_text("utf-8"))


def test_the_truth_comes_back_within_its_covariance(small_project):
    path, truth = small_project()
    audit = trigpoint.audit(path)
    worth = audit.judged[0].alignment.reliability
    fit = audit.judged[0].alignment.similarity
    log_scale = np.log(fit.scale / truth.scale)
    assert abs(log_scale) < 4 * np.sqrt(worth.covariance[0, 0])
    places = truth(truth.inverse()(audit.reference.cloud.coordinates[::50]))
    misses = np.abs(fit(truth.inverse()(places)) - places)
    assert (misses < 4.5 * worth.sigma(places)).all()


def test_results_keep_to_the_schema_and_hold_both_stages(bundle):
    folder, _ = bundle()
    results = read_results(folder)
    jsonschema.validate(results, schema())
    nerf, sfm = results["reconstructions"]["nerf"], results["reconstructions"]["sfm"]
    assert {each["path"]: each["format"] for each in results["inputs"]} == {
        "lidar.laz": "LAZ 1.4, point format 6",
        "nerf.ply": "PLY 1.0, little endian, double",
        "picks.csv": "CSV",
        "sfm.laz": "LAZ 1.4, point format 6",
    }
    assert nerf["alignment"]["n"] == 6
    assert nerf["checks"]["n"] == 2
    assert nerf["icp"]["check_rmse_before_m"] == pytest.approx(nerf["checks"]["rmse_m"], abs=1e-6)
    assert sfm["alignment"] is None
    assert sfm["icp"]["control_rmse_before_m"] is None
    for each in (nerf, sfm):
        for stage in ("delivered", "after_icp"):
            zones = each["comparison"][stage]["completeness"]
            assert list(zones) == ["all", "lower", "middle", "upper"]
            assert zones["all"]["n"] == sum(zones[z]["n"] for z in ("lower", "middle", "upper"))


def test_the_bundle_holds_no_path_of_the_machine_and_no_time(bundle, tmp_path):
    folder, _ = bundle()
    for path in sorted(
        path for path in folder.rglob("*") if path.suffix in {".json", ".csv", ".txt"}
    ):
        text = path.read_text("utf-8")
        assert str(tmp_path) not in text
        assert "/tmp" not in text


def test_the_georeferenced_cloud_lies_where_the_similarity_puts_it(bundle, tmp_path):
    folder, _ = bundle()
    matrix = np.loadtxt(folder / "transform" / "nerf_matrix.txt")
    vertex = PlyData.read(tmp_path / "small" / "nerf.ply")["vertex"]
    source = np.column_stack([vertex[axis] for axis in "xyz"]).astype(float)
    written = laspy.read(folder / "clouds" / "nerf-georeferenced.laz")
    expected = source @ matrix[:3, :3].T + matrix[:3, 3]
    assert np.abs(np.asarray(written.xyz) - expected).max() < 1e-4
    assert (
        written.header.parse_crs().to_epsg() == 32615
        or "32615" in written.header.parse_crs().to_wkt()
    )


def test_distances_are_written_as_extra_dimensions(bundle):
    folder, _ = bundle()
    results = read_results(folder)["reconstructions"]["nerf"]["comparison"]
    for direction in ("accuracy", "completeness"):
        cloud = laspy.read(folder / "clouds" / f"nerf-{direction}.laz")
        for name, stage in (("distance_m", "delivered"), ("distance_after_icp_m", "after_icp")):
            row = results[stage][direction]["all"]
            distances = np.asarray(cloud[name])
            assert len(distances) == row["n"]
            assert np.sqrt((distances**2).mean()) == pytest.approx(row["rmse_m"], abs=1e-6)


def test_the_same_input_gives_the_same_bytes_in_another_folder_with_one_thread(
    bundle, small_project, tmp_path
):
    folder, _ = bundle()
    small_project(folder=tmp_path / "elsewhere" / "deep")
    code = (
        "import sys, trigpoint\n"
        "from pathlib import Path\n"
        "from trigpoint.bundle import fill_bundle\n"
        "audit = trigpoint.audit(sys.argv[1])\n"
        "Path(sys.argv[2]).mkdir()\n"
        "fill_bundle(Path(sys.argv[2]), audit, audit.results())\n"
    )
    environment = {
        "OMP_NUM_THREADS": "1",
        "OPENBLAS_NUM_THREADS": "1",
        "TZ": "Asia/Kathmandu",
        "LC_ALL": "C",
    }
    subprocess.run(
        [
            sys.executable,
            "-c",
            code,
            tmp_path / "elsewhere" / "deep" / "project.toml",
            tmp_path / "other",
        ],
        check=True,
        env=environment,
    )
    files = sorted(path.relative_to(folder) for path in folder.rglob("*") if path.is_file())
    assert files == sorted(
        p.relative_to(tmp_path / "other") for p in (tmp_path / "other").rglob("*") if p.is_file()
    )
    for path in files:
        assert (folder / path).read_bytes() == (tmp_path / "other" / path).read_bytes(), path


def test_what_is_issued_is_never_overwritten_and_a_draft_is(bundle, small_project):
    folder, _ = bundle()
    path, _ = small_project()
    project = read_project(path)
    assert bundle_folder(project) == folder
    stored = folder / "data" / "results.json"
    text = stored.read_text("utf-8")
    for status, why in (
        ('"issued"', "is issued"),
        ("[]", "is no draft"),
        ('"draft', "is no draft"),
    ):
        stored.write_text(text.replace('"status": "draft"', f'"status": {status}'), "utf-8")
        with pytest.raises(ProjectError, match=f"small-r1 is there already and {why}"):
            bundle_folder(project)
    path.write_text(path.read_text("utf-8").replace('title = "<script>"', "revision = 2"), "utf-8")
    assert bundle_folder(read_project(path)) == folder.with_name("small-r2")


@pytest.mark.parametrize(("status", "refused"), [("issued", True), ("draft", False)])
def test_a_zip_alone_counts_as_what_it_holds(small_project, status, refused):
    path, _ = small_project()
    archive = path.parent / "audit" / "small-r1.zip"
    archive.parent.mkdir()
    with zipfile.ZipFile(archive, "w") as file:
        file.writestr("small-r1/data/results.json", json.dumps({"project": {"status": status}}))
    project = read_project(path)
    if refused:
        with pytest.raises(ProjectError, match=r"small-r1\.zip is there already and is issued"):
            bundle_folder(project)
    else:
        assert bundle_folder(project) == path.parent / "audit" / "small-r1"


def test_a_reconstruction_in_another_crs_is_refused(small_project):
    path, _ = small_project()
    text = path.read_text("utf-8").replace(
        'path = "lidar.laz"', 'path = "lidar.laz"\ncrs = "EPSG:32616"'
    )
    path.write_text(text, "utf-8")
    with pytest.raises(CrsError, match=r"EPSG:32615.*EPSG:32616"):
        trigpoint.audit(path)


def test_a_limit_turns_into_a_verdict(small_project):
    limits = (
        '[[limit]]\nquantity = "loocv.rmse_m"\nof = "nerf"\nmax = 0.2\nsource = "brief"\n'
        '[[limit]]\nquantity = "comparison.delivered.completeness.all.within[0.20].pct"\n'
        'of = "sfm"\nmin = 99.9\nsource = "brief"\n'
    )
    path, _ = small_project(extra=limits)
    results = trigpoint.audit(path).results()
    assert [each["met"] for each in results["criteria"]] == [True, False]
    assert results["verdict"] == "FAIL"


def test_a_scale_bar_that_disagrees_is_said(small_project):
    bar = (
        '[[cross_check]]\nkind = "scale_bar"\nfrom = [0, 0, 0]\nto = [1, 0, 0]\n'
        "length_m = 3.5\nsigma_m = 0.01\n"
    )
    path, _ = small_project(extra=bar)
    results = trigpoint.audit(path).results()
    check = results["reconstructions"]["nerf"]["reliability"]["cross_checks"][0]
    assert check["discrepancy"] == pytest.approx(-0.24, abs=0.03)
    assert "cross_check_disagrees" in [each["code"] for each in results["warnings"]]


def test_every_kind_of_cross_check_is_in_the_results_and_enters_no_fit(small_project, tmp_path):
    path, truth = small_project(extra="icp = false\nintervals = false\n")
    plain = trigpoint.audit(path).results()
    cameras = np.array([[0.0, 0, 9], [3, 1, 4], [-2, 5, 1]])
    gnss = truth(cameras) + np.array([0, 0, 3])
    extra = (
        '[[cross_check]]\nkind = "up_direction"\nsigma_deg = 0.3\n'
        f"up = {truth.rotation[2].tolist()}\n"
        '[[cross_check]]\nkind = "camera_positions"\nsigma_m = [0.02, 0.02, 5.0]\n'
        f"source = {cameras.tolist()}\ntarget_m = {gnss.tolist()}\n"
    )
    path, _ = small_project(tmp_path / "checked", extra="icp = false\nintervals = false\n" + extra)
    results = trigpoint.audit(path).results()
    jsonschema.validate(results, schema())
    found, before = (each["reconstructions"]["nerf"] for each in (results, plain))
    up, places = found["reliability"]["cross_checks"]
    assert (up["kind"], up["unit"], up["p_value"] > 0.01) == ("up_direction", "deg", True)
    assert places["discrepancy"] == pytest.approx(3, abs=0.1)
    assert places["p_value"] > 0.01  # their heights are hardly known
    assert found["alignment"] == before["alignment"]


def test_the_georeferenced_cloud_holds_sigmas_where_the_project_asks(bundle):
    extra = "icp = false\nintervals = false\n[alignment]\nsigma = true\n"
    folder, _ = bundle(extra=extra)
    cloud = trigpoint.read(folder / "clouds" / "nerf-georeferenced.laz")
    sigmas = np.column_stack([cloud.attributes[name] for name in ("sigma_e", "sigma_n", "sigma_h")])
    assert 0.001 < sigmas.min() < sigmas.max() < 0.1


def test_a_warning_about_one_of_several_reconstructions_names_it(small_project):
    path, _ = small_project(extra="icp = false\nintervals = false\n")
    cloud = trigpoint.read(path.parent / "sfm.laz")
    low = cloud.take(cloud.coordinates[:, 2] < 152)
    trigpoint.write(path.parent / "sfm.laz", low)
    warnings = trigpoint.audit(path).results()["warnings"]
    (empty,) = (each["message"] for each in warnings if each["code"] == "zone_empty")
    assert empty.startswith("sfm: The reconstruction has no points in these zones: middle, upper.")
    (shared,) = (each["message"] for each in warnings if each["code"] == "threshold_below_voxel")
    assert shared.startswith("Thresholds 0.05, 0.1, 0.2 m are not above the voxel")
