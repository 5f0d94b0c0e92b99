"""Statistics of the current pairs: what the engine says of them, as the panel shows it."""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
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
from trigpoint_panel.names import isolated
from trigpoint_panel.pairs import Pairs, complete, to_picks, with_role
from trigpoint_panel.state import Adopted
from trigpoint_panel.verdicts import Flag, verdicts

# A second spread this small beside the first is a line, as far as a person is concerned.
LINE = 1e-3
# Of the places listed to pick next: how many, and how far apart as a share of the reference's
# diagonal. As in the audit's record.
NEXT, APART = 3, 0.1
# So many places are judged after every pick, a quarter of the audit's: the gain is smooth, and the
# hand is waiting.
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


# The engine's cautions that name single picks.
AGAINST_PICKS = frozenset({"blunder_suspected", "picks_rejected"})
TESTED = ("redundancy", "standardised", "p_value", "detectable_blunder_m")


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
        there is no number. After ICP the residuals are those of the adopted similarity, and what
        is known of the fit alone (leave-one-out, redundancy, tests) is NaN.
    controls, checks : int
        Complete control and check pairs.
    rmse_m, check_rmse_m, loocv_rmse_m : float
        Of the inliers, of the check pairs, of leave-one-out; NaN where there is none. Leave-one-out
        is of the fit, without ICP.
    weakness : str
        What makes the layout weak, in one clause; empty where it is sound.
    next_picks : DataFrame
        x, y, z, gain_m: where to pick next, best first. Empty without a survey.
    adopted : Similarity or None
        ICP's refinement of the fit, where it is adopted for what is shown and saved.
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
    adopted: Similarity | None = None

    @property
    def similarity(self) -> Similarity | None:
        """Maps source to target as it is shown and saved, or None."""
        if self.adopted is not None:
            return self.adopted
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
    def doubt(self) -> str:
        """What the engine says against single picks, in its words; empty: nothing."""
        said = (each.message for each in self.cautions if each.code in AGAINST_PICKS)
        return " ".join(said)

    @property
    def suspects(self) -> tuple[str, ...]:
        """Ids of the pairs in red, worst first; check pairs, which the fit may wrong, last."""
        red = self.table[self.table["level"] == "red"]
        red = red.assign(check=red["role"] == "check", d_m=-red["d_m"])
        return tuple(red.sort_values(["check", "d_m"], kind="stable")["id"])

    def flagged(self, flag: Flag) -> tuple[str, ...]:
        """Ids of the pairs in red that have this flag, worst first."""
        named = set(self.table["id"][self.table["flag"] == flag])
        return tuple(name for name in self.suspects if name in named)


def fit_pairs(
    pairs: Pairs,
    settings: AlignmentSettings | None = None,
    survey: Survey | None = None,
    adopted: Adopted | None = None,
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
    adopted : Adopted, optional
        ICP's refinement of the fit of exactly these pairs.
    """
    return _fit(pairs, settings or AlignmentSettings(), survey, adopted)


@lru_cache(maxsize=32)
def _fit(
    pairs: Pairs, settings: AlignmentSettings, survey: Survey | None, adopted: Adopted | None
) -> Fit:
    bare = tuple(replace(pair, note="") for pair in complete(pairs))
    found, refusal, places = _aligned(bare, settings, survey)
    controls, checks = with_role(pairs, "control"), with_role(pairs, "check")
    refined = None if adopted is None else adopted.similarity
    table = _table(pairs, found, refined, settings.threshold_m)
    if found is None:
        nan = float("nan")
        return Fit(
            None, refusal, table, len(controls), len(checks), nan, nan, nan, "", _nowhere(), refined
        )
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
        refined,
    )


@lru_cache(maxsize=64)
def _aligned(
    pairs: Pairs, settings: AlignmentSettings, survey: Survey | None
) -> tuple[Alignment | None, str, pd.DataFrame]:
    """Ask the engine; half-open pairs and notes come and go without asking again."""
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
                return (
                    f"{isolated(first)} and {isolated(pair.id)} are the same point in the {side}: "
                    "pick one again."
                )
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


def _table(
    pairs: Pairs, found: Alignment | None, refined: Similarity | None, threshold: float
) -> pd.DataFrame:
    table = pd.DataFrame({name: [np.nan] * len(pairs) for name in COLUMNS}, index=range(len(pairs)))
    table["id"] = [pair.id for pair in pairs]
    table["role"] = [pair.role for pair in pairs]
    for name in ("used", "suspected"):
        table[name] = np.zeros(len(pairs), np.bool_)
    for name in ("flag", "level", "why"):
        table[name] = [""] * len(pairs)
    if found is None or not len(pairs):
        return table
    rows = {pair.id: row for row, pair in enumerate(pairs)}
    whole = to_picks(complete(pairs))
    errors = whole.target - (refined or found.similarity)(whole.source)
    at = [rows[name] for name in whole.ids]
    table.loc[at, ["dx_m", "dy_m", "dz_m"]] = errors
    table.loc[at, "d_m"] = np.sqrt((errors**2).sum(axis=1))
    used = [rows[name] for name in found.inliers.ids]
    table.loc[used, "used"] = True
    control = found.picks.control.ids
    folds = found.loocv.folds
    table.loc[[rows[control[i]] for i in folds["position"]], "loo_m"] = folds["d_m"].to_numpy()
    tested = found.reliability.picks
    for name in (*TESTED, "suspected"):
        table.loc[used, name] = tested[name].to_numpy()
    said = verdicts(table, pairs, threshold, after_icp=refined is not None)
    for i, name in enumerate(("flag", "level", "why")):
        table[name] = [verdict[i] for verdict in said]
    if refined is not None:
        table[["loo_m", *TESTED]] = np.nan
    return table


def _rms(distances: pd.Series[float]) -> float:
    values = distances.to_numpy(np.float64)
    return float(np.sqrt((values**2).mean())) if len(values) else float("nan")
