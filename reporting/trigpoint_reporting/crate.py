"""The bundle described as an RO-Crate: what was made, from what, by which software."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any
from urllib.parse import quote

from trigpoint_reporting.dictionary import describe_file
from trigpoint_reporting.manifest import MANIFEST
from trigpoint_reporting.readme import SCHEMA

CRATE = "ro-crate-metadata.json"
CRATE_1_1 = "https://w3id.org/ro/crate/1.1"
PROCESS_RUN = "https://w3id.org/ro/wfrun/process/0.5"

FORMATS = {
    ".csv": "text/csv",
    ".html": "text/html",
    ".ipynb": "application/x-ipynb+json",
    ".json": "application/json",
    ".laz": "application/vnd.laszip",
    ".npz": "application/zip",
    ".pdf": "application/pdf",
    ".png": "image/png",
    ".py": "text/x-python",
    ".svg": "image/svg+xml",
    ".toml": "application/toml",
    ".txt": "text/plain",
}

Entity = dict[str, Any]


def describe_crate(
    folder: Path, results: Mapping[str, Any], hashes: Mapping[str, str]
) -> dict[str, Any]:
    """Return what ``ro-crate-metadata.json`` holds, by the Process Run Crate profile 0.5.

    The only date is the project's own; a draft without one has none, although RO-Crate asks for
    the date of publication: it has not been published.

    Parameters
    ----------
    folder : Path
        The bundle.
    results : dict
        As in results.json.
    hashes : dict of str to str
        SHA-256 of every file in the bundle, by path.

    References
    ----------
    https://w3id.org/ro/wfrun/process/0.5; Leo et al. (2024), Recording provenance of workflow runs
    with RO-Crate, doi:10.1371/journal.pone.0309210.
    """
    files = [_file(folder, name, digest) for name, digest in hashes.items()]
    listed = [*({"@id": each["@id"]} for each in files), {"@id": MANIFEST}]
    inputs = list(_inputs(results, hashes))
    actions = list(_actions(results, hashes, inputs))
    graph = [
        {
            "@id": CRATE,
            "@type": "CreativeWork",
            "conformsTo": {"@id": CRATE_1_1},
            "about": {"@id": "./"},
        },
        _root(results, listed, actions),
        {
            "@id": PROCESS_RUN,
            "@type": "CreativeWork",
            "name": "Process Run Crate",
            "version": "0.5",
        },
        *_agents(results),
        *_software(results),
        *actions,
        *(each for each in inputs if each["@id"].startswith("#")),
        *files,
        {
            "@id": MANIFEST,
            "@type": "File",
            "name": MANIFEST,
            "description": "SHA-256 of every other file: sha256sum -c checks it",
        },
    ]
    context = [f"{CRATE_1_1}/context", "https://w3id.org/ro/terms/workflow-run/context"]
    return {"@context": context, "@graph": graph}


def _root(
    results: Mapping[str, Any], listed: list[Entity], actions: list[Entity]
) -> dict[str, Any]:
    about = results["project"]
    title = about["title"] or about["id"]
    root: Entity = {
        "@id": "./",
        "@type": "Dataset",
        "identifier": f"{about['id']}-r{about['revision']}",
        "name": f"{title}: audit, revision {about['revision']}",
        "description": about["purpose"]
        or "A reconstruction carried into a geodetic frame, and measured against a reference.",
        "version": str(about["revision"]),
        "creativeWorkStatus": about["status"],
        "license": "Not stated by the project: all rights remain with its owner.",
        "conformsTo": {"@id": PROCESS_RUN},
        "mentions": [{"@id": each["@id"]} for each in actions],
        "hasPart": listed,
    }
    if about["date"]:
        root["datePublished"] = about["date"]
    if about["site"]:
        root["contentLocation"] = about["site"]
    if agent := _agent(about):
        root["author"] = agent
    return root


def _agent(about: Mapping[str, Any]) -> Entity | None:
    if about["surveyor"]:
        return {"@id": "#surveyor"}
    return {"@id": "#organisation"} if about["organisation"] else None


def _agents(results: Mapping[str, Any]) -> Iterator[Entity]:
    about = results["project"]
    if about["organisation"]:
        yield {"@id": "#organisation", "@type": "Organization", "name": about["organisation"]}
    if about["surveyor"]:
        person: Entity = {"@id": "#surveyor", "@type": "Person", "name": about["surveyor"]}
        if about["organisation"]:
            person["affiliation"] = {"@id": "#organisation"}
        yield person


def _software(results: Mapping[str, Any]) -> Iterator[Entity]:
    yield {
        "@id": "#trigpoint",
        "@type": "SoftwareApplication",
        "name": "trigpoint",
        "softwareVersion": results["environment"]["trigpoint"],
        "softwareRequirements": {"@id": "env/requirements.lock"},
    }
    if any(given["role"] == "picks" for given in results["inputs"]):
        yield {
            "@id": "#picking",
            "@type": "SoftwareApplication",
            "name": "the tool in which points were picked (not stated by the project)",
        }


def _inputs(results: Mapping[str, Any], hashes: Mapping[str, str]) -> Iterator[Entity]:
    """Describe what was read; only pick files are in the bundle themselves."""
    inside = {digest: name for name, digest in hashes.items() if name.startswith("config/picks-")}
    for position, given in enumerate(results["inputs"], 1):
        if given["sha256"] in inside:
            yield {"@id": _identifier(inside[given["sha256"]])}
            continue
        yield {
            "@id": f"#input-{position}",
            "@type": "CreativeWork",
            "name": given["path"],
            "description": f"{given['role']} {given['name']}, not in the bundle",
            "contentSize": str(given["bytes"]),
            "sha256": given["sha256"],
        }


def _actions(
    results: Mapping[str, Any], hashes: Mapping[str, str], inputs: list[Entity]
) -> Iterator[Entity]:
    about = results["project"]
    stated: Entity = {"endTime": about["date"]} if about["date"] else {}
    agent = _agent(about)
    by = {} if agent is None else {"agent": agent}
    # Picking is provenance too, and a person's.
    picks = [each for each in inputs if each["@id"].startswith("config/picks-")]
    for position, each in enumerate(picks, 1):
        yield {
            "@id": f"#picking-{position}",
            "@type": "CreateAction",
            "name": "Picking correspondences by hand",
            "instrument": {"@id": "#picking"},
            "result": {"@id": each["@id"]},
            **by,
        }
    read = {"config/project.toml", *(name for name in hashes if name.startswith("config/picks-"))}
    yield {
        "@id": "#audit",
        "@type": "CreateAction",
        "name": f"Audit {about['id']}, revision {about['revision']}",
        "description": "trigpoint audit project.toml",
        "instrument": {"@id": "#trigpoint"},
        "object": [{"@id": "config/project.toml"}, *({"@id": each["@id"]} for each in inputs)],
        "result": [{"@id": _identifier(name)} for name in hashes if name not in read],
        "actionStatus": {"@id": "http://schema.org/CompletedActionStatus"},
        **stated,
        **by,
    }


def _file(folder: Path, name: str, digest: str) -> Entity:
    entity: Entity = {
        "@id": _identifier(name),
        "@type": "File",
        "name": name,
        "contentSize": str((folder / name).stat().st_size),
        "sha256": digest,
    }
    if told := describe_file(name):
        entity["description"] = told
    if name == "data/results.json" and (folder / SCHEMA).is_file():
        entity["conformsTo"] = {"@id": SCHEMA}
    suffix = re.search(r"\.\w+$", name)
    if suffix and suffix[0] in FORMATS:
        entity["encodingFormat"] = FORMATS[suffix[0]]
    return entity


def _identifier(name: str) -> str:
    return quote(name)
