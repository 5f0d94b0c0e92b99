"""The coordinate reference: what it says at the site, and what it leaves open."""

from __future__ import annotations

from collections.abc import Iterator

from trigpoint_reporting.blocks import Block, Cell, Passage, Table
from trigpoint_reporting.evidence import Evidence
from trigpoint_reporting.numbers import Numbers

ASSIGNED = "An assigned CRS is taken at its word: nothing was reprojected."


def coordinate_reference(evidence: Evidence) -> list[Block]:
    """Return what the CRS says, then all that it does not say."""
    crs = Numbers(evidence.results).below("crs")
    rows = list(_rows(crs))
    return [
        Table(
            "What the coordinate reference says",
            ("Item", "At this site"),
            rows,
            (
                "Grid scale: length on the map over length on the ellipsoid; combined factor: over "
                "length on the ground. Convergence: from true north to grid north, clockwise. "
                f"{ASSIGNED}",
            ),
        ),
        *_unsaid(crs),
        Passage(
            (
                "Coordinates are taken as easting, northing, height, whatever order the CRS lists "
                "its axes in, and in metres. Every sum is done in double precision about an origin "
                "near the data. The similarity goes from the reconstruction's frame to this one.",
            )
        ),
    ]


def _rows(crs: Numbers) -> Iterator[tuple[Cell, Cell]]:
    yield "Name", "none" if crs["name"] == "none" else crs.value("name")
    yield "Code", crs["code"] or "none"
    yield "Horizontal datum", crs["datum"] or "not stated"
    if crs["is_ensemble"]:
        yield "Accuracy of that datum's ensemble (m)", crs.value("ensemble_accuracy_m")
    yield "Vertical datum", crs["vertical_datum"] or "not stated"
    yield "Units of easting, northing, height", ", ".join(crs["units"])
    yield "Longitude of the site (°)", crs.value("longitude_deg")
    yield "Latitude of the site (°)", crs.value("latitude_deg")
    inside = {True: "yes", False: "NO", None: "not known"}[crs["in_area_of_use"]]
    yield "Site lies in the CRS's area of use", inside
    yield "Grid scale", crs.value("grid_scale")
    yield "Effect of height on lengths (ppm)", crs.value("height_effect_ppm")
    yield "Combined factor", crs.value("combined_factor")
    yield "The map adds to 100 m on the ground (mm)", crs.value("mm_over_100_m")
    yield "Convergence (°)", crs.value("convergence_deg")


def _unsaid(crs: Numbers) -> Iterator[Passage]:
    if crs["name"] == "none":
        yield _warning(
            "There is no coordinate reference: coordinates are taken as metres, and nothing here "
            "says where on Earth they are."
        )
        return
    if crs["vertical_datum"] is None:
        yield _warning(
            "The vertical datum is unknown: the CRS does not say what heights count from, so "
            "heights can be compared within this project only."
        )
    if crs["is_ensemble"]:
        yield _warning(
            f"{crs['datum']} stands for several realisations: without the realisation and epoch, "
            "absolute positions are known no better than to ",
            crs.value("ensemble_accuracy_m"),
            " m. Agreement between clouds in this one frame is not affected.",
        )
    else:
        yield Passage(("The epoch of the coordinates is not stated.",), "note")
    if crs["in_area_of_use"] is False:
        yield _warning("The site lies outside the area that this CRS is meant for.")
    if crs["mm_over_100_m"] is not None:
        yield Passage(
            (
                "The map stretches horizontal lengths by ",
                crs.value("mm_over_100_m"),
                " mm over 100 m and heights by nothing. One similarity has one scale and can't "
                "follow both: what is left is part of the residuals, and was not corrected.",
            ),
            "note",
        )


def _warning(*parts: Cell) -> Passage:
    return Passage(parts, "warning")
