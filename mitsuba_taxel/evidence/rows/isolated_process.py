"""Measurement of a case in a process of its own: a crash, timeout or lack of memory becomes a row."""

from __future__ import annotations

import json
import os
import pickle
import resource
import signal
import sys
import tempfile
from typing import Any, Protocol

from mitsuba_taxel.base.limits import memory_limit
from mitsuba_taxel.base.worker_process import NoAnswer, answer_of


class Measurable(Protocol):
    """A case to measure: it can be pickled, and its row is a dataclass of JSON values."""

    def measured(self) -> Any: ...

    def failed(self, end: str) -> Any: ...


MOST_SECONDS = 600.0
MOST_MEMORY = 16 * 2**30
"""Memory limit of a process in bytes, which counts what solvers reserve and never use: several times as much."""


def measure_isolated(case: Measurable, seconds: float = MOST_SECONDS, memory: int = MOST_MEMORY) -> Any:
    """The row of a case, measured in another process with an empty cache, within limits of time and memory [bytes]."""
    limit = str(memory_limit(memory, resource.RLIMIT_DATA))
    command = [sys.executable, "-m", "mitsuba_taxel.evidence.rows.worker", limit]
    with tempfile.TemporaryDirectory() as cache:
        environment = {**os.environ, "MITSUBA_TAXEL_CACHE": cache}
        try:
            row = json.loads(answer_of(command, pickle.dumps(case), seconds, environment))
        except NoAnswer as failed:
            return case.failed(_words(failed, seconds))
    return type(case.failed(""))(**row)


def _words(failed: NoAnswer, seconds: float) -> str:
    """How a process without a row ended."""
    if failed.end == "time":
        return f"out of time after {seconds:g} s"
    if failed.end == "memory":
        return "out of memory"
    if failed.end == "error":
        return f"died: {failed.last[:200]}"
    return f"died: signal {signal.Signals[failed.end].value} ({failed.end})"
