"""Every figure of the report, through one door.

Each takes the evidence, and the name of a reconstruction where it is about one. It returns a
picture whose alternative text states the finding, or a passage that says why there is none.
"""

from trigpoint_reporting.curves import (
    accuracy_by_zone,
    accuracy_curves,
    completeness_by_zone,
    completeness_curves,
)
from trigpoint_reporting.elevations import (
    colour_elevations,
    distance_elevations,
    missing_elevations,
    readme_picture,
)
from trigpoint_reporting.perspective import perspective_views
from trigpoint_reporting.pick_figures import (
    icp_before_after,
    leave_one_out_errors,
    pick_reliability,
    pose_uncertainty,
    scale_sensitivity,
)
from trigpoint_reporting.residual_figure import residual_vectors

# Of one reconstruction: (evidence, name).
OF_ONE = (
    residual_vectors,
    leave_one_out_errors,
    scale_sensitivity,
    pick_reliability,
    pose_uncertainty,
    icp_before_after,
    distance_elevations,
    missing_elevations,
    colour_elevations,
)
# Of all of them together: (evidence).
OF_ALL = (
    accuracy_curves,
    accuracy_by_zone,
    completeness_curves,
    completeness_by_zone,
    readme_picture,
    perspective_views,
)
