import json
import math

import jsonschema
import numpy as np
import pytest
from towers import TOWER

from trigpoint.alignment import align
from trigpoint.canonical import to_json
from trigpoint.criteria import schema
from trigpoint.errors import DegeneratePicksError, PicksError, SimilarityError
from trigpoint.picks import picks_from
from trigpoint.results import alignment_results, read_similarity
from trigpoint.similarity import umeyama


@pytest.fixture
def tower(similarity_from):
    """Six picks of a tower with 5 cm of noise at UTM coordinates, and a check pick."""

    def make(seed=1, count=6, **columns):
        truth = similarity_from(seed, np.array([741_000.0, 4_279_000.0, 150.0]))
        target = truth(TOWER) + np.random.default_rng(seed).normal(scale=0.05, size=TOWER.shape)
        ids = [f"p{i}" for i in range(6)]
        return picks_from(ids[:count], TOWER[:count], target[:count], **columns)

    return make


def results_of(alignment):
    return json.loads(to_json(alignment_results(alignment)))


def test_the_results_keep_to_the_schema(tower):
    results = results_of(align(tower(roles=["control"] * 5 + ["check"])))
    for key in ("alignment", "loocv", "checks", "reliability", "warnings"):
        jsonschema.validate(results[key], {"$ref": f"#/$defs/{key}", "$defs": schema()["$defs"]})
    assert set(results) == {"alignment", "loocv", "checks", "reliability", "warnings"}


def test_residuals_are_target_minus_transformed_source_and_rmse_divides_by_n(tower):
    picks = tower()
    found = results_of(align(picks))["alignment"]
    errors = picks.target - umeyama(picks.source, picks.target)(picks.source)
    assert [each["dx_m"] for each in found["residuals"]] == pytest.approx(errors[:, 0], abs=1e-9)
    squares = (errors**2).sum()
    assert found["rmse_m"] == pytest.approx(math.sqrt(squares / 6), abs=1e-9)
    assert found["rmse_dof_m"] == pytest.approx(math.sqrt(squares / (6 - 7 / 3)), abs=1e-9)
    assert (found["n"], found["dof"]) == (6, 11)


def test_a_check_pick_enters_nothing_and_changes_nothing(tower):
    picks = tower(roles=["control"] * 5 + ["check"])
    moved = picks.target.copy()
    moved[5] += 40
    other = picks_from(picks.ids, picks.source, moved, roles=picks.roles)
    one, two = results_of(align(picks)), results_of(align(other))
    assert one["checks"]["rmse_m"] < 0.5 < two["checks"]["rmse_m"]
    for key in ("alignment", "loocv", "reliability"):
        assert one[key] == two[key]


def test_a_rejected_pick_is_listed_with_its_residual(tower):
    picks = tower()
    target = picks.target.copy()
    target[3] += [3, 0, 0]
    alignment = align(picks_from(picks.ids, picks.source, target))
    found = results_of(alignment)["alignment"]
    assert found["outliers"] == ["p3"]
    assert [each["used"] for each in found["residuals"]] == [True, True, True, False, True, True]
    assert found["residuals"][3]["d_m"] > 2
    assert "picks_rejected" in [each.code for each in alignment.cautions]


@pytest.mark.parametrize(("method", "seed"), [("ransac", 42), ("exhaustive", None), ("all", None)])
def test_every_method_says_what_it_did(tower, method, seed):
    found = results_of(align(tower(), method=method))["alignment"]
    assert (found["method"], found["seed"]) == (method, seed)
    assert found["exhaustive_agrees"] is (None if method == "all" else True)
    assert len(found["inliers"]) == 6


@pytest.mark.parametrize("method", ["ransac", "exhaustive", "all"])
def test_what_is_left_out_to_be_quick_changes_nothing_else(tower, method):
    whole, quick = align(tower(), method=method), align(tower(), method=method, thorough=False)
    expected, found = results_of(whole), results_of(quick)
    assert found["alignment"].pop("exhaustive_agrees") is None
    assert found["loocv"].pop("rmse_procedure_m") is None
    for results in (expected, found):
        results["alignment"].pop("exhaustive_agrees", None)
        results["loocv"].pop("rmse_procedure_m", None)
        for fold in results["loocv"]["folds"]:
            fold.pop("inliers_changed")
    assert found == expected


def test_order_of_picks_changes_no_bit_of_the_fit(tower):
    picks = tower()
    order = np.array([3, 1, 5, 0, 4, 2])
    assert (
        align(picks).similarity.matrix.tobytes()
        == align(picks.take(order)).similarity.matrix.tobytes()
    )


def test_weights_follow_the_sigmas_in_both_frames(tower):
    sigmas = {"sigma_target": [0.01] * 3 + [0.5] * 3, "sigma_source": [0.01] * 6}
    picks = tower(**sigmas)
    alignment = align(picks, weighted=True)
    scale = align(picks).similarity.scale
    weights = 1 / (picks.sigma_target**2 + (scale * picks.sigma_source) ** 2)
    np.testing.assert_allclose(
        alignment.similarity.matrix,
        umeyama(picks.source, picks.target, weights=weights).matrix,
        rtol=1e-12,
    )


def test_weights_without_sigmas_are_refused(tower):
    with pytest.raises(PicksError, match="6 of 6 have neither: p0, p1"):
        align(tower(), weighted=True)


def test_three_picks_fit_and_nothing_is_claimed_of_them(tower):
    results = results_of(align(tower(count=3)))
    assert results["alignment"]["dof"] == 2
    assert results["loocv"]["rmse_m"] is None
    assert "2 redundant equations" in results["reliability"]["statement"]


def test_trap_4_picks_along_a_tower_edge_are_refused_although_they_fit(similarity_from, offset):
    rng = np.random.default_rng(1)
    edge = np.column_stack(
        [rng.normal(0, 0.003, 6), rng.normal(0, 0.003, 6), np.linspace(0, 15, 6)]
    )
    target = similarity_from(1, offset)(edge) + rng.normal(0, 0.05, edge.shape)
    with pytest.raises(DegeneratePicksError, match=r"rotation about .* (known to|not known)"):
        align(picks_from([f"p{i}" for i in range(6)], edge, target))


def test_a_mirrored_source_is_refused_by_name(tower):
    picks = tower()
    with pytest.raises(DegeneratePicksError, match="looks mirrored"):
        align(picks_from(picks.ids, picks.source * [1, 1, -1], picks.target))


def test_a_similarity_is_read_back_from_all_that_is_written(tower, tmp_path):
    alignment = align(tower())
    results = alignment_results(alignment)
    bare = {key: results["alignment"][key] for key in ("scale", "rotation", "translation")}
    for stored in (results, {**results["alignment"], "crs": "EPSG:32615"}, bare):
        path = tmp_path / "similarity.json"
        path.write_text(to_json(stored))
        fit, crs = read_similarity(path)
        np.testing.assert_allclose(fit.matrix, alignment.similarity.matrix, rtol=1e-11)
        assert crs == stored.get("crs")


BAD = {
    "no JSON": ("{", "is not JSON"),
    "no similarity": ("[1]", "holds no similarity"),
    "no rotation": ('{"scale": 1, "translation": [0, 0, 0]}', "holds no similarity"),
    "a mirror": (
        '{"scale": 1, "rotation": [[1,0,0],[0,1,0],[0,0,-1]], "translation": [0,0,0]}',
        "determinant -1",
    ),
    "a scale beyond every float": (
        f'{{"scale": {"9" * 400}, "rotation": [[1,0,0],[0,1,0],[0,0,1]], "translation": [0,0,0]}}',
        "holds no similarity",
    ),
    "a translation beyond every float": (
        f'{{"scale": 1, "rotation": [[1,0,0],[0,1,0],[0,0,1]], "translation": [0,0,{"9" * 400}]}}',
        "holds no similarity",
    ),
    "a scale of zero": (
        '{"scale": 0, "rotation": [[1,0,0],[0,1,0],[0,0,1]], "translation": [0,0,0]}',
        "scale is 0",
    ),
}


@pytest.mark.parametrize("case", BAD)
def test_a_similarity_file_is_refused_with(case, tmp_path):
    text, words = BAD[case]
    path = tmp_path / "similarity.json"
    path.write_text(text)
    with pytest.raises(SimilarityError, match=words):
        read_similarity(path)
