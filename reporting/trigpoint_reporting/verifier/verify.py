"""Recompute what a trigpoint bundle states, from the evidence in the bundle.

    python verify/verify.py [BUNDLE] [--table]

A second implementation of the method, apart from trigpoint: it needs Python 3.11 and NumPy and
nothing else. Exit code 0: everything holds. 1: something differs, and is named. 2: this is no
bundle that can be checked.

What holds shows that the bundle agrees with itself: with its hashes, and its numbers with the
picks and distances in it. It does not show who made it; for that, compare the hashes that it
prints with ones kept elsewhere: the record's with the one in an issued report, the manifest's,
which covers the report too, with one noted when it was issued. Without Python,
`sha256sum -c manifest-sha256.txt` checks the hashes.
"""

from __future__ import annotations

import base64
import csv
import hashlib
import html
import json
import math
import re
import sys
import tomllib
import zipfile
import zlib
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

SCHEMA = "trigpoint-results/1"
Array = NDArray[np.float64]
Json = dict[str, Any]

# What results.json rounds to.
LENGTH_STEP, OTHER_STEP = 1e-9, 1e-12
# A bundle's arrays may unpack to this many bytes, no more: they come from strangers.
MOST_ARRAY_BYTES = 16 * 2**30

NOT_RECOMPUTED = {
    "the searches (ransac, exhaustive)": "which picks agree is checked against the threshold; that "
    "no larger set agrees is not searched for again",
    "loocv.rmse_procedure_m, inliers_changed": "they repeat the search in every fold",
    "icp": "an iteration over whole clouds; only its verdict is drawn again from its numbers",
    "intervals of shares and distances, perfect": "resampled (Monte Carlo); what paired concludes "
    "from them is drawn again",
    "floor_rmse_m, raw_pct": "measured on points before thinning, which the bundle does not hold",
    "reliability.zones, next_picks, geometry": "they need the reference cloud",
    "crs, inputs' formats, points and extents": "read from the inputs' headers",
    "what data/changes.json has from before": "it stands in the bundle of the revision before; "
    "what it has from after is compared with results.json",
    "clouds/, figures/, the pages of report.pdf": "derived; of the PDF what it embeds is "
    "compared, and the whole report is made again by trigpoint verify --again",
}


class UnreadableError(Exception):
    """There is no bundle here that can be checked."""


# --- what was found ---------------------------------------------------------------------------


@dataclass
class Row:
    """One comparison."""

    quantity: str
    stored: Any
    recomputed: Any
    tolerance: float
    ok: bool


@dataclass
class Report:
    """Every comparison, in order, and the hashes of the bundle's record and manifest."""

    rows: list[Row] = field(default_factory=list)
    record: str = ""
    manifest: str = ""
    notes: list[str] = field(default_factory=list)

    @property
    def differences(self) -> list[Row]:
        """The comparisons that do not hold."""
        return [row for row in self.rows if not row.ok]

    def equal(self, quantity: str, stored: Any, recomputed: Any) -> None:
        """Compare what must be the same exactly."""
        self.rows.append(Row(quantity, stored, recomputed, 0.0, stored == recomputed))

    def close(self, quantity: str, stored: Any, recomputed: Any, tolerance: float) -> None:
        """Compare numbers, or nested lists of them; what is missing is null, and not a number."""
        if isinstance(stored, list):
            found = list(recomputed)
            if len(found) != len(stored):
                self.equal(f"{quantity} (how many)", len(stored), len(found))
            for k, (one, other) in enumerate(zip(stored, found, strict=False)):
                self.close(f"{quantity}[{k}]", one, other, tolerance)
            return
        own = None if recomputed is None or not math.isfinite(recomputed) else float(recomputed)
        if own is None or not _is_number(stored):
            ok = own is None and stored is None
        else:
            ok = abs(stored - own) <= tolerance
        self.rows.append(Row(quantity, stored, own, float(tolerance), bool(ok)))

    def holds(self, quantity: str, ok: bool, *, stored: Any = "", expected: Any = "") -> None:
        """Record whether a statement holds."""
        self.rows.append(Row(quantity, stored, expected, 0.0, bool(ok)))


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


# --- reading ----------------------------------------------------------------------------------


def _reason(error: Exception) -> str:
    """Say why reading failed, without the path of this machine that the system's message has."""
    return (isinstance(error, OSError) and error.strerror) or str(error)


def read_json(path: Path) -> Json:
    """Read a JSON object; NaN and infinity are not JSON."""

    def refuse(name: str) -> None:
        message = f"{name} is not JSON"
        raise ValueError(message)

    try:
        stored = json.loads(path.read_text("utf-8"), parse_constant=refuse)
    except (OSError, ValueError, RecursionError) as error:
        message = f"{path.name} can't be read: {_reason(error)}"
        raise UnreadableError(message) from error
    if not isinstance(stored, dict):
        message = f"{path.name} holds no object."
        raise UnreadableError(message)
    return stored


def read_csv(path: Path) -> list[dict[str, str]]:
    """Read a CSV as rows of text by column."""
    try:
        with path.open(encoding="utf-8", newline="") as file:
            return list(csv.DictReader(file))
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        message = f"{path.name} can't be read: {_reason(error)}"
        raise UnreadableError(message) from error


def read_arrays(path: Path) -> dict[str, Array]:
    """Read the arrays of an npz file, never its pickles."""
    try:
        with zipfile.ZipFile(path) as archive:
            size = sum(entry.file_size for entry in archive.infolist())
        if size > MOST_ARRAY_BYTES:
            message = f"{path.name} unpacks to {size:,} bytes."
            raise UnreadableError(message)
        with np.load(path, allow_pickle=False) as stored:
            return {key: np.asarray(stored[key], np.float64).ravel() for key in stored.files}
    except (OSError, ValueError, zipfile.BadZipFile, zlib.error, EOFError) as error:
        message = f"{path.name} can't be read: {_reason(error)}"
        raise UnreadableError(message) from error


def sha256(path: Path) -> str:
    """Return a file's SHA-256, in hexadecimal."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


# --- special functions --------------------------------------------------------------------------
# Numerical Recipes, chapter 6: a series where it converges fast, a continued fraction elsewhere.


def gamma_upper(a: float, x: float) -> float:
    """Return the regularised upper incomplete gamma function Q(a, x)."""
    if x <= 0:
        return 1.0
    front = math.exp(a * math.log(x) - x - math.lgamma(a))
    if x < a + 1:
        term = total = 1 / a
        for k in range(1, 100_000):
            term *= x / (a + k)
            total += term
            if term < total * 1e-17:
                break
        return 1 - front * total

    def step(k: int) -> tuple[float, float]:
        return -k * (k - a), x + 2 * k + 1 - a

    return front / _continued(x + 1 - a, step)


def beta_lower(a: float, b: float, x: float, y: float) -> float:
    """Return the regularised incomplete beta function I_x(a, b); y is 1 - x, unrounded."""
    if x <= 0 or y <= 0:
        return float(y <= 0)
    if x > (a + 1) / (a + b + 2):
        return 1 - beta_lower(b, a, y, x)
    front = math.exp(a * math.log(x) + b * math.log1p(-x) - _log_beta(a, b))
    return front / (a * _continued(1.0, lambda k: (_beta_step(a, b, x, k), 1.0)))


def _log_beta(a: float, b: float) -> float:
    a, b = min(a, b), max(a, b)
    if b < 50:
        return math.lgamma(a) + math.lgamma(b) - math.lgamma(a + b)

    def rest(x: float) -> float:  # of Stirling's series
        return 1 / (12 * x) - 1 / (360 * x**3) + 1 / (1260 * x**5)

    # The difference of two large logarithms, without taking it.
    grown = (b - 0.5) * math.log1p(a / b) + a * math.log(a + b) - a + rest(a + b) - rest(b)
    return math.lgamma(a) - grown


def _beta_step(a: float, b: float, x: float, k: int) -> float:
    m = k // 2
    if k % 2:
        return -(a + m) * (a + b + m) * x / ((a + 2 * m) * (a + 2 * m + 1))
    return m * (b - m) * x / ((a + 2 * m - 1) * (a + 2 * m))


def _continued(first: float, step: Callable[[int], tuple[float, float]]) -> float:
    """Evaluate ``first + a1 / (b1 + a2 / (b2 + ...))`` by Lentz's method."""
    tiny = 1e-300
    value = first or tiny
    c, d = value, 0.0
    for k in range(1, 100_000):
        a, b = step(k)
        d = 1 / ((b + a * d) or tiny)
        c = (b + a / c) or tiny
        value *= c * d
        if abs(c * d - 1) < 1e-16:
            break
    return value


def chi2_sf(x: float, dof: float) -> float:
    """Return the probability that a chi-square variable exceeds x."""
    return gamma_upper(dof / 2, x / 2)


def f_sf(x: float, top: float, bottom: float) -> float:
    """Return the probability that an F variable exceeds x."""
    whole = bottom + top * x
    return beta_lower(bottom / 2, top / 2, bottom / whole, top * x / whole)


def noncentral_chi2_sf(x: float, dof: float, size: float) -> float:
    """Return the probability that a chi-square variable of this noncentrality exceeds x."""
    half = size / 2
    last = int(half + 40 * math.sqrt(half + 1) + 40)
    weights = (math.exp(k * math.log(half) - half - math.lgamma(k + 1)) for k in range(last))
    return sum(w * gamma_upper(dof / 2 + k, x / 2) for k, w in enumerate(weights))


def solve(falling: Callable[[float], float], wanted: float) -> float:
    """Return where a falling function takes a value, by bisection from 0 up."""
    low, high = 0.0, 1.0
    while falling(high) > wanted:
        high *= 2
    for _ in range(200):
        middle = (low + high) / 2
        low, high = (middle, high) if falling(middle) > wanted else (low, middle)
    return (low + high) / 2


def chi2_quantile(dof: float, tail: float) -> float:
    """Return what a chi-square variable exceeds with this probability."""
    return solve(lambda x: chi2_sf(x, dof), tail)


def t_quantile(dof: float) -> float:
    """Return how many sigmas a two-sided 95 % interval of Student's t spans."""
    return math.sqrt(solve(lambda x: f_sf(x, 1, dof), 0.05))


def normal_quantile() -> float:
    """Return the same for the normal distribution."""
    return math.sqrt(solve(lambda x: chi2_sf(x, 1), 0.05))


@cache
def blunder_noncentrality() -> float:
    """Return lambda for three degrees of freedom, alpha 0.001 and power 0.80: about 21.55."""
    critical = solve(lambda x: chi2_sf(x, 3), 0.001)
    return solve(lambda size: 1 - noncentral_chi2_sf(critical, 3, max(size, 1e-9)), 0.20)


# --- the similarity -------------------------------------------------------------------------------


@dataclass
class Fit:
    """A similarity, and how far rounding may have turned it (rad)."""

    scale: float
    rotation: Array
    translation: Array
    wobble: float

    def __call__(self, points: Array) -> Array:
        """Carry points of shape (n, 3)."""
        turned: Array = np.einsum("ij,nj->ni", self.rotation, points)
        return self.scale * turned + self.translation


def horn(source: Array, target: Array, weights: Array) -> Fit | None:
    """Fit a similarity by Horn's quaternion; None where the points lie on a line.

    Horn (1987), Closed-form solution of absolute orientation using unit quaternions, JOSA A 4(4),
    doi:10.1364/JOSAA.4.000629; the scale is Umeyama's, which minimises the error in the target.
    """
    if len(source) < 3 or on_a_line(source) or on_a_line(target):
        return None
    share = weights / weights.sum()
    middle = [points[0] + share @ (points - points[0]) for points in (source, target)]
    a, b = source - middle[0], target - middle[1]
    s = np.einsum("n,ni,nj->ij", share, a, b)
    skew = np.array([s[1, 2] - s[2, 1], s[2, 0] - s[0, 2], s[0, 1] - s[1, 0]])
    quartic = np.empty((4, 4))
    quartic[0, 0] = np.trace(s)
    quartic[0, 1:] = quartic[1:, 0] = skew
    quartic[1:, 1:] = s + s.T - np.trace(s) * np.eye(3)
    values, vectors = np.linalg.eigh(quartic)
    w, x, y, z = vectors[:, -1]
    rotation = np.array(
        [
            [w * w + x * x - y * y - z * z, 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), w * w - x * x + y * y - z * z, 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), w * w - x * x - y * y + z * z],
        ]
    )
    carried = np.einsum("ij,nj->ni", rotation, a)
    scale = float(np.einsum("n,ni,ni->", share, b, carried) / np.einsum("n,ni,ni->", share, a, a))
    translation = middle[1] - scale * rotation @ middle[0]
    wobble = 1e-15 * values[-1] / max(values[-1] - values[-2], 1e-300)
    return Fit(scale, rotation, translation, float(wobble))


def spreads(points: Array) -> Array:
    """Return the RMS extents of points along their principal axes, largest first."""
    values = np.linalg.svd(points - points.mean(axis=0), compute_uv=False)
    return np.pad(values, (0, 3 - len(values))) / math.sqrt(len(points))


def on_a_line(points: Array) -> bool:
    """Tell whether points spread in one direction only, to within rounding."""
    first, second, _ = spreads(points)
    return bool(second <= max(1e-6 * first, 64 * np.spacing(np.abs(points).max())))


def angle_deg(one: Array, other: Array) -> float:
    """Return the angle between two rotations, exact for small ones too."""
    chord = float(np.linalg.norm(one - other)) / math.sqrt(8)
    return math.degrees(2 * math.asin(min(1.0, chord)))


# --- the adjustment -------------------------------------------------------------------------------


@dataclass
class Adjusted:
    """The fit as a linear problem in ln scale, three rotations and the centroid's position."""

    centroid: Array
    design: Array
    weights: Array
    residuals: Array
    cofactor: Array
    redundancy: Array


def adjust(fit: Fit, source: Array, target: Array, weights: Array) -> Adjusted:
    """Linearise at the fit; weights are scaled to mean 1."""
    weights = weights / weights.mean()
    carried = fit(source)
    centroid = target[0] + (weights / weights.sum()) @ (target - target[0])
    design = motions(carried - centroid)
    cofactor = invert(np.einsum("nia,n,nib->ab", design, weights, design))
    hat = np.einsum("nia,ab,njb,n->nij", design, cofactor, design, weights)
    return Adjusted(centroid, design, weights, target - carried, cofactor, np.eye(3) - hat)


def motions(arms: Array) -> Array:
    """Return how the seven parameters move points at arms (n, 3) from the centroid: (n, 3, 7)."""
    design = np.zeros((len(arms), 3, 7))
    design[:, :, 0] = arms
    design[:, :, 1:4] = np.cross(np.eye(3)[None], arms[:, None, :]).transpose(0, 2, 1)
    design[:, :, 4:] = np.eye(3)
    return design


def invert(normal: Array) -> Array:
    """Invert a normal matrix whose parameters differ in unit."""
    size = 1 / np.sqrt(np.diag(normal))
    inverse: Array = np.linalg.inv(normal * np.outer(size, size)) * np.outer(size, size)
    return inverse


def misfit(adjusted: Adjusted, variances: Array) -> float:
    """Return the weighted sum of squares that the best fit for these variances would leave."""
    root = 1 / np.sqrt(variances)
    rows = (adjusted.design * root[:, None, None]).reshape(-1, 7)
    right = (adjusted.residuals * root[:, None]).ravel()
    size = np.linalg.norm(rows, axis=0)
    shift = np.linalg.lstsq(rows / size, right, rcond=None)[0]
    return float(((right - rows / size @ shift) ** 2).sum())


# --- one reconstruction that has picks ------------------------------------------------------------


@dataclass
class Evidence:
    """The correspondences of one reconstruction."""

    ids: list[str]
    roles: list[str]
    source: Array
    target: Array
    sigma_source: Array
    sigma_target: Array
    weight: Array

    def take(self, which: Sequence[int]) -> Evidence:
        """Keep some of them, by position."""
        rows = list(which)
        return Evidence(
            [self.ids[row] for row in rows],
            [self.roles[row] for row in rows],
            *(
                column[rows]
                for column in (
                    self.source,
                    self.target,
                    self.sigma_source,
                    self.sigma_target,
                    self.weight,
                )
            ),
        )


def read_evidence(path: Path) -> Evidence:
    """Read ``correspondences-<name>.csv``."""
    rows = read_csv(path)

    def column(name: str) -> Array:
        return np.array([float(row[name]) if row[name] else math.nan for row in rows])

    def points(frame: str) -> Array:
        return np.column_stack([column(f"{frame}_{axis}") for axis in "xyz"])

    try:
        ids, roles = [row["id"] for row in rows], [row["role"] for row in rows]
        evidence = Evidence(
            ids,
            roles,
            points("source"),
            points("target"),
            column("sigma_source"),
            column("sigma_target"),
            column("weight"),
        )
    except (KeyError, ValueError, TypeError) as error:
        message = f"{path.name} holds no correspondences: {error}"
        raise UnreadableError(message) from error
    if len(set(ids)) != len(ids) or not np.isfinite([evidence.source, evidence.target]).all():
        message = f"{path.name} names a pick twice, or lacks a coordinate."
        raise UnreadableError(message)
    return evidence


def read_repeats(path: Path) -> dict[str, dict[int, dict[str, Array]]]:
    """Read ``repeats-<name>.csv``: places by frame, session and id; none where there is no file."""
    found: dict[str, dict[int, dict[str, Array]]] = {}
    try:
        for row in read_csv(path) if path.is_file() else []:
            place = np.array([float(row[axis]) for axis in "xyz"])
            session = found.setdefault(row["frame"], {}).setdefault(int(row["session"]), {})
            session[row["id"]] = place
    except (KeyError, ValueError, TypeError) as error:
        message = f"{path.name} holds no repeated picks: {error}"
        raise UnreadableError(message) from error
    return found


def check_alignment(
    report: Report, place: str, stored: Json, evidence: Evidence, settings: Json
) -> None:
    """Refit the similarity, and recompute all that follows from the picks."""
    alignment = stored["alignment"]
    control = evidence.take([k for k, role in enumerate(evidence.roles) if role == "control"])
    kept = [k for k, name in enumerate(control.ids) if name in set(alignment["inliers"])]
    left = [k for k in range(len(control.ids)) if k not in set(kept)]
    at = f"{place}.alignment"
    report.equal(f"{at}.inliers", alignment["inliers"], [control.ids[k] for k in kept])
    report.equal(f"{at}.outliers", alignment["outliers"], [control.ids[k] for k in left])
    used = control.take(kept)
    weights = used.weight if alignment["weighted"] else np.ones(len(kept))
    sound = bool(np.isfinite(weights).all())
    report.holds(f"{at}.weighted: every inlier has its weight", sound)
    fit = horn(used.source, used.target, weights)
    if fit is None:
        report.holds(f"{at}: the inliers pin down a similarity", False)
        return
    step = length_tolerance(control, fit)

    count = len(kept)
    report.equal(f"{at}.n", alignment["n"], count)
    report.equal(f"{at}.dof", alignment["dof"], 3 * count - 7)
    turning = 2 * OTHER_STEP + 8 * fit.wobble
    report.close(f"{at}.scale", alignment["scale"], fit.scale, OTHER_STEP + turning * fit.scale)
    report.close(f"{at}.rotation", alignment["rotation"], fit.rotation.tolist(), turning)
    reach = float(np.abs(used.source).max()) * fit.scale
    report.close(
        f"{at}.translation",
        alignment["translation"],
        fit.translation.tolist(),
        step + turning * reach,
    )
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = fit.scale * fit.rotation, fit.translation
    loose = step + turning * max(reach, fit.scale)
    report.close(f"{at}.matrix", alignment["matrix"], matrix.tolist(), loose)

    residuals = control.target - fit(control.source)
    lengths = np.sqrt((residuals**2).sum(axis=1))
    report.equal(f"{at}.residuals (ids)", [r["id"] for r in alignment["residuals"]], control.ids)
    for k, row in enumerate(alignment["residuals"][: len(control.ids)]):
        here = f"{at}.residuals[{row['id']}]"
        report.equal(f"{here}.used", row["used"], k in kept)
        report.equal(f"{here}.role", row["role"], "control")
        for axis, key in enumerate(("dx_m", "dy_m", "dz_m")):
            report.close(f"{here}.{key}", row[key], residuals[k, axis], step)
        report.close(f"{here}.d_m", row["d_m"], lengths[k], step)
    squares = float((lengths[kept] ** 2).sum())
    report.close(f"{at}.rmse_m", alignment["rmse_m"], math.sqrt(squares / count), step)
    dof_rmse = math.sqrt(squares / (count - 7 / 3))
    report.close(f"{at}.rmse_dof_m", alignment["rmse_dof_m"], dof_rmse, 2 * step)
    report.close(f"{at}.mean_m", alignment["mean_m"], residuals[kept].mean(axis=0).tolist(), step)
    threshold = alignment["threshold_m"]
    if alignment["method"] != "all":
        agree = bool((lengths[kept] <= threshold + step).all())
        # Weights can send the consensus in circles: then a pick within it may be left out.
        apart = alignment["weighted"] or bool((lengths[left] > threshold - step).all())
        report.holds(f"{at}: inliers lie within the threshold, outliers beyond it", agree and apart)
    else:
        report.equal(f"{at}.outliers (method all)", alignment["outliers"], [])

    adjusted = adjust(fit, used.source, used.target, weights)
    check_loocv(report, f"{place}.loocv", stored["loocv"], used, weights, fit, adjusted, step)
    name = place.removeprefix("reconstructions.")
    given = [each for each in settings.get("cross_check", []) if each.get("of", "") in ("", name)]
    accuracy = settings.get("reference", {}).get("accuracy_m")
    check_reliability(report, f"{place}.reliability", stored, used, fit, adjusted, step, given)
    others = evidence.take([k for k, role in enumerate(evidence.roles) if role == "check"])
    check_checks(report, f"{place}.checks", stored["checks"], others, fit, step, accuracy)


def check_repeats(
    report: Report,
    at: str,
    stored: list[Json],
    evidence: Evidence,
    again: dict[str, dict[int, dict[str, Array]]],
) -> None:
    """Recompute the picking sigma from how far picks of one place lie apart."""
    report.equal(f"{at} (frames)", [row["frame"] for row in stored], list(again))
    for row in stored:
        frame, here = row["frame"], f"{at}[{row['frame']}]"
        sessions = list(again.get(frame, {}).values())
        if not sessions:
            continue
        fitted = evidence.source if frame == "source" else evidence.target
        used = {
            name: place
            for name, role, place in zip(evidence.ids, evidence.roles, fitted, strict=True)
            if role != "off"
        }
        same = sessions[0].keys() == used.keys() and all(
            (place == used[name]).all() for name, place in sessions[0].items()
        )
        report.holds(f"{here}: the first session is what was fitted", same)
        places = {
            name: np.array([session[name] for session in sessions if name in session])
            for name in used
        }
        twice = [points for points in places.values() if len(points) > 1]
        report.equal(f"{here}.sessions", row["sessions"], len(sessions))
        report.equal(f"{here}.places", row["places"], len(twice))
        dof = 3 * sum(len(points) - 1 for points in twice)
        report.equal(f"{here}.dof", row["dof"], dof)
        if not dof:
            continue
        step = LENGTH_STEP + 8 * float(np.spacing(np.abs(fitted).max()))
        sigma = math.sqrt(math.fsum(map(_scatter, twice)) / dof)
        report.close(f"{here}.sigma", row["sigma"], sigma, step)
        for key, tail in (("sigma_low", 0.025), ("sigma_high", 0.975)):
            factor = math.sqrt(dof / chi2_quantile(dof, tail))
            report.close(f"{here}.{key}", row[key], sigma * factor, step * factor)
        own = evidence.sigma_source if frame == "source" else evidence.sigma_target
        report.close(f"{here}: the sigma of every pick", own.tolist(), [sigma] * len(own), step)
        whole = [points for points in twice if len(points) == len(sessions)]
        report.close(f"{here}.bias_p_value", row["bias_p_value"], _by_chance(whole), 1e-6)


def _scatter(points: Array) -> float:
    """Return the squares about the mean: those of all differences, over the number of points."""
    return float(((points[:, None] - points) ** 2).sum()) / 2 / len(points)


def _by_chance(places: list[Array]) -> float:
    """Return the probability of sessions this far apart by chance: analysis of variance."""
    count = len(places)
    if count < 2:
        return math.nan
    sessions = len(places[0])
    moved = np.array([points - points[0] for points in places])
    between = count * _scatter(moved.mean(axis=0))
    if between <= 0:
        return 1.0
    least = float(np.finfo(float).eps) * between
    within = max(math.fsum(map(_scatter, places)) - between, least)
    top, bottom = 3 * (sessions - 1), 3 * (sessions - 1) * (count - 1)
    return f_sf(between / top / (within / bottom), top, bottom)


def length_tolerance(evidence: Evidence, fit: Fit) -> float:
    """Return how far two sound computations of a coordinate may differ, in metres."""
    target = float(np.spacing(np.abs(evidence.target).max()))
    source = fit.scale * float(np.spacing(np.abs(evidence.source).max()))
    reach = float(np.abs(evidence.target - evidence.target.mean(axis=0)).max())
    return LENGTH_STEP + 8 * (target + source) + 8 * fit.wobble * reach


def check_loocv(
    report: Report,
    at: str,
    stored: Json,
    used: Evidence,
    weights: Array,
    fit: Fit,
    adjusted: Adjusted,
    step: float,
) -> None:
    """Withhold each inlier and predict it: by a refit each, or above 50 by the closed form."""
    count = len(used.ids)
    report.equal(f"{at}.closed_form", stored["closed_form"], count > 50)
    report.equal(f"{at}.folds (ids)", [row["id"] for row in stored["folds"]], used.ids)
    folds = _closed_folds if count > 50 else _refitted_folds
    errors, changes = [], []
    for row, (error, scale, turned, shift, wobble) in zip(
        stored["folds"], folds(used, weights, fit, adjusted), strict=False
    ):
        here = f"{at}.folds[{row['id']}]"
        reach = float(np.abs(used.target - used.target.mean(axis=0)).max())
        loose = step + 16 * wobble * reach
        length = math.sqrt(float((error**2).sum()))
        change = 100 * (scale - fit.scale) / fit.scale
        for axis, key in enumerate(("dx_m", "dy_m", "dz_m")):
            report.close(f"{here}.{key}", row[key], error[axis], loose)
        report.close(f"{here}.d_m", row["d_m"], length, loose)
        ratio = 4 * OTHER_STEP + 16 * wobble
        report.close(f"{here}.scale", row["scale"], scale, ratio * max(1.0, fit.scale))
        report.close(f"{here}.scale_change_pct", row["scale_change_pct"], change, 200 * ratio)
        report.close(
            f"{here}.rotation_change_deg", row["rotation_change_deg"], turned, 60 * ratio + 1e-11
        )
        report.close(f"{here}.shift_m", row["shift_m"], shift, loose)
        errors.append(length)
        changes.append(abs(change))
    rmse = math.sqrt(sum(error**2 for error in errors) / len(errors)) if errors else math.nan
    worst = max(changes, default=math.nan) if math.isfinite(rmse) else math.nan
    report.close(f"{at}.rmse_m", stored["rmse_m"], rmse, 2 * step)
    key = "max_scale_change_pct"
    report.close(f"{at}.{key}", stored[key], worst, 1e-9)


Fold = tuple[Array, float, float, float, float]


def _refitted_folds(used: Evidence, weights: Array, fit: Fit, _: Adjusted) -> Iterator[Fold]:
    share = weights / weights.sum()
    centre = (used.source[0] + share @ (used.source - used.source[0]))[None]
    for k in range(len(used.ids)):
        others = np.arange(len(used.ids)) != k
        fold = horn(used.source[others], used.target[others], weights[others])
        if fold is None:
            yield np.full(3, math.nan), math.nan, math.nan, math.nan, 0.0
            continue
        error = used.target[k] - fold(used.source[[k]])[0]
        shift = float(np.linalg.norm(fold(centre) - fit(centre)))
        turned = angle_deg(fold.rotation, fit.rotation)
        yield error, fold.scale, turned, shift, fold.wobble


def _closed_folds(_: Evidence, weights: Array, fit: Fit, adjusted: Adjusted) -> Iterator[Fold]:
    # R_ii^-1 e_i, and what letting go of it does to the seven parameters.
    free = np.linalg.eigvalsh(adjusted.redundancy)[:, 0] > 1e-9
    for k in range(len(weights)):
        error = np.full(3, math.nan)
        if free[k]:
            error = np.linalg.solve(adjusted.redundancy[k], adjusted.residuals[k])
        pull = adjusted.cofactor @ (adjusted.design[k].T @ (adjusted.weights[k] * error))
        scale = fit.scale * math.exp(-pull[0])
        turned = math.degrees(float(np.linalg.norm(pull[1:4])))
        yield error, scale, turned, float(np.linalg.norm(pull[4:])), fit.wobble


def check_checks(
    report: Report,
    at: str,
    stored: Json,
    picks: Evidence,
    fit: Fit,
    step: float,
    accuracy: float | None,
) -> None:
    """Recompute the errors at check picks, also with the reference's own accuracy per axis."""
    count = len(picks.ids)
    report.equal(f"{at}.n", stored["n"], count)
    report.equal(f"{at}.residuals (ids)", [row["id"] for row in stored["residuals"]], picks.ids)
    errors = picks.target - fit(picks.source)
    for error, row in zip(errors, stored["residuals"], strict=False):
        here = f"{at}.residuals[{row['id']}]"
        report.equal(f"{here}.role", row["role"], "check")
        for axis, key in enumerate(("dx_m", "dy_m", "dz_m")):
            report.close(f"{here}.{key}", row[key], error[axis], 4 * step)
        report.close(f"{here}.d_m", row["d_m"], math.sqrt(float((error**2).sum())), 4 * step)
    mean = errors.mean(axis=0).tolist() if count else [math.nan] * 3
    rmse = math.sqrt(float((errors**2).sum()) / count) if count else math.nan
    report.close(f"{at}.mean_m", stored["mean_m"], mean, 4 * step)
    report.close(f"{at}.rmse_m", stored["rmse_m"], rmse, 4 * step)
    total = math.nan if accuracy is None else math.sqrt(rmse**2 + 3 * accuracy**2)
    report.close(f"{at}.total_m", stored["total_m"], total, 4 * step)


def check_reliability(
    report: Report,
    at: str,
    stored: Json,
    used: Evidence,
    fit: Fit,
    adjusted: Adjusted,
    step: float,
    given: list[Json],
) -> None:
    """Recompute sigmas, intervals, covariance, redundancy and the tests of every pick."""
    worth, count = stored["reliability"], len(used.ids)
    dof = 3 * count - 7
    both = np.column_stack([fit.scale * used.sigma_source, used.sigma_target])
    known = bool((~np.isnan(both)).any(axis=1).all())
    shape = np.nansum(both**2, axis=1) if known else 1 / adjusted.weights
    unit = 1 / float((1 / shape).mean())
    left = misfit(adjusted, shape / unit)
    sigma0 = math.sqrt(left / dof)
    low, high = (math.sqrt(dof / chi2_quantile(dof, tail)) for tail in (0.025, 0.975))
    report.close(f"{at}.sigma0_m", worth["sigma0_m"], sigma0, 2 * step)
    report.close(f"{at}.centroid_m", worth["centroid_m"], adjusted.centroid.tolist(), step)
    report.close(f"{at}.sigma0_low_m", worth["sigma0_low_m"], sigma0 * low, 2 * step * low)
    report.close(f"{at}.sigma0_high_m", worth["sigma0_high_m"], sigma0 * high, 2 * step * high)

    report.equal(f"{at}.noise", worth["noise"], "stated" if known else "residuals")
    report.close(f"{at}.sigma_m", worth["sigma_m"], math.sqrt(unit) if known else sigma0, 2 * step)
    fits = chi2_sf(left / unit, dof) if known else math.nan
    blunt = 1e-9 + 4 * dof * step / math.sqrt(unit) if known else 0.0
    report.close(f"{at}.global_p_value", worth["global_p_value"], fits, blunt)

    # Everything below is a shape, which the picks' places fix, times sigma, which rounding in the
    # residuals may move.
    sigma, blur = (math.sqrt(unit), 0.0) if known else (sigma0, 2 * step)
    weighted = adjusted.weights**2 * shape / unit
    noise = np.einsum("nia,n,nib->ab", adjusted.design, weighted, adjusted.design)
    form = adjusted.cofactor @ noise @ adjusted.cofactor
    sizes = np.sqrt(np.diag(form))
    moved = (sigma + blur) ** 2 - sigma**2 + 1e-9 * sigma**2
    for i in range(7):
        for j in range(7):
            report.close(
                f"{at}.covariance[{i}][{j}]",
                worth["covariance"][i][j],
                sigma**2 * form[i, j],
                moved * sizes[i] * sizes[j],
            )
    turned = np.degrees(np.sqrt(np.linalg.eigvalsh(form[1:4, 1:4])[::-1].clip(0)))
    report.close(
        f"{at}.rotation_sigma_deg",
        worth["rotation_sigma_deg"],
        (sigma * turned).tolist(),
        OTHER_STEP + (blur + 1e-7 * sigma) * float(turned[0]),
    )
    half = (normal_quantile() if known else t_quantile(dof)) * sizes[0]
    for key, sign in (("scale_low", -1), ("scale_high", 1)):
        bound = fit.scale * math.exp(sign * half * sigma)
        loose = 4 * OTHER_STEP + half * (blur + 1e-9 * sigma)
        report.close(f"{at}.{key}", worth[key], bound, fit.scale * 2 * loose)
    _check_picks(
        report, f"{at}.picks", worth, used, adjusted, shape / unit, sigma, left, known, fit
    )
    freedom = math.inf if known else dof
    _cross_check(report, at, worth["cross_checks"], given, fit, adjusted, sigma**2 * form, freedom)


def _check_picks(
    report: Report,
    at: str,
    worth: Json,
    used: Evidence,
    adjusted: Adjusted,
    shape: Array,
    sigma: float,
    left: float,
    known: bool,
    fit: Fit,
) -> None:
    """Test each pick's residual against its own covariance, direction by direction."""
    count = len(used.ids)
    rounding = 64 * max(
        np.spacing(np.abs(used.target).max()), fit.scale * np.spacing(np.abs(used.source).max())
    )
    exact = math.sqrt(left / (3 * count - 7)) <= rounding
    noise = np.einsum(
        "nia,n,nib->ab", adjusted.design, adjusted.weights**2 * shape, adjusted.design
    )
    spread = adjusted.cofactor @ noise @ adjusted.cofactor
    limit = blunder_noncentrality()
    report.equal(f"{at} (ids)", [row["id"] for row in worth["picks"]], used.ids)
    slack = 1e-9 + 16 * length_tolerance(used, fit) / sigma if sigma > 0 else math.inf
    for k, row in enumerate(worth["picks"][:count]):
        here = f"{at}[{row['id']}]"
        redundancy = adjusted.redundancy[k]
        shown, axes = np.linalg.eigh((redundancy + redundancy.T) / 2)
        seen = shown > 1e-9
        design = adjusted.design[k]
        own = shape[k] * (2 * redundancy - np.eye(3)) + design @ spread @ design.T
        inside = axes[:, seen]
        weight = np.linalg.inv(inside.T @ own @ inside) if seen.any() else np.zeros((0, 0))
        error = inside.T @ adjusted.residuals[k]
        square, free = float(error @ weight @ error), int(seen.sum())
        standardised = p = give = math.nan
        if count > 3 and not (exact and not known):
            standardised = math.sqrt(square) / sigma

            def tail(square: float, free: int = free) -> float:
                if known:
                    return chi2_sf(square / sigma**2, free)
                spare = 3 * count - 7 - free
                rest = max(left - square, 2.3e-308)
                return f_sf(square / free / (rest / spare), free, spare)

            p = tail(square)
            # What rounding in the residuals makes of it.
            step = length_tolerance(used, fit)
            moved = 4 * step * math.sqrt(square * float(np.linalg.eigvalsh(weight)[-1]))
            give = 1e-11 + abs(tail(max(square - moved, 0.0)) - tail(square + moved))
        response = (shown[seen][:, None] * weight) * shown[seen]
        least = float(np.linalg.eigvalsh(response)[0]) if seen.all() and count > 3 else 0.0
        detectable = sigma * math.sqrt(limit / least) if least > 0 else math.inf
        report.close(f"{here}.redundancy", row["redundancy"], np.trace(redundancy), 1e-9)
        bound = slack * max(1.0, standardised if math.isfinite(standardised) else 1.0)
        report.close(f"{here}.standardised", row["standardised"], standardised, bound)
        report.close(f"{here}.p_value", row["p_value"], p, give)
        if not math.isfinite(p) or abs(p - 0.05 / count) > give:
            report.equal(f"{here}.suspected", row["suspected"], bool(p < 0.05 / count))
        size = 1.0 if math.isinf(detectable) else detectable
        report.close(
            f"{here}.detectable_blunder_m",
            row["detectable_blunder_m"],
            detectable,
            LENGTH_STEP + 1e-8 * size + slack * size,
        )


def _cross_check(
    report: Report,
    at: str,
    rows: list[Json],
    given: list[Json],
    fit: Fit,
    adjusted: Adjusted,
    covariance: Array,
    dof: float,
) -> None:
    """Check the similarity against what else is known, as the settings state it."""
    report.equal(f"{at}.cross_checks (how many)", len(rows), len(given))
    for k, (row, check) in enumerate(zip(rows, given, strict=False)):
        here = f"{at}.cross_checks[{k}]"
        report.equal(f"{here}.kind", row["kind"], check["kind"])
        errors, design, own, size, step = _differences(check, fit, adjusted)
        fitted = design @ covariance @ design.T
        weight = np.linalg.inv(fitted + np.diag(own))
        square = float(errors @ weight @ errors)
        share = float(np.trace(weight @ fitted)) / len(errors)
        exactly = dof > 1e6 * share**2
        p = (
            chi2_sf(square, len(errors))
            if exactly
            else f_sf(square / len(errors), len(errors), dof / share**2)
        )
        unit = math.degrees(1) if check["kind"] == "up_direction" else 1.0
        found = float(errors[0]) if len(errors) == 1 else math.sqrt(float(errors @ errors) / size)
        sigma = math.sqrt((float(np.trace(fitted)) + float(own.sum())) / size)
        report.close(f"{here}.discrepancy", row["discrepancy"], unit * found, unit * step)
        report.close(f"{here}.sigma", row["sigma"], unit * sigma, unit * step)
        loose = 8 * len(errors) * step / math.sqrt(float(own.min()))
        report.close(f"{here}.p_value", row["p_value"], p, 1e-9 + loose)


def _differences(
    check: Json, fit: Fit, adjusted: Adjusted
) -> tuple[Array, Array, Array, int, float]:
    """Return what a check finds (k,), how the parameters move it (k, 7), and its variances (k,).

    Also by how many the squares are to be divided, and how far rounding may move what is found.
    """
    if check["kind"] == "scale_bar":
        apart = math.dist(check["from"], check["to"])
        design = np.zeros((1, 7))
        design[0, 0] = fit.scale * apart
        errors = np.array([fit.scale * apart - check["length_m"]])
        return errors, design, np.array([check["sigma_m"] ** 2]), 1, 1e-8 * max(1.0, apart)
    if check["kind"] == "up_direction":
        up = np.array(check["up"], float)
        x, y, z = fit.rotation @ (up / np.linalg.norm(up))
        flat = math.hypot(x, y)
        axis = np.array([y, -x]) / flat if flat > 0 else np.array([1.0, 0.0])
        own = np.full(2, math.radians(check["sigma_deg"]) ** 2)
        return math.atan2(flat, z) * axis, np.eye(7)[1:3], own, 1, 1e-8
    carried = fit(np.array(check["source"], float))
    errors = np.array(check["target_m"], float) - carried
    arms = carried - adjusted.centroid
    own = np.tile(np.square(check["sigma_m"]), len(arms))
    step = 1e-8 * max(1.0, float(np.abs(arms).max()))
    return errors.ravel(), motions(arms).reshape(-1, 7), own, len(arms), step


# --- distances --------------------------------------------------------------------------------


def check_comparison(report: Report, place: str, stored: Json, arrays: dict[str, Array]) -> None:
    """Recompute every zone's statistics from the stored distances and heights."""
    edges = arrays["zone_edges_m"]
    for stage, comparison in stored["comparison"].items():
        if comparison is None:
            report.holds(
                f"{place}.comparison.{stage}: no distances either",
                f"{stage}_accuracy_m" not in arrays,
            )
            continue
        for direction, counted in (
            ("accuracy", "reconstruction_voxels"),
            ("completeness", "reference_voxels"),
        ):
            distances = arrays[f"{stage}_{direction}_m"]
            heights = arrays[f"{stage}_{direction}_height_m"]
            zone = sum((heights >= edge).astype(int) for edge in edges[1:-1])
            at = f"{place}.comparison.{stage}.{direction}"
            for k, (name, row) in enumerate(comparison[direction].items()):
                own = distances if k == 0 else distances[zone == k - 1]
                _check_zone(report, f"{at}.{name}", row, own)
            at = f"{place}.comparison.{stage}.counts"
            counts = comparison["counts"]
            report.equal(f"{at}.{counted}", counts[counted], len(distances))
        inside = counts["reconstruction_points"] - counts["reconstruction_outside_region"]
        key = "reconstruction_in_region"
        report.equal(f"{at}.{key}", counts[key], inside)
        report.equal(
            f"{place}.comparison.{stage}: zones",
            len(comparison["accuracy"]) - 1,
            len(edges) - 1,
        )


def _check_zone(report: Report, at: str, row: Json, distances: Array) -> None:
    d = np.sort(distances)
    count = len(d)
    report.equal(f"{at}.n", row["n"], count)
    found = dict.fromkeys(("mean_m", "median_m", "rmse_m", "nmad_m", "p95_m", "max_m"), math.nan)
    if count and math.isfinite(d[-1]):
        middle = _quantile(d, 0.5)
        found = {
            "mean_m": float(d.sum()) / count,
            "median_m": middle,
            "rmse_m": math.sqrt(float((d * d).sum()) / count),
            "nmad_m": 1.4826 * _quantile(np.sort(np.abs(d - middle)), 0.5),
            "p95_m": _quantile(d, 0.95),
            "max_m": float(d[-1]),
        }
    for key, value in found.items():
        report.close(f"{at}.{key}", row[key], value, LENGTH_STEP + 1e-12 * float(count and d[-1]))
    for share in row["within"]:
        inside = int(np.searchsorted(d, share["threshold_m"], side="right"))
        pct = 100 * inside / max(count, 1)
        report.close(f"{at}.within[{share['threshold_m']:g}].pct", share["pct"], pct, 1e-11)


def _quantile(d: Array, share: float) -> float:
    position = share * (len(d) - 1)
    below = int(position)
    above = min(below + 1, len(d) - 1)
    return float(d[below] + (position - below) * (d[above] - d[below]))


def check_paired(report: Report, results: Json) -> None:
    """Compare the differences of two reconstructions with what each one scored."""
    found = results["reconstructions"]
    voxel = results["project"]["settings"]["comparison"]["voxel_m"]
    for stage, pairs in results["paired"].items():
        for k, pair in enumerate(pairs):
            scores = [found[name]["comparison"][stage]["completeness"] for name in pair["names"]]
            for row in pair["differences"]:
                zone, threshold = row["zone"], row["threshold_m"]
                at = f"paired.{stage}[{k}].{zone}.within[{threshold:g}]"
                pcts = [
                    next(
                        each["pct"]
                        for each in score[zone]["within"]
                        if each["threshold_m"] == threshold
                    )
                    for score in scores
                ]
                if not scores[0][zone]["n"]:
                    pcts = [math.nan, math.nan]
                report.close(f"{at}.one_pct", row["one_pct"], pcts[0], 1e-11)
                report.close(f"{at}.other_pct", row["other_pct"], pcts[1], 1e-11)
                gap = pcts[0] - pcts[1]
                report.close(f"{at}.difference_pct", row["difference_pct"], gap, 1e-11)
                report.equal(f"{at}.verdict", row["verdict"], _told_apart(row, voxel))
            posed = {
                name: stage == "delivered"
                and bool((found[name]["comparison"][stage]["intervals"] or {}).get("has_pose"))
                for name in pair["names"]
            }
            stated = _pair_statement(pair, posed)
            report.equal(f"paired.{stage}[{k}].statement", pair["statement"], stated)


def _told_apart(row: Json, voxel: float) -> str:
    low, high, gap = (row[key] for key in ("low_pct", "high_pct", "difference_pct"))
    if row["threshold_m"] <= voxel:
        return "not resolvable"
    if low is None or high is None:
        return "not known"
    if low <= 0 <= high:
        return "not distinguishable"
    if low > 0:
        return "better" if gap > 0 else "not told"
    return "worse" if gap < 0 else "not told"


def _pair_statement(pair: Json, posed: Mapping[str, bool]) -> str:
    """Conclude over all zones, as the report does in words."""
    one, other = pair["names"]
    both = f"{one} and {other}"
    wording = (
        ("better", f"{one} is more complete than {other} within", ""),
        ("worse", f"{one} is less complete than {other} within", ""),
        ("not distinguishable", f"{both} are not distinguishable in completeness within", ""),
        ("not known", f"{both} can't be compared in completeness (too few blocks) within", ""),
        (
            "not told",
            "which is more complete within",
            " is not told, for what was measured and its interval disagree",
        ),
        ("not resolvable", "nothing is said within", ", not above the voxel"),
    )
    overall = [row for row in pair["differences"] if row["zone"] == "all"]
    parts = []
    for verdict, before, after in wording:
        at = [f"{row['threshold_m']:g}" for row in overall if row["verdict"] == verdict]
        if at:
            listed = f"{', '.join(at[:-1])} and {at[-1]}" if at[1:] else at[0]
            parts.append(f"{before} {listed} m{after}")
    if all(row["verdict"] == "not resolvable" for row in overall):
        return f"Over all zones, {'; '.join(parts)}."
    fixed = " and ".join(name for name in pair["names"] if not posed[name])
    taken = f", the pose of {fixed} being taken as it is" if fixed else ""
    return f"Over all zones, {'; '.join(parts)} (95 % intervals{taken})."


def check_icp(report: Report, place: str, found: Json) -> None:
    """Draw the verdict on ICP again from its numbers."""
    icp = found["icp"]
    if icp is None:
        return
    before, after = icp["check_rmse_before_m"], icp["check_rmse_after_m"]
    if before is None:
        before, after = icp["loocv_rmse_before_m"], icp["loocv_rmse_after_m"]
    fell = before is not None and after is not None and after < before
    report.equal(f"{place}.icp.retained", icp["retained"], fell)
    if found["alignment"] is not None:
        step = 1e-7
        rmse = found["alignment"]["rmse_m"]
        report.close(f"{place}.icp.control_rmse_before_m", icp["control_rmse_before_m"], rmse, step)
        rmse = found["checks"]["rmse_m"]
        report.close(f"{place}.icp.check_rmse_before_m", icp["check_rmse_before_m"], rmse, step)
        if not found["loocv"]["closed_form"]:
            rmse, key = found["loocv"]["rmse_m"], "loocv_rmse_before_m"
            report.close(f"{place}.icp.{key}", icp[key], rmse, step)


# --- limits and the verdict -----------------------------------------------------------------------

PRECONDITIONS = {
    "blunder_suspected",
    "consensus_ambiguous",
    "consensus_disagrees",
    "crs_conflict",
    "crs_doubtful",
    "crs_missing",
    "cross_check_disagrees",
    "picks_mirrored",
    "vertical_datum_unknown",
    "weak_geometry",
}


def look_up(results: Any, path: str) -> Any:
    """Return what stands at a path such as ``a.b.2`` or ``within[0.10].pct``; KeyError if nothing.

    Names may hold dots themselves: the longest that fits is taken.
    """
    rest = path
    while rest:
        if rest.startswith("["):
            label, _, rest = rest[1:].partition("]")
            results, rest = _row(results, label), rest.removeprefix(".")
            continue
        if isinstance(results, list):
            label, _, rest = rest.partition(".")
            label, bracket, tail = label.partition("[")
            results = _row(results, label)
            rest = f"[{tail}.{rest}".rstrip(".") if bracket else rest
            continue
        if not isinstance(results, Mapping):
            raise KeyError(path)
        fitting = [key for key in results if rest == key or rest.startswith((f"{key}.", f"{key}["))]
        if not fitting:
            raise KeyError(path)
        key = max(fitting, key=len)
        results, rest = results[key], rest[len(key) :].removeprefix(".")
    return results


def _row(rows: Any, label: str) -> Any:
    if not isinstance(rows, list):
        raise KeyError(label)
    for row in rows:
        if isinstance(row, Mapping):
            if row.get("id") == label:
                return row
            try:
                if "threshold_m" in row and float(label) == row["threshold_m"]:
                    return row
            except ValueError:
                continue
    if label.isdigit() and int(label) < len(rows):
        return rows[int(label)]
    raise KeyError(label)


def check_verdict(report: Report, results: Json, settings: Json) -> None:
    """Compare the findings with the limits in the settings, and draw the verdict."""
    limits, rows = settings.get("limit", []), results["criteria"]
    report.equal("criteria (how many)", len(rows), len(limits))
    for k, (limit, row) in enumerate(zip(limits, rows, strict=False)):
        at = f"criteria[{k}]"
        try:
            found = look_up(results["reconstructions"][limit["of"]], limit["quantity"])
        except KeyError:
            found = None
        word = "max" if "max" in limit else "min"
        margin = None if found is None else (limit[word] - found) * (1 if word == "max" else -1)
        for key in ("quantity", "of", "source"):
            report.equal(f"{at}.{key}", row[key], limit[key])
        report.equal(f"{at}.limit", row["limit"], f"{word} {limit[word]:g}")
        report.equal(f"{at}.found", row["found"], found)
        report.close(f"{at}.margin", row["margin"], margin, 2 * OTHER_STEP)
        report.equal(f"{at}.met", row["met"], margin is not None and margin >= 0)
    codes = {warning["code"] for warning in results["warnings"]}
    verdict = "NOT TESTED"
    if limits:
        met = all(row["met"] for row in rows)
        verdict = "FAIL" if not met else "CONDITIONAL" if PRECONDITIONS & codes else "PASS"
    report.equal("verdict", results["verdict"], verdict)
    for code, where in _due_warnings(results):
        report.holds(f"warnings: {code} is given, as {where} asks", code in codes)


def _due_warnings(results: Json) -> Iterator[tuple[str, str]]:
    """List the warnings that follow from the results themselves."""
    crs = results["crs"]
    if crs.get("name") and not crs.get("vertical_datum"):
        yield "vertical_datum_unknown", "crs.vertical_datum"
    for name, found in results["reconstructions"].items():
        place = f"reconstructions.{name}"
        if found["alignment"] is not None:
            if found["alignment"]["outliers"]:
                yield "picks_rejected", f"{place}.alignment.outliers"
            if found["alignment"]["exhaustive_agrees"] is False:
                yield "consensus_disagrees", f"{place}.alignment.exhaustive_agrees"
            if found["reliability"]["geometry"] != "sound":
                yield "weak_geometry", f"{place}.reliability.geometry"
            if any(row["suspected"] for row in found["reliability"]["picks"]):
                yield "blunder_suspected", f"{place}.reliability.picks"
            if any(row["p_value"] < 0.05 for row in found["reliability"].get("cross_checks", [])):
                yield "cross_check_disagrees", f"{place}.reliability.cross_checks"
            if found["icp"] is not None and not found["icp"]["retained"]:
                yield "icp_not_retained", f"{place}.icp.retained"


# --- what a revision changed ----------------------------------------------------------------------

# By what a row of a list is known in a path, where its position would not say.
ROW_KEYS = ("id", "threshold_m", "quantity", "sha256", "message")


def leaves(value: Any, path: str = "") -> Iterator[tuple[str, Any]]:
    """Yield every value of nested objects and lists by its path, as changes.json writes it."""
    if isinstance(value, dict):
        for key, item in value.items():
            yield from leaves(item, f"{path}.{key}" if path else key)
    elif isinstance(value, list):
        objects = bool(value) and all(isinstance(row, dict) for row in value)
        names = (
            key
            for key in ROW_KEYS
            if objects and len({str(row.get(key)) for row in value if key in row}) == len(value)
        )
        own = next(names, None)
        for position, item in enumerate(value):
            label = position if own is None else item[own]
            rest = item if own is None else {k: v for k, v in item.items() if k != own}
            yield from leaves(rest, f"{path}[{label}]")
    else:
        yield path, value


def replaced(changes: Json, results: Json) -> str:
    """Say what the report has to say of the revision that this one replaces."""
    if changes["against"] is None:
        return "not known: no earlier revision lay beside this one"
    after = dict(leaves(results))
    before = after | {row["path"]: row["before"] for row in changes["changes"]}
    for row in changes["changes"]:
        if row["kind"] == "added":
            del before[row["path"]]
    status, verdict = before["project.status"], before["verdict"]
    told = f"revision {before['project.revision']}, {status}, {verdict}"
    old, new = limits(before), limits(after)
    moved = sum(old.get(key) != new.get(key) for key in old | new)
    if moved:
        told += f"; {moved:,} limit{'s' if moved > 1 else ''} changed since"
    return told


def limits(found: dict[str, Any]) -> dict[tuple[str, str, str, int], str]:
    """Return the limits among the values of results by path."""
    rows: dict[str, Json] = {}
    for path, value in found.items():
        if path.startswith("criteria["):
            label, _, key = path[len("criteria[") :].rpartition("].")
            rows.setdefault(label, {})[key] = value
    told: dict[tuple[str, str, str, int], str] = {}
    for label, row in rows.items():
        place = row["of"], row.get("quantity", label), row["limit"].split(" ")[0]
        told[*place, sum(each[:3] == place for each in told)] = row["limit"]
    return told


def check_changes(report: Report, folder: Path, results: Json) -> None:
    """Compare what changed with what came of it, and the report with what it replaces."""
    about, path = results["project"], folder / "data" / "changes.json"
    report.equal("data/changes.json is there", path.is_file(), about["revision"] > 1)
    if not path.is_file():
        return
    changes, found = read_json(path), dict(leaves(results))
    wrong = [
        row["path"]
        for row in changes["changes"]
        if (row["kind"] == "removed") == (row["path"] in found)
        or row["after"] != found.get(row["path"])
    ]
    ends = "of what changed, all is in results.json as it is after"
    report.equal(f"data/changes.json: {ends}", wrong, [])
    page = folder / "report.html"
    if page.is_file():
        told = f"Replaces {replaced(changes, results)}"
        printed = _letters("".join(_parse(page.read_text("utf-8")).text))
        report.holds("report.html says what it replaces", _letters(told) in printed, expected=told)


# --- settings, tables and matrices ----------------------------------------------------------------


def check_settings(report: Report, results: Json, settings: Json) -> None:
    """Compare what results.json says of the project with the settings that were used."""
    stated, about = settings.get("project", {}), results["project"]
    for key, value in about.items():
        if key != "settings":
            own = stated.get(key)
            report.equal(f"project.{key}", value, own if key == "revision" else _text(own))
    for section in ("alignment", "comparison", "reference"):
        for key, value in about["settings"][section].items():
            own = settings.get(section, {}).get(key)
            own = None if (section, key, own) == ("comparison", "margin_m", "none") else own
            report.equal(f"project.settings.{section}.{key}", value, own)
    names = [each["name"] for each in settings.get("reconstruction", [])]
    report.equal("reconstructions (names)", list(results["reconstructions"]), names)
    listed = {(each["name"], each["role"]): each["path"] for each in results["inputs"]}
    given = {(settings["reference"]["name"], "reference"): settings["reference"]["path"]}
    for each in settings["reconstruction"]:
        given[each["name"], each["kind"]] = each["path"]
        if each.get("picks"):
            given[each["name"], "picks"] = each["picks"]
    if settings["reference"].get("region"):
        given[settings["reference"]["name"], "region"] = settings["reference"]["region"]
    for key, path in given.items():
        report.equal(f"inputs: {key[1]} of {key[0]}", listed.get(key), path)


def _text(value: Any) -> Any:
    return value if value is None else str(value)


def check_pick_copies(report: Report, folder: Path, results: Json) -> None:
    """Compare the copies of the pick files with the hashes of what was read."""
    again: dict[str, int] = {}
    for given in results["inputs"]:
        name = given["name"]
        if given["role"] == "repicks":
            again[name] = again.get(name, 0) + 1
        if given["role"] in ("picks", "repicks"):
            number = "" if given["role"] == "picks" else f"-{again[name]}"
            copies = sorted((folder / "config").glob(f"{given['role']}-{name}{number}.*"))
            found = sha256(copies[0]) if len(copies) == 1 else "missing"
            which = f"the {given['role']} of {name}{number}"
            report.equal(f"inputs: SHA-256 of {which}", given["sha256"], found)


def check_tables(report: Report, folder: Path, name: str, found: Json) -> None:
    """Compare the CSV tables and the files of the transformation with results.json."""
    tables: dict[str, list[Json]] = {"zones": [], "within": []}
    if found["alignment"] is not None:
        tables["picks"] = found["alignment"]["residuals"]
        tables["loocv"] = found["loocv"]["folds"]
        tables["reliability"] = found["reliability"]["picks"]
        tables["next-picks"] = found["reliability"]["next_picks"]
        if found["checks"]["n"]:
            tables["checks"] = found["checks"]["residuals"]
    for stage, comparison in found["comparison"].items():
        for direction in ("accuracy", "completeness") if comparison else ():
            for zone, row in comparison[direction].items():
                place = {"stage": stage, "direction": direction, "zone": zone}
                tables["zones"].append(place | {k: v for k, v in row.items() if k != "within"})
                tables["within"] += [place | share for share in row["within"]]
    for kind, rows in tables.items():
        _check_table(report, folder / "data" / f"{kind}-{name}.csv", rows)
    if found["alignment"] is not None:
        stored = read_json(folder / "transform" / f"{name}.json")
        stored.pop("crs", None)
        report.equal(f"transform/{name}.json (keys)", sorted(stored), sorted(found["alignment"]))
        for key, value in found["alignment"].items():
            report.equal(f"transform/{name}.json: {key}", stored.get(key), value)
        text = (folder / "transform" / f"{name}_matrix.txt").read_text("utf-8")
        try:
            rows_of = [[float(cell) for cell in line.split()] for line in text.splitlines()]
        except ValueError:
            rows_of = []
        for k, row in enumerate(found["alignment"]["matrix"]):
            own = rows_of[k] if k < len(rows_of) else None
            report.equal(f"transform/{name}_matrix.txt row {k + 1}", own, row)


def _check_table(report: Report, path: Path, rows: list[Json]) -> None:
    cells = read_csv(path) if path.is_file() and path.stat().st_size > 2 else []
    report.equal(f"data/{path.name} (rows)", len(cells), len(rows))
    wrong = [
        f"row {number} {key}: {line.get(key)!r} where results.json has {value!r}"
        for number, (line, row) in enumerate(zip(cells, rows, strict=False), 1)
        for key, value in row.items()
        if not _same_cell(line.get(key), value)
    ]
    report.holds(f"data/{path.name} agrees with results.json", not wrong, stored="; ".join(wrong))


def _same_cell(cell: str | None, value: Any) -> bool:
    if cell is None:
        return False
    if value is None:
        return cell == ""
    if isinstance(value, bool | str):
        return cell == str(value)
    if not isinstance(value, int | float):
        return True  # a list in a cell is the table's own affair
    try:
        return float(cell) == value
    except ValueError:
        return False


def check_quality(report: Report, folder: Path, results: Json) -> None:
    """Compare the data-quality elements with the numbers that they name."""
    for scope in read_json(folder / "quality" / "iso19157.json")["reports"]:
        for element in scope["elements"]:
            found = element["result"]
            path = found["path"]
            stored = look_up(results, path.removeprefix("100 - "))
            if path.startswith("100 - ") and stored is not None:
                stored = 100 - stored
            value = found["pass"] if found["type"] == "conformance" else found["value"]
            at = f"quality/iso19157.json: {path}"
            if isinstance(stored, float):
                report.close(at, value, stored, 2 * OTHER_STEP)
            else:
                report.equal(at, value, stored)


def check_crate(report: Report, folder: Path, hashes: Mapping[str, str]) -> None:
    """Compare the hashes in the crate with those of the files."""
    graph = read_json(folder / "ro-crate-metadata.json")["@graph"]
    stated = {
        each["name"]: each["sha256"]
        for each in graph
        if each["@type"] == "File" and "sha256" in each
    }
    for name, digest in hashes.items():
        if name not in ("ro-crate-metadata.json", "manifest-sha256.txt"):
            report.equal(f"ro-crate-metadata.json: {name}", stated.get(name), digest)


# --- what is printed ------------------------------------------------------------------------------


class _Printed(HTMLParser):
    """Collects the text, the numbers with their paths, and the embedded pictures of a page."""

    def __init__(self) -> None:
        super().__init__(convert_charrefs=True)
        self.values: list[tuple[str, str, str | None]] = []
        self.pictures: list[tuple[str, bytes]] = []
        self.text: list[str] = []
        self._open: list[str] | None = None
        self._path = ""
        self._value: str | None = None
        self._silent = 0

    def handle_starttag(self, tag: str, attributes: list[tuple[str, str | None]]) -> None:
        given = dict(attributes)
        if tag in ("script", "style"):
            self._silent += 1
        if tag == "data" and given.get("data-path"):
            self._open, self._path = [], given["data-path"] or ""
            self._value = given.get("value")
        source = given.get("src") or ""
        if tag == "img" and given.get("data-file") and ";base64," in source:
            content = base64.b64decode(source.partition(";base64,")[2], validate=False)
            self.pictures.append((given["data-file"] or "", content))

    def handle_endtag(self, tag: str) -> None:
        if tag in ("script", "style"):
            self._silent = max(0, self._silent - 1)
        if tag == "data" and self._open is not None:
            self.values.append((self._path, "".join(self._open), self._value))
            self._open = None

    def handle_data(self, data: str) -> None:
        if self._open is not None:
            self._open.append(data)
        if not self._silent:
            self.text.append(data)


def check_printed(report: Report, folder: Path, results: Json) -> None:
    """Compare every number printed in the report and the notebook with results.json."""
    rules = folder / "data" / "rounding.json"
    rounding = read_json(rules) if rules.is_file() else {}
    page, notebook = folder / "report.html", folder / "audit.ipynb"
    shown = list(_outputs(read_json(notebook))) if notebook.is_file() else []
    if shown:
        _check_page(report, "audit.ipynb", _parse("".join(shown)), results, rounding)
    if page.is_file():
        printed = _parse(page.read_text("utf-8"))
        _check_page(report, "report.html", printed, results, rounding)
        _check_words(report, printed, results, shown)
        for name, content in printed.pictures:
            path = folder / "figures" / name
            if path.is_file():
                digest = hashlib.sha256(content).hexdigest()
                report.equal(f"figures/{name} is the picture in report.html", sha256(path), digest)
    else:
        report.notes.append("There is no report.html here: nothing printed was compared.")
    if (folder / "report.pdf").is_file():
        _check_attachments(report, folder, folder / "report.pdf")


def _check_words(report: Report, printed: _Printed, results: Json, shown: Sequence[str]) -> None:
    """Compare what the report says in words: what a person wrote, and each cell's output."""
    text = "".join(printed.text)
    letters = _letters(text)
    stated = report.record in text
    report.holds("report.html states the record's hash", stated, expected=report.record)
    for key in ("title", "limitations", "purpose"):
        if results["project"][key]:
            words = _letters(results["project"][key])
            report.holds(f"report.html prints the project's {key}", words in letters)
    for number, output in enumerate(shown, 1):
        same = _letters("".join(_parse(output).text)) in letters
        report.holds(f"report.html prints output {number} of audit.ipynb as it is", same)


def _parse(text: str) -> _Printed:
    printed = _Printed()
    printed.feed(text)
    printed.close()
    return printed


def _letters(text: str) -> str:
    return "".join(filter(str.isalnum, html.unescape(text)))


def _outputs(notebook: Json) -> Iterator[str]:
    for cell in notebook.get("cells", []):
        for output in cell.get("outputs", []):
            shown = output.get("data", {}).get("text/html", "")
            yield "".join(shown) if isinstance(shown, list) else str(shown)


def _check_page(
    report: Report, page: str, printed: _Printed, results: Json, rounding: Json
) -> None:
    report.holds(f"{page} prints numbers with their paths", bool(printed.values))
    for path, text, value in printed.values:
        at = f"{page}: {path}"
        if value is not None and _plain_number(value) != _plain_number(text):
            report.holds(f"{at}: its value attribute", False, stored=value, expected=text)
        try:
            stored = look_up(results, path)
        except (KeyError, TypeError):
            report.holds(f"{at} stands in results.json", False, stored=text)
            continue
        digits = digits_for(rounding, path, results)
        ok, expected = printed_right(text, stored, digits, exact=bool(rounding) and digits is None)
        report.holds(at, ok, stored=text, expected=expected)


def digits_for(rounding: Json, path: str, results: Json) -> int | None:
    """Return how many decimals a path is printed with; None: all that the number has."""
    if match := re.fullmatch(r"criteria\W(\d+)\W+(found|margin)", path):
        row = results["criteria"][int(match[1])]  # as the quantity that the limit is about
        path = f"reconstructions.{row['of']}.{row['quantity']}"
    for rule in rounding.get("rules", []):
        if _is_tame(rule["pattern"]) and re.fullmatch(rule["pattern"], path):
            return None if rule["digits"] is None else int(rule["digits"])
    return None


def _is_tame(pattern: str) -> bool:
    """Tell whether a pattern from a stranger can't keep the matcher busy for ever."""
    repeats = len(re.findall(r"[*+]|\{\d*,", pattern))
    nested = re.search(r"\)([*+]|\{\d*,)", pattern)
    return len(pattern) <= 200 and repeats <= 3 and nested is None


def printed_right(
    text: str, stored: Any, digits: int | None, *, exact: bool = False
) -> tuple[bool, str]:
    """Tell whether a text is how a value is printed, and what it should have said."""
    text = text.strip()
    if stored is None:
        return text == "not available", "not available"
    if not _is_number(stored):
        return text == str(stored), str(stored)
    plain = _plain_number(text)
    shown = len(plain.partition(".")[2])
    expected = str(stored) if exact else f"{stored:.{shown if digits is None else digits}f}"
    try:
        number = float(plain)
    except ValueError:
        return False, expected
    if exact or isinstance(stored, int):
        return number == stored, expected
    near = abs(number - stored) <= 0.5 * 10.0**-shown * (1 + 1e-9) + 1e-12 * abs(stored)
    return near and (digits is None or shown == digits), expected


def _plain_number(text: str) -> str:
    """Return a printed number as Python reads it: no grouping, no typographic minus."""
    return re.sub(r"[\s,\u2009\u202f\u00a0]", "", text).replace("\u2212", "-").removeprefix("+")


def _check_attachments(report: Report, folder: Path, pdf: Path) -> None:
    """Compare what is embedded in the PDF with the files beside it."""
    beside = {sha256(path) for path in folder.rglob("*") if path.is_file()}
    content = pdf.read_bytes()
    starts = list(re.finditer(rb"/EmbeddedFile\b(?s:.*?)\bstream\r?\n", content))
    if not starts:
        report.notes.append("report.pdf embeds nothing that its hash alone does not cover.")
    for k, match in enumerate(starts):
        end = content.find(b"endstream", match.end())
        packed = content[match.end() : end]
        try:
            unpacked = zlib.decompressobj().decompress(packed, 2**30)
        except zlib.error:
            unpacked = packed.rstrip(b"\r\n")
        digest = hashlib.sha256(unpacked).hexdigest()
        report.holds(f"report.pdf attachment {k + 1} is a file of the bundle", digest in beside)


# --- the whole bundle -----------------------------------------------------------------------------


def check_hashes(report: Report, folder: Path) -> dict[str, str]:
    """Compare every file with the manifest, and the evidence with the record; return all hashes."""
    hashes = {
        path.relative_to(folder).as_posix(): sha256(path)
        for path in sorted(folder.rglob("*"))
        if path.is_file() and not path.is_symlink()
    }
    for name in ("manifest-sha256.txt", "record-sha256.txt"):
        listed = _read_manifest(folder / name)
        for path, digest in listed.items():
            report.equal(f"{name}: {path}", digest, hashes.get(path, "missing"))
        if name.startswith("manifest"):
            for path in sorted(set(hashes) - set(listed) - {name}):
                report.holds(f"{name}: {path} is listed", False)
    report.record = hashes["record-sha256.txt"]
    report.manifest = sha256(folder / "manifest-sha256.txt")
    return hashes


def _read_manifest(path: Path) -> dict[str, str]:
    try:
        lines = path.read_text("utf-8").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        message = f"{path.name} can't be read: {_reason(error)}"
        raise UnreadableError(message) from error
    hashes = {}
    for line in lines:
        digest, _, name = line.partition("  ")
        parts = name.split("/")
        if len(digest) != 64 or not name or {"", ".", ".."} & set(parts) or "\\" in name:
            message = f"{path.name} holds a line that is no hash and path: {line[:80]!r}."
            raise UnreadableError(message)
        hashes[name] = digest
    return hashes


def check(folder: Path) -> Report:
    """Check a whole bundle.

    Raises
    ------
    UnreadableError
        If it is no bundle, or of another kind than this checks.
    """
    results = read_json(folder / "data" / "results.json")
    if results.get("schema") != SCHEMA:
        message = f"results.json is of schema {results.get('schema')!r}, not {SCHEMA!r}."
        raise UnreadableError(message)
    report = Report()
    hashes = check_hashes(report, folder)
    settings: Json = {}

    def read_settings() -> None:
        settings.update(tomllib.loads((folder / "config" / "project.toml").read_text("utf-8")))

    attempt(report, "config/project.toml", read_settings)
    attempt(report, "the settings", lambda: check_settings(report, results, settings))
    attempt(report, "the pick files", lambda: check_pick_copies(report, folder, results))
    for name, found in dict(results.get("reconstructions") or {}).items():
        _check_reconstruction(report, folder, name, found, settings)
    attempt(report, "the pairs", lambda: check_paired(report, results))
    attempt(report, "quality/iso19157.json", lambda: check_quality(report, folder, results))
    attempt(report, "ro-crate-metadata.json", lambda: check_crate(report, folder, hashes))
    attempt(report, "the verdict", lambda: check_verdict(report, results, settings))
    attempt(report, "what changed", lambda: check_changes(report, folder, results))
    attempt(report, "what is printed", lambda: check_printed(report, folder, results))
    return report


def _check_reconstruction(
    report: Report, folder: Path, name: str, found: Json, settings: Json
) -> None:
    place = f"reconstructions.{name}"

    def alignment() -> None:
        if found["alignment"] is not None:
            evidence = read_evidence(folder / "data" / f"correspondences-{name}.csv")
            check_alignment(report, place, found, evidence, settings)
            again = read_repeats(folder / "data" / f"repeats-{name}.csv")
            repeats = found["reliability"]["repeats"]
            check_repeats(report, f"{place}.reliability.repeats", repeats, evidence, again)

    def comparison() -> None:
        arrays = read_arrays(folder / "data" / f"distances-{name}.npz")
        check_comparison(report, place, found, arrays)

    attempt(report, f"{place}.alignment", alignment)
    attempt(report, f"{place}.comparison", comparison)
    attempt(report, f"{place}.icp", lambda: check_icp(report, place, found))
    attempt(report, f"{place}: its tables", lambda: check_tables(report, folder, name, found))


def attempt(report: Report, what: str, check_it: Callable[[], None]) -> None:
    """Run a check; where the bundle's content stops it, that is a difference and not a crash."""
    try:
        check_it()
    except (
        UnreadableError,
        OSError,
        ValueError,  # also UnicodeDecodeError, TOMLDecodeError, LinAlgError
        KeyError,
        TypeError,
        IndexError,
        AttributeError,
        ArithmeticError,
        RecursionError,
    ) as error:
        found = f"{type(error).__name__}: {error}"
        report.holds(f"{what}: can be checked", False, stored=found)


def summary(report: Report, *, table: bool = False) -> str:
    """Say what was proved and name every difference."""
    lines = []
    if table:
        lines.append("quantity | stored | recomputed | tolerance | ok")
        lines += [_line(row) for row in report.rows]
    differences = report.differences
    lines += _told(differences)
    lines += [f"note: {note}" for note in report.notes]
    lines.append("hashed, not recomputed:")
    lines += [f"  {what}: {why}" for what, why in NOT_RECOMPUTED.items()]
    lines += [f"record {report.record}", f"manifest {report.manifest}"]
    held = len(report.rows) - len(differences)
    lines.append(f"{held} of {len(report.rows)} checks hold; {len(differences)} differ.")
    return "\n".join(lines) + "\n"


def _told(differences: list[Row]) -> Iterator[str]:
    """Name each difference once, however often a number is printed."""
    times = Counter(
        (row.quantity, _shown(row.stored), _shown(row.recomputed)) for row in differences
    )
    for (quantity, stored, recomputed), count in times.items():
        said = f": stored {stored}, recomputed {recomputed}" if stored or recomputed else ""
        yield f"DIFFERS  {quantity}{said}{f' ({count} times)' if count > 1 else ''}"


def _line(row: Row) -> str:
    ok = "ok" if row.ok else "NO"
    cells = (row.quantity, _shown(row.stored), _shown(row.recomputed), f"{row.tolerance:.1e}", ok)
    return " | ".join(cells)


def _shown(value: Any) -> str:
    text = "null" if value is None else str(value)
    return text if len(text) <= 120 else f"{text[:117]}..."


def main(arguments: Sequence[str]) -> int:
    """Check the bundle named, or the one that this file lies in."""
    named = [argument for argument in arguments if argument != "--table"]
    if len(named) > 1 or any(argument.startswith("-") for argument in named):
        sys.stderr.write("usage: python verify.py [BUNDLE] [--table]\n")
        return 2
    folder = Path(named[0]) if named else Path(__file__).resolve().parent.parent
    try:
        report = check(folder)
    except UnreadableError as error:
        sys.stderr.write(f"verify: {error}\n")
        return 2
    sys.stdout.write(summary(report, table="--table" in arguments))
    return 1 if report.differences else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
