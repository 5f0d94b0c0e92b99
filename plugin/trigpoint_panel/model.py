"""The model: the state of a session, every change to it, and the way back."""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import replace
from pathlib import Path
from typing import Any

from numpy.typing import ArrayLike

from trigpoint.errors import PicksError
from trigpoint.project import Project
from trigpoint.similarity import Similarity
from trigpoint_panel.cells import PLACES, Column, Draft, Drafts, typed_cell, typed_place
from trigpoint_panel.clicks import Placed, clicked
from trigpoint_panel.ghosts import Ghost, doubt, predict
from trigpoint_panel.history import History
from trigpoint_panel.pairs import (
    ROLES,
    Pair,
    Pairs,
    Role,
    Side,
    exchanged,
    find,
    next_id,
    place_of,
    refuse_taken,
    without,
)
from trigpoint_panel.projects import checked
from trigpoint_panel.state import State, adopted_of, question, with_given, with_paths_of
from trigpoint_panel.statistics import Fit, Survey, fit_pairs, survey_of


class Model:
    """The current state of a session, with undo and with listeners.

    Every change is one step with a name, undone as a whole. Selecting and opening clouds are no
    steps: undo leaves them be. `changed` holds plain callables, called after every change.
    """

    def __init__(self, state: State | None = None) -> None:
        self.changed: list[Callable[[], None]] = []
        self._state = state or State()
        self._history = History()
        self._survey: Survey | None = None
        self._drafts = Drafts()
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
        state = self._state
        return fit_pairs(state.pairs, state.alignment, self._survey, state.adopted)

    @property
    def similarity(self) -> Similarity | None:
        """What links and overlays the views: the adopted refinement, else the fit."""
        return self.fit.similarity

    def ghost(self, pair: Pair | None = None) -> Ghost | None:
        """Predict the open half of a pair, by default of the selected or else the last such pair.

        None without a fit of three control pairs, without an open half, and for a second
        operator, whose hand it would lead.
        """
        pair = pair or self.half_open
        if pair is None or self._state.is_second_operator:
            return None
        return predict(pair, self.fit)

    def draft(self, name: str, side: Side) -> Draft:
        """Return what is typed so far of a half that is not whole yet."""
        return self._drafts.of(name, side)

    @property
    def is_stale(self) -> bool:
        """Whether what enters the results changed since `mark_reported`; False without one."""
        return self._reported is not None and self._reported != question(self._state)

    # Steps and ways back -----------------------------------------------------------------------

    @property
    def undo_text(self) -> str:
        """What undo would undo; empty: nothing."""
        return self._history.undo_text

    @property
    def redo_text(self) -> str:
        """What redo would do again; empty: nothing."""
        return self._history.redo_text

    def undo(self) -> None:
        """Go back one step; nothing happens without one."""
        self._back_to(self._history.undo())

    def redo(self) -> None:
        """Go forward again one step; nothing happens without one."""
        self._back_to(self._history.redo())

    def load(self, state: State) -> None:
        """Take over another session: nothing of the former can be undone."""
        self._history = History()
        self._drafts.clear()
        self._reported = self._survey = None
        self._state = state
        self._tell()

    def step(self, text: str, **changes: Any) -> None:
        """Change fields of the state, as one step that undo names; nothing where nothing does."""
        after = replace(self._state, **changes)
        if find(after.pairs, after.selected) is None:
            after = replace(after, selected=None)
        if "adopted" not in changes and question(after) != question(self._state):
            after = replace(after, adopted=None)  # it refined a fit that is no more
        if replace(after, selected=None) == replace(self._state, selected=None):
            self._set(after)
            return
        self._history.add(text, self._state, after)
        self._set(after)

    def refuse_second_operator(self) -> None:
        """Raise PicksError while a second operator picks."""
        if self._state.is_second_operator:
            message = "A second operator is picking: end that round first."
            raise PicksError(message)

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
        """Say where the reference lies: see `trigpoint_panel.statistics.survey_of`."""
        self._survey = survey_of(extent, places)
        self._tell()

    def set_alignment(self, **changes: Any) -> None:
        """Change how the pairs are fitted: fields of AlignmentSettings, or ProjectError."""
        project = self._state.project
        self._change_project("Change fit settings", alignment=replace(project.alignment, **changes))

    def set_comparison(self, **changes: Any) -> None:
        """Change how the clouds are compared: fields of ComparisonSettings, or ProjectError."""
        settings = replace(self._state.comparison, **changes)
        self._change_project("Change comparison settings", comparison=settings)

    def set_about(self, **changes: Any) -> None:
        """Change what the report says of the project: fields of About, or ProjectError."""
        self._change_project("Change project details", about=replace(self._state.about, **changes))

    def set_reference(self, **changes: Any) -> None:
        """Change what is known of the reference: fields of ReferenceInput, or ProjectError."""
        reference = replace(self._state.project.reference, **changes)
        self._change_project("Change reference details", reference=reference)

    def set_project(self, project: Project) -> None:
        """Say which project.toml the session belongs to, once it is written; it is no step."""
        self._set(replace(self._state, project=project))

    def mark_reported(self, state: State | None = None) -> None:
        """Remember that a report was made of the state it was asked for, by default of now."""
        self._reported = question(state or self._state)
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
        if self._state.selected in names:
            self.select(names[(names.index(self._state.selected) + step) % len(names)])
        elif names:
            self.select(names[0 if step > 0 else -1])

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
        place = place_of(xyz)
        click = clicked(self._state, side, place, sigma=sigma, note=note)
        ghost = None if click.found is None else self.ghost(click.found)
        warning = doubt(self._state.pairs, side, place, ghost, self.fit if ghost else None)
        self.step(click.text, pairs=click.pairs, selected=click.selected)
        return Placed(click.id, warning)

    def drop_open_half(self) -> str | None:
        """Drop the selected half-open pair, else the last such; return its id, None without one."""
        pair = self.half_open
        if pair is None:
            return None
        if self._state.is_second_operator:
            blank = pair.placed("source", None).placed("target", None)
            pairs = exchanged(self._state.pairs, pair.id, blank)
        else:
            pairs = without(self._state.pairs, {pair.id})
        self.step(f"Drop {pair.id}", pairs=pairs)
        return pair.id

    def new_pair(self) -> str:
        """Begin a pair with both halves open, to type its coordinates, and select it."""
        self.refuse_second_operator()
        name = next_id(self._state.pairs)
        self.step(f"New pair {name}", pairs=(*self._state.pairs, Pair(name)), selected=name)
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
        moved = self._known(name).placed(side, place_of(xyz), sigma=sigma, note=note)
        pairs = exchanged(self._state.pairs, name, moved)
        self.step(f"Move {name} in the {side}", pairs=pairs)

    def reopen(self, name: str, side: Side) -> None:
        """Open one half of a pair again, so that the next click there picks it anew."""
        pair = self._known(name).placed(side, None)
        pairs = exchanged(self._state.pairs, name, pair)
        self.step(f"Open {name} in the {side}", pairs=pairs, selected=name)

    def delete(self, names: Collection[str]) -> None:
        """Delete pairs; nothing happens for ids that there are not."""
        gone = [pair.id for pair in self._state.pairs if pair.id in names]
        if gone:
            text = f"Delete {gone[0]}" if len(gone) == 1 else f"Delete {len(gone)} pairs"
            self.step(text, pairs=without(self._state.pairs, gone))

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
        self.step(f"Rename {name} to {bare}", pairs=pairs, selected=selected)

    def set_role(self, names: Collection[str], role: Role) -> None:
        """Make pairs control, check or off."""
        pairs = tuple(
            replace(pair, role=role) if pair.id in names else pair for pair in self._state.pairs
        )
        who = next(iter(names)) if len(names) == 1 else f"{len(names)} pairs"
        self.step(f"Set {who} to {role}", pairs=pairs)

    def cycle_role(self, names: Collection[str]) -> None:
        """Take pairs from control to check, to off, to control; all as the first of them."""
        first = next((pair for pair in self._state.pairs if pair.id in names), None)
        if first is not None:
            self.set_role(names, ROLES[(ROLES.index(first.role) + 1) % len(ROLES)])

    def edit(self, name: str, column: Column, text: str) -> None:
        """Take what was typed into a cell of the table.

        A coordinate typed into an open half waits in a draft until all three are there; three
        numbers in one cell fill it at once. A coordinate that is emptied opens its half again.

        Raises
        ------
        PicksError
            If it can't be what the column holds.
        """
        pair = self._known(name)
        if column == "id":
            self.rename(name, text)
        elif column in PLACES:
            side, axis = PLACES[column]
            if not text.strip() and pair.at(side) is not None:
                self.reopen(name, side)
                return
            half = pair.at(side) or self.draft(name, side)
            place = self._drafts.typed(name, side, typed_place(half, axis, text))
            if place is None:
                self._tell()
            elif place != pair.at(side):
                self.move(name, side, place, note="typed")
        else:
            edited = typed_cell(pair, column, text)
            self.step(f"Edit {name}", pairs=exchanged(self._state.pairs, name, edited))

    def adopt(self, similarity: Similarity) -> None:
        """Show and save the fit as ICP refined it, until a pair changes; the audit is as ever."""
        self.step("Adopt ICP", adopted=adopted_of(similarity))

    def discard_adopted(self) -> None:
        """Go back to the fit."""
        self.step("Discard ICP", adopted=None)

    # How it is done ----------------------------------------------------------------------------

    def _known(self, name: str) -> Pair:
        pair = find(self._state.pairs, name)
        if pair is None:
            message = f"There is no pair {name!r}."
            raise PicksError(message)
        return pair

    def _change_project(self, text: str, **changes: Any) -> None:
        self.step(text, project=checked(replace(self._state.project, **changes)))

    def _back_to(self, state: State | None) -> None:
        if state is not None:
            self._set(with_paths_of(self._state, state))

    def _set(self, state: State) -> None:
        if state != self._state:
            self._state = state
            self._drafts.keep_open(state.pairs)
            self._tell()

    def _tell(self) -> None:
        for listener in tuple(self.changed):
            listener()
