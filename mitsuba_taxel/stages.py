"""Where a run's time goes, by stage."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager

_running: list[list] = []
_records: list[dict[str, float]] = []


@contextmanager
def record() -> Iterator[dict[str, float]]:
    """Collect the seconds of every :func:`stage` entered within; what one stage holds is not counted in another."""
    seconds: dict[str, float] = {}
    _records.append(seconds)
    try:
        yield seconds
    finally:
        _records.remove(seconds)


@contextmanager
def stage(name: str) -> Iterator[None]:
    """Count the time spent within as that of stage ``name``, less that of stages inside it."""
    entry = [time.perf_counter(), 0.0]
    _running.append(entry)
    try:
        yield
    finally:
        _running.remove(entry)
        elapsed = time.perf_counter() - entry[0]
        if _running:
            _running[-1][1] += elapsed
        for seconds in _records:
            seconds[name] = seconds.get(name, 0.0) + elapsed - entry[1]
