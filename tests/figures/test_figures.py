import re
import shutil
import xml.etree.ElementTree as ET
from copy import deepcopy

import numpy as np
import pandas as pd
import pytest

from trigpoint_reporting.blocks import Passage, Picture
from trigpoint_reporting.evidence import Evidence
from trigpoint_reporting.figures import OF_ALL, OF_ONE
from trigpoint_reporting.perspective import perspective_views
from trigpoint_reporting.style import pick_labels

# The perspective needs OpenGL, and has its own tests.
DRAWN = [each for each in OF_ALL if each is not perspective_views]
NO_PICKS = {
    "residual_vectors",
    "leave_one_out_errors",
    "scale_sensitivity",
    "pick_reliability",
    "pose_uncertainty",
    "icp_before_after",
}


FIGURES = {figure.__name__: figure for figure in (*DRAWN, *OF_ONE)}
BLOCKS = []


def all_blocks(evidence):
    """Draw every figure; once for all tests."""
    if not BLOCKS:
        BLOCKS.extend((figure.__name__, "", figure(evidence)) for figure in DRAWN)
        BLOCKS.extend(
            (figure.__name__, name, figure(evidence, name))
            for figure in OF_ONE
            for name in evidence.names
        )
    return BLOCKS


def text_of(block):
    if isinstance(block, Passage):
        return "".join(block.parts)
    return f"{block.caption} {block.alt}"


def test_every_figure_is_a_picture_or_says_why_not(evidence):
    names = []
    for figure, name, block in all_blocks(evidence):
        if isinstance(block, Picture):
            names.append(block.name)
            assert block.caption
            assert len(block.alt) > 40
            if block.kind == "svg":
                ET.fromstring(block.content)
            else:
                assert block.content.startswith(b"\x89PNG")
        else:
            assert (name == "sfm" and figure in NO_PICKS) or figure == "colour_elevations"
    assert len(names) == len(set(names)) > 12


def test_the_words_hold_no_missing_numbers(evidence):
    for figure, _, block in all_blocks(evidence):
        assert not re.search(r"\bnan\b|None|inf\b|-\d|e-\d", text_of(block)), figure


def test_drawing_twice_gives_the_same_bytes(evidence):
    rooms = {}
    for figure, name, block in all_blocks(evidence):
        if isinstance(block, Picture):
            rooms.setdefault(FIGURES[figure].__module__, (figure, name, block))
    assert len(rooms) == 4
    for figure, name, block in rooms.values():
        assert FIGURES[figure](evidence, *([name] if name else [])) == block


def test_alternative_text_states_the_findings_of_results_json(evidence):
    found = evidence.results["reconstructions"]["nerf"]
    pictures = {(f, n): b for f, n, b in all_blocks(evidence) if isinstance(b, Picture)}
    alt = {key: block.alt for key, block in pictures.items()}
    loocv, alignment = found["loocv"], found["alignment"]
    assert f"{loocv['rmse_m']:.3f} m RMSE" in alt["leave_one_out_errors", "nerf"]
    assert f"{alignment['rmse_m']:.3f} m" in alt["leave_one_out_errors", "nerf"]
    assert f"{loocv['max_scale_change_pct']:.3f} %" in alt["scale_sensitivity", "nerf"]
    assert "limit of 0.5 %" in alt["scale_sensitivity", "nerf"]
    worst = max(alignment["residuals"], key=lambda row: row["d_m"])
    assert f"{worst['d_m']:.3f} m ({worst['id']})" in alt["residual_vectors", "nerf"]
    within = found["comparison"]["delivered"]["completeness"]["all"]["within"]
    share = next(row["pct"] for row in within if row["threshold_m"] == 0.1)
    assert f"{share:.1f} % for nerf" in alt["completeness_curves", ""]
    assert f"{100 - share:.1f} % of the reference" in alt["missing_elevations", "nerf"]


def _of(evidence, wanted):
    for figure in OF_ONE:
        if figure.__name__ == wanted:
            yield wanted, "nerf", figure(evidence, "nerf")


def test_three_picks_leave_figures_that_say_what_is_missing(changed):
    def three(results):
        found = results["reconstructions"]["nerf"]
        for fold in found["loocv"]["folds"]:
            for key in fold:
                fold[key] = fold[key] if key == "id" else None
        found["loocv"] |= dict.fromkeys(("rmse_m", "rmse_procedure_m", "max_scale_change_pct"))
        found["reliability"] |= {
            "sigma0_m": None,
            "scale_low": None,
            "scale_high": None,
            "covariance": None,
            "rotation_sigma_deg": [None, None, None],
            "zones": {zone: {"sigma_m": None} for zone in ("lower", "middle", "upper")},
            "picks": [
                dict.fromkeys(row) | {"id": row["id"]} for row in found["reliability"]["picks"]
            ],
        }
        found["checks"] = {"n": 0, "mean_m": [None] * 3, "rmse_m": None, "residuals": []}
        for key in found["icp"]:
            if key.startswith(("control", "loocv", "check")):
                found["icp"][key] = None

    few = changed(three)
    for wanted in (
        "leave_one_out_errors",
        "scale_sensitivity",
        "pick_reliability",
        "pose_uncertainty",
        "icp_before_after",
    ):
        ((_, _, block),) = _of(few, wanted)
        assert isinstance(block, Passage)
        assert "not drawn, because" in text_of(block)
    ((_, _, block),) = _of(few, "residual_vectors")
    assert isinstance(block, Picture)


def test_the_weakest_axis_is_the_covariances_own_and_is_named(changed):
    axis = np.array([0.6, 0.8, 0.0])

    def turned(results):
        worth = results["reconstructions"]["nerf"]["reliability"]
        covariance = np.eye(7) * 1e-6
        covariance[1:4, 1:4] += 99e-6 * np.outer(axis, axis)
        worth["covariance"] = covariance.tolist()
        worth["rotation_sigma_deg"] = np.degrees([1e-2, 1e-3, 1e-3]).tolist()

    ((_, _, block),) = _of(changed(turned), "pose_uncertainty")
    weakest = "a horizontal axis bearing 37° from grid north"
    assert f"The rotation is weakest about {weakest}." in block.caption
    assert f"least certain about {weakest}, sigma 0.573 degrees" in block.alt


def test_icp_that_was_not_asked_for_is_said(changed):
    def without(results):
        results["reconstructions"]["nerf"]["icp"] = None

    ((_, _, block),) = _of(changed(without), "icp_before_after")
    assert "does not ask for it" in text_of(block)


def test_a_pick_has_one_number_in_every_figure_and_in_the_table_of_coordinates(evidence, tmp_path):
    bundle = bundle_of(evidence, tmp_path / "long", 8, names="塔の角{}")
    table = bundle.table("correspondences-nerf")
    shown = pick_labels(bundle, "nerf")
    assert shown == {name: f"no. {k}" for k, name in enumerate(table["id"], start=1)}
    for wanted in ("residual_vectors", "leave_one_out_errors", "pick_reliability"):
        ((_, _, block),) = _of(bundle, wanted)
        assert "“no.”: the pick's number in the table" in block.caption


def test_picks_that_are_not_named_are_counted(evidence, tmp_path):
    ((_, _, block),) = _of(bundle_of(evidence, tmp_path / "many", 60), "residual_vectors")
    left = int(
        re.search(r" (\d+) of 60 picks are not named: only the 12 largest are", block.caption)[1]
    )
    assert left >= 48


def test_a_change_by_icp_that_the_picks_cannot_show_is_said_beside_the_figure(changed):
    def little(results):
        icp = results["reconstructions"]["nerf"]["icp"]
        icp |= {"retained": True, "check_rmse_before_m": 0.174, "check_rmse_after_m": 0.173}

    ((_, _, block),) = _of(changed(little), "icp_before_after")
    assert "ICP meets the rule and is not delivered" in block.alt
    assert "2 picks know their RMSE to about 0.050 m, and the change is smaller." in block.alt


def bundle_of(evidence, folder, count, *, names="pick {}"):
    """The same building with many picks, some rejected, with any names."""
    shutil.copytree(evidence.folder, folder)
    rng = np.random.default_rng(5)
    ids = [names.format(k) for k in range(count)]
    error = rng.normal(scale=0.05, size=(count, 3))
    used = np.arange(count) % 10 != 3
    error[~used] *= 100
    size = np.sqrt((error**2).sum(axis=1))
    rows = pd.DataFrame(
        {"id": ids, "role": "control", "dx_m": error[:, 0], "dy_m": error[:, 1]}
    ).assign(dz_m=error[:, 2], d_m=size, used=used)
    rows.to_csv(folder / "data" / "picks-nerf.csv", index=False)
    places = rng.uniform(0, 10, (count, 3)) + np.array([741_000, 4_279_000, 150])
    pd.DataFrame(places, columns=["target_x", "target_y", "target_z"]).assign(id=ids).to_csv(
        folder / "data" / "correspondences-nerf.csv", index=False
    )
    results = deepcopy(evidence.results)
    found = results["reconstructions"]["nerf"]
    found["alignment"]["residuals"] = rows.to_dict(orient="records")
    fold = found["loocv"]["folds"][0]
    found["loocv"]["folds"] = [
        fold | {"id": name, "d_m": float(d), "scale_change_pct": float(d) / 100}
        for name, d in zip(ids, size, strict=True)
    ]
    pick = found["reliability"]["picks"][0]
    found["reliability"]["picks"] = [
        pick | {"id": name, "suspected": k == 3} for k, name in enumerate(ids)
    ]
    found["checks"]["n"] = 0
    return Evidence(folder, results)


@pytest.mark.parametrize("names", ["塔{}", "<script>ركن $\\frac{{ {}\nb", "x" * 60 + "{}"])
def test_any_names_and_rejected_picks_are_drawn(evidence, tmp_path, names):
    many = bundle_of(evidence, tmp_path / "many", 11, names=names)
    for wanted in ("scale_sensitivity", "residual_vectors"):
        ((_, _, block),) = _of(many, wanted)
        assert isinstance(block, Picture)
        ET.fromstring(block.content)
    assert "1 rejected" in block.alt
    assert "arrow is cut" in block.caption


def test_three_hundred_picks_are_drawn_and_what_is_left_out_is_said(evidence, tmp_path):
    many = bundle_of(evidence, tmp_path / "many", 300)
    for wanted in ("leave_one_out_errors", "scale_sensitivity", "pick_reliability"):
        ((_, _, block),) = _of(many, wanted)
        assert "The 40 largest of 300 are shown." in block.caption
        assert len(block.content) < 400_000
    ((_, _, block),) = _of(many, "residual_vectors")
    assert "30 rejected" in block.alt


def test_a_bundle_without_coordinates_of_picks_says_so(evidence, tmp_path):
    bare = Evidence(tmp_path, evidence.results)
    (tmp_path / "data").mkdir()
    ((_, _, block),) = _of(bare, "residual_vectors")
    assert "no coordinates of the picks" in text_of(block)
