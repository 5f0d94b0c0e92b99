"""Elevations to scale, measured and not rendered: every pixel is a point's colour in the legend."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from typing import Any

import matplotlib as mpl
import numpy as np
from numpy.typing import NDArray

from trigpoint.cloud import PointCloud
from trigpoint.files import describe, stream
from trigpoint_reporting.blocks import Passage, Picture
from trigpoint_reporting.evidence import Evidence
from trigpoint_reporting.numbers import number_text
from trigpoint_reporting.photo import fewer_colours, photo_colours
from trigpoint_reporting.sheet import (
    PER_MM,
    SCALES,
    Colours,
    Legend,
    Panel,
    Plan,
    draw,
    lay_out,
    to_png,
)
from trigpoint_reporting.splat import Side, Splat, extent, grown, splat
from trigpoint_reporting.style import (
    VERMILLION,
    labels,
    listed,
    metres,
    not_drawn,
    percent,
)

FOUR: tuple[Side, ...] = ("north", "east", "south", "west")
# Up to where distances are told apart where no project says otherwise, and in bands of what width.
# A report has one limit for all its figures, so that any two can be laid side by side.
LIMIT_M, BAND_M = 0.50, 0.05
BANDS = round(LIMIT_M / BAND_M)
REACH = 2.5  # times the largest threshold
# Where the plan of what is missing draws its line, if the project measures there.
MARK_M = 0.10
AROUND_M = 1.0
# A point covers this many voxels' edges, so that a thinned surface looks as closed as it is.
POINT = 1.5
# Pixels over which a nearer surface darkens the one behind it.
SHADOW = 3
# Height in pixels of a sheet that shares its page with another, or with two.
HALF, THIRD = 1150, 800
# Room of the picture on the first page, in millimetres: width, height.
SMALL_MM = (36.0, 34.0)


def limit_of(evidence: Evidence) -> float:
    """Return the distance beyond which every figure of a report tells none apart, in metres."""
    return limit_within(evidence.results["project"]["settings"]["comparison"]["within_m"])


def limit_within(within: Collection[float]) -> float:
    """Return the distance up to which distances are told apart, for thresholds in metres.

    Examples
    --------
    >>> limit_within((0.01, 0.05))
    0.125
    """
    return round(REACH * max(within), 6) if within else LIMIT_M


def rgb(colour: str) -> Colours:
    """Return a colour such as ``#D55E00`` as three bytes.

    Examples
    --------
    >>> rgb("#D55E00").tolist()
    [213, 94, 0]
    """
    return np.frombuffer(bytes.fromhex(colour.removeprefix("#")), np.uint8)


def bands() -> Colours:
    """Return the colours of the distance bands, near first: light for good, dark for bad."""
    shades = mpl.colormaps["cividis"](np.linspace(0.97, 0.0, BANDS))
    return np.round(255 * shades[:, :3]).astype(np.uint8)


BEYOND, NOTHING = rgb(VERMILLION), rgb("#000000")
NO_BANDS = np.empty((0, 3), np.uint8)
COVERED, NEAR_MISS, MISSING = rgb("#CFCFCF"), rgb(VERMILLION), rgb("#000000")


def distance_bands(distances: NDArray[np.float64], *, limit: float = LIMIT_M) -> NDArray[np.uint8]:
    """Return the position of each distance's colour in `colour_table`.

    A distance on an edge between bands belongs to the nearer band, as ``within`` counts it.
    """
    edges = limit / BANDS * np.arange(1, BANDS + 1) + 1e-9
    band = np.searchsorted(edges, distances, side="left")
    return np.where(np.isfinite(distances), band, BANDS + 1).astype(np.uint8)


def band_edges(limit: float) -> list[str]:
    """Return the ends of the bands as they are written, all with as many decimals."""
    edges = [round(limit * k / BANDS, 9) for k in range(BANDS + 1)]
    digits = max(len(number_text(edge).partition(".")[2]) for edge in edges)
    return [number_text(edge, digits) for edge in edges]


def colour_table() -> Colours:
    """Return the colours of the bands, of what is beyond them, and of no distance at all."""
    return np.concatenate([bands(), BEYOND[None], NOTHING[None]])


def distance_colours(distances: NDArray[np.float64], *, limit: float = LIMIT_M) -> Colours:
    """Return the colour of each distance, shape (n, 3); of none (NaN) black."""
    return colour_table()[distance_bands(distances, limit=limit)]


def distance_elevations(evidence: Evidence, name: str) -> Picture | Passage:
    """Draw a reconstruction from four sides, coloured by its distance to the reference."""
    cloud, site = evidence.cloud(name, "accuracy"), _site(evidence, name)
    if cloud is None:
        return not_drawn(f"Elevations of {name}", "no point of it lies in the evaluation region")
    panels = [site.panel(side, f"From the {side}") for side in FOUR]
    plan = lay_out(panels)
    colours = distance_colours(_distances(cloud), limit=site.limit)
    pictures = [site.picture(cloud, side, plan.pixel, colours) for side in FOUR]
    beyond = _beyond(cloud, site.limit)
    legend = _distance_legend(site.limit, f": {percent(beyond)}")
    content = draw(panels, plan, pictures, legend, zones=site.zones)
    shown = evidence.results["reconstructions"][name]["comparison"]["delivered"]["accuracy"]
    mark, limit = metres(site.mark, None), metres(site.limit, None)
    alt = (
        f"{_within(shown['all'], site.mark)} of {name}'s points lie within {mark} of the reference "
        f"and {percent(beyond)} beyond {limit}{_worst_zone(shown)}."
    )
    caption = (
        f"{name} from four sides, orthographic and to scale, coloured by distance to the "
        f"reference. {_how(len(cloud), plan, site)}"
    )
    return Picture(f"elevations-distance-{name}", caption, alt, content, "png")


def thumbnail(evidence: Evidence, name: str) -> Picture | None:
    """Draw a reconstruction from the south as `distance_elevations` does, but small."""
    cloud = evidence.cloud(name, "accuracy")
    if cloud is None:
        return None
    site = _site(evidence, name)
    left, bottom, right, top = extent(site.corners, "south")
    needed = 1000 * max((right - left) / SMALL_MM[0], (top - bottom) / SMALL_MM[1])
    scale = float(SCALES[needed <= SCALES][0])
    colours = distance_colours(_distances(cloud), limit=site.limit)
    content = to_png(site.picture(cloud, "south", scale / 1000 / PER_MM, colours))
    near = f"{_within(_accuracy(evidence, name), site.mark)} within {metres(site.mark, None)}"
    caption = f"{name} from the south, 1:{scale:g}, as in section Elevations"
    return Picture("thumbnail", caption, f"{caption}: {near}.", content, "png", small=True)


def missing_elevations(evidence: Evidence, name: str) -> Picture | Passage:
    """Draw the reference from four sides and above: what the reconstruction lacks of it."""
    reference, site = evidence.cloud(name, "completeness"), _site(evidence, name)
    assert reference is not None  # a reference without points is refused
    distances = _distances(reference)
    far = ~(distances <= site.limit)  # what has no counterpart at all is NaN, and is far
    colours = np.where(
        (distances <= site.mark)[:, None], COVERED, np.where(far[:, None], MISSING, NEAR_MISS)
    )
    sides: tuple[Side, ...] = (*FOUR, "above")
    panels = [
        site.panel(side, "From above, north up" if side == "above" else f"From the {side}")
        for side in sides
    ]
    plan = lay_out(panels, tallest=HALF)
    pictures = [site.picture(reference, side, plan.pixel, colours) for side in sides]
    mark, limit = metres(site.mark, None), metres(site.limit, None)
    covered = 100 * float((distances <= site.mark).mean())
    missing = 100 * float(far.mean())
    legend = Legend(
        f"Distance from the reference to {labels([name])[0]}",
        NO_BANDS,
        (),
        (
            (COVERED, f"within {mark}: {percent(covered)}"),
            (NEAR_MISS, f"{mark} to {limit}: {percent(100 - covered - missing)}"),
            (MISSING, f"beyond {limit}: {percent(missing)}"),
        ),
    )
    content = draw(panels, plan, pictures, legend, zones=site.zones)
    shown = evidence.results["reconstructions"][name]["comparison"]["delivered"]["completeness"]
    alt = (
        f"{name} lacks {percent(100 - covered)} of the reference at {mark}, {percent(missing)} "
        f"by more than {limit}{_worst_zone(shown)}."
    )
    caption = (
        f"The reference, coloured by whether {name} has a point near it. "
        f"{_how(len(reference), plan, site)}"
    )
    return Picture(f"elevations-missing-{name}", caption, alt, content, "png")


def colour_elevations(evidence: Evidence, name: str) -> Picture | Passage:
    """Draw a georeferenced reconstruction from four sides in its own colours."""
    path = evidence.folder / "clouds" / f"{name}-georeferenced.laz"
    if not path.exists():
        return not_drawn(f"{name} in its own colours", "the bundle holds no such cloud")
    site = _site(evidence, name)
    panels = [site.panel(side, f"From the {side}") for side in FOUR]
    plan = lay_out(panels, tallest=HALF)
    count = 0
    seen: dict[Side, Splat] = {}
    for piece in stream(path):
        if not {"red", "green", "blue"} <= set(piece.attributes):
            return not_drawn(f"{name} in its own colours", "it has none")
        count += len(piece)
        # White is the paper's; what is white in the cloud is drawn a shade darker.
        colours = np.minimum(photo_colours(piece), 254).astype(np.int64) @ [65536, 256, 1]
        for side, panel in zip(FOUR, panels, strict=True):
            part = site.seen(piece, side, panel.window, plan.pixel, size=0.0)
            found = Splat(np.where(part.index >= 0, colours[part.index], -1), part.depth)
            seen[side] = _nearer(seen[side], found) if side in seen else found
    edge = max(1, int(np.ceil(site.voxel / plan.pixel)))
    packed = [grown(seen[side], edge).index for side in FOUR]
    pictures = fewer_colours(
        [np.stack([each >> 16, each >> 8, each], axis=-1).astype(np.uint8) for each in packed]
    )
    legend = Legend("Colours as the reconstruction holds them", NO_BANDS, ())
    content = draw(panels, plan, pictures, legend, zones=site.zones)
    alt = f"{name} as its own colours show it, {count:,} points, from four sides."
    caption = f"{name} in its own colours. {_how(count, plan, site, thinned=False)}"
    return Picture(f"elevations-colour-{name}", caption, alt, content, "png")


def readme_picture(evidence: Evidence) -> Picture | Passage:
    """Draw every reconstruction by its distances beside the reference, from the south."""
    side: Side = "south"
    clouds = {name: evidence.cloud(name, "accuracy") for name in evidence.names}
    drawn = {name: cloud for name, cloud in clouds.items() if cloud is not None}
    reference = evidence.cloud(evidence.names[0], "completeness")
    if reference is None or not drawn:
        return not_drawn("The clouds side by side", "no cloud has points in the region")
    site = _site(evidence, evidence.names[0])
    told = [
        (
            f"{_within(_accuracy(evidence, name), site.mark)} within {metres(site.mark, None)}",
            f"{percent(_beyond(cloud, site.limit))} beyond {metres(site.limit, None)}",
        )
        for name, cloud in drawn.items()
    ]
    given = evidence.results["project"]["settings"]["reference"]["name"] or "Reference"
    titles = [*labels(list(drawn)), *labels([given])]
    notes = [*map("\n".join, told), "the reference, shaded"]
    panels = [site.panel(side, title, note) for title, note in zip(titles, notes, strict=True)]
    plan = lay_out(panels, tallest=THIRD)
    pictures = [
        site.picture(cloud, side, plan.pixel, distance_colours(_distances(cloud), limit=site.limit))
        for cloud in drawn.values()
    ]
    seen = site.seen(reference, side, panels[-1].window, plan.pixel)
    pictures.append(_shaded(seen))
    content = draw(panels, plan, pictures, _distance_legend(site.limit), zones=site.zones)
    alt = (
        "Seen from the south at one scale, of the points of "
        + "; of ".join(
            f"{name}, {both[0]} and {both[1]}" for name, both in zip(drawn, told, strict=True)
        )
        + f" of the reference ({given}, shaded)."
    )
    caption = (
        f"{listed([*drawn, given])} from the south, orthographic and to scale; the reconstructions "
        f"coloured by distance to the reference. {_how(None, plan, site)}"
    )
    return Picture("side-by-side", caption, alt, content, "png")


@dataclass(frozen=True, slots=True, eq=False)
class _Site:
    """What every sheet of one bundle shares: the frame, its window, the zones, the voxel."""

    origin: NDArray[np.float64]
    corners: NDArray[np.float64]
    zones: tuple[tuple[str, float], ...]
    voxel: float
    mark: float
    limit: float

    def panel(self, side: Side, title: str, note: str = "") -> Panel:
        window = extent(self.corners, side)
        return Panel(title, window + _height(self, side), side != "above", note)

    def seen(
        self,
        cloud: PointCloud,
        side: Side,
        window: NDArray[np.float64],
        pixel: float,
        *,
        size: float | None = None,
    ) -> Splat:
        window = window - _height(self, side)
        points = cloud.about(self.origin).xyz
        size = POINT * self.voxel if size is None else size
        return splat(points, side, window=window, pixel=pixel, size=size)

    def picture(self, cloud: PointCloud, side: Side, pixel: float, colours: Colours) -> Colours:
        """Colour what is seen of a cloud; white where nothing is."""
        window = extent(self.corners, side) + _height(self, side)
        index = self.seen(cloud, side, window, pixel).index
        return np.where((index >= 0)[..., None], colours[index], np.uint8(255))


def _height(site: _Site, side: Side) -> NDArray[np.float64]:
    """Return what must be added to a window so that its lower and upper edge are heights."""
    return np.zeros(4) if side == "above" else np.array([0, 1, 0, 1]) * site.origin[2]


def _site(evidence: Evidence, name: str) -> _Site:
    comparison = evidence.results["project"]["settings"]["comparison"]
    found = evidence.results["reconstructions"][name]["comparison"]["delivered"]["accuracy"]
    zones = [zone.replace("_", " ") for zone in found if zone != "all"]
    reference = describe(evidence.folder / "clouds" / f"{name}-completeness.laz")
    margin, within = comparison["margin_m"], comparison["within_m"]
    around = AROUND_M if margin is None else min(AROUND_M, margin)
    origin = np.floor(reference.low)
    return _Site(
        origin,
        np.array([reference.low - around, reference.high + around]) - origin,
        tuple(
            zip(
                zones,
                evidence.distances(name, "zone_edges_m")["zone_edges_m"][:-1].tolist(),
                strict=True,
            )
        ),
        comparison["voxel_m"],
        float(MARK_M if MARK_M in within else within[len(within) // 2]),
        limit_of(evidence),
    )


def _distances(cloud: PointCloud) -> NDArray[np.float64]:
    return cloud.attributes["distance_m"].astype(np.float64)


def _beyond(cloud: PointCloud, limit: float) -> float:
    """Return the percentage of a cloud that is out of the legend's range."""
    return 100 * float((_distances(cloud) > limit).mean())


def _distance_legend(limit: float, share: str = "") -> Legend:
    edges = [text if k % 2 == 0 else "" for k, text in enumerate(band_edges(limit))]
    return Legend(
        "Distance to the reference, metres",
        bands(),
        edges,
        ((BEYOND, f"beyond {metres(limit, None)}{share}"),),
        hatched=BEYOND,
    )


def _shaded(seen: Splat) -> Colours:
    """Shade in grey: darker where what is beside a pixel stands nearer to the viewer."""
    depth = np.pad(seen.depth, SHADOW, constant_values=-np.inf)
    height, width = seen.depth.shape
    own = np.where(seen.index >= 0, seen.depth, 0.0)
    hidden = np.zeros_like(own)
    for down, across in ((0, 1), (0, -1), (1, 0), (-1, 0)):
        rows = slice(SHADOW * (1 + down), SHADOW * (1 + down) + height)
        columns = slice(SHADOW * (1 + across), SHADOW * (1 + across) + width)
        hidden += np.clip(depth[rows, columns] - own, 0.0, 1.0)
    grey = np.where(seen.index >= 0, 190 - 10 * np.round(12 * np.minimum(hidden, 1.0)), 255)
    return np.repeat(grey.astype(np.uint8)[..., None], 3, axis=2)


def _nearer(one: Splat, other: Splat) -> Splat:
    nearer = other.depth > one.depth
    return Splat(np.where(nearer, other.index, one.index), np.where(nearer, other.depth, one.depth))


def _accuracy(evidence: Evidence, name: str) -> dict[str, Any]:
    found = evidence.results["reconstructions"][name]["comparison"]["delivered"]["accuracy"]["all"]
    return dict(found)


def _within(row: dict[str, Any], mark: float) -> str:
    return percent(next(each["pct"] for each in row["within"] if each["threshold_m"] == mark))


def _worst_zone(rows: dict[str, Any]) -> str:
    known = {k: row["p95_m"] for k, row in rows.items() if k != "all" and row["p95_m"] is not None}
    if not known:
        return ""
    worst = max(known, key=known.__getitem__)
    return f"; 95 % of the {worst} zone lies within {metres(known[worst])}"


def _how(count: int | None, plan: Plan, site: _Site, *, thinned: bool = True) -> str:
    drawn = "" if count is None else f"{count:,} points"
    if thinned and site.voxel:
        drawn += f"{', ' if drawn else 'Points '}thinned to {metres(site.voxel, None)}, each drawn "
        drawn += f"{metres(max(POINT * site.voxel, plan.pixel))} wide"
    drawn = drawn and f"{drawn}; "
    return (
        f"{drawn}{plan.pixel:g} m a pixel, 1:{plan.scale:g} at its stated size; heights in "
        "metres, dashed lines between the height zones."
    )
