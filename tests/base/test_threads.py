"""Work by one thread and by several."""

from __future__ import annotations

import threading

import pytest

from mitsuba_taxel.base.processes import threads


@pytest.mark.parametrize("count", [1, 3])
def test_results_come_in_the_order_of_the_items(monkeypatch, count):
    monkeypatch.setattr(threads, "_chosen", count)
    workers = set()
    together = threading.Barrier(count)

    def work(item):
        workers.add(threading.get_ident())
        together.wait(10)
        return item**2

    assert threads.side_by_side(work, range(6)) == [0, 1, 4, 9, 16, 25]
    assert len(workers) == count and (count > 1 or workers == {threading.get_ident()})
