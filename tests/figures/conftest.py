"""A small audited building to draw, made once."""

from copy import deepcopy
from dataclasses import replace

import pytest

LIMIT = """intervals = false
[[limit]]
quantity = "loocv.max_scale_change_pct"
of = "nerf"
max = 0.5
source = "brief"
"""
BUILT = []


@pytest.fixture
def evidence(small_project, tmp_path_factory):
    """The bundle of the small building: nerf with six control and two check picks, and sfm."""
    from trigpoint.bundle import fill_bundle
    from trigpoint.pipeline import audit
    from trigpoint.project import read_project
    from trigpoint_reporting.evidence import open_evidence
    from trigpoint_reporting.sealing import write_record

    if not BUILT:
        path, _ = small_project(tmp_path_factory.mktemp("project") / "small", extra=LIMIT)
        done = audit(read_project(path))
        folder = tmp_path_factory.mktemp("bundle") / "small-r1"
        folder.mkdir()
        fill_bundle(folder, done, done.results())
        write_record(folder, done, done.results())
        BUILT.append(folder)
    return open_evidence(BUILT[0])


@pytest.fixture
def changed(evidence):
    """Return the evidence with its results changed by a function."""

    def make(change):
        results = deepcopy(evidence.results)
        change(results)
        return replace(evidence, results=results)

    return make
