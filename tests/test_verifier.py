import copy
import json
import subprocess
import sys

import numpy as np
import pytest
from scipy import stats

from trigpoint.alignment import align
from trigpoint.blunders import noncentrality
from trigpoint.bundle import fill_bundle
from trigpoint.canonical import plain
from trigpoint.cloud import cloud_from
from trigpoint.comparison import compare
from trigpoint.picks import picks_from
from trigpoint.results import alignment_results, comparison_results
from trigpoint_reporting.sealing import seal, write_record
from trigpoint_reporting.verifier import verify as verifier

SETTINGS = {"reference": {"accuracy_m": 0.02}}

# --- special functions


@pytest.mark.parametrize("dof", [1, 2, 3, 11, 200, 12_782])
def test_chi_square_tails_are_scipys(dof):
    for p in (0.999, 0.975, 0.5, 0.025, 1e-3, 1e-9):
        x = stats.chi2.isf(p, dof)
        assert verifier.chi2_sf(x, dof) == pytest.approx(stats.chi2.sf(x, dof), rel=1e-9)


@pytest.mark.parametrize(("top", "bottom"), [(1, 2), (3, 2), (3, 8), (2, 5), (3, 12_779), (1, 1e6)])
def test_f_tails_are_scipys(top, bottom):
    for p in (0.999, 0.5, 0.05, 1e-3, 1e-8):
        x = stats.f.isf(p, top, bottom)
        # Near 1 the tail is 1 minus a small number: it is absolute then.
        assert verifier.f_sf(x, top, bottom) == pytest.approx(
            stats.f.sf(x, top, bottom), rel=1e-8, abs=1e-15
        )


def test_quantiles_and_the_blunder_noncentrality_are_the_published_ones():
    assert verifier.normal_quantile() == pytest.approx(1.959963984540054, abs=1e-12)
    for dof in (2, 5, 11, 300):
        assert verifier.t_quantile(dof) == pytest.approx(stats.t.isf(0.025, dof), rel=1e-11)
    assert verifier.blunder_noncentrality() == pytest.approx(
        noncentrality(0.001, 0.80, 3), rel=1e-11
    )


def test_what_is_beyond_a_distribution_has_its_limit():
    assert verifier.chi2_sf(0.0, 3) == 1
    assert verifier.chi2_sf(1e6, 3) == 0
    assert verifier.f_sf(0.0, 3, 5) == 1


# --- the two implementations agree


def scene(seed, offset, similarity_from, *, count, noise=0.05, sigmas=False, checks=0, wrong=0):
    rng = np.random.default_rng(seed)
    truth = similarity_from(seed, offset)
    source = rng.uniform(-4, 4, (count + checks, 3))
    target = truth(source) + rng.normal(0, noise, source.shape)
    target[:wrong] += 5.0
    return picks_from(
        [f"p{k}, “{k}”" for k in range(count + checks)],
        source,
        target,
        roles=["control"] * count + ["check"] * checks,
        sigma_source=rng.uniform(0.005, 0.02, count + checks) if sigmas else None,
        sigma_target=rng.uniform(0.02, 0.08, count + checks) if sigmas else None,
    )


def evidence_of(alignment):
    picks = alignment.picks
    weight = np.full(len(picks), np.nan)
    if alignment.weights is not None:
        weight[np.flatnonzero(picks.roles == "control")[alignment.consensus.inliers]] = (
            alignment.weights
        )
    return verifier.Evidence(
        list(picks.ids),
        picks.roles.tolist(),
        picks.source,
        picks.target,
        picks.sigma_source,
        picks.sigma_target,
        weight,
    )


def recheck(alignment):
    report = verifier.Report()
    stored = json.loads(json.dumps(plain(alignment_results(alignment, accuracy=0.02))))
    verifier.check_alignment(report, "it", stored, evidence_of(alignment), SETTINGS)
    return report, stored


@pytest.mark.parametrize("seed", range(8))
def test_it_agrees_on_ordinary_picks(seed, offset, similarity_from):
    picks = scene(seed, offset, similarity_from, count=6 + seed, checks=seed % 3, wrong=seed % 2)
    report, _ = recheck(align(picks))
    assert report.differences == []


@pytest.mark.parametrize("weighted", [False, True])
def test_it_agrees_where_sigmas_are_stated(weighted, offset, similarity_from):
    picks = scene(3, offset, similarity_from, count=9, sigmas=True)
    report, stored = recheck(align(picks, weighted=weighted))
    assert report.differences == []
    assert stored["alignment"]["weighted"] == weighted


def test_it_agrees_on_three_and_four_picks(offset, similarity_from):
    for count in (3, 4):
        picks = scene(1, offset, similarity_from, count=count, noise=0.005)
        report, stored = recheck(align(picks))
        assert report.differences == []
    assert stored["loocv"]["rmse_m"] is not None


def test_it_agrees_on_picks_that_fit_exactly(similarity_from):
    picks = scene(2, np.zeros(3), similarity_from, count=7, noise=0.0)
    report, stored = recheck(align(picks))
    assert report.differences == []
    assert stored["reliability"]["picks"][0]["p_value"] is None


def test_it_agrees_on_a_plane_and_on_a_fold_that_has_no_fit(similarity_from):
    rng = np.random.default_rng(4)
    flat = np.column_stack([rng.uniform(0, 9, (8, 2)), np.zeros(8)])
    lever = np.column_stack([np.linspace(0, 9, 8), np.zeros(8), np.zeros(8)])
    lever[-1] = [4.0, 5.0, 0.5]
    for source in (flat, lever):
        target = similarity_from(4)(source) + rng.normal(0, 1e-9, source.shape)
        picks = picks_from([f"p{k}" for k in range(8)], source, target)
        alignment = align(picks, method="all")
        report, stored = recheck(alignment)
        assert report.differences == []
    assert stored["loocv"]["rmse_m"] is None


def test_it_agrees_on_the_closed_form_above_fifty(offset, similarity_from):
    picks = scene(5, offset, similarity_from, count=120, wrong=9)
    report, stored = recheck(align(picks, trials=300))
    assert stored["loocv"]["closed_form"]
    assert report.differences == []


def test_it_agrees_on_empty_zones_and_on_no_points_at_all():
    wall = np.array([[x, 0.0, z] for x in range(8) for z in (0.0, 1.0, 10.0)])
    reference = cloud_from(wall)
    for points in (wall[wall[:, 2] < 5] + [0, 0.06, 0], wall + 1000.0):
        comparison = compare(cloud_from(points), reference)
        stored = {
            "comparison": {"delivered": plain(comparison_results(comparison)), "after_icp": None}
        }
        arrays = {"zone_edges_m": comparison.zones.edges_m}
        for direction, cloud, distances in (
            ("accuracy", comparison.reconstruction, comparison.accuracy_m),
            ("completeness", comparison.reference, comparison.completeness_m),
        ):
            arrays[f"delivered_{direction}_m"] = distances
            arrays[f"delivered_{direction}_height_m"] = cloud.xyz[:, 2] + cloud.origin[2]
        report = verifier.Report()
        verifier.check_comparison(report, "it", stored, arrays)
        assert report.differences == []
        assert len(report.rows) > 60


def test_its_tolerances_are_far_below_anything_that_matters(offset, similarity_from):
    report, _ = recheck(align(scene(7, offset, similarity_from, count=9, checks=2)))
    metres = [row.tolerance for row in report.rows if row.quantity.split("[")[0].endswith("_m")]
    assert max(metres) < 1e-6
    assert max(row.tolerance for row in report.rows if "alignment" in row.quantity) < 1e-7


# --- what it covers

# Leaves of results.json that it takes as they are, because other checks than its own hold them.
TAKEN = (
    "rmse_procedure_m",
    "inliers_changed",
    "floor_rmse_m",
    "raw_pct",
    "low_pct",
    "high_pct",
    "seed",
    "trials",
    "degenerate_trials",
    "exhaustive_agrees",
    "method",
    "weighted",
    "threshold_m",
    "geometry",
    "statement",
)


def leaves(value, path=()):
    if isinstance(value, dict):
        for key, item in value.items():
            yield from leaves(item, (*path, key))
    elif isinstance(value, list):
        for position, item in enumerate(value):
            yield from leaves(item, (*path, position))
    else:
        yield path


def test_every_other_number_that_is_changed_a_little_is_found(similarity_from, offset):
    picks = scene(6, offset, similarity_from, count=5, checks=1, wrong=1)
    alignment = align(picks)
    evidence = evidence_of(alignment)
    stored = json.loads(json.dumps(plain(alignment_results(alignment, accuracy=0.02))))
    del stored["warnings"]
    missed = []
    for path in leaves(stored):
        if path[-1] in TAKEN:
            continue
        changed = copy.deepcopy(stored)
        parent = changed
        for step in path[:-1]:
            parent = parent[step]
        value = parent[path[-1]]
        if isinstance(value, bool):
            parent[path[-1]] = not value
        elif isinstance(value, str):
            parent[path[-1]] = value + "x"
        elif value is None:
            parent[path[-1]] = 0.1
        elif isinstance(value, int):
            parent[path[-1]] = value + 1
        else:  # a ten-thousandth, or a micrometre where it is next to nothing
            parent[path[-1]] = value * 1.0001 + (1e-6 if abs(value) < 1e-3 else 0)
        report = verifier.Report()
        verifier.check_alignment(report, "it", changed, evidence, SETTINGS)
        if not report.differences:
            missed.append(path)
    assert missed == []


# --- it stands alone


def test_it_runs_with_numpy_alone_from_the_bundle(small_project, tmp_path):
    import trigpoint

    path, _ = small_project()
    audit = trigpoint.audit(path)
    results = audit.results()
    folder = tmp_path / "bundle"
    folder.mkdir()
    fill_bundle(folder, audit, results)
    write_record(folder, audit, results)
    seal(folder)
    code = (
        "import runpy, sys\n"
        "allowed = set(sys.stdlib_module_names) | {'numpy'}\n"
        "class Alone:\n"
        "    def find_spec(self, name, path=None, target=None):\n"
        "        if name.partition('.')[0] not in allowed:\n"
        "            raise ImportError(name + ' is not NumPy')\n"
        "sys.meta_path.insert(0, Alone())\n"
        "sys.argv = sys.argv[1:]\n"
        "runpy.run_path(sys.argv[0], run_name='__main__')\n"
    )

    def run(*arguments, cwd=folder):
        script = folder / "verify" / "verify.py"
        return subprocess.run(
            [sys.executable, "-I", "-B", "-c", code, script, *arguments],
            capture_output=True,
            text=True,
            cwd=cwd,
            check=False,
        )

    whole = run(cwd=tmp_path)
    assert whole.returncode == 0, whole.stderr + whole.stdout
    assert "checks hold; 0 differ." in whole.stdout
    table = run("--table").stdout
    assert "quantity | stored | recomputed | tolerance | ok" in table
    assert "reconstructions.nerf.loocv.rmse_m | 0.0" in table
    rows = (folder / "data" / "zones-nerf.csv").read_text("utf-8")
    (folder / "data" / "zones-nerf.csv").write_text(rows.replace("1", "2", 1), "utf-8")
    changed = run()
    assert changed.returncode == 1
    assert "DIFFERS  manifest-sha256.txt: data/zones-nerf.csv" in changed.stdout
    (folder / "data" / "results.json").unlink()
    gone = run()
    assert gone.returncode == 2
    assert gone.stderr.count("\n") == 1
    assert run("--nonsense").returncode == 2


# --- what is printed


@pytest.mark.parametrize(
    ("text", "stored", "digits", "right"),
    [
        ("0.137", 0.13745, 3, True),
        ("0.138", 0.13745, 3, False),
        ("0.14", 0.13745, 3, False),
        ("\u22120.021", -0.0213, 3, True),
        ("0.021", -0.0213, 3, False),
        ("770,574.317", 770574.3166, 3, True),
        ("770\u202f574.317", 770574.3166, 3, True),
        ("12", 12, 0, True),
        ("0.137", 0.13745, None, True),
        ("not available", None, 3, True),
        ("0.000", None, 3, False),
        ("PASS", "PASS", None, True),
        ("PASS", "FAIL", None, False),
        ("nan", 0.1, None, False),
    ],
)
def test_a_printed_number_is_its_value_under_the_declared_rounding(text, stored, digits, right):
    assert verifier.printed_right(text, stored, digits)[0] is right


def test_paths_find_names_with_dots_and_rows_by_id_threshold_or_position():
    results = {
        "reconstructions": {"nerf": 1, "nerf.v2": {"within": [{"threshold_m": 0.1, "pct": 90.7}]}},
        "picks": [{"id": "1", "d_m": 0.5}, {"id": "0", "d_m": 0.7}],
        "mean_m": [1, 2, 3],
    }
    at = "reconstructions.nerf.v2.within"
    assert verifier.look_up(results, f"{at}[0.10].pct") == 90.7
    assert verifier.look_up(results, f"{at}.0.pct") == 90.7
    assert verifier.look_up(results, f"{at}[0].pct") == 90.7
    assert verifier.look_up(results, "picks[0].d_m") == 0.7  # an id goes before a position
    assert verifier.look_up(results, "mean_m.2") == 3
    assert verifier.look_up(results, "mean_m[2]") == 3
    for path in ("reconstructions.sfm", "mean_m.3", "mean_m.x", "picks[9].d_m", "nothing"):
        with pytest.raises(KeyError):
            verifier.look_up(results, path)
