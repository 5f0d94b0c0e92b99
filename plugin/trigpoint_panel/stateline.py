"""The state line: what there is and what comes next, as a pure function of the model."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from trigpoint.picks import FEWEST
from trigpoint_panel.model import Model
from trigpoint_panel.names import isolated, listed
from trigpoint_panel.pairs import CALLED, complete

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
    word : str
        The level in a word, for eyes that do not see its colour; empty for "info".
    """

    text: str
    level: Level
    enabled: frozenset[Action]
    word: str = ""


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
        return StateLine(failure, "red", standing.enabled, "Failed")
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
        name, view = isolated(half.id), CALLED[half.open_side]
        text = f"{name}: now click the same corner in the {view} view. (Esc drops it)"
        return StateLine(text, "info", can | {"drop"})
    if state.is_second_operator:
        done = len(complete(state.pairs))
        text = f"Second operator: {done} of {len(state.pairs)} pairs picked again."
        if done < len(state.pairs):
            text += f" Next: {isolated(state.selected)}." if state.selected else ""
        return StateLine(text, "info", can - {"errors", "report"})
    if not state.pairs:
        return StateLine("Press P, then click the same corner in both views.", "info", can)
    if fit.controls < FEWEST:
        return StateLine(_too_few(model), "info", can)
    if fit.alignment is None:
        return StateLine(fit.refusal, "red", can, "No fit")
    if model.is_stale:
        text = "Pairs changed since the report: run again."
        return StateLine(text, "amber", can, "Outdated")
    return _fitted(model, can)


def _too_few(model: Model) -> str:
    controls = model.fit.controls
    others = len(complete(model.pairs)) - controls
    if not others:
        return f"{controls} of {FEWEST} pairs. Spread them over height and around the object."
    are = "pair is" if others == 1 else "pairs are"
    return (
        f"{controls} of {FEWEST} control pairs, which make the fit. {others} other {are} check or "
        f"off: Space changes that."
    )


def _fitted(model: Model, can: frozenset[Action]) -> StateLine:
    fit = model.fit
    assert fit.similarity is not None
    used = int(fit.table["used"].sum())
    of = "" if used == fit.controls else f"{used} of "
    facts = [f"scale {fit.similarity.scale:.3f}"]
    if fit.adopted is not None:
        facts.append("ICP adopted: the views and the saved cloud have it, the report does not")
    facts.append(f"{of}{fit.controls} control, {fit.checks} check")
    text = " · ".join(facts)
    suspects, rejected, far = (fit.flagged(flag) for flag in ("suspect", "rejected", "far"))
    if suspects:
        also = f"; {listed(rejected)} rejected" if rejected else ""
        doubt = f"{listed(suspects)} does not fit the others{also}"
        return StateLine(f"{doubt} · {text}", "red", can, "Suspect")
    if rejected:
        doubt = f"{listed(rejected)} left out, the others agree"
        return StateLine(f"{doubt} · {text}", "red", can, "Rejected")
    if far:
        are = "a check pair, lies" if len(far) == 1 else "check pairs, lie"
        threshold = model.state.alignment.threshold_m
        doubt = f"{listed(far)}, {are} beyond {threshold:g} m"
        return StateLine(f"{doubt} · {text}", "red", can, "Far")
    if used == FEWEST:
        text += " · no pick can be tested yet: add a fourth"
        return StateLine(text, "amber", can, "Untested")
    if fit.weakness:
        return StateLine(f"{text} · {fit.weakness}", "amber", can, "Weak")
    return StateLine(text, "good", can, "Fitted")
