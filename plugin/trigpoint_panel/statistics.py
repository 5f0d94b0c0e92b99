"""Statistics of the current pairs: what the engine says of them, as the panel shows it."""

from __future__ import annotations

import re
from dataclasses import dataclass
from functools import lru_cache
from typing import Literal

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray

from trigpoint.alignment import Alignment, align
from trigpoint.cautions import Caution
from trigpoint.errors import TrigpointError
from trigpoint.picks import FEWEST
from trigpoint.placement import next_picks
from trigpoint.project import AlignmentSettings
from trigpoint.reliability import Reliability
from trigpoint.similarity import Points, Similarity, principal_spreads
from trigpoint_panel.pairs import Pair, Pairs, complete, to_picks, with_role

Flag = Literal["", "rejected", "suspect", "look again", "unchecked", "far"]
Level = Literal["", "amber", "red"]

# Below 5 % a residual deserves a look; naming a suspect asks for 5 % shared among all picks.
LOOK_AGAIN = 0.05
# A second spread this small beside the first is a line, as far as a person is concerned.
LINE = 1e-3
# Of the places listed to pick next: how many, and how far apart as a share of the reference's
# diagonal. As in the audit's record.
NEXT, APART = 3, 0.1
# So many places are judged after every pick: the gain is smooth, and the hand is waiting.
CANDIDATES = 500

COLUMNS = (
    "id",
    "role",
    "used",
    "dx_m",
    "dy_m",
    "dz_m",
    "d_m",
    "loo_m",
    "redundancy",
    "standardised",
    "p_value",
    "detectable_blunder_m",
    "suspected",
    "flag",
    "level",
    "why",
)


@dataclass(frozen=True, slots=True, eq=False)
class Survey:
    """What is known of the reference while pairs are picked.

    Attributes
    ----------
    extent : ndarray of shape (2, 3)
        Lowest and highest coordinates, metres.
    places : ndarray of shape (m, 3)
        Some thousand of its points: where one could pick next.
    """

    extent: NDArray[np.float64]
    places: Points


def survey_of(extent: ArrayLike, places: ArrayLike) -> Survey:
    """Say where the reference lies: lowest and highest corner, and points to pick at, metres.

    A few thousand places, spread over it, are enough.
    """
    return Survey(
        np.array(extent, np.float64).reshape(2, 3), np.array(places, np.float64).reshape(-1, 3)
    )


@dataclass(frozen=True, slots=True, eq=False)
class Fit:
    """What the pairs are worth, or why they can't be fitted.

    Attributes
    ----------
    alignment : Alignment or None
        The engine's, of the complete pairs, without what takes long and changes no fit (the
        consensus redone without each pick); None where there is none.
    refusal : str
        Why there is none, in one sentence; empty if there is one.
    table : DataFrame
        A row for each pair, half-open ones included, in their order: `id`, `role`; `used`, whether
        the fit was made from it; `dx_m`, `dy_m`, `dz_m`, `d_m`, target minus transformed source;
        `loo_m`, that distance with the pair withheld; `redundancy`, `standardised`, `p_value`,
        `detectable_blunder_m`, `suspected` as `trigpoint.reliability` has them; `flag`, one word
        for what is wrong, with its `level` (amber or red) and `why` in a sentence. NaN where
        there is no number.
    controls, checks : int
        Complete control and check pairs.
    rmse_m, check_rmse_m, loocv_rmse_m : float
        Of the inliers, of the check pairs, of leave-one-out; NaN where there is none.
    weakness : str
        What makes the layout weak, in one clause; empty where it is sound.
    next_picks : DataFrame
        x, y, z, gain_m: where to pick next, best first. Empty without a survey.
    """

    alignment: Alignment | None
    refusal: str
    table: pd.DataFrame
    controls: int
    checks: int
    rmse_m: float
    check_rmse_m: float
    loocv_rmse_m: float
    weakness: str
    next_picks: pd.DataFrame

    @property
    def similarity(self) -> Similarity | None:
        """Maps source to target, or None."""
        return None if self.alignment is None else self.alignment.similarity

    @property
    def reliability(self) -> Reliability | None:
        """What the engine says the similarity is worth, or None."""
        return None if self.alignment is None else self.alignment.reliability

    @property
    def geometry(self) -> Literal["sound", "weak", "refused", ""]:
        """The verdict on the layout of the pairs; empty while there is nothing to judge."""
        if self.alignment is None:
            return "refused" if self.controls >= FEWEST else ""
        return "weak" if self.weakness else "sound"

    @property
    def statement(self) -> str:
        """The verdict in one sentence, or the refusal."""
        return self.refusal if self.alignment is None else self.alignment.reliability.statement

    @property
    def cautions(self) -> tuple[Caution, ...]:
        """The engine's doubts."""
        return () if self.alignment is None else self.alignment.cautions

    @property
    def suspects(self) -> tuple[str, ...]:
        """Ids of the pairs that the outlier test names or the consensus rejected, worst first."""
        named = self.table[self.table["level"] == "red"]
        return tuple(named.sort_values("d_m", ascending=False, kind="stable")["id"])


def fit_pairs(
    pairs: Pairs, settings: AlignmentSettings | None = None, survey: Survey | None = None
) -> Fit:
    """Fit the complete pairs as the audit would, and say what that is worth.

    The same pairs, settings and survey are worked out once.

    Parameters
    ----------
    pairs : tuple of Pair
    settings : AlignmentSettings, optional
        The project's; the engine's defaults if omitted.
    survey : Survey, optional
        Of the reference, once it is open.
    """
    return _fit(pairs, settings or AlignmentSettings(), survey)


@lru_cache(maxsize=32)
def _fit(pairs: Pairs, settings: AlignmentSettings, survey: Survey | None) -> Fit:
    found, refusal, places = _aligned(complete(pairs), settings, survey)
    controls, checks = with_role(pairs, "control"), with_role(pairs, "check")
    table = _table(pairs, found, settings.threshold_m)
    if found is None:
        nan = float("nan")
        return Fit(None, refusal, table, len(controls), len(checks), nan, nan, nan, "", _nowhere())
    loocv = found.loocv.rmse_m
    return Fit(
        found,
        "",
        table,
        len(controls),
        len(checks),
        _rms(table["d_m"][table["used"]]),
        _rms(table["d_m"][table["role"] == "check"]),
        float("nan") if loocv is None else loocv,
        _weakness(found, survey),
        places,
    )


@lru_cache(maxsize=64)
def _aligned(
    pairs: Pairs, settings: AlignmentSettings, survey: Survey | None
) -> tuple[Alignment | None, str, pd.DataFrame]:
    """Ask the engine; a half-open pair comes and goes without asking again."""
    controls = with_role(pairs, "control")
    if len(controls) < FEWEST:
        return None, f"{len(controls)} of {FEWEST} control pairs.", _nowhere()
    try:
        found = align(
            to_picks(pairs),
            method=settings.method,
            threshold=settings.threshold_m,
            trials=settings.trials,
            seed=settings.seed,
            weighted=settings.weighted,
            extent=None if survey is None else survey.extent,
            thorough=False,
        )
    except TrigpointError as error:
        return None, _refusal(controls, str(error)), _nowhere()
    return found, "", _next(found, survey)


def _refusal(controls: Pairs, reason: str) -> str:
    """Say in one sentence why control pairs have no fit."""
    for side in ("source", "target"):
        seen: dict[object, str] = {}
        for pair in controls:
            first = seen.setdefault(pair.source if side == "source" else pair.target, pair.id)
            if first != pair.id:
                return f"{first} and {pair.id} are the same point in the {side}: pick one again."
    for points in ([pair.source for pair in controls], [pair.target for pair in controls]):
        spreads = principal_spreads(np.array(points, np.float64))
        if spreads[1] <= LINE * spreads[0]:
            return "The control points lie on one line: add one off the line."
    return _verdict(reason) if reason.startswith("Refused: ") else first_sentence(reason)


def _verdict(statement: str) -> str:
    """Return the engine's refusal of a layout without its numbers' explanation."""
    said = _reason(statement)
    if said.startswith("the rotation"):
        said = f"{said.split(', and ')[0]}: add a pick well off that axis"
    return f"{said[:1].upper()}{said[1:]}."


def _reason(statement: str) -> str:
    """Return the first reason of the engine's verdict, without what one pick is worth."""
    said = re.sub(r"^\w+: ", "", statement).split("; also, ")[0]
    return re.sub(r" \((?:one pick is good|2 redundant|they fit exactly)[^()]*\)\.?$", "", said)


def first_sentence(text: str) -> str:
    """Return a text's first sentence.

    Examples
    --------
    >>> first_sentence("No three picks agree within 0.5 m. Check the pairing.")
    'No three picks agree within 0.5 m.'
    """
    return re.split(r"(?<=\.)\s+(?=[A-Z])", " ".join(text.split()), maxsplit=1)[0]


def _next(found: Alignment, survey: Survey | None) -> pd.DataFrame:
    if survey is None or not len(survey.places):
        return _nowhere()
    corners = found.reliability.corners[["x", "y", "z"]].to_numpy()
    apart = APART * float(np.linalg.norm(survey.extent[1] - survey.extent[0]))
    places = survey.places[:: max(1, -(-len(survey.places) // CANDIDATES))]
    return next_picks(found.reliability, places, corners, count=NEXT, apart=apart)


def _nowhere() -> pd.DataFrame:
    return pd.DataFrame(columns=["x", "y", "z", "gain_m"], dtype=np.float64)


def _weakness(found: Alignment, survey: Survey | None) -> str:
    worth = found.reliability
    if survey is not None:
        low, high = survey.extent[:, 2]
        share = (found.inliers.target[:, 2] - low) / max(high - low, np.finfo(np.float64).tiny)
        if share.max() < 1 / 3:
            return "all pairs in the lower third: heights above are extrapolated"
        if share.min() > 2 / 3:
            return "all pairs in the upper third: heights below are extrapolated"
    if worth.geometry == "sound":
        return ""
    return _reason(worth.statement)


def _table(pairs: Pairs, found: Alignment | None, threshold: float) -> pd.DataFrame:
    table = pd.DataFrame({name: [np.nan] * len(pairs) for name in COLUMNS}, index=range(len(pairs)))
    table["id"] = [pair.id for pair in pairs]
    table["role"] = [pair.role for pair in pairs]
    for name in ("used", "suspected"):
        table[name] = np.zeros(len(pairs), np.bool_)
    if found is not None and len(pairs):
        rows = {pair.id: row for row, pair in enumerate(pairs)}
        whole = complete(pairs)
        residuals = found.residuals(to_picks(whole))
        at = [rows[name] for name in residuals["id"]]
        for name in ("dx_m", "dy_m", "dz_m", "d_m"):
            table.loc[at, name] = residuals[name].to_numpy()
        used = [rows[name] for name in found.inliers.ids]
        table.loc[used, "used"] = True
        control = found.picks.control.ids
        folds = found.loocv.folds
        table.loc[[rows[control[i]] for i in folds["position"]], "loo_m"] = folds["d_m"].to_numpy()
        tested = found.reliability.picks
        for name in ("redundancy", "standardised", "p_value", "detectable_blunder_m", "suspected"):
            table.loc[used, name] = tested[name].to_numpy()
    flags = [
        _flagged(pair, used, d, p, suspected, blunder, threshold)
        if found is not None and pair.is_complete
        else ("", "", "")
        for pair, used, d, p, suspected, blunder in zip(
            pairs,
            table["used"].tolist(),
            table["d_m"].tolist(),
            table["p_value"].tolist(),
            table["suspected"].tolist(),
            table["detectable_blunder_m"].tolist(),
            strict=True,
        )
    ]
    for i, name in enumerate(("flag", "level", "why")):
        table[name] = [flag[i] for flag in flags]
    return table


def _flagged(
    pair: Pair,
    used: bool,
    d: float,
    p: float,
    suspected: bool,
    blunder: float,
    threshold: float,
) -> tuple[Flag, Level, str]:
    """Return a pair's flag, its level and its reason."""
    if pair.role == "off":
        return "", "", ""
    if pair.role == "check":
        if d > threshold:
            return "far", "red", f"This check pair lies {d:.2f} m off, beyond {threshold:g} m."
        return "", "", ""
    if not used:
        return "rejected", "red", f"It lies {d:.2f} m off, and the others agree without it."
    if suspected:
        return "suspect", "red", f"Its residual does not fit the others (p {p:.2g})."
    if p < LOOK_AGAIN:
        return "look again", "amber", f"So large a residual is rare (p {p:.2g})."
    if np.isinf(blunder):
        return "unchecked", "amber", "No other pair would show an error in it: pick more around it."
    return "", "", ""


def _rms(distances: pd.Series[float]) -> float:
    values = distances.to_numpy(np.float64)
    return float(np.sqrt((values**2).mean())) if len(values) else float("nan")
