"""The report's sections in their order, each with its figures."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from trigpoint_reporting import curves, pick_figures
from trigpoint_reporting import elevations as drawn
from trigpoint_reporting.blocks import Block, Passage, Picture
from trigpoint_reporting.content.conduct import method
from trigpoint_reporting.content.distances import accuracy, completeness
from trigpoint_reporting.content.doubts import limitations
from trigpoint_reporting.content.frame import coordinate_reference
from trigpoint_reporting.content.front import result
from trigpoint_reporting.content.glossary import glossary
from trigpoint_reporting.content.hypothesis import icp
from trigpoint_reporting.content.pairs import paired
from trigpoint_reporting.content.provenance import provenance
from trigpoint_reporting.content.residuals import picks
from trigpoint_reporting.content.scope import purpose
from trigpoint_reporting.content.sources import inputs
from trigpoint_reporting.content.transform import transformation
from trigpoint_reporting.content.validity import validation
from trigpoint_reporting.content.views import elevations, views
from trigpoint_reporting.content.worth import reliability
from trigpoint_reporting.perspective import perspective_views
from trigpoint_reporting.residual_figure import residual_vectors
from trigpoint_reporting.viewer import viewer_html


@dataclass(frozen=True, slots=True)
class Section:
    """One section.

    Attributes
    ----------
    id : str
        Its anchor.
    title : str
    function : callable
        From the evidence, and a reconstruction's name where the section is about each, to blocks.
    per_reconstruction : bool
    figures : tuple of callable
        From the evidence, or the evidence and a name, to a picture or a passage in its place; the
        viewer is HTML.
    """

    id: str
    title: str
    function: Callable[..., list[Block]]
    per_reconstruction: bool = False
    figures: tuple[Callable[..., Picture | Passage | str], ...] = ()


SECTIONS = (
    Section("result", "Result", result),
    Section("purpose", "Purpose, scope and independence", purpose),
    Section("inputs", "Inputs", inputs),
    Section("coordinate-reference", "Coordinate reference", coordinate_reference),
    Section("picks", "Picks and residuals", picks, True, (residual_vectors,)),
    Section("transformation", "Transformation", transformation, True),
    Section(
        "validation",
        "Validation",
        validation,
        True,
        (pick_figures.leave_one_out_errors, pick_figures.scale_sensitivity),
    ),
    Section(
        "reliability",
        "Reliability",
        reliability,
        True,
        (pick_figures.pick_reliability, pick_figures.pose_uncertainty),
    ),
    Section("icp", "ICP as a tested hypothesis", icp, True, (pick_figures.icp_before_after,)),
    Section(
        "accuracy",
        "Accuracy by zone",
        accuracy,
        True,
        (curves.accuracy_curves, curves.accuracy_by_zone),
    ),
    Section(
        "completeness",
        "Completeness by zone",
        completeness,
        True,
        (curves.completeness_curves, curves.completeness_by_zone),
    ),
    Section("paired", "Reconstructions compared", paired),
    Section(
        "elevations",
        "Elevations",
        elevations,
        False,
        (
            drawn.readme_picture,
            drawn.distance_elevations,
            drawn.missing_elevations,
            drawn.colour_elevations,
        ),
    ),
    Section("views", "Views in perspective", views, False, (perspective_views, viewer_html)),
    Section("method", "Method, settings and effects", method),
    Section("limitations", "Limitations and warnings", limitations),
    Section("provenance", "Provenance and reproduction", provenance),
    Section("glossary", "Glossary of statistics", glossary),
)
