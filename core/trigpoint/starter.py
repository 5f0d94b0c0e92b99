"""A new project's folder: a commented project.toml, an empty picks.csv, and where things go."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path

from trigpoint.canonical import write_text
from trigpoint.entries import LONGEST
from trigpoint.errors import ProjectError

PROJECT = """\
# A trigpoint project. Paths are relative to this file and stay in its folder, or are absolute.
# Run it with: trigpoint audit project.toml

[project]
id = "my-building"            # becomes the name of the bundle
title = ""
site = ""
client = ""
surveyor = ""
organisation = ""
purpose = ""
limitations = ""              # in a person's words; printed in the report
status = "draft"              # draft or issued; what is issued is never overwritten
revision = 1
# date = 2026-09-21           # of the report; an issued one needs it

[reference]                   # the georeferenced cloud that everything is measured against
path = "reference.laz"
name = "ALS"
crs = ""                      # assigned, never reprojected; empty: what the file says
vertical_crs = ""             # such as EPSG:5703; empty: what the file says
captured = ""
# accuracy_m = 0.05           # and where that number comes from:
accuracy_source = ""
region = ""                   # a polygon file; empty: the reference's extent and the margin

[[reconstruction]]            # a cloud in its own frame has picks
name = "nerf"
kind = "neural"               # neural or photogrammetry
path = "nerf.ply"
picks = "picks.csv"
picks_repeated = []           # more files with the same ids, picked again: they give the sigmas

# [[reconstruction]]          # a cloud that is already in the reference's CRS has none
# name = "sfm"
# kind = "photogrammetry"
# path = "sfm.laz"

[alignment]
method = "ransac"             # ransac, exhaustive (every set of three picks), or all (no consensus)
threshold_m = 0.50            # a pick is an inlier within this distance
trials = 10000
seed = 42
weighted = false              # true: weight by the picks' sigmas
sigma = false                 # true: the georeferenced LAZ holds each point's sigma_e, _n and _h

[comparison]
voxel_m = 0.10                # 0: no thinning
within_m = [0.05, 0.10, 0.20]
zones = [0.33, 0.66]          # cuts of the reference's height range
margin_m = 1.0                # around the reference's extent; "none": no crop
icp = true                    # try rigid ICP, and say whether it helps
intervals = true

# [[cross_check]]             # two points of the neural cloud a known length apart; enters no fit
# kind = "scale_bar"
# from = [0, 0, 0]
# to = [1, 0, 0]
# length_m = 3.2
# sigma_m = 0.005

# [[cross_check]]             # a direction of the neural cloud that is known to point up
# kind = "up_direction"
# up = [0, 0, 1]
# sigma_deg = 0.2

# [[cross_check]]             # camera centres of the neural cloud, and where GNSS had them
# kind = "camera_positions"
# source = [[0, 0, 0], [1, 0, 0]]
# target_m = [[741000.0, 4279000.0, 180.0], [741003.2, 4279000.0, 180.0]]
# sigma_m = [0.02, 0.02, 0.04]

# [[limit]]                   # your own limits; with none the verdict is NOT TESTED
# quantity = "loocv.rmse_m"   # a number of results.json, below its reconstruction
# of = "nerf"
# max = 0.25                  # or min
# source = "brief, clause 4"
"""

PICKS = (
    "id,source_x,source_y,source_z,target_x,target_y,target_z,role,sigma_source,sigma_target,note\n"
)


def project_text(changes: Mapping[str, str]) -> str:
    """Return the text of a new project.toml with some of its lines changed.

    Parameters
    ----------
    changes : mapping of str to str
        What a line holds before its comment, and what it is to hold instead; the comment stays.

    Examples
    --------
    >>> print(project_text({'id = "my-building"': 'id = "tower"'}).splitlines()[4])
    id = "tower"                  # becomes the name of the bundle
    """
    text = PROJECT
    for old, new in changes.items():
        before, found, after = text.partition(f"\n{old}")
        if not found:
            message = f"No line of a new project begins with {old!r}."
            raise ValueError(message)
        # The comment keeps its column.
        room = len(after) - len(after.lstrip(" "))
        spaces = " " * max(room + len(old) - len(new), 1) if room else ""
        text = f"{before}\n{new}{spaces}{after[room:]}"
    return text


def start_project(folder: str | Path) -> tuple[Path, ...]:
    """Write the files of a new project into a folder, and say which.

    The project takes the folder's name, in letters that every system can write.

    Raises
    ------
    ProjectError
        If one of them is already there: nothing is overwritten.
    """
    folder = Path(folder)
    name = re.sub("[^A-Za-z0-9._-]+", "-", folder.absolute().name).strip("._-")[:LONGEST]
    text = project_text({'id = "my-building"': f'id = "{name}"'}) if name else PROJECT
    written = {folder / "project.toml": text, folder / "picks.csv": PICKS}
    for path in written:
        if path.exists():
            message = f"{path} is already there; a new project needs a folder without one."
            raise ProjectError(message)
    folder.mkdir(parents=True, exist_ok=True)
    for path, text in written.items():
        write_text(path, text)
    return tuple(written)
