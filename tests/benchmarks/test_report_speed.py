"""The demo's report: time of the notebook, the HTML and the PDF, each beside its budget."""

import time
from itertools import pairwise

import pytest

pytest.importorskip(
    "weasyprint", reason="the report's packages are not installed", exc_type=ImportError
)

from trigpoint import audit, read_project
from trigpoint.bundle import fill_bundle
from trigpoint.synthetic import clock_tower, write_project
from trigpoint_reporting.document import write_report
from trigpoint_reporting.sealing import write_record

pytestmark = pytest.mark.benchmark

BUDGETS = {"executing the notebook": 20, "writing report.html": 1, "writing report.pdf": 10}


def test_the_demos_report_keeps_its_budget(tmp_path, line):
    found = audit(read_project(write_project(tmp_path / "demo", clock_tower())))
    results = found.results()
    folder = tmp_path / "bundle"
    folder.mkdir()
    fill_bundle(folder, found, results)
    write_record(folder, found, results)
    times = []
    assert write_report(folder, say=lambda step: times.append((step, time.perf_counter()))) == ()
    times.append(("", time.perf_counter()))
    took = {step: after - start for (step, start), (_, after) in pairwise(times)}
    size = (folder / "report.pdf").stat().st_size / 1e6
    line(
        "the demo's report: "
        + ", ".join(f"{step} {took[step]:.1f} s (allowed: {BUDGETS[step]})" for step in BUDGETS)
        + f"; the PDF {size:.1f} MB (allowed: 5)"
    )
    assert all(took[step] <= seconds for step, seconds in BUDGETS.items())
    assert size <= 5
