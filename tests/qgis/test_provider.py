"""The provider and its algorithms inside QGIS's own Python."""

import json
import os
import time
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("qgis.core", reason="this Python is not QGIS's; .ci/qgis.sh makes one that is")
pytest.importorskip("pytest_qgis", reason="pytest-qgis is not installed")

from qgis.core import (
    Qgis,
    QgsApplication,
    QgsProcessingContext,
    QgsProcessingException,
    QgsProject,
    QgsRasterLayer,
    QgsRenderContext,
    QgsVectorLayer,
)

from trigpoint_qgis import deps, results

pytestmark = pytest.mark.qgis


@pytest.fixture
def provider(qgis_processing):  # noqa: ARG001
    from trigpoint_qgis.provider import TrigpointProvider

    provider = TrigpointProvider()
    QgsApplication.processingRegistry().addProvider(provider)
    yield provider
    QgsApplication.processingRegistry().removeProvider(provider)


@pytest.fixture
def run(provider):  # noqa: ARG001
    import processing

    return processing.run


def test_the_provider_has_its_four_algorithms(provider):
    deps.attach(deps.find_environment(Path(os.environ["TRIGPOINT_QGIS_ENVIRONMENT"])))
    names = {algorithm.id() for algorithm in provider.algorithms()}
    assert names == {f"trigpoint:{name}" for name in ("align", "apply", "audit", "compare")}
    assert provider.warningMessage() == ""
    assert not provider.icon().isNull()
    for algorithm in provider.algorithms():
        assert algorithm.canExecute()[0]
        assert len(algorithm.shortHelpString()) > 100


def test_align_gives_the_similarity_and_its_picks_with_residuals(run, small_project, tmp_path):
    project, truth = small_project()
    found = run(
        "trigpoint:align",
        {
            "PICKS": str(project.with_name("picks.csv")),
            "CRS": "EPSG:32615",
            "EXAGGERATION": 10,
            "SIMILARITY": str(tmp_path / "similarity.json"),
            "POINTS": str(tmp_path / "points.gpkg"),
            "VECTORS": str(tmp_path / "vectors.gpkg"),
        },
    )
    assert found["SCALE"] == pytest.approx(truth.scale, rel=5e-3)
    assert found["INLIERS"] == 6
    assert found["GEOMETRY"] == "sound"
    for value in found.values():
        assert type(value) in (str, float, int), "a numpy scalar becomes an empty string"
    stored = json.loads((tmp_path / "similarity.json").read_text())
    assert stored["crs"] == "EPSG:32615"
    points = QgsVectorLayer(found["POINTS"], "points", "ogr")
    assert points.featureCount() == 8
    assert points.crs().authid() == "EPSG:32615"
    by_id = {feature["id"]: feature for feature in points.getFeatures()}
    assert {by_id[f"c{i}"]["role"] for i in (6, 7)} == {"check"}
    residual = next(row for row in stored["residuals"] if row["id"] == "c0")
    assert by_id["c0"]["d_m"] == pytest.approx(residual["d_m"], abs=1e-9)
    vectors = QgsVectorLayer(found["VECTORS"], "vectors", "ogr")
    line = next(f for f in vectors.getFeatures() if f["id"] == "c0").geometry()
    assert line.length() == pytest.approx(10 * np.hypot(residual["dx_m"], residual["dy_m"]))
    ends = list(line.vertices())
    assert ends[1].x() == pytest.approx(by_id["c0"].geometry().constGet().x())
    assert ends[1].x() - ends[0].x() == pytest.approx(10 * residual["dx_m"], abs=1e-6)


def test_align_tells_what_it_refuses_in_its_own_sentence(run, tmp_path):
    picks = tmp_path / "picks.csv"
    picks.write_text(
        "id,source_x,source_y,source_z,target_x,target_y,target_z\na,0,0,0,1,1,1\nb,1,0,0,2,1,1\n"
    )
    with pytest.raises(QgsProcessingException, match=r"(?i)at least 3|three"):
        run("trigpoint:align", {"PICKS": str(picks), "SIMILARITY": str(tmp_path / "s.json")})
    assert not (tmp_path / "s.json").exists()


def test_a_place_that_can_t_be_written_is_named_with_the_reason(run, small_project, tmp_path):
    project, _ = small_project()
    place = tmp_path / "none" / "s.json"
    with pytest.raises(QgsProcessingException, match=r"s\.json can't be read or written: No such"):
        run(
            "trigpoint:align",
            {"PICKS": str(project.with_name("picks.csv")), "SIMILARITY": str(place)},
        )


def test_a_length_that_is_told_has_its_unit(provider):
    told = {
        output.name(): output.description()
        for algorithm in provider.algorithms()
        for output in algorithm.outputDefinitions()
    }
    for name in ("RMSE", "LOOCV", "ACCURACY_RMSE", "COMPLETENESS_RMSE"):
        assert told[name].endswith("(m)")


def test_residual_vectors_can_t_be_drawn_without_a_length(provider):
    factor = provider.algorithm("align").parameterDefinition("EXAGGERATION")
    assert not factor.checkValueIsAcceptable(0)
    assert factor.checkValueIsAcceptable(0.5)


def test_apply_carries_every_point_there_and_back(run, small_project, tmp_path):
    from trigpoint.canonical import to_json
    from trigpoint.files import read

    project, truth = small_project()
    fit = {
        "scale": truth.scale,
        "rotation": truth.rotation.tolist(),
        "translation": truth.translation.tolist(),
        "crs": "EPSG:32615",
    }
    (tmp_path / "fit.json").write_text(to_json(fit))
    source, there, back = project.with_name("nerf.ply"), tmp_path / "a.laz", tmp_path / "b.ply"
    common = {"SIMILARITY": str(tmp_path / "fit.json")}
    found = run("trigpoint:apply", common | {"INPUT": str(source), "OUTPUT": str(there)})
    assert found == {"OUTPUT": str(there), "COUNT": 8000}
    run("trigpoint:apply", common | {"INPUT": str(there), "OUTPUT": str(back), "INVERSE": True})
    np.testing.assert_allclose(read(back).coordinates, read(source).coordinates, atol=1e-3)


def test_compare_maps_what_it_measures(run, small_project, tmp_path):
    project, _ = small_project()
    found = run(
        "trigpoint:compare",
        {
            "RECONSTRUCTION": str(project.with_name("sfm.laz")),
            "REFERENCE": str(project.with_name("lidar.laz")),
            "VOXEL": 0.2,
            "CELL": 1.0,
            "RESULTS": str(tmp_path / "results.json"),
            "COMPLETENESS": str(tmp_path / "completeness.tif"),
            "ERROR": str(tmp_path / "error.tif"),
            "FOOTPRINT": str(tmp_path / "footprint.gpkg"),
        },
    )
    results = json.loads((tmp_path / "results.json").read_text())
    assert found["ACCURACY_RMSE"] == results["accuracy"]["all"]["rmse_m"]
    assert 0 < found["ACCURACY_RMSE"] < 1
    completeness = QgsRasterLayer(found["COMPLETENESS"])
    error = QgsRasterLayer(found["ERROR"])
    for raster in (completeness, error):
        assert raster.crs().authid() == "EPSG:32615"
        assert raster.rasterUnitsPerPixelX() == 1.0
    statistics = completeness.dataProvider().bandStatistics(1)
    assert 0 <= statistics.minimumValue <= statistics.maximumValue <= 100
    footprint = QgsVectorLayer(found["FOOTPRINT"], "footprint", "ogr")
    (feature,) = footprint.getFeatures()
    assert feature.geometry().area() == pytest.approx(feature["area_m2"])
    # The ground about the building measures 16 x 14 m.
    assert 150 < feature["area_m2"] < 16 * 18


def test_a_pick_that_the_others_agree_without_has_a_marker_of_its_own(
    run,
    small_project,
    tmp_path,
    qgis_new_project,  # noqa: ARG001
):
    from trigpoint_qgis import layers

    project, _ = small_project()
    lines = project.with_name("picks.csv").read_text().splitlines()
    names, spoilt = lines[0].split(","), lines[1].split(",")
    place = names.index("target_x")
    spoilt[place] = str(float(spoilt[place]) + 3)
    (tmp_path / "picks.csv").write_text("\n".join([lines[0], ",".join(spoilt), *lines[2:]]))
    found = run(
        "trigpoint:align",
        {
            "PICKS": str(tmp_path / "picks.csv"),
            "SIMILARITY": str(tmp_path / "similarity.json"),
            "POINTS": str(tmp_path / "points.gpkg"),
        },
    )
    points = QgsVectorLayer(found["POINTS"], "points", "ogr")
    layers.style(points, layers.PICKS)
    context = QgsRenderContext()
    renderer = points.renderer()
    renderer.startRender(context, points.fields())
    shown = {}
    for feature in points.getFeatures():
        context.expressionContext().setFeature(feature)
        shown[feature["id"]] = renderer.legendKeysForFeature(feature, context)
    renderer.stopRender(context)
    titles = {item.ruleKey(): item.label() for item in renderer.legendSymbolItems()}
    titled = {name: titles[key] for name, (key,) in ((n, tuple(k)) for n, k in shown.items())}
    assert titled == dict.fromkeys((f"c{i}" for i in range(1, 6)), "control") | {
        "c0": "rejected",
        "c6": "check",
        "c7": "check",
    }


def test_the_legend_of_a_raster_has_units_and_says_that_the_largest_are_cut(tmp_path):
    from trigpoint_qgis import layers, plan

    grid = plan.grid_over(np.array([[0.0, 0.0], [3.0, 3.0]]), 1.0)
    values = np.arange(16, dtype=float).reshape(grid.shape)
    layers.write_raster(tmp_path / "a.tif", values, grid, "", np.ones(3), "error (RMSE, m)")
    raster = QgsRasterLayer(str(tmp_path / "a.tif"), "a")
    for kind, ends in (("error", ("0 m", "≥ 0.5 m")), ("completeness", ("0 %", "100 %"))):
        layers.style(raster, kind, largest=0.5)
        legend = raster.renderer().shader().rasterShaderFunction().legendSettings()
        assert (legend.minimumLabel(), legend.maximumLabel()) == ends


def test_what_comes_to_the_map_lies_where_it_is_seen_whatever_was_there():
    from trigpoint_qgis import layers
    from trigpoint_qgis.algorithms.base import arrange

    project, made = QgsProject(), {}
    root = project.layerTreeRoot()
    for kind in ("mine", *reversed(layers.PILE), "mine too"):
        made[kind] = QgsVectorLayer("Point?crs=EPSG:32615", kind, "memory")
        project.addMapLayer(made[kind], False)
        root.insertLayer(0, made[kind])
    pile = [(kind, made[kind].id()) for kind in layers.PILE]
    for _ in range(2):
        arrange(root, pile)
        QgsApplication.processEvents()
        names = [node.name() for node in root.findLayers()]
        assert names == ["mine too", *reversed(layers.PILE), "mine"]
    assert len(project.mapLayers()) == len(made)


def test_a_layer_that_is_not_to_be_seen_is_switched_off():
    from trigpoint_qgis.algorithms.base import Styler

    project, context = QgsProject(), QgsProcessingContext()
    context.setProject(project)
    made = [QgsVectorLayer("Polygon?crs=EPSG:32615", name, "memory") for name in "ab"]
    project.addMapLayers(made)
    Styler("footprint", {}, []).postProcessLayer(made[0], context, None)
    Styler("footprint", {}, [], seen=False).postProcessLayer(made[1], context, None)
    root = project.layerTreeRoot()
    assert [root.findLayer(layer.id()).isVisible() for layer in made] == [True, False]


def test_an_audit_without_the_report_s_packages_is_refused_before_it_runs(provider, monkeypatch):
    lack = deps.Lack("weasyprint", "70", None)
    monkeypatch.setattr(
        deps, "lacking", lambda packages, *_: (lack,) if "weasyprint" in packages else ()
    )
    able = {each.name(): each.canExecute()[0] for each in provider.algorithms()}
    assert able == {"align": True, "apply": True, "compare": True, "audit": False}


def test_compare_refuses_what_it_can_t_use(run, small_project, tmp_path):
    project, _ = small_project()
    given = {
        "RECONSTRUCTION": str(project.with_name("sfm.laz")),
        "REFERENCE": str(project.with_name("lidar.laz")),
        "RESULTS": str(tmp_path / "r.json"),
    }
    with pytest.raises(QgsProcessingException, match="numbers separated by commas"):
        run("trigpoint:compare", given | {"WITHIN": "a, b"})
    with pytest.raises(QgsProcessingException, match="numbers separated by commas"):
        run("trigpoint:compare", given | {"WITHIN": " "})
    with pytest.raises(QgsProcessingException, match="larger than zero"):
        run("trigpoint:compare", given | {"CELL": 0})
    (tmp_path / "cut.laz").write_bytes(project.with_name("sfm.laz").read_bytes()[:5000])
    with pytest.raises(QgsProcessingException, match=r"cut\.laz"):
        run("trigpoint:compare", given | {"RECONSTRUCTION": str(tmp_path / "cut.laz")})


def test_what_is_refused_names_the_parameter_and_not_an_option():
    from trigpoint.errors import CrsError
    from trigpoint_qgis.algorithms.base import told

    with pytest.raises(QgsProcessingException, match="the right one in the parameter CRS"), told():
        raise CrsError("the header names another CRS: name the right one with --crs.")


def test_what_is_missing_is_named_before_anything_runs(provider, monkeypatch):
    lack = deps.Lack("laspy", "2.5", None)
    monkeypatch.setattr(deps, "lacking", lambda *_: (lack,))
    for algorithm in provider.algorithms():
        possible, reason = algorithm.canExecute()
        assert not possible
        assert "Missing: laspy." in reason
    assert "Missing: laspy." in provider.warningMessage()


@pytest.fixture
def bundle(small_project):
    """A bundle as an audit leaves it, without its report."""
    from trigpoint.bundle import bundle_folder, fill_bundle
    from trigpoint.pipeline import audit
    from trigpoint_reporting.sealing import write_record

    project, _ = small_project()
    done = audit(project)
    made = bundle_folder(done.project, None)
    made.mkdir(parents=True)
    found = done.results()
    fill_bundle(made, done, found)
    write_record(made, done, found)
    return made


def test_a_bundle_is_drawn_beside_it_and_shown_in_a_group(bundle, qgis_new_project):  # noqa: ARG001
    before = sorted(bundle.rglob("*"))
    drawn = results.draw(bundle, cell=1.0)
    assert sorted(bundle.rglob("*")) == before, "a bundle is sealed"
    assert {(each.title.split(":")[0], each.kind) for each in drawn} == {
        *(("nerf", kind) for kind in ("completeness", "error", "footprint", "picks")),
        ("nerf", "residual_vectors"),
        *(("sfm", kind) for kind in ("completeness", "error", "footprint")),
    }
    results.show(drawn, "small")
    (group,) = QgsProject.instance().layerTreeRoot().findGroups()
    layers = [node.layer() for node in group.findLayers()]
    assert len(layers) == 8
    # Rasters lie under picks, and of the pile only the uppermost is switched on.
    assert [child.name() for child in group.children()] == ["nerf", "sfm"]
    assert [node.name() for node in group.findLayers() if node.isVisible()] == [
        "nerf: picks",
        "nerf: residuals x 20",
        "nerf: footprint",
        "nerf: error (RMSE, m)",
    ]
    scales = {each.largest for each in drawn if each.kind == "error"}
    assert len(scales) == 1, "what looks alike is alike"
    assert all(layer.isValid() and layer.crs().authid() == "EPSG:32615" for layer in layers)
    picks = next(layer for layer in layers if layer.name() == "nerf: picks")
    assert picks.featureCount() == 8
    assert picks.labelsEnabled()
    assert {feature["used"] for feature in picks.getFeatures()} == {"yes", "no"}
    # Drawn again, over what is open: nothing is locked.
    assert len(results.draw(bundle, cell=2.0)) == 8


def waited_for(true, seconds=60):
    end = time.monotonic() + seconds
    while not true():
        assert time.monotonic() < end, "it took too long"
        QgsApplication.processEvents()
        time.sleep(0.01)


def test_the_panel_s_audit_is_put_on_the_map_by_a_task(bundle, qgis_new_project):  # noqa: ARG001
    results.add(bundle, "bundle")
    waited_for(lambda: len(QgsProject.instance().mapLayers()) == 8)
    (group,) = QgsProject.instance().layerTreeRoot().findGroups()
    assert bundle.name in group.name()


def test_what_can_t_be_put_on_the_map_is_told(tmp_path, qgis_new_project):  # noqa: ARG001
    told = []
    results.add(tmp_path / "none.laz", "cloud", lambda *said: told.append(said))
    waited_for(lambda: told)
    ((level, text),) = told
    assert level == "warning"
    assert "none.laz can't be put on the map" in text


def test_a_cloud_that_qgis_can_t_draw_is_shown_by_its_footprint_and_that_is_said(
    small_project,
    qgis_new_project,  # noqa: ARG001
    monkeypatch,
):
    project, _ = small_project()
    cloud, told = project.with_name("sfm.laz"), []
    monkeypatch.setattr(results, "cloud_layer", lambda _: None)
    results.add(cloud, "cloud", lambda *said: told.append(said))
    waited_for(lambda: told)
    (layer,) = QgsProject.instance().mapLayers().values()
    assert layer.name() == "sfm.laz: footprint"
    ((level, text),) = told
    assert level == "info"
    assert "footprint of sfm.laz" in text


def test_a_cloud_is_drawn_by_the_provider_that_this_qgis_has_for_it(tmp_path, monkeypatch):
    asked = []

    class Layer:
        def __init__(self, address, _title, provider):
            asked.append((address.rpartition("/")[2], provider))

        def isValid(self):  # noqa: N802
            return True

    class Registry:
        def providerList(self):  # noqa: N802
            return ["ogr", *known]

    monkeypatch.setattr(results, "QgsPointCloudLayer", Layer)
    monkeypatch.setattr(results.QgsProviderRegistry, "instance", lambda: Registry())
    known = ["copc"]
    assert results.cloud_layer(tmp_path / "a.laz") is None
    assert results.cloud_layer(tmp_path / "a.ply") is None
    assert results.cloud_layer(tmp_path / "a.copc.laz") is not None
    known = ["copc", "pdal"]
    assert results.cloud_layer(tmp_path / "b.LAS") is not None
    assert asked == [("a.copc.laz", "copc"), ("b.LAS", "pdal")]


def test_a_map_that_is_drawn_again_takes_the_place_of_the_first(bundle, qgis_new_project):  # noqa: ARG001
    results.show(results.draw(bundle, cell=1.0), "small", of=bundle)
    before = set(QgsProject.instance().mapLayers())
    results.add(bundle, "bundle")
    assert not QgsProject.instance().mapLayers()
    waited_for(lambda: len(QgsProject.instance().mapLayers()) == 8)
    assert not before & set(QgsProject.instance().mapLayers())
    groups = QgsProject.instance().layerTreeRoot().children()
    assert [group.name() for group in groups] == [f"Trigpoint {bundle.name}"]


def test_a_map_that_is_being_drawn_when_the_plugin_goes_is_given_up(bundle, qgis_new_project):  # noqa: ARG001
    told = []
    results.add(bundle, "bundle", lambda *said: told.append(said))
    results.stop()
    for _ in range(50):
        QgsApplication.processEvents()
        time.sleep(0.01)
    assert not QgsProject.instance().mapLayers()
    assert not told


def test_the_footprint_of_a_cloud_is_drawn_beside_it(small_project):
    project, _ = small_project()
    (drawn,) = results.outline_of(project.with_name("sfm.laz"), cell=1.0)
    layer = drawn.layer()
    (feature,) = layer.getFeatures()
    assert 150 < feature["area_m2"] < 16 * 18
    assert feature["points"] == 5000
    assert layer.crs().authid() == "EPSG:32615"


def test_heights_keep_their_own_crs(small_project):
    if Qgis.QGIS_VERSION_INT < 33800:
        pytest.skip("this QGIS keeps no vertical CRS")
    import pyproj

    from trigpoint_qgis import layers

    project, _ = small_project()
    crs = pyproj.CRS("EPSG:32615+5703")
    address = results.outline_of(project.with_name("sfm.laz"))[0].address
    drawn = results.Drawn("a", address, layers.VECTORS, vertical=layers.heights_of(crs))
    assert drawn.layer().verticalCrs().authid() == "EPSG:5703"
    assert layers.heights_of(pyproj.CRS("EPSG:32615")) == ""
    assert layers.heights_of(None) == ""
