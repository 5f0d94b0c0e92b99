"""The state line: what there is and what comes next, as a pure function of the model."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

from trigpoint.picks import FEWEST
from trigpoint_panel.model import Model
from trigpoint_panel.pairs import complete, with_role

Level = Literal["info", "good", "amber", "red"]
Action = Literal[
    "open", "pick", "drop", "link", "overlay", "align", "errors", "report", "export", "cancel"
]

OPEN: frozenset[Action] = frozenset({"open"})
PICK: frozenset[Action] = OPEN | {"pick"}
FITTED: frozenset[Action] = PICK | {"link", "overlay", "align", "errors", "report", "export"}


@dataclass(frozen=True, slots=True)
class Running:
    """A job under way: what it does, and the share that is done (None: not known)."""

    what: str
    share: float | None = None


@dataclass(frozen=True, slots=True)
class StateLine:
    """One line at the foot of the panel.

    Attributes
    ----------
    text : str
        The next step, or what the fit is worth.
    level : {"info", "good", "amber", "red"}
    enabled : frozenset of str
        What can be done now.
    """

    text: str
    level: Level
    enabled: frozenset[Action]


def state_line(model: Model, *, running: Running | None = None, failure: str = "") -> StateLine:
    """Say where a session stands.

    Parameters
    ----------
    model : Model
    running : Running, optional
        The job under way.
    failure : str
        Why the last job failed, in one line; until the next change.
    """
    if running is not None:
        share = "" if running.share is None else f": {100 * running.share:.0f} %"
        return StateLine(
            f"{running.what}{share} (Esc cancels)", "info", frozenset({"cancel", "pick"})
        )
    standing = _standing(model)
    if failure:
        return StateLine(failure, "red", standing.enabled)
    return standing


def _standing(model: Model) -> StateLine:
    state = model.state
    if state.source_path is None and state.target_path is None and not state.pairs:
        return StateLine("Open a source cloud and a reference cloud.", "info", OPEN)
    if state.target_path is None and not state.pairs:
        return StateLine("Now open the reference (LiDAR).", "info", OPEN)
    if state.source_path is None and not state.pairs:
        return StateLine("Now open the source (the reconstruction).", "info", OPEN)
    fit = model.fit
    can = PICK if fit.alignment is None else FITTED
    if fit.alignment is not None and None in (state.source_path, state.target_path):
        can = can - {"errors", "report"}
    half = model.half_open
    if half is not None and half.open_side is not None:
        view = half.open_side
        text = f"{half.id}: now click the same corner in the {view} view. (Esc drops it)"
        return StateLine(text, "info", can | {"drop"})
    if state.is_second_operator:
        done = len(complete(state.pairs))
        text = f"Second operator: {done} of {len(state.pairs)} pairs picked again."
        if done < len(state.pairs):
            text += f" Next: {state.selected}." if state.selected else ""
        return StateLine(text, "info", can - {"errors", "report"})
    if not state.pairs:
        return StateLine("Press P, then click the same corner in both views.", "info", can)
    if fit.controls < FEWEST:
        text = f"{fit.controls} of {FEWEST} pairs. Spread them over height and around the object."
        return StateLine(text, "info", can)
    if fit.alignment is None:
        return StateLine(fit.refusal, "red", can)
    if model.is_stale:
        return StateLine("Pairs changed since the report: run again.", "amber", can)
    return _fitted(model, can)


def _fitted(model: Model, can: frozenset[Action]) -> StateLine:
    fit = model.fit
    assert fit.similarity is not None
    held_out = "n/a" if math.isnan(fit.loocv_rmse_m) else f"{fit.loocv_rmse_m:.3f} m"
    text = (
        f"scale {fit.similarity.scale:.3f} · RMSE {fit.rmse_m:.3f} m · LOOCV {held_out} · "
        f"{fit.controls} control, {len(with_role(model.pairs, 'check'))} check"
    )
    if fit.suspects:
        return StateLine(f"{text} · suspect: {', '.join(fit.suspects)}", "red", can)
    if fit.table["used"].sum() == FEWEST:
        text += " · no pick can be tested yet: add a fourth"
        return StateLine(text, "amber", can)
    if fit.weakness:
        return StateLine(f"{text} · {fit.weakness}", "amber", can)
    return StateLine(text, "good", can)
