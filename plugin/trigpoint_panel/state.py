"""The state of a session: all that is saved and undone, as one frozen value."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from trigpoint.project import (
    About,
    AlignmentSettings,
    ComparisonSettings,
    Project,
    ReconstructionInput,
    ReferenceInput,
)
from trigpoint.similarity import Similarity
from trigpoint_panel.pairs import Pairs

# A path that is not there yet; the engine's Project knows no None.
NOWHERE = Path()

BLANK = Project(
    NOWHERE,
    About("untitled"),
    ReferenceInput(NOWHERE),
    (ReconstructionInput("nerf", NOWHERE),),
    AlignmentSettings(),
    ComparisonSettings(),
    (),
    (),
)


@dataclass(frozen=True, slots=True)
class Adopted:
    """A similarity that ICP refined and a person adopted for what is shown and saved.

    Attributes
    ----------
    scale : float
    rotation : tuple of nine float
        Row by row.
    translation : tuple of three float
    """

    scale: float
    rotation: tuple[float, ...]
    translation: tuple[float, ...]

    @property
    def similarity(self) -> Similarity:
        """The same as the engine has it."""
        return Similarity(
            self.scale, np.array(self.rotation).reshape(3, 3), np.array(self.translation)
        )


def adopted_of(similarity: Similarity) -> Adopted:
    """Return a similarity as a state holds it."""
    flat = (*similarity.rotation.ravel().tolist(),)
    return Adopted(similarity.scale, flat, (*similarity.translation.tolist(),))


@dataclass(frozen=True, slots=True)
class State:
    """All of a session that is saved and undone.

    Attributes
    ----------
    project : Project
        Paths (`NOWHERE` while there is none), settings and facts, as the engine reads them;
        `project.path` is the project.toml that it belongs to.
    reconstruction : str
        Which of the project's reconstructions is the source.
    pairs : tuple of Pair
    selected : str or None
        Id of the pair that the next click completes.
    first : tuple of Pair or None
        The first operator's pairs while a second one picks them again in `pairs`.
    adopted : Adopted or None
        ICP's refinement of the fit of exactly these pairs.
    """

    project: Project = BLANK
    reconstruction: str = "nerf"
    pairs: Pairs = ()
    selected: str | None = None
    first: Pairs | None = None
    adopted: Adopted | None = None

    @property
    def given(self) -> ReconstructionInput:
        """The source, as the project has it."""
        return next(
            each for each in self.project.reconstructions if each.name == self.reconstruction
        )

    @property
    def source_path(self) -> Path | None:
        """The source cloud's file, or None."""
        return None if self.given.path == NOWHERE else self.given.path

    @property
    def target_path(self) -> Path | None:
        """The reference cloud's file, or None."""
        path = self.project.reference.path
        return None if path == NOWHERE else path

    @property
    def crs(self) -> str:
        """The CRS assigned to the reference; empty: what its file says."""
        return self.project.reference.crs

    @property
    def alignment(self) -> AlignmentSettings:
        """How the pairs are fitted."""
        return self.project.alignment

    @property
    def comparison(self) -> ComparisonSettings:
        """How the clouds are compared."""
        return self.project.comparison

    @property
    def about(self) -> About:
        """Title, people and purpose, as the report prints them."""
        return self.project.about

    @property
    def is_second_operator(self) -> bool:
        """Whether a second operator is picking."""
        return self.first is not None


def question(state: State) -> object:
    """Return what of a state enters the results: equal questions have equal answers."""
    # Where it is written changes nothing: the pairs are what the picks file will hold.
    project = replace(with_given(state, replace(state.given, picks=None)), path=NOWHERE)
    pairs = tuple(replace(pair, note="") for pair in state.pairs if pair.is_complete)
    return project, state.reconstruction, pairs


def with_given(state: State, given: ReconstructionInput) -> Project:
    """Return the project with the source's entry exchanged."""
    every = state.project.reconstructions
    return replace(
        state.project,
        reconstructions=tuple(
            given if each.name == state.reconstruction else each for each in every
        ),
    )


def with_paths_of(current: State, state: State) -> State:
    """Return a former state with the clouds that are open now, and the files it is written to."""
    source = replace(state.given, path=current.given.path, picks=current.given.picks)
    project = replace(with_given(state, source), path=current.project.path)
    reference = replace(project.reference, path=current.project.reference.path)
    return replace(state, project=replace(project, reference=reference))
