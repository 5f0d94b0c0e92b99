"""What a new revision changed, number by number, against the one before it."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from trigpoint.canonical import to_json, write_text
from trigpoint_reporting.manifest import BundleError

# By what a row of a list is known, where its position would not say.
KEYS = ("id", "threshold_m", "quantity", "sha256", "message")


def write_changes(path: Path, results: Mapping[str, Any], bundles: Path) -> None:
    """Write what changed since the latest earlier revision that lies in a folder of bundles.

    Nothing is written for a first revision. Where no earlier bundle is at hand, the file says so.

    Parameters
    ----------
    path : Path
        Of the file to write.
    results : dict
        Of the new revision.
    bundles : Path
        Where ``<id>-r<revision>`` folders lie.
    """
    about = results["project"]
    if about["revision"] <= 1:
        return
    earlier = find_earlier(bundles, about["id"], about["revision"])
    changes: list[dict[str, Any]] = []
    if earlier is not None:
        changes = compare_results(_read(earlier), results)
    against = None if earlier is None else earlier.name
    write_text(path, to_json({"against": against, "changes": changes}))


def find_earlier(bundles: Path, name: str, revision: int) -> Path | None:
    """Return the folder of the latest revision of a project before this one, or None."""
    for number in range(revision - 1, 0, -1):
        folder = bundles / f"{name}-r{number}"
        if (folder / "data" / "results.json").is_file():
            return folder
    return None


def compare_results(before: Mapping[str, Any], after: Mapping[str, Any]) -> list[dict[str, Any]]:
    """List every value that differs between two results: path, kind, before, after.

    Parameters
    ----------
    before, after : dict
        As in results.json.

    Examples
    --------
    >>> old = {"rmse_m": 0.2, "picks": [{"id": "a", "d_m": 0.1}]}
    >>> new = {"rmse_m": 0.1, "picks": [{"id": "b", "d_m": 0.1}]}
    >>> [(row["path"], row["kind"]) for row in compare_results(old, new)]
    [('rmse_m', 'changed'), ('picks[a].d_m', 'removed'), ('picks[b].d_m', 'added')]
    """
    old, new = leaves(before), leaves(after)
    rows = []
    for path in dict.fromkeys([*old, *new]):
        kind = "added" if path not in old else "removed" if path not in new else "changed"
        if kind != "changed" or old[path] != new[path]:
            values = {"before": old.get(path), "after": new.get(path)}
            rows.append({"path": path, "kind": kind, **values})
    return rows


def leaves(results: Mapping[str, Any]) -> dict[str, Any]:
    """Return every value of results by its path, as lists of changes write it.

    Examples
    --------
    >>> leaves({"picks": [{"id": "a", "d_m": 0.1}], "mean_m": [1, 2]})
    {'picks[a].d_m': 0.1, 'mean_m[0]': 1, 'mean_m[1]': 2}
    """
    return dict(_leaves(results))


def leaves_before(after: Mapping[str, Any], changes: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Return every value of the results before, from those after and the list of changes.

    Examples
    --------
    >>> old, new = {"n": 5, "rmse_m": 0.2}, {"rmse_m": 0.1, "dof": 8}
    >>> leaves_before(new, compare_results(old, new)) == leaves(old)
    True
    """
    found = leaves(after)
    for row in changes:
        if row["kind"] == "added":
            found.pop(row["path"], None)
        else:
            found[row["path"]] = row["before"]
    return found


def _leaves(value: Any, path: str = "") -> Iterator[tuple[str, Any]]:
    if isinstance(value, Mapping):
        for key, item in value.items():
            yield from _leaves(item, f"{path}.{key}" if path else str(key))
    elif isinstance(value, Sequence) and not isinstance(value, str):
        key = _naming(value)
        for position, item in enumerate(value):
            label = position if key is None else item[key]
            rest = item if key is None else {k: v for k, v in item.items() if k != key}
            yield from _leaves(rest, f"{path}[{label}]")
    else:
        yield path, value


def _naming(rows: Sequence[Any]) -> str | None:
    """Return the key that names each of these rows, and no two of them alike; None without."""
    if not all(isinstance(row, Mapping) for row in rows):
        return None
    for key in KEYS:
        names = [str(row[key]) for row in rows if key in row]
        if rows and len(names) == len(set(names)) == len(rows):
            return key
    return None


def _read(folder: Path) -> dict[str, Any]:
    try:
        stored = json.loads((folder / "data" / "results.json").read_text("utf-8"))
    except (OSError, ValueError) as error:
        message = f"{folder.name} lies beside this revision and its results.json can't be read."
        raise BundleError(message) from error
    return stored  # type: ignore[no-any-return]
