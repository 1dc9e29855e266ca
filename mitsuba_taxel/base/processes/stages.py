"""Time of a run by stage."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar

# Of the current thread or asynchronous task only.
_records: ContextVar[tuple[dict[str, float], ...]] = ContextVar("records", default=())
_lost: ContextVar[list[float] | None] = ContextVar("lost", default=None)  # seconds of the stage entered last to others


@contextmanager
def record() -> Iterator[dict[str, float]]:
    """Collect the seconds of every :func:`stage` entered within; nested stages are not counted twice."""
    seconds: dict[str, float] = {}
    before = _records.set((*_records.get(), seconds))
    try:
        yield seconds
    finally:
        _records.reset(before)


@contextmanager
def stage(name: str) -> Iterator[None]:
    """Count the time spent within as that of stage ``name``, excluding nested stages."""
    start = time.perf_counter()
    inside = [0.0]
    around = _lost.get()
    before = _lost.set(inside)
    try:
        yield
    finally:
        _lost.reset(before)
        elapsed = time.perf_counter() - start
        if around is not None:
            around[0] += elapsed
        for seconds in _records.get():
            seconds[name] = seconds.get(name, 0.0) + elapsed - inside[0]
