"""The verifier on picks that others published: two implementations, one answer."""

import json

import numpy as np
import pytest

from trigpoint.alignment import align
from trigpoint.canonical import plain
from trigpoint.picks import read_picks
from trigpoint.results import alignment_results
from trigpoint_reporting.verifier import verify as verifier


@pytest.mark.parametrize(
    ("name", "settings"),
    [
        ("textbook_helmert/ghilani_4pt.csv", {"method": "all"}),
        ("textbook_helmert/dewitt_6pt.csv", {"threshold": 1.0}),
        ("textbook_helmert/grafarend_awange_7pt.csv", {"method": "all"}),
        ("textbook_helmert/umeyama1991_2d.csv", {"method": "all"}),
        ("lidar_ign_two_flightlines/correspondences.csv", {}),
        ("herzjesu_even_vs_odd/picks6.csv", {}),
        ("herzjesu_even_vs_odd/picks9_three_outliers.csv", {}),
        (
            "herzjesu_even_vs_odd/structural_all_with_outliers.csv",
            {"threshold": 0.06, "trials": 200},
        ),
    ],
)
def test_both_implementations_agree_on_published_picks(real_data, name, settings):
    alignment = align(read_picks(real_data(name)), **settings)
    picks = alignment.picks
    evidence = verifier.Evidence(
        list(picks.ids),
        picks.roles.tolist(),
        picks.source,
        picks.target,
        picks.sigma_source,
        picks.sigma_target,
        np.full(len(picks), np.nan),
    )
    stored = json.loads(json.dumps(plain(alignment_results(alignment))))
    report = verifier.Report()
    verifier.check_alignment(report, "it", stored, evidence, {})
    assert report.differences == []
    assert len(report.rows) > 100
