"""One page over many audits: a row for each, with its verdict and a way to its report."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator, Mapping, Sequence
from html import escape
from pathlib import Path
from typing import Any
from urllib.parse import quote

from trigpoint.canonical import write_text

# By word, sign and colour: a page may be printed in grey and read by ear.
SIGNS = {"PASS": "✓", "CONDITIONAL": "◐", "FAIL": "✗", "NOT TESTED": "○"}
STYLE = """
:root { color-scheme: light; }
body { font: 1rem/1.5 system-ui, sans-serif; color: #1b1b1b; background: #fff; margin: 2rem auto;
  max-width: 70rem; padding: 0 1rem; }
h1 { font-size: 1.5rem; margin: 0 0 .25rem; }
p { margin: .25rem 0 1.25rem; max-width: 45rem; }
.scroll { overflow-x: auto; }
table { border-collapse: collapse; width: 100%; font-variant-numeric: tabular-nums; }
caption { text-align: left; font-weight: 600; padding-bottom: .5rem; }
th, td { text-align: left; vertical-align: top; padding: .5rem .75rem .5rem 0;
  border-bottom: 1px solid #d0d0d0; }
thead th { border-bottom: 2px solid #1b1b1b; white-space: nowrap; vertical-align: bottom; }
tbody th { font-weight: 600; min-width: 9rem; max-width: 24rem; overflow-wrap: anywhere; }
.number { text-align: right; white-space: nowrap; }
small { display: block; font-weight: 400; color: #4a4a4a; }
.verdict { white-space: nowrap; font-weight: 600; border-left: .35rem solid; padding-left: .5rem; }
.pass { border-color: #007a5a; } .conditional { border-color: #b06f00; }
.fail { border-color: #b3261e; } .not-tested { border-color: #767676; }
a { color: #00527a; }
@media print { body { margin: 0; max-width: none; font-size: 8pt; }
  .scroll { overflow: visible; } thead th { white-space: normal; }
  thead { display: table-header-group; } tr { break-inside: avoid; } }
"""
MISSING = "not available"


def write_index(path: Path, bundles: Sequence[Path]) -> None:
    """Write a page with a row for every bundle, self-contained and escaped.

    Parameters
    ----------
    path : Path
        Of the page, such as ``index.html`` beside the bundles; links are relative to it.
    bundles : sequence of Path
        Folders of bundles, in the order of the rows.
    """
    rows = [row for bundle in bundles for row in _rows(bundle, path.parent)]
    verdicts = [json.loads(_results(bundle))["verdict"] for bundle in bundles]
    told = ", ".join(f"{verdicts.count(name)} {name}" for name in SIGNS if verdicts.count(name))
    count = f"{len(bundles)} project{'' if len(bundles) == 1 else 's'}"
    page = f"""<!doctype html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>Audits: {count}</title>
<style>{STYLE}</style>
</head>
<body>
<h1>Audits</h1>
<p>{count}: {told or "none"}. A verdict is about each project's own limits: NOT TESTED means that \
none were stated, CONDITIONAL that they are met while something they rest on is in doubt.</p>
<div class="scroll" tabindex="0" role="region" aria-label="Table of audits">
<table>
<caption>RMSE in metres, at the picks</caption>
<thead><tr><th scope="col">Project</th><th scope="col">Verdict</th><th scope="col">Limits met</th>\
<th scope="col">Reconstruction</th><th scope="col" class="number">Picks used</th>\
<th scope="col" class="number">Fit RMSE</th><th scope="col" class="number">Leave-one-out</th>\
<th scope="col" class="number">Warnings</th></tr></thead>
<tbody>
{"".join(rows)}</tbody>
</table>
</div>
</body>
</html>
"""
    write_text(path, page)


def _results(bundle: Path) -> str:
    return (bundle / "data" / "results.json").read_text("utf-8")


def _rows(bundle: Path, beside: Path) -> Iterator[str]:
    results = json.loads(_results(bundle))
    found: Mapping[str, Any] = results["reconstructions"]
    span = f' rowspan="{len(found)}"' if len(found) > 1 else ""
    met = [row["met"] for row in results["criteria"]]
    shared_before = (
        f'<th scope="row"{span}>{_link(bundle, beside, results["project"])}</th>'
        f"<td{span}>{_verdict(results['verdict'])}</td>"
        f"<td{span}>{f'{sum(met)} of {len(met)}' if met else 'none stated'}</td>"
    )
    shared_after = f'<td{span} class="number">{len(results["warnings"])}</td>'
    for position, (name, each) in enumerate(found.items()):
        alignment = each["alignment"]
        own = '<td colspan="3">came georeferenced</td>'
        if alignment is not None:
            total = alignment["n"] + len(alignment["outliers"])
            loocv = each["loocv"]["rmse_m"]
            cells = (
                f"{alignment['n']} of {total}",
                f"{alignment['rmse_m']:.3f}",
                MISSING if loocv is None else f"{loocv:.3f}",
            )
            own = "".join(f'<td class="number">{cell}</td>' for cell in cells)
        own = f"<td>{escape(name)}</td>{own}"
        first = position == 0
        yield f"<tr>{shared_before if first else ''}{own}{shared_after if first else ''}</tr>\n"


def _link(bundle: Path, beside: Path, about: Mapping[str, Any]) -> str:
    target = bundle / "report.html"
    name = escape(f"{about['id']} r{about['revision']}")
    title, site = escape(about["title"]), escape(about["site"])
    if target.is_file():
        place = Path(os.path.relpath(target, beside)).as_posix()
        name = f'<a href="{escape(quote(place))}">{name}</a>'
    told = [title, site, f"{about['status']}{', ' + about['date'] if about['date'] else ''}"]
    return name + "".join(f"<small><bdi>{each}</bdi></small>" for each in told if each)


def _verdict(word: str) -> str:
    kind = word.lower().replace(" ", "-")
    return (
        f'<span class="verdict {kind}"><span aria-hidden="true">{SIGNS[word]}</span> {word}</span>'
    )
