import json

import pytest

from trigpoint_reporting.crate import describe_crate
from trigpoint_reporting.manifest import hash_files

rocrate = pytest.importorskip("rocrate.rocrate", reason="rocrate reads crates in its own way")


def test_rocrate_reads_the_crate_and_finds_the_run(tmp_path):
    (tmp_path / "config").mkdir()
    (tmp_path / "data").mkdir()
    (tmp_path / "config" / "project.toml").write_text("", "utf-8")
    (tmp_path / "data" / "a b.csv").write_text("x\n", "utf-8")
    results = {
        "project": {
            "id": "tower",
            "title": "Clock tower",
            "site": "",
            "purpose": "",
            "revision": 2,
            "status": "issued",
            "date": "2026-09-21",
            "surveyor": "A",
            "organisation": "",
        },
        "environment": {"trigpoint": "0.1.0"},
        "inputs": [
            {
                "name": "nerf",
                "role": "neural",
                "path": "nerf.ply",
                "bytes": 12,
                "sha256": "0" * 64,
            }
        ],
    }
    crate = describe_crate(tmp_path, results, hash_files(tmp_path))
    (tmp_path / "ro-crate-metadata.json").write_text(json.dumps(crate), "utf-8")
    read = rocrate.ROCrate(tmp_path)
    assert read.root_dataset["name"] == "Clock tower: audit, revision 2"
    action = read.dereference("#audit")
    assert action.type == "CreateAction"
    assert action["instrument"]["softwareVersion"] == "0.1.0"
    assert {each["name"] for each in action["object"]} == {"config/project.toml", "nerf.ply"}
    assert read.dereference("data/a%20b.csv")["name"] == "data/a b.csv"
