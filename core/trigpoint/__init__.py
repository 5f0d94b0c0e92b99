"""trigpoint: one similarity between a neural cloud and a geodetic frame, and what it is worth."""

from trigpoint.alignment import Alignment, align
from trigpoint.cautions import Caution
from trigpoint.cloud import PointCloud
from trigpoint.comparison import Comparison, compare
from trigpoint.consensus import Consensus, exhaustive, ransac
from trigpoint.crossvalidation import LeaveOneOut, leave_one_out
from trigpoint.errors import TrigpointError
from trigpoint.files import describe, read, stream, write
from trigpoint.picks import Picks, read_picks, write_picks
from trigpoint.pipeline import audit
from trigpoint.project import Project, read_project
from trigpoint.record import Audit
from trigpoint.refinement import Refinement, icp
from trigpoint.reliability import Reliability, assess
from trigpoint.similarity import Similarity, umeyama

# Literal: inside QGIS no package metadata says it.
__version__ = "0.1.0"

__all__ = [
    "Alignment",
    "Audit",
    "Caution",
    "Comparison",
    "Consensus",
    "LeaveOneOut",
    "Picks",
    "PointCloud",
    "Project",
    "Refinement",
    "Reliability",
    "Similarity",
    "TrigpointError",
    "align",
    "assess",
    "audit",
    "compare",
    "describe",
    "exhaustive",
    "icp",
    "leave_one_out",
    "ransac",
    "read",
    "read_picks",
    "read_project",
    "stream",
    "umeyama",
    "write",
    "write_picks",
]
