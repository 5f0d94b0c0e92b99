"""Pieces worked on by threads while the next ones are read."""

from __future__ import annotations

import os
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from typing import TypeVar

# More threads would hold more pieces in memory, and reading LAZ keeps the other cores busy.
WORKERS = 4

T = TypeVar("T")
R = TypeVar("R")


def worked(work: Callable[[T], R], items: Iterable[T]) -> Iterator[R]:
    """Yield ``work(item)`` for every item, in their order, worked out by threads.

    NumPy lets other threads run while it sorts and adds, so `work` that is mostly NumPy gains.
    Items are taken from their iterator one at a time by the calling thread, only a few ahead of
    what has been yielded.

    Examples
    --------
    >>> list(worked(str.upper, ["a", "b", "c"]))
    ['A', 'B', 'C']
    """
    workers = min(WORKERS, os.cpu_count() or 1)
    waiting: deque[Future[R]] = deque()
    with ThreadPoolExecutor(workers) as pool:
        for item in items:
            waiting.append(pool.submit(work, item))
            if len(waiting) > workers:
                yield waiting.popleft().result()
        while waiting:
            yield waiting.popleft().result()
