"""The clouds to turn about in a browser: one piece of HTML that loads nothing."""

from __future__ import annotations

import base64
import zlib
from importlib.resources import files
from itertools import pairwise
from typing import Any

import jinja2
import numpy as np
from numpy.typing import NDArray

from trigpoint.cloud import PointCloud
from trigpoint_reporting.elevations import (
    band_edges,
    colour_table,
    distance_bands,
    limit_of,
)
from trigpoint_reporting.evidence import Evidence
from trigpoint_reporting.style import listed, metres, percent

# Of all clouds together: half a megabyte of HTML.
MOST = 120_000
SEED = 0
# Coordinates are stored in this share of a voxel.
STEP = 0.2


def viewer_html(evidence: Evidence) -> str:
    """Return the viewer: every reconstruction by its distance, and the reference by what it lacks.

    Parameters
    ----------
    evidence : Evidence

    Returns
    -------
    str
        HTML to put into a page, with its data, style and script; empty where there is nothing to
        show. It belongs beside a picture, for readers without a browser.
    """
    clouds, layers = _clouds(evidence)
    if not clouds:
        return ""
    voxel = evidence.results["project"]["settings"]["comparison"]["voxel_m"]
    low = np.min([cloud.coordinates.min(axis=0) for cloud, _ in clouds], axis=0)
    high = np.max([cloud.coordinates.max(axis=0) for cloud, _ in clouds], axis=0)
    step = max(STEP * voxel, float((high - low).max()) / 65_000)
    limit = limit_of(evidence)
    kept, packed = [], []
    for cloud, scalars in clouds:
        chosen = _some(len(cloud), MOST // len(clouds))
        kept.append(len(chosen))
        cells = np.round((cloud.coordinates[chosen] - low) / step).astype(np.int64)
        packed.append(
            pack(cells, [distance_bands(values[chosen], limit=limit) for values in scalars])
        )
    scene = {
        "step": step,
        "size": ((high - low) / step).tolist(),
        "counts": kept,
        "layers": [{"cloud": cloud, "scalar": scalar} for _, cloud, scalar in layers],
        "colours": colour_table().tolist(),
        "reach": _reach(clouds, kept),
    }
    template = files("trigpoint_templates").joinpath("viewer.html.j2").read_text("utf-8")
    # Names come from the project file: everything is escaped.
    page = jinja2.Environment(autoescape=True).from_string(template)
    return page.render(
        scene=scene,
        packed=packed,
        titles=[title for title, _, _ in layers],
        finding=_finding(evidence),
        points=f"{sum(kept):,}",
        total=f"{sum(len(cloud) for cloud, _ in clouds):,}",
        step=metres(step),
        legend=_legend(limit),
    )


def pack(cells: NDArray[np.int64], scalars: list[NDArray[np.uint8]]) -> str:
    """Pack lattice cells, shape (n, 3), with bytes for each, so that a browser can unpack them.

    Every axis is the steps from point to point, folded so that small ones of either sign are small
    numbers (zigzag), their low bytes and then their high bytes; then zlib, then base64.
    """
    steps = np.diff(cells, axis=0, prepend=0)
    folded = np.where(steps < 0, -2 * steps - 1, 2 * steps)
    if folded.max(initial=0) > 65_535:
        message = f"A step of {folded.max()} cells does not fit two bytes."
        raise ValueError(message)
    planes = [
        part.astype(np.uint8).tobytes() for axis in folded.T for part in (axis & 255, axis >> 8)
    ]
    planes += [values.tobytes() for values in scalars]
    return base64.b64encode(zlib.compress(b"".join(planes), 9)).decode("ascii")


Shown = tuple[PointCloud, list[NDArray[np.float64]]]


def _clouds(evidence: Evidence) -> tuple[list[Shown], list[tuple[str, int, int]]]:
    """Return the clouds with their distances, and each layer's title, cloud and distances."""
    clouds: list[Shown] = []
    layers = []
    for name in evidence.names:
        cloud = evidence.cloud(name, "accuracy")
        if cloud is not None:
            layers.append((f"{name}: distance to the reference", len(clouds), 0))
            clouds.append((cloud, [_distances(cloud)]))
    reference: Shown | None = None
    for name in evidence.names:
        cloud = evidence.cloud(name, "completeness")
        assert cloud is not None  # a reference without points is refused
        if reference is None:
            reference = (cloud, [])
        layers.append((f"The reference: distance to {name}", len(clouds), len(reference[1])))
        reference[1].append(_distances(cloud))
    return [*clouds, *([reference] if reference else [])], layers


def _distances(cloud: PointCloud) -> NDArray[np.float64]:
    return cloud.attributes["distance_m"].astype(np.float64)


def _some(count: int, most: int) -> NDArray[np.int64]:
    """Choose points at random, in their order: every n-th would follow the lattice in stripes."""
    if count <= most:
        return np.arange(count)
    return np.sort(np.random.default_rng(SEED).choice(count, most, replace=False))


def _reach(clouds: list[Shown], kept: list[int]) -> list[float]:
    """Return how wide each cloud's points are drawn, in metres, so that surfaces nearly close."""
    widths = []
    for (cloud, _), count in zip(clouds, kept, strict=True):
        cells = np.floor(cloud.xyz - cloud.xyz.min(axis=0)).astype(np.int64)
        area = len(np.unique(cells @ [1, 2**20, 2**40]))  # square metres, roughly
        widths.append(1.4 * float(np.sqrt(area / count)))
    return widths


def _finding(evidence: Evidence) -> str:
    told = []
    for name in evidence.names:
        found = evidence.results["reconstructions"][name]["comparison"]["delivered"]
        near = next(
            (each for each in found["accuracy"]["all"]["within"] if each["threshold_m"] >= 0.1),
            found["accuracy"]["all"]["within"][-1],
        )
        told.append(f"{percent(near['pct'])} of {name} within {metres(near['threshold_m'], None)}")
    return f"{listed(told)} of the reference."


def _legend(limit: float) -> list[dict[str, Any]]:
    """Name every colour of the table."""
    names = [f"{low}\N{EN DASH}{high} m" for low, high in pairwise(band_edges(limit))]
    names += [f"beyond {metres(limit, None)}", "no counterpart"]
    return [
        {"colour": "#{:02x}{:02x}{:02x}".format(*colour), "name": name}
        for colour, name in zip(colour_table().tolist(), names, strict=True)
    ]
