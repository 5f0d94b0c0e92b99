"""What a cloud can be coloured by, and how to read the colours."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import matplotlib as mpl
import numpy as np
from numpy.typing import NDArray

from trigpoint.cloud import PointCloud
from trigpoint_reporting.elevations import (
    BANDS,
    LIMIT_M,
    band_edges,
    colour_table,
    distance_colours,
)
from trigpoint_reporting.photo import photo_colours
from trigpoint_reporting.style import BLUE, GREEN, GREY, ORANGE, PALE, PURPLE, VERMILLION

ColourMode = Literal["rgb", "height", "intensity", "class", "distance"]
Colours = NDArray[np.uint8]

LABELS: dict[ColourMode, str] = {
    "rgb": "Own colours",
    "height": "Height",
    "intensity": "Intensity",
    "class": "Class",
    "distance": "Distance",
}
# Values in the tails of a ramp share its end colours: one flyer would flatten the rest.
TAIL = 1.0
# Codes of the ASPRS LAS specification; the others are grey.
CLASSES = {
    0: ("never classified", PALE),
    1: ("unclassified", PALE),
    2: ("ground", "#9C7A4D"),
    3: ("low vegetation", "#8FD3B6"),
    4: ("vegetation", "#3DB38A"),
    5: ("high vegetation", GREEN),
    6: ("building", VERMILLION),
    7: ("noise", PURPLE),
    9: ("water", BLUE),
    11: ("road", GREY),
    17: ("bridge", ORANGE),
    18: ("high noise", PURPLE),
}


@dataclass(frozen=True, slots=True)
class Legend:
    """How to read a view's colours: a ramp between two values, or named swatches.

    Attributes
    ----------
    title : str
    ramp : tuple of str
        Colours as ``#rrggbb``, from low to high; empty where there are swatches.
    low, high : str
        What stands at the ramp's ends.
    swatches : tuple of (str, str)
        Colour and name.
    """

    title: str
    ramp: tuple[str, ...] = ()
    low: str = ""
    high: str = ""
    swatches: tuple[tuple[str, str], ...] = ()


def modes_of(cloud: PointCloud, *, has_distances: bool = False) -> tuple[ColourMode, ...]:
    """Say what a cloud can be coloured by, the most telling first.

    An attribute of which every point has the same value tells nothing.
    """
    modes: list[ColourMode] = []
    if {"red", "green", "blue"} <= set(cloud.attributes):
        modes.append("rgb")
    modes.append("height")
    if _varies(cloud, "intensity"):
        modes.append("intensity")
    if _varies(cloud, "classification"):
        modes.append("class")
    if has_distances or "distance_m" in cloud.attributes:
        modes.append("distance")
    return tuple(modes)


def coloured(
    cloud: PointCloud,
    mode: ColourMode,
    *,
    up: NDArray[np.float64],
    distances: NDArray[np.float64] | None = None,
    limit: float = LIMIT_M,
    unit: str = "m",
) -> tuple[Colours, Legend | None]:
    """Colour a cloud.

    Ramps are perceptually uniform and told apart by every kind of colour vision; distances have
    the bands of the report.

    Parameters
    ----------
    cloud : PointCloud
    mode : str
    up : ndarray of shape (3,)
        Heights count along it.
    distances : ndarray of shape (n,), optional
        Metres; by default the cloud's own ``distance_m``.
    limit : float
        Up to where distances are told apart, metres.
    unit : str
        Of the heights.

    Returns
    -------
    colours : ndarray of shape (n, 3)
    legend : Legend or None
        None where the colours are the cloud's own.
    """
    if mode == "rgb":
        return photo_colours(cloud), None
    if mode == "class":
        return _classes(cloud.attributes["classification"])
    if mode == "distance":
        given = cloud.attributes.get("distance_m") if distances is None else distances
        metres = np.asarray(given, np.float64)
        has_gaps = bool(np.isnan(metres).any())
        return distance_colours(metres, limit=limit), distance_legend(limit, has_gaps=has_gaps)
    if mode == "intensity":
        values = cloud.attributes["intensity"].astype(np.float32)
        # The ends of grey would vanish on a light or a dark background.
        return _ramp(values, "gray", (0.15, 0.9), "Intensity", "")
    return _ramp(_heights(cloud, up), "viridis", (0.0, 1.0), "Height", f" {unit}")


def _heights(cloud: PointCloud, up: NDArray[np.float64]) -> NDArray[np.float64]:
    x, y, z = up / np.linalg.norm(up)
    local = cloud.xyz
    heights: NDArray[np.float64] = local[:, 0] * x + local[:, 1] * y + local[:, 2] * z
    return heights + float(cloud.origin @ [x, y, z])


def _ramp(
    values: NDArray[np.floating], name: str, ends: tuple[float, float], title: str, unit: str
) -> tuple[Colours, Legend]:
    every = max(1, len(values) // 200_000)
    low, high = np.percentile(values[::every], [TAIL, 100 - TAIL])
    table = np.round(255 * mpl.colormaps[name](np.linspace(*ends, 256))[:, :3]).astype(np.uint8)
    steps = (values - low) * (255 / max(high - low, 1e-12))
    digits = max(0, 2 - int(np.floor(np.log10(max(high - low, 1e-6)))))
    ramp = tuple(_hex(colour) for colour in table[::17])
    legend = Legend(title, ramp, f"{low:.{digits}f}{unit}", f"{high:.{digits}f}{unit}")
    return table[np.clip(steps, 0, 255).astype(np.uint8)], legend


def _classes(values: NDArray[np.generic]) -> tuple[Colours, Legend]:
    codes = np.asarray(values).astype(np.uint8)
    table = np.full((256, 3), 128, np.uint8)
    for code, (_, colour) in CLASSES.items():
        table[code] = np.frombuffer(bytes.fromhex(colour[1:]), np.uint8)
    present = np.flatnonzero(np.bincount(codes, minlength=256))
    swatches = tuple(
        (_hex(table[code]), CLASSES.get(int(code), (f"class {code}", ""))[0]) for code in present
    )
    return table[codes], Legend("Class", swatches=swatches)


def distance_legend(limit: float, *, has_gaps: bool = False) -> Legend:
    """Say how to read distances, the same in every view and in the report.

    Parameters
    ----------
    limit : float
        Up to where they are told apart, metres.
    has_gaps : bool
        Whether some points have none (NaN).
    """
    table, end = [_hex(colour) for colour in colour_table()], f"{band_edges(limit)[-1]} m"
    swatches = [(table[BANDS], f"beyond {end}")]
    if has_gaps:
        swatches.append((table[BANDS + 1], "none measured"))
    return Legend("Distance", tuple(table[:BANDS]), "0 m", end, tuple(swatches))


def _hex(colour: NDArray[np.uint8]) -> str:
    return "#" + bytes(colour).hex()


def _varies(cloud: PointCloud, name: str) -> bool:
    values = cloud.attributes.get(name)
    return values is not None and bool((values != values[:1]).any())
