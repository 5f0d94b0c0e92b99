"""What goes wrong, as errors that stop the work.

::

    TrigpointError
    ├── CloudError            (ValueError)   a cloud file can't be read, or holds what can't be used
    ├── CrsError              (ValueError)   a coordinate reference system unfit for metric work
    ├── PicksError            (ValueError)   a pick file is wrong
    ├── DegeneratePicksError  (ValueError)   the picks do not pin down a similarity
    ├── ConsensusError        (ValueError)   no three picks agree
    ├── SimilarityError       (ValueError)   a similarity file holds none
    ├── RegionError           (ValueError)   the evaluation region or its zones are unusable
    ├── RefinementError       (ValueError)   ICP did nothing, or had nothing to work on
    ├── SettingError          (ValueError)   a setting is out of its range
    ├── ProjectError          (ValueError)   a project file is wrong
    └── MissingPackageError   (ImportError)  an optional package is needed here

Every message says what is wrong, the numbers found, and what would do.
"""

from __future__ import annotations


class TrigpointError(Exception):
    """Root of every error that trigpoint raises on purpose; `code` names it to machines."""

    code = "error"


class CloudError(TrigpointError, ValueError):
    """A cloud file can't be read, or holds what can't be used."""

    code = "cloud"


class CrsError(TrigpointError, ValueError):
    """A coordinate reference system is unfit for metric work."""

    code = "crs"


class PicksError(TrigpointError, ValueError):
    """A pick file is wrong."""

    code = "picks"


class DegeneratePicksError(TrigpointError, ValueError):
    """The picks do not pin down a similarity."""

    code = "degenerate_picks"


class ConsensusError(TrigpointError, ValueError):
    """No three picks agree on a similarity."""

    code = "no_consensus"


class SimilarityError(TrigpointError, ValueError):
    """A similarity file holds none."""

    code = "similarity"


class RegionError(TrigpointError, ValueError):
    """The evaluation region or its zones are unusable."""

    code = "region"


class RefinementError(TrigpointError, ValueError):
    """ICP did nothing, or had nothing to work on."""

    code = "refinement"


class SettingError(TrigpointError, ValueError):
    """A setting is out of its range."""

    code = "setting"


class ProjectError(TrigpointError, ValueError):
    """A project file is wrong."""

    code = "project"


class MissingPackageError(TrigpointError, ImportError):
    """An optional package is needed here and is not installed."""

    code = "missing_package"
