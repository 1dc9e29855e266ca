"""Measurement of a case in a separate process, so that a crash, a timeout or a lack of memory becomes a result."""

from __future__ import annotations

import json
import os
import pickle
import signal
import sys
import tempfile
from typing import Any, Protocol

from mitsuba_taxel.base.processes.system import memory_limit
from mitsuba_taxel.base.processes.worker_process import NoAnswer, answer_of


class Measurable(Protocol):
    """A test case. It can be pickled; its result is a dataclass of values that JSON supports."""

    def measured(self) -> Any: ...

    def failed(self, end: str) -> Any: ...


MOST_SECONDS = 600.0
MOST_MEMORY = 16 * 2**30
"""Memory limit of a process in bytes. It includes reserved memory, and solvers reserve several times the memory that
they use."""


def measure_isolated(case: Measurable, seconds: float = MOST_SECONDS, memory: int = MOST_MEMORY) -> Any:
    """Measure a case in a new process with an empty cache of solutions.

    Parameters
    ----------
    case : Measurable
        The case, which is pickled.
    seconds : float
        Limit of the wall time.
    memory : int
        Limit of the memory in bytes.

    Returns
    -------
    Any
        The result of the case; if the process ends without a result, that of ``case.failed`` with the reason.
    """
    limit = str(memory_limit(memory, "DATA"))
    command = [sys.executable, "-m", "mitsuba_taxel.evidence.rows.worker", limit]
    with tempfile.TemporaryDirectory() as cache:
        environment = {**os.environ, "MITSUBA_TAXEL_CACHE": cache}
        try:
            row = json.loads(answer_of(command, pickle.dumps(case), seconds, environment))
        except NoAnswer as failure:
            return case.failed(_end_of_process(failure, seconds))
    return type(case.failed(""))(**row)


def _end_of_process(failure: NoAnswer, seconds: float) -> str:
    """Describe how a process without a result ended."""
    if failure.end == "time":
        return f"out of time after {seconds:g} s"
    if failure.end == "memory":
        return "out of memory"
    if failure.end == "error":
        return f"died: {failure.last[:200]}"
    return f"died: signal {signal.Signals[failure.end].value} ({failure.end})"
