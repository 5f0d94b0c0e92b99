"""Pace: how much a view draws while it moves, by how long its last pictures took."""

from __future__ import annotations

from statistics import median

# Seconds that a picture may take: two tied views make more than ten a second of it.
BUDGET = 0.025
# A picture is too slow only beyond this many budgets, or noise alone would take points away.
PATIENCE = 1.3
# Pictures of which the quickest tells: the others may have waited for an upload or something else.
RECENT = 3
# Points of a cloud that can be drawn: few steps, since each is a draw of its own.
FEWEST, STEP = 10_000, 1.5
STEPS = tuple(round(FEWEST * STEP**k) for k in range(24))
# Points drawn at first, while nothing is known of the machine.
FIRST = STEPS[4]


class Pace:
    """What there is time for while a view moves.

    During a movement it only ever becomes less, so that nothing flickers; the next one starts with
    what this one had time for.

    Parameters
    ----------
    count : int
        Points to begin with.

    Attributes
    ----------
    count : int
        Points of a cloud to draw, one of `STEPS`.
    is_lit : bool
        Whether there is time for eye-dome lighting.
    """

    def __init__(self, count: int = FIRST) -> None:
        self.count, self.is_lit = _step(count), True
        self._drawn = self.count
        self._times: list[float] = []

    def took(self, seconds: float, drawn: int) -> bool:
        """Take note of a picture of so many points; return whether the next one is to be less."""
        self._drawn = drawn
        self._times.append(seconds)
        quickest = min(self._times[-RECENT:])
        if len(self._times) < RECENT or quickest <= PATIENCE * BUDGET:
            return False
        if self.is_lit:
            self.is_lit = False
        elif drawn > FEWEST:
            self.count = _step(drawn * BUDGET / quickest)
        self._times.clear()
        return True

    def rested(self) -> None:
        """End a movement."""
        if len(self._times) >= RECENT:
            usual = median(self._times)
            self.count = max(self.count, _step(self._drawn * BUDGET / usual))
            self.is_lit = self.is_lit or usual < BUDGET / 4
        self._times.clear()


def _step(count: float) -> int:
    return max((step for step in STEPS if step <= count), default=FEWEST)
