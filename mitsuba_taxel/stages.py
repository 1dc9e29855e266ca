"""Where a run's time goes, by stage."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager

_records: list[dict[str, float]] = []


class _Running(threading.local):
    """The stages that a thread is in, outermost first: seconds that each has lost to stages inside it."""

    def __init__(self) -> None:
        self.inner: list[float] = []


_running = _Running()


@contextmanager
def record() -> Iterator[dict[str, float]]:
    """Collect the seconds of every :func:`stage` entered within; what one stage holds is not counted in another."""
    seconds: dict[str, float] = {}
    _records.append(seconds)
    try:
        yield seconds
    finally:
        del _records[next(i for i, record in enumerate(_records) if record is seconds)]  # equal ones may be there too


@contextmanager
def stage(name: str) -> Iterator[None]:
    """Count the time spent within as that of stage ``name``, less that of stages inside it."""
    start = time.perf_counter()
    _running.inner.append(0.0)
    try:
        yield
    finally:
        elapsed = time.perf_counter() - start
        own = elapsed - _running.inner.pop()
        if _running.inner:
            _running.inner[-1] += elapsed
        for seconds in _records:
            seconds[name] = seconds.get(name, 0.0) + own
