"""The model: the state of a session, every change to it, and the way back."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal, cast

import numpy as np
from numpy.typing import ArrayLike

from trigpoint.errors import PicksError
from trigpoint.picks import examine, read_picks, write_picks
from trigpoint.project import Project
from trigpoint.similarity import Similarity
from trigpoint_panel.exchange import read_point_list, write_point_list, write_points_file
from trigpoint_panel.operators import Repeatability, repeatability, second_round, with_sigmas
from trigpoint_panel.pairs import (
    ROLES,
    SIDES,
    Pair,
    Pairs,
    Place,
    Role,
    Side,
    complete,
    exchanged,
    find,
    from_picks,
    next_id,
    refuse_taken,
    to_picks,
    waiting,
    without,
)
from trigpoint_panel.projects import reference_crs
from trigpoint_panel.state import Adopted, State, question, with_given, with_paths_of
from trigpoint_panel.statistics import Fit, Survey, fit_pairs

# A click further from its ghost than this many RMSE, and than this, deserves a word.
GHOST_RMSES, GHOST_M = 4.0, 1.0

Column = Literal[
    "id",
    "role",
    "source_x",
    "source_y",
    "source_z",
    "target_x",
    "target_y",
    "target_z",
    "sigma_source",
    "sigma_target",
    "note",
]
AXES = ("x", "y", "z")


@dataclass(frozen=True, slots=True)
class Ghost:
    """Where the fit of the other pairs expects the open half of a pair.

    Attributes
    ----------
    id : str
    side : {"source", "target"}
        The half that is open.
    xyz : tuple of three float
    pairs : int
        How many pairs put it there.
    """

    id: str
    side: Side
    xyz: Place
    pairs: int

    @property
    def label(self) -> str:
        """The pair's name with a question mark."""
        return f"{self.id}?"


@dataclass(frozen=True, slots=True)
class Placed:
    """What a click did.

    Attributes
    ----------
    id : str
        The pair whose half it filled.
    warning : str
        A doubt in one sentence, or empty.
    """

    id: str
    warning: str


@dataclass(frozen=True, slots=True)
class _Step:
    text: str
    before: State
    after: State


class Model:
    """The current state of a session, with undo and with listeners.

    Every change is one step with a name, undone as a whole. Selecting and opening clouds are no
    steps: undo leaves them be. `changed` holds plain callables, called after every change.
    """

    def __init__(self, state: State | None = None) -> None:
        self.changed: list[Callable[[], None]] = []
        self._state = state or State()
        self._done: list[_Step] = []
        self._undone: list[_Step] = []
        self._survey: Survey | None = None
        self._drafts: dict[tuple[str, Side], tuple[float | None, ...]] = {}
        self._reported: object = None

    # What there is -----------------------------------------------------------------------------

    @property
    def state(self) -> State:
        """The current state: frozen, to be compared and kept."""
        return self._state

    @property
    def pairs(self) -> Pairs:
        """The current pairs."""
        return self._state.pairs

    @property
    def selected(self) -> Pair | None:
        """The selected pair."""
        return find(self._state.pairs, self._state.selected)

    @property
    def half_open(self) -> Pair | None:
        """The selected pair if it is half open, else the last that is."""
        chosen = self.selected
        if chosen is not None and chosen.is_half_open:
            return chosen
        return next((pair for pair in reversed(self._state.pairs) if pair.is_half_open), None)

    @property
    def survey(self) -> Survey | None:
        """What is known of the reference; None until its cloud is loaded."""
        return self._survey

    @property
    def fit(self) -> Fit:
        """What the engine says of the current pairs; worked out once for each set of pairs."""
        return fit_pairs(self._state.pairs, self._state.alignment, self._survey)

    @property
    def similarity(self) -> Similarity | None:
        """What links and overlays the views: the adopted refinement, else the fit."""
        adopted = self._state.adopted
        return self.fit.similarity if adopted is None else adopted.similarity

    def ghost(self, pair: Pair | None = None) -> Ghost | None:
        """Predict the open half of a pair, by default of the selected or else the last such pair.

        None without a fit of three control pairs, without an open half, and for a second
        operator, whose hand it would lead.
        """
        pair = pair or self.half_open
        fit = self.fit.similarity
        if pair is None or fit is None or self._state.is_second_operator:
            return None
        if pair.source is not None and pair.target is None:
            xyz = fit(np.array([pair.source]))[0]
            return Ghost(pair.id, "target", _place(xyz), self.fit.controls)
        if pair.target is not None and pair.source is None:
            xyz = fit.inverse()(np.array([pair.target]))[0]
            return Ghost(pair.id, "source", _place(xyz), self.fit.controls)
        return None

    def draft(self, name: str, side: Side) -> tuple[float | None, float | None, float | None]:
        """Return what is typed so far of a half that is not whole yet."""
        x, y, z = self._drafts.get((name, side), (None, None, None))
        return x, y, z

    @property
    def is_stale(self) -> bool:
        """Whether what enters the results changed since `mark_reported`; False without one."""
        return self._reported is not None and self._reported != question(self._state)

    # Ways back ---------------------------------------------------------------------------------

    @property
    def undo_text(self) -> str:
        """What undo would undo; empty: nothing."""
        return self._done[-1].text if self._done else ""

    @property
    def redo_text(self) -> str:
        """What redo would do again; empty: nothing."""
        return self._undone[-1].text if self._undone else ""

    def undo(self) -> None:
        """Go back one step; nothing happens without one."""
        if self._done:
            step = self._done.pop()
            self._undone.append(step)
            self._set(with_paths_of(self._state, step.before))

    def redo(self) -> None:
        """Go forward again one step; nothing happens without one."""
        if self._undone:
            step = self._undone.pop()
            self._done.append(step)
            self._set(with_paths_of(self._state, step.after))

    def load(self, state: State) -> None:
        """Take over another session: nothing of the former can be undone."""
        self._done.clear()
        self._undone.clear()
        self._drafts.clear()
        self._reported = self._survey = None
        self._set(state)

    # Clouds and settings -----------------------------------------------------------------------

    def open_cloud(self, side: Side, path: Path | str) -> None:
        """Name the file of one side; pairs and undo stay."""
        path = Path(path).absolute()
        project = self._state.project
        if side == "target":
            if project.reference.path != path:
                self._survey = None
            project = replace(project, reference=replace(project.reference, path=path))
        else:
            project = with_given(self._state, replace(self._state.given, path=path))
        self._set(replace(self._state, project=project))

    def set_survey(self, extent: ArrayLike, places: ArrayLike) -> None:
        """Say where the reference lies: lowest and highest corner, and points to pick at, metres.

        A few thousand places, spread over it, are enough.
        """
        self._survey = Survey(
            np.array(extent, np.float64).reshape(2, 3), np.array(places, np.float64).reshape(-1, 3)
        )
        self._tell()

    def set_alignment(self, **changes: Any) -> None:
        """Change how the pairs are fitted: fields of AlignmentSettings."""
        project = self._state.project
        self._change_project("Change fit settings", alignment=replace(project.alignment, **changes))

    def set_comparison(self, **changes: Any) -> None:
        """Change how the clouds are compared: fields of ComparisonSettings."""
        settings = replace(self._state.comparison, **changes)
        self._change_project("Change comparison settings", comparison=settings)

    def set_about(self, **changes: Any) -> None:
        """Change what the report says of the project: fields of About."""
        self._change_project("Change project details", about=replace(self._state.about, **changes))

    def set_reference(self, **changes: Any) -> None:
        """Change what is known of the reference, its `crs` among it: fields of ReferenceInput."""
        reference = replace(self._state.project.reference, **changes)
        self._change_project("Change reference details", reference=reference)

    def set_project(self, project: Project) -> None:
        """Say which project.toml the session belongs to, once it is written; it is no step."""
        self._set(replace(self._state, project=project))

    def mark_reported(self) -> None:
        """Remember that a report was made of what the session holds now."""
        self._reported = question(self._state)
        self._tell()

    # Picking -----------------------------------------------------------------------------------

    def select(self, name: str | None) -> None:
        """Select a pair, or none."""
        if find(self._state.pairs, name) is None:
            name = None
        if name != self._state.selected:
            self._set(replace(self._state, selected=name))

    def select_next(self, step: int = 1) -> None:
        """Select the next pair, or with -1 the one before, round and round."""
        names = [pair.id for pair in self._state.pairs]
        if names:
            at = names.index(self._state.selected) if self._state.selected in names else None
            self.select(names[((at if at is not None else -min(step, 1)) + step) % len(names)])

    def place(
        self, side: Side, xyz: ArrayLike, *, sigma: float | None = None, note: str = ""
    ) -> Placed:
        """Pick a half: of the selected pair, else of the last open on that side, else of a new one.

        Parameters
        ----------
        side : {"source", "target"}
        xyz : array_like of shape (3,)
            Source units, or metres.
        sigma : float, optional
            Standard deviation per axis of the snap, in the same units.
        note : str
            How it was snapped, with the raw pick.

        Returns
        -------
        Placed
            A warning where it lies far from its ghost, or where another pair lies.

        Raises
        ------
        PicksError
            For a coordinate that is not finite, and when a second operator has picked all.
        """
        place = _place(xyz)
        pair = waiting(self._state.pairs, self._state.selected, side)
        if pair is None and self._state.is_second_operator:
            message = "Every pair is picked again on this side: end the second operator's round."
            raise PicksError(message)
        warning = self._doubt(pair, side, place)
        known = self._state.pairs
        if pair is None:
            pair = Pair(next_id((*known, *(self._state.first or ()))))
            known = (*known, pair)
        filled = pair.placed(side, place, sigma=sigma, note=note)
        verb = "Complete" if filled.is_complete else "Pick"
        pairs = exchanged(known, pair.id, filled)
        selected = pair.id
        if filled.is_complete and self._state.is_second_operator:
            selected = next((each.id for each in pairs if not each.is_complete), pair.id)
        self._step(f"{verb} {pair.id} in the {side}", pairs=pairs, selected=selected)
        return Placed(pair.id, warning)

    def drop_open_half(self) -> str | None:
        """Drop the selected half-open pair, else the last such; return its id, None without one."""
        pair = self.half_open
        if pair is None:
            return None
        if self._state.is_second_operator:
            blank = replace(pair.placed("source", None).placed("target", None))
            pairs = exchanged(self._state.pairs, pair.id, blank)
        else:
            pairs = without(self._state.pairs, {pair.id})
        self._step(f"Drop {pair.id}", pairs=pairs)
        return pair.id

    def new_pair(self) -> str:
        """Begin a pair with both halves open, to type its coordinates, and select it."""
        name = next_id((*self._state.pairs, *(self._state.first or ())))
        self._step(f"New pair {name}", pairs=(*self._state.pairs, Pair(name)), selected=name)
        return name

    def move(
        self,
        name: str,
        side: Side,
        xyz: ArrayLike,
        *,
        sigma: float | None = None,
        note: str = "",
    ) -> None:
        """Put one half of a pair somewhere else."""
        moved = self._known(name).placed(side, _place(xyz), sigma=sigma, note=note)
        pairs = exchanged(self._state.pairs, name, moved)
        self._step(f"Move {name} in the {side}", pairs=pairs)

    def reopen(self, name: str, side: Side) -> None:
        """Open one half of a pair again, so that the next click there picks it anew."""
        pair = self._known(name).placed(side, None)
        if pair.source is None and pair.target is None and not self._state.is_second_operator:
            self.delete({name})
            return
        pairs = exchanged(self._state.pairs, name, pair)
        self._step(f"Open {name} in the {side}", pairs=pairs, selected=name)

    def delete(self, names: Collection[str]) -> None:
        """Delete pairs; nothing happens for ids that there are not."""
        gone = [pair.id for pair in self._state.pairs if pair.id in names]
        if gone:
            text = f"Delete {gone[0]}" if len(gone) == 1 else f"Delete {len(gone)} pairs"
            self._step(text, pairs=without(self._state.pairs, gone))

    def rename(self, name: str, successor: str) -> None:
        """Give a pair another id.

        Raises
        ------
        PicksError
            If the id is empty or taken.
        """
        pair = self._known(name)
        if successor.strip() == name:
            return
        if self._state.is_second_operator:
            message = "Names tie the two operators' picks together: rename after the second round."
            raise PicksError(message)
        bare = refuse_taken(self._state.pairs, successor)
        selected = bare if self._state.selected == name else self._state.selected
        pairs = exchanged(self._state.pairs, name, replace(pair, id=bare))
        self._step(f"Rename {name} to {bare}", pairs=pairs, selected=selected)

    def set_role(self, names: Collection[str], role: Role) -> None:
        """Make pairs control, check or off."""
        pairs = tuple(
            replace(pair, role=role) if pair.id in names else pair for pair in self._state.pairs
        )
        who = next(iter(names)) if len(names) == 1 else f"{len(names)} pairs"
        self._step(f"Set {who} to {role}", pairs=pairs)

    def cycle_role(self, names: Collection[str]) -> None:
        """Take pairs from control to check, to off, to control; all as the first of them."""
        first = next((pair for pair in self._state.pairs if pair.id in names), None)
        if first is not None:
            self.set_role(names, ROLES[(ROLES.index(first.role) + 1) % len(ROLES)])

    def edit(self, name: str, column: Column, text: str) -> None:
        """Take what was typed into a cell of the table.

        A coordinate typed into an open half waits in a draft until all three are there; three
        numbers in one cell fill it at once.

        Raises
        ------
        PicksError
            If it can't be what the column holds.
        """
        pair = self._known(name)
        if column == "id":
            self.rename(name, text)
        elif column == "role":
            role = text.strip().lower()
            if role not in ROLES:
                message = f"The role {text.strip()!r} is not known: type control, check or off."
                raise PicksError(message)
            self.set_role({name}, role)
        elif column == "note":
            self._exchange(f"Edit note of {name}", replace(pair, note=" ".join(text.split())))
        elif column in ("sigma_source", "sigma_target"):
            sigma = _number(text) if text.strip() else None
            if sigma is not None and not sigma > 0:
                message = f"A sigma of {text.strip()} can't be: type a number above zero, or none."
                raise PicksError(message)
            changes: dict[str, Any] = {column: sigma}
            self._exchange(f"Edit sigma of {name}", replace(pair, **changes))
        else:
            side, _, axis = column.partition("_")
            self._edit_place(pair, cast(Side, side), AXES.index(axis), text)

    # Files and operators -----------------------------------------------------------------------

    def import_picks(self, path: Path | str, *, replacing: bool = False) -> tuple[str, ...]:
        """Add the pairs of a picks.csv, or take them in place of the current ones.

        Returns
        -------
        tuple of str
            Doubts, a sentence each.

        Raises
        ------
        TrigpointError
            In a sentence, also for what another program's list is; or if an id is taken.
        """
        self._refuse_second_operator()
        picks = read_picks(path, crs=reference_crs(self._state.project))
        added = from_picks(picks)
        kept = () if replacing else self._state.pairs
        taken = sorted({pair.id for pair in kept} & {pair.id for pair in added})
        if taken:
            message = (
                f"{', '.join(taken[:5])} {'is' if len(taken) == 1 else 'are'} there already: "
                f"rename, or import in place of the current pairs."
            )
            raise PicksError(message)
        self._step(f"Import {Path(path).name}", pairs=(*kept, *added))
        return tuple(caution.message for caution in (*picks.cautions, *examine(picks)))

    def import_points(self, path: Path | str, side: Side) -> tuple[str, ...]:
        """Fill the halves of one side from a CloudCompare picking list.

        A point goes to the pair of its name, else to the first pair whose half is open, else it
        begins a pair. Coordinates are source units, or metres.

        Returns
        -------
        tuple of str
            The ids of the pairs filled, in the list's order.

        Raises
        ------
        PicksError
            In a sentence, if the file is no such list; the pairs are as they were.
        """
        self._refuse_second_operator()
        pairs, filled = self._state.pairs, []
        for point in read_point_list(path):
            pair = find(pairs, point.name)
            if pair is None and not point.name:
                pair = next((each for each in pairs if each.at(side) is None), None)
            if pair is None:
                pair = Pair(point.name or next_id(pairs))
                pairs = (*pairs, pair)
            placed = pair.placed(side, point.xyz, note=f"from {Path(path).name}")
            pairs = exchanged(pairs, pair.id, placed)
            filled.append(pair.id)
        self._step(f"Import {Path(path).name} as {side}", pairs=pairs)
        return tuple(filled)

    def export_picks(self, path: Path | str) -> tuple[Path, ...]:
        """Write the complete pairs: .csv for the engine, .points for QGIS, .txt for CloudCompare.

        QGIS's file holds the plan only; CloudCompare's are two lists, one a side.

        Returns
        -------
        tuple of Path
            The files written.

        Raises
        ------
        TrigpointError
            If there is nothing to write, or no way to.
        """
        path = Path(path)
        pairs, crs = self._state.first or self._state.pairs, reference_crs(self._state.project)
        if not complete(pairs):
            message = "There is no complete pair to export."
            raise PicksError(message)
        if path.suffix.lower() == ".csv":
            write_picks(path, to_picks(pairs), crs=crs)
            return (path,)
        if path.suffix.lower() == ".points":
            write_points_file(path, pairs, crs)
            return (path,)
        if path.suffix.lower() != ".txt":
            message = (
                f"Pairs are written as .csv (trigpoint), .points (QGIS) or .txt (CloudCompare), "
                f"not as {path.suffix or path.name}."
            )
            raise PicksError(message)
        written = tuple(path.with_stem(f"{path.stem}-{side}") for side in SIDES)
        for side, each in zip(SIDES, written, strict=True):
            write_point_list(each, pairs, side)
        return written

    def begin_second_operator(self) -> None:
        """Hide the pairs, and have a second operator pick the same places again."""
        self._refuse_second_operator()
        blank = second_round(self._state.pairs)
        self._step(
            "Begin second operator", first=self._state.pairs, pairs=blank, selected=blank[0].id
        )

    def end_second_operator(self, *, adopt: bool) -> Repeatability:
        """Bring the first operator's pairs back, and say how far two picks of a place lie apart.

        Parameters
        ----------
        adopt : bool
            Whether the pairs that state no sigma take the picking sigma found.

        Raises
        ------
        PicksError
            If no second operator is picking.
        """
        first = self._first_operator()
        found = repeatability(first, self._state.pairs)
        pairs = with_sigmas(first, found) if adopt else first
        self._step("End second operator", pairs=pairs, first=None)
        return found

    def cancel_second_operator(self) -> None:
        """Bring the first operator's pairs back, and forget the second's.

        Raises
        ------
        PicksError
            If no second operator is picking.
        """
        self._step("Cancel second operator", pairs=self._first_operator(), first=None)

    def adopt(self, similarity: Similarity) -> None:
        """Show and save the fit as ICP refined it, until a pair changes; the audit is as ever."""
        flat = (*similarity.rotation.ravel().tolist(),)
        adopted = Adopted(similarity.scale, flat, (*similarity.translation.tolist(),))
        self._step("Adopt ICP", adopted=adopted)

    def discard_adopted(self) -> None:
        """Go back to the fit."""
        self._step("Discard ICP", adopted=None)

    # How it is done ----------------------------------------------------------------------------

    def _edit_place(self, pair: Pair, side: Side, axis: int, text: str) -> None:
        numbers = _numbers(text)
        if len(numbers) == 3:
            whole: list[float | None] = list(numbers)
        elif len(numbers) == 1:
            whole = list(pair.at(side) or self.draft(pair.id, side))
            whole[axis] = numbers[0]
        else:
            message = f"{text.strip()!r} is not a coordinate: type one number, or x, y and z."
            raise PicksError(message)
        if any(value is None for value in whole):
            self._drafts[pair.id, side] = tuple(whole)
            self._tell()
            return
        self._drafts.pop((pair.id, side), None)
        typed = pair.placed(side, _place(cast(list[float], whole)), note="typed")
        self._exchange(f"Type {pair.id} in the {side}", typed)

    def _exchange(self, text: str, pair: Pair) -> None:
        self._step(text, pairs=exchanged(self._state.pairs, pair.id, pair))

    def _known(self, name: str) -> Pair:
        pair = find(self._state.pairs, name)
        if pair is None:
            message = f"There is no pair {name!r}."
            raise PicksError(message)
        return pair

    def _first_operator(self) -> Pairs:
        if self._state.first is None:
            message = "No second operator is picking."
            raise PicksError(message)
        return self._state.first

    def _refuse_second_operator(self) -> None:
        if self._state.is_second_operator:
            message = "A second operator is picking: end that round first."
            raise PicksError(message)

    def _doubt(self, pair: Pair | None, side: Side, place: Place) -> str:
        """Say what is doubtful about a pick before it is made."""
        same = next((each.id for each in self._state.pairs if each.at(side) == place), None)
        if same is not None:
            return f"That is {same}'s point already. Keep?"
        ghost = None if pair is None else self.ghost(pair)
        fit = self.fit
        if ghost is None or ghost.side != side or fit.similarity is None:
            return ""
        apart = math.dist(ghost.xyz, place) * (fit.similarity.scale if side == "source" else 1.0)
        if apart <= max(GHOST_RMSES * fit.rmse_m, GHOST_M):
            return ""
        return f"{apart:.1f} m from where {ghost.pairs} pairs put it. Keep?"

    def _change_project(self, text: str, **changes: Any) -> None:
        self._step(text, project=replace(self._state.project, **changes))

    def _step(self, text: str, **changes: Any) -> None:
        after = replace(self._state, **changes)
        if find(after.pairs, after.selected) is None:
            after = replace(after, selected=None)
        if "adopted" not in changes and question(after) != question(self._state):
            after = replace(after, adopted=None)  # it refined a fit that is no more
        if replace(after, selected=None) == replace(self._state, selected=None):
            self._set(after)
            return
        self._done.append(_Step(text, self._state, after))
        self._undone.clear()
        self._set(after)

    def _set(self, state: State) -> None:
        if state != self._state:
            self._state = state
            self._tell()

    def _tell(self) -> None:
        for listener in tuple(self.changed):
            listener()


def _place(xyz: ArrayLike) -> Place:
    values = np.asarray(xyz, np.float64)
    if values.shape != (3,) or not np.isfinite(values).all():
        message = f"{values.tolist()} is no place: give three finite numbers."
        raise PicksError(message)
    x, y, z = values.tolist()
    return x, y, z


def _numbers(text: str) -> list[float]:
    """Read one number, or three between blanks, semicolons or commas."""
    cells = text.replace(";", " ").split()
    if len(cells) == 1 and cells[0].count(",") == 2:
        cells = cells[0].split(",")
    return [_number(cell.rstrip(",")) for cell in cells]


def _number(text: str) -> float:
    """Read a number with a decimal point, or with a decimal comma where there is no point."""
    plain = text.strip()
    if plain.count(",") == 1 and "." not in plain:
        plain = plain.replace(",", ".")
    try:
        value = float(plain) if "_" not in plain else math.nan
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        message = f"{text.strip()!r} is not a number: type digits, with a decimal point."
        raise PicksError(message)
    return value
