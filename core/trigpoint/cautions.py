"""Cautions: doubts that do not stop the work, in a fixed vocabulary of codes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, get_args

Code = Literal[
    "crs_missing",  # a cloud that should have a CRS has none
    "crs_doubtful",  # what the header says does not fit its coordinates
    "crs_conflict",  # two records of one file disagree
    "vertical_datum_unknown",
    "datum_ensemble",  # the datum is known only to its ensemble's accuracy
    "grid_scale",  # the map grid is not true to length at the site
    "units_converted",  # feet became metres
    "coordinates_coarse",  # stored with steps too large for the work
    "points_dropped",  # NaN or infinite points left out
    "attribute_dropped",  # an attribute that the format written can't hold
    "picks_equal",  # two picks are the same place
    "picks_swapped",  # sources look georeferenced, targets do not
    "picks_few",  # too few for the statistics that were asked for
    "picks_coplanar",
    "picks_mirrored",
    "picks_rejected",  # the consensus left some control picks out
    "consensus_disagrees",  # sampled and exhaustive consensus differ
    "consensus_ambiguous",  # another consensus of the same size exists
    "fold_failed",  # leave-one-out impossible without some pick
    "weak_geometry",
    "blunder_suspected",
    "sigmas_doubtful",  # stated with some picks only, or the residuals contradict them
    "repeats_disagree",  # those who picked the same places differ by more than chance
    "source_noise_dominates",  # picking in the source frame dominates the error
    "threshold_below_voxel",
    "zone_empty",
    "region_mostly_empty",  # the region crop left little of a reconstruction
    "region_leaves_out_reference",  # reconstructions are cropped where the reference has points
    "blocks_few",  # too small an area for an interval
    "raw_not_measured",  # too many points for unthinned shares
    "icp_not_retained",
    "icp_not_converged",  # it was still moving when its iterations ran out
    "cross_check_disagrees",
    "report_not_made",  # what reports need is not installed
    "pdf_not_made",  # the system lacks what the report's PDF needs
    "letters_without_font",  # the report's fonts lack letters that a name has
]

CODES: frozenset[str] = frozenset(get_args(Code))


@dataclass(frozen=True, slots=True)
class Caution:
    """A doubt about an input or a result.

    Attributes
    ----------
    code : str
        One of `CODES`: stable, for machines.
    message : str
        One sentence with the numbers found, for people.
    """

    code: Code
    message: str
