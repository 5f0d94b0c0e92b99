"""The history of a session: whole states before and after each step, with its name."""

from __future__ import annotations

from dataclasses import dataclass

from trigpoint_panel.state import State


@dataclass(frozen=True, slots=True)
class _Step:
    text: str
    before: State
    after: State


class History:
    """Steps done and undone. A session holds dozens of pairs, so that whole states cost nothing."""

    def __init__(self) -> None:
        self._done: list[_Step] = []
        self._undone: list[_Step] = []

    @property
    def undo_text(self) -> str:
        """What undo would undo; empty: nothing."""
        return self._done[-1].text if self._done else ""

    @property
    def redo_text(self) -> str:
        """What redo would do again; empty: nothing."""
        return self._undone[-1].text if self._undone else ""

    def add(self, text: str, before: State, after: State) -> None:
        """Remember a step; what was undone can't be done again after it."""
        self._done.append(_Step(text, before, after))
        self._undone.clear()

    def undo(self) -> State | None:
        """Return the state before the last step, or None without one."""
        if not self._done:
            return None
        self._undone.append(self._done.pop())
        return self._undone[-1].before

    def redo(self) -> State | None:
        """Return the state after the step undone last, or None without one."""
        if not self._undone:
            return None
        self._done.append(self._undone.pop())
        return self._done[-1].after
