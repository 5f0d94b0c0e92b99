"""What every file of a bundle is, and what every column, key and extra dimension in it means."""

from __future__ import annotations

from collections.abc import Mapping
from fnmatch import fnmatchcase

# By pattern, in the order in which a reader wants them; NAME is a reconstruction's. The first
# pattern that fits decides.
FILES: Mapping[str, str] = {
    "README.txt": "what you are reading",
    "report.html": "the report, in one page that needs nothing else",
    "report.pdf": "the report for paper and archive (PDF/A)",
    "audit.ipynb": "the report as a notebook, with the code that made it",
    "audit.py": "the same code as a script",
    "figures/*": "a picture of the report",
    "data/results.json": "every finding, number and setting; what the report prints",
    "data/results.schema.json": "which keys results.json has, as a JSON Schema",
    "data/rounding.json": "how many decimals the report prints of which number",
    "data/changes.json": "every value that differs from the revision before",
    "data/picks-*.csv": "residuals of the control picks",
    "data/checks-*.csv": "errors at the check picks, which the fit did not use",
    "data/loocv-*.csv": "leave-one-out: every used pick predicted from the others",
    "data/reliability-*.csv": "how well each used pick is checked by the others",
    "data/next-picks-*.csv": "where one more pick would help most, best first",
    "data/correspondences-*.csv": "coordinates of the picks as they were read, to the last bit",
    "data/repeats-*.csv": "coordinates of places that were picked more than once",
    "data/zones-*.csv": "statistics of the distances, by zone of height",
    "data/within-*.csv": "shares of the distances within thresholds, by zone of height",
    "data/distances-*.npz": "every distance, with the height that gives its zone (NumPy)",
    "transform/*_matrix.txt": "the similarity as a 4 x 4 matrix, from source to target",
    "transform/*.json": "the similarity with its picks and residuals, for trigpoint apply",
    "clouds/*-georeferenced.laz": "the cloud carried into the frame, with all its attributes",
    "clouds/*-accuracy.laz": "the thinned cloud, each point with its distance to the reference",
    "clouds/*-completeness.laz": "the thinned reference, each point with its distance to the cloud",
    "quality/iso19157.json": "quality elements in the terms of ISO 19157",
    "config/project.toml": "the project as it was run, every setting stated",
    "config/picks-*": "the pick file as it was given",
    "config/repicks-*": "a file of repeated picks as it was given",
    "env/requirements.lock": "every package, pinned, for pip install -r",
    "env/platform.json": "Python, system and linear algebra that it was run with",
    "env/source.txt": "commit of trigpoint's source, where it ran from a git checkout",
    "verify/verify.py": "recomputes the numbers; needs Python and NumPy alone",
    "ro-crate-metadata.json": "who made what from what, for machines (RO-Crate)",
    "record-sha256.txt": "SHA-256 of what the report rests on; the report states its own",
    "manifest-sha256.txt": "SHA-256 of every other file",
}

_ERRORS = {
    "dx_m": "easting of the target less that of the transformed pick, m",
    "dy_m": "the same of northing, m",
    "dz_m": "the same of height, m",
    "d_m": "length of the three in space, m",
}
_PLACE = {
    "stage": "delivered: under the similarity alone; after_icp: after the ICP that was tried",
    "direction": "accuracy: from the cloud to the reference; completeness: the other way",
    "zone": "zone of height; all: every zone together",
}
_BOUNDS = "of the 95 % interval; empty where none was worked out"
_ID = {"id": "name of the pick"}
_DISTANCE = {
    "distance_m": "distance to the nearest point of the other cloud as delivered, m; NaN: none",
    "distance_after_icp_m": "the same after the ICP that was tried, m; NaN: none",
}

# What stands in the files of a pattern: columns of CSV, keys of NPZ, extra dimensions of LAZ.
NAMES: Mapping[str, Mapping[str, str]] = {
    "data/picks-*.csv": {
        **_ID,
        "role": "control",
        **_ERRORS,
        "used": "True: fitted to; False: rejected by the consensus",
    },
    "data/checks-*.csv": {**_ID, "role": "check", **_ERRORS},
    "data/loocv-*.csv": {
        "id": "name of the pick that was left out",
        **_ERRORS,
        "scale": "of the fit without it; empty, as all below, where none was possible",
        "scale_change_pct": "change of scale against the fit to all, %",
        "rotation_change_deg": "angle between the two rotations, degrees",
        "shift_m": "how far the centroid of the used picks moves, m",
        "inliers_changed": "True: without it other picks are used; empty: not searched",
    },
    "data/reliability-*.csv": {
        **_ID,
        "redundancy": "how far the other picks check it: 0 not at all, 3 wholly",
        "standardised": "length of its residual in standard deviations of its own",
        "p_value": "chance of so large a residual, were the pick good",
        "suspected": "True: p_value is below 0.05 over the number of picks",
        "detectable_blunder_m": "error that would be found at alpha 0.001, power 0.80, m; "
        "empty: none would",
    },
    "data/next-picks-*.csv": {
        "x": "easting, m",
        "y": "northing, m",
        "z": "height, m",
        "gain_m": "by how much a pick here lowers the largest sigma over the reference, m",
    },
    "data/correspondences-*.csv": {
        **_ID,
        "role": "control: may be fitted to; check: never; off: not used at all",
        "source_x": "x in the reconstruction's own frame and units (m where it has a CRS)",
        "source_y": "y, likewise",
        "source_z": "z, likewise",
        "target_x": "easting in the reference, m",
        "target_y": "northing in the reference, m",
        "target_z": "height in the reference, m",
        "sigma_source": "stated standard deviation per axis, in units of the source; empty: none",
        "sigma_target": "stated standard deviation per axis, m; empty: none",
        "weight": "in a weighted fit; empty: not used, or all that are used count alike",
    },
    "data/repeats-*.csv": {
        "frame": "source: picked in the reconstruction; target: in the reference",
        "session": "number of the session; the first holds what was fitted to",
        "id": "name of the pick",
        "x": "x in that frame, in its units; easting, m, in the target",
        "y": "y, likewise; northing, m, in the target",
        "z": "z, likewise; height, m, in the target",
    },
    "data/zones-*.csv": {
        **_PLACE,
        "n": "number of distances",
        "mean_m": "mean distance, m",
        "median_m": "median distance, m",
        "rmse_m": "root mean square distance, m",
        "rmse_low_m": f"lower end of rmse_m, m, {_BOUNDS}",
        "rmse_high_m": f"upper end of rmse_m, m, {_BOUNDS}",
        "nmad_m": "1.4826 times the median absolute deviation from the median, m",
        "p95_m": "95th percentile, m",
        "max_m": "largest distance, m",
        "floor_rmse_m": "rmse_m that two halves of the reference show against each other, m",
    },
    "data/within-*.csv": {
        **_PLACE,
        "threshold_m": "threshold, m",
        "pct": "share of the distances that are at most the threshold, %",
        "low_pct": f"lower end, %, {_BOUNDS}",
        "high_pct": f"upper end, %, {_BOUNDS}",
        "pose_low_pct": "low_pct from the similarity's uncertainty alone, %",
        "pose_high_pct": "high_pct from the similarity's uncertainty alone, %",
        "sampling_low_pct": "low_pct from resampled blocks of the building alone, %",
        "sampling_high_pct": "high_pct from resampled blocks of the building alone, %",
        "raw_pct": "pct before the clouds were thinned, %; empty: not measured",
    },
    "data/distances-*.npz": {
        "delivered_accuracy_m": "distances from the cloud to the reference, m",
        "delivered_accuracy_height_m": "heights of the points that they start from, m",
        "delivered_completeness_m": "distances from the reference to the cloud, m",
        "delivered_completeness_height_m": "heights of the points that they start from, m",
        "after_icp_accuracy_m": "delivered_accuracy_m after the ICP that was tried, m",
        "after_icp_accuracy_height_m": "heights of the points that they start from, m",
        "after_icp_completeness_m": "delivered_completeness_m after the ICP that was tried, m",
        "after_icp_completeness_height_m": "heights of the points that they start from, m",
        "zone_edges_m": "heights that bound the zones, lowest first, m",
    },
    "clouds/*-georeferenced.laz": {
        "sigma_e": "standard deviation of the easting that the similarity's own gives, m",
        "sigma_n": "the same of the northing, m",
        "sigma_h": "the same of the height, m",
    },
    "clouds/*-accuracy.laz": _DISTANCE,
    "clouds/*-completeness.laz": _DISTANCE,
}


def describe_file(name: str) -> str:
    """Return what a file of a bundle is; empty for one that no bundle has.

    Examples
    --------
    >>> describe_file("data/checks-nerf.csv")
    'errors at the check picks, which the fit did not use'
    """
    found = (text for pattern, text in FILES.items() if fnmatchcase(name, pattern))
    return next(found, "")
