"""Work by threads: in order, a little ahead, and errors come through."""

import threading
import time

import pytest

from trigpoint.threads import WORKERS, worked


def test_results_come_in_the_order_of_the_items():
    def slow_first(k):
        time.sleep(0.02 if k == 0 else 0)
        return k

    assert list(worked(slow_first, range(20))) == list(range(20))


def test_items_are_taken_only_a_few_ahead_by_the_calling_thread():
    taken = []

    def items():
        for k in range(50):
            taken.append(threading.current_thread())
            yield k

    for k, _ in enumerate(worked(abs, items())):
        assert len(taken) <= k + WORKERS + 1
    assert set(taken) == {threading.current_thread()}


def test_an_error_in_the_work_comes_through():
    with pytest.raises(ZeroDivisionError):
        list(worked(lambda k: 1 / k, [1, 0, 1]))
