"""The similarity in full, and as the plain text that archives ask for."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from scipy.spatial.transform import Rotation

from trigpoint.similarity import principal_spreads
from trigpoint_reporting.blocks import Block, Cell, Passage, Table
from trigpoint_reporting.content.residuals import no_picks
from trigpoint_reporting.evidence import Evidence
from trigpoint_reporting.numbers import Numbers, derived, number_text

METHODS = {
    "ransac": "RANSAC, seeded",
    "exhaustive": "every set of three picks",
    "all": "no consensus: all control picks",
}
AGREES = {True: "yes", False: "NO", None: "not compared"}


def transformation(evidence: Evidence, name: str) -> list[Block]:
    """Return scale, rotation and position, the matrix, how it was found, and how to apply it."""
    numbers = Numbers(evidence.results)
    found = numbers.below("reconstructions", name)
    if found["alignment"] is None:
        return [no_picks(name)]
    alignment = found.below("alignment")
    return [
        Table(
            f"{name}: the similarity, target = s R source + t",
            ("Parameter", "x", "y", "z"),
            list(_parameters(found)),
            tuple(_checks(alignment)),
        ),
        Table(
            f"{name}: the same as one matrix",
            ("Row", "x", "y", "z", "1"),
            [(f"{k + 1}", *(alignment.value("matrix", k, m) for m in range(4))) for k in range(4)],
            (
                f"Plain text, full precision: transform/{name}_matrix.txt (four rows of four "
                f"numbers, target_from_source); with all settings: transform/{name}.json.",
            ),
        ),
        Table(
            f"{name}: how the picks were chosen",
            ("Setting", "Value"),
            list(_consensus(evidence, name, alignment)),
        ),
        Table(
            f"{name}: scan registration metadata, as an archive asks for it",
            ("Item", "Value"),
            list(_registration(evidence, name, alignment)),
        ),
        Passage((f"To apply it: trigpoint apply transform/{name}.json IN OUT",)),
    ]


def _parameters(found: Numbers) -> Iterator[tuple[Cell, ...]]:
    alignment = found.below("alignment")
    rotation = Rotation.from_matrix(np.array(alignment["rotation"]))
    vector = rotation.as_rotvec()
    angle = float(np.linalg.norm(vector))
    axis = vector / angle if angle else np.array([0.0, 0.0, 1.0])
    quaternion = rotation.as_quat()
    quaternion = quaternion * (1 if quaternion[3] >= 0 else -1)
    yield "Scale s", alignment.value("scale"), "", ""
    if found["reliability"]["scale_low"] is not None:
        low, high = (found.value("reliability", key) for key in ("scale_low", "scale_high"))
        yield "Scale, 95 % from, to", low, high, ""
    for k in range(3):
        yield f"Rotation R, row {k + 1}", *(alignment.value("rotation", k, m) for m in range(3))
    yield "Translation t (m)", *(alignment.value("translation", k) for k in range(3))
    yield "Axis of rotation", *(derived(float(each), 6) for each in axis)
    yield "Angle of rotation (°)", derived(float(np.degrees(angle)), 6), "", ""
    yield "Quaternion, vector part", *(derived(float(each), 9) for each in quaternion[:3])
    yield "Quaternion, scalar part", derived(float(quaternion[3]), 9), "", ""


def _checks(alignment: Numbers) -> Iterator[Cell]:
    rotation = np.array(alignment["rotation"])
    skew = float(np.abs(rotation @ rotation.T - np.eye(3)).max())
    yield "det R = "
    yield derived(float(np.linalg.det(rotation)), 9)
    yield "; R Rᵀ differs from the identity by at most "
    yield derived(skew, 12)
    yield ". Printed rounded; files hold all digits."


def _consensus(evidence: Evidence, name: str, alignment: Numbers) -> Iterator[tuple[Cell, Cell]]:
    yield "Method", METHODS[alignment["method"]]
    if alignment["method"] == "ransac":
        yield "Seed", alignment.value("seed")
    if alignment["method"] != "all":
        yield "Inlier threshold (m)", alignment.value("threshold_m")
        yield "Sets of three tried", alignment.value("trials")
        yield "Degenerate sets skipped", alignment.value("degenerate_trials")
        yield "Trying every set of three agrees", AGREES[alignment["exhaustive_agrees"]]
    yield "Control picks", number_text(len(alignment["residuals"]))
    yield "Control picks used", alignment.value("n")
    yield "Control picks rejected", number_text(len(alignment["outliers"]))
    yield "Weighted by stated sigmas", "yes" if alignment["weighted"] else "no"
    if (evidence.folder / "data" / f"correspondences-{name}.csv").is_file():
        picks = evidence.table(f"correspondences-{name}")
        used = picks[picks["id"].isin(alignment["inliers"])]
        if len(used) > 1:
            places = used[["target_x", "target_y", "target_z"]].to_numpy(np.float64)
            spreads = principal_spreads(places)
            for word, spread in zip(("Largest", "Middle", "Smallest"), spreads, strict=True):
                yield f"{word} spread of the picks used (m)", derived(float(spread), 3)


def _registration(evidence: Evidence, name: str, alignment: Numbers) -> Iterator[tuple[Cell, Cell]]:
    numbers = Numbers(evidence.results)
    given = [row for row in numbers.rows("inputs") if row["name"] == name]
    yield "Name of registered dataset", name
    cloud = next((row for row in given if row["points"] is not None), None)
    if cloud is not None:
        yield "File", cloud["path"]
        yield "Total number of points", cloud.value("points")
    yield (
        "Registration method",
        "one seven-parameter similarity (Umeyama 1991), picked correspondences",
    )
    yield "Registered to", evidence.results["project"]["settings"]["reference"]["name"]
    yield "Coordinate system", evidence.results["crs"]["name"]
    yield "Global registration error, total RMS (m)", alignment.value("rmse_m")
    yield "The same by degrees of freedom (m)", alignment.value("rmse_dof_m")
    yield "Matrix", f"transform/{name}_matrix.txt"
