"""A project's bundle, made and sealed as the command line does it, without the report."""

import trigpoint
from trigpoint.bundle import bundle_folder, fill_bundle
from trigpoint.delivery import whole_folder
from trigpoint_reporting.sealing import seal, write_record


def sealed_bundle(project, finish=lambda draft, results: None):  # noqa: ARG005
    """Audit a project and return its bundle; `finish` adds to the draft before it is sealed."""
    audit = trigpoint.audit(project)
    results = audit.results()
    folder = bundle_folder(audit.project)
    with whole_folder(folder) as draft:
        fill_bundle(draft, audit, results)
        write_record(draft, audit, results)
        finish(draft, results)
        seal(draft)
    return folder
