"""Verdicts: what is wrong with a pair, in a word, with its level and its reason."""

from __future__ import annotations

from typing import Literal

import numpy as np
import pandas as pd

from trigpoint_panel.names import isolated
from trigpoint_panel.pairs import Pairs

Flag = Literal["", "rejected", "suspect", "look again", "not testable", "far"]
Level = Literal["", "amber", "red"]
Verdict = tuple[Flag, Level, str]

# Below 5 % a residual deserves a look; naming a suspect asks for 5 % shared among all picks.
LOOK_AGAIN = 0.05


def verdicts(
    table: pd.DataFrame, pairs: Pairs, threshold: float, *, after_icp: bool = False
) -> list[Verdict]:
    """Return the verdict on each pair, from the table of `trigpoint_panel.statistics`.

    One wrong pick bends the fit, and others then stand out because of it: one alone is the
    suspect, the worst, as in the engine's caution. The tests are of the fit, also after ICP.
    """
    chances = table["p_value"].where(table["suspected"], np.inf).to_numpy(np.float64)
    worst = int(chances.argmin()) if table["suspected"].any() else None
    then = ", before ICP" if after_icp else ""
    because = "" if worst is None else f", perhaps only because of {isolated(pairs[worst].id)}"
    columns = ("d_m", "p_value", "used", "detectable_blunder_m")
    found: list[Verdict] = []
    for row, (pair, d, p, used, blunder) in enumerate(
        zip(pairs, *(table[name].tolist() for name in columns), strict=True)
    ):
        if pair.role == "off" or not pair.is_complete:
            found.append(("", "", ""))
        elif pair.role == "check":
            found.append(_of_check(d, threshold, because))
        elif not used:
            why = f"It lies {d:.2f} m off, and the others agree without it."
            found.append(("rejected", "red", why))
        elif row == worst:
            why = f"Its residual does not fit the others (p {p:.2g}{then})."
            found.append(("suspect", "red", why))
        elif p < LOOK_AGAIN:
            why = f"So large a residual is rare (p {p:.2g}{then}){because}."
            found.append(("look again", "amber", why))
        elif np.isinf(blunder):
            why = "No other pair would show an error in it: pick more around it."
            found.append(("not testable", "amber", why))
        else:
            found.append(("", "", ""))
    return found


def _of_check(d: float, threshold: float, because: str = "") -> Verdict:
    """Return the verdict on a check pair; `because` ends its reason, of a fit that is in doubt."""
    if not d > threshold:
        return "", "", ""
    why = f"This check pair lies {d:.2f} m off, beyond {threshold:g} m{because}."
    return "far", "amber" if because else "red", why
