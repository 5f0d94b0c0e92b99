"""What was done to how many points with which settings, and what could have affected the result."""

from __future__ import annotations

from collections.abc import Iterator

from trigpoint_reporting.blocks import Block, Cell, Table
from trigpoint_reporting.evidence import Evidence
from trigpoint_reporting.numbers import Numbers, number_text

Row = tuple[Cell, ...]

STEPS = (
    (
        "Consensus",
        "Sets of three picks propose similarities; the largest set of picks that agree "
        "within the threshold is kept, refitted and judged again until it stays the same.",
    ),
    (
        "Fit",
        "One similarity (Umeyama 1991) by least squares to the picks kept: scale, rotation, "
        "position, and nothing non-rigid.",
    ),
    ("Validation", "Each pick kept is left out in turn and predicted; check picks enter nothing."),
    (
        "Reliability",
        "The fit is linearised at its solution; the picks' noise is carried through "
        "its seven parameters to every point.",
    ),
    (
        "Thinning",
        "All clouds on one lattice in the target frame; the centroid of each cell is kept.",
    ),
    (
        "Distances",
        "Exact nearest neighbours both ways, in three dimensions, never cut off; zones "
        "cut the reference's height range.",
    ),
    (
        "ICP",
        "Rigid, point to plane, about the clouds' centre, worst pairs trimmed: a hypothesis "
        "for comparison.",
    ),
    (
        "Intervals",
        "The similarity's uncertainty by drawn poses, and sampling by blocks drawn again; seeded.",
    ),
)


def method(evidence: Evidence) -> list[Block]:
    """Return the steps, every setting, and the effects with their sizes."""
    return [
        Table("Method, step by step", ("Step", "What is done"), STEPS),
        Table(
            "Effects on the result",
            ("Effect", "Size", "Unit", "How estimated", "Affects", "Treated?"),
            list(_effects(evidence)),
            ("Sizes are one standard deviation where the effect is random.",),
        ),
        _kept(evidence),
        Table(
            "Every setting of this audit",
            ("Section", "Setting", "Value"),
            list(_settings(evidence)),
            ("As a file that runs again beside the inputs: config/project.toml.",),
        ),
    ]


def _kept(evidence: Evidence) -> Table:
    """Return the counts of every reconstruction, side by side."""
    reconstructions = Numbers(evidence.results).below("reconstructions")
    counts = {
        name: found.below("comparison", "delivered", "counts")
        for name, found in reconstructions.items()
    }
    steps = dict.fromkeys(key for part in counts.values() for key in part.stored)
    return Table(
        "Points kept and lost at every step",
        ("Step", *counts),
        [
            (
                key.replace("_", " "),
                *(
                    part.value(key) if key in part.stored else "\N{EN DASH}"
                    for part in counts.values()
                ),
            )
            for key in steps
        ],
        tuple(_region(evidence)),
    )


def _region(evidence: Evidence) -> Iterator[Cell]:
    settings = Numbers(evidence.results).below("project", "settings", "comparison")
    polygon = [row["path"] for row in evidence.results["inputs"] if row["role"] == "region"]
    yield "Evaluation region: "
    if polygon:
        yield f"the polygon in {polygon[0]}. "
    elif settings["margin_m"] is None:
        yield "everything, no crop. "
    else:
        yield "the reference's extent and "
        yield settings.value("margin_m")
        yield " m around it. "
    yield (
        "It crops reconstructions only: no point of the reference is left out for want of a "
        "partner."
    )


def _settings(evidence: Evidence) -> Iterator[Row]:
    for section, part in Numbers(evidence.results).items("project", "settings"):
        for key, setting in part.items():
            yield section, key, _setting(setting)


def _setting(setting: Numbers) -> Cell:
    value = setting.stored
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, list):
        return ", ".join(number_text(each) for each in value)
    if isinstance(value, str):
        return value or "not stated"
    return "none" if value is None else setting.value()


def _effects(evidence: Evidence) -> Iterator[Row]:
    numbers = Numbers(evidence.results)
    for name, found in numbers.items("reconstructions"):
        if found["alignment"] is not None:
            yield from _of_alignment(evidence, name, found)
    for name, found in numbers.items("reconstructions"):
        if found["icp"] is not None:
            yield (
                f"{name}: pose left over, as ICP sees it",
                found.value("icp", "shift_m"),
                "m",
                "rigid ICP against the reference",
                "accuracy, completeness",
                "reported; compared after ICP too",
            )
    yield from _of_reference(evidence, numbers)
    yield from _of_map(numbers.below("crs"))
    settings = numbers.below("project", "settings", "comparison")
    yield (
        "Voxel",
        settings.value("voxel_m"),
        "m",
        "a setting",
        "shares within thresholds near it",
        "shares before thinning beside",
    )


def _of_alignment(evidence: Evidence, name: str, found: Numbers) -> Iterator[Row]:
    carried = "carried through: covariance, intervals"
    stated = found["reliability"]["noise"] == "stated"
    if stated:
        yield (
            f"{name}: picking noise, both frames, per axis",
            found.value("reliability", "sigma_m"),
            "m",
            f"sigmas of the picks: {_stated(evidence, name)}",
            "fit, leave-one-out, position",
            carried,
        )
    yield (
        f"{name}: picking noise {'as the fit shows it' if stated else 'and misfit'}, per axis",
        found.value("reliability", "sigma0_m"),
        "m",
        "residuals of the fit",
        "fit, leave-one-out, position",
        "no: compared with the sigmas" if stated else carried,
    )
    zones = [(part["sigma_m"], part) for _, part in found.items("reliability", "zones")]
    known = [(sigma, part) for sigma, part in zones if sigma is not None]
    if known:
        _, part = max(known, key=lambda each: each[0])
        yield (
            f"{name}: similarity, worst zone",
            part.value("sigma_m"),
            "m",
            "covariance of the fit",
            "accuracy, completeness",
            "in the intervals",
        )


def _stated(evidence: Evidence, name: str) -> str:
    """Tell the control picks' sigmas in both frames, root mean squares where they differ."""
    found = {
        "in the reference": (evidence.picking_sigma(name, "target", "control"), "m"),
        "in the source, times the scale": (
            evidence.picking_sigma(name, "source", "control"),
            "units",
        ),
    }
    told = [
        f"{number_text(round(sigma, 6))} {unit} {where}"
        for where, (sigma, unit) in found.items()
        if sigma is not None
    ]
    return ", ".join(told) or "stated or repeated"


def _of_reference(evidence: Evidence, numbers: Numbers) -> Iterator[Row]:
    reference = numbers.below("project", "settings", "reference")
    stated = reference["accuracy_m"] is not None
    yield (
        "Reference: its own position, per axis",
        reference.value("accuracy_m") if stated else "not stated",
        "m",
        reference["accuracy_source"] or "source not stated",
        "absolute position",
        "added at the check picks only" if stated else "no",
    )
    # The floor is the reference's own: the same beside every reconstruction.
    floor = numbers.below("reconstructions", evidence.names[0], "comparison", "delivered")
    yield (
        "Reference: spacing and noise",
        floor.value("completeness", "all", "floor_rmse_m"),
        "m",
        "two random halves against each other",
        "accuracy, completeness",
        "reported as the floor",
    )


def _of_map(crs: Numbers) -> Iterator[Row]:
    yield (
        "Map grid, over 100 m, horizontally only",
        crs.value("mm_over_100_m"),
        "mm",
        "the projection at the site",
        "scale, horizontal lengths",
        "no: stated",
    )
    if crs["is_ensemble"]:
        yield (
            "Datum ensemble",
            crs.value("ensemble_accuracy_m"),
            "m",
            "the datum's register",
            "absolute position",
            "no: stated",
        )
    vertical = crs["vertical_datum"]
    yield (
        "Vertical datum",
        vertical or "not known",
        "\N{EN DASH}",
        "the CRS",
        "absolute heights",
        "as stated" if vertical else "no: a warning",
    )
