"""Computing time of a run by stage."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar

# Records of the current thread or asynchronous task.
_records: ContextVar[tuple[dict[str, float], ...]] = ContextVar("records", default=())
# Seconds that nested stages have taken from the innermost current stage.
_nested: ContextVar[list[float] | None] = ContextVar("nested", default=None)


@contextmanager
def record() -> Iterator[dict[str, float]]:
    """Record the seconds of every :func:`stage` in the block; nested stages are not counted twice."""
    seconds: dict[str, float] = {}
    token = _records.set((*_records.get(), seconds))
    try:
        yield seconds
    finally:
        _records.reset(token)


@contextmanager
def stage(name: str) -> Iterator[None]:
    """Count the time of the block as time of the stage ``name``, excluding nested stages."""
    start = time.perf_counter()
    nested_seconds = [0.0]
    outer_seconds = _nested.get()
    token = _nested.set(nested_seconds)
    try:
        yield
    finally:
        _nested.reset(token)
        elapsed = time.perf_counter() - start
        if outer_seconds is not None:
            outer_seconds[0] += elapsed
        for seconds in _records.get():
            seconds[name] = seconds.get(name, 0.0) + elapsed - nested_seconds[0]
