"""trigpoint: one similarity between a neural cloud and a geodetic frame, and what it is worth."""

from trigpoint.cautions import Caution
from trigpoint.cloud import PointCloud
from trigpoint.errors import TrigpointError
from trigpoint.similarity import Similarity, umeyama

__version__ = "0.1.0"

__all__ = ["Caution", "PointCloud", "Similarity", "TrigpointError", "umeyama"]
