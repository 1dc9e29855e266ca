"""Measurement of a case in a process of its own: a crash, timeout or lack of memory becomes a row."""

from __future__ import annotations

import json
import os
import pickle
import resource
import signal
import subprocess
import sys
import tempfile
from typing import Any, Protocol

from mitsuba_taxel.base.limits import memory_limit


class Measurable(Protocol):
    """A case to measure: it can be pickled, and its row is a dataclass of JSON values."""

    def measured(self) -> Any: ...

    def failed(self, end: str) -> Any: ...


MOST_SECONDS = 600.0
MOST_MEMORY = 16 * 2**30
"""Memory limit of a process in bytes, which counts what solvers reserve and never use: several times as much."""


def measure_isolated(case: Measurable, seconds: float = MOST_SECONDS, memory: int = MOST_MEMORY) -> Any:
    """The row of a case, measured in another process with an empty cache, within limits of time and memory [bytes]."""
    command = [sys.executable, "-m", "mitsuba_taxel.bench.worker", str(memory_limit(memory, resource.RLIMIT_DATA))]
    with tempfile.TemporaryDirectory() as cache:
        environment = {**os.environ, "MITSUBA_TAXEL_CACHE": cache}
        try:
            done = subprocess.run(
                command, input=pickle.dumps(case), capture_output=True, timeout=seconds, env=environment
            )
            end = "" if done.returncode == 0 else _end_of(done)
        except subprocess.TimeoutExpired:
            end = f"out of time after {seconds:g} s"
    failed = case.failed(end)
    return failed if end else type(failed)(**json.loads(done.stdout))


def _end_of(done: subprocess.CompletedProcess[bytes]) -> str:
    """How a process without a row ended."""
    lines = done.stderr.decode(errors="replace").strip().splitlines() or [""]
    if any(word in lines[-1] for word in ("MemoryError", "bad_alloc", "memory allocation")):
        return "out of memory"
    if done.returncode < 0:
        number = -done.returncode
        return f"died: signal {number} ({signal.Signals(number).name})"
    return f"died: {lines[-1][:200]}"
