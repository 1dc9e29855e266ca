"""Meshing of a user's geometry in a separate process: meshers may crash, hang or exhaust memory."""

from __future__ import annotations

import io
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from mitsuba_taxel.base.errors import ComputationError
from mitsuba_taxel.base.processes.system import memory_limit
from mitsuba_taxel.base.processes.worker_process import NoAnswer, answer_of
from mitsuba_taxel.geometry.geometry_error import GeometryError

WORKER = Path(__file__).with_name("worker.py")
"""Program of the separate process: run as a script, so that the process imports neither this package nor Mitsuba."""
MOST_SECONDS = 600.0
MOST_MEMORY = 8 * 2**30
"""Largest address space of the separate process in bytes, unless this process itself has a lower limit."""


def run_isolated(task: str, arrays: Mapping[str, object]) -> dict[str, np.ndarray]:
    """Run a task of the script `worker` in a separate process. Data pass through pipes, so that no file is left behind.

    Parameters
    ----------
    task : str
        Name of the task.
    arrays : Mapping[str, object]
        Arguments of the task, as arrays or values that become arrays.

    Returns
    -------
    dict[str, ndarray]
        Results by name.

    Raises
    ------
    GeometryError
        if the geometry cannot be read.
    ComputationError
        in one line, if the process crashes, fails, or exceeds :data:`MOST_SECONDS` or :data:`MOST_MEMORY`; its output
        is in the exception's cause.
    """
    memory = memory_limit(int(MOST_MEMORY))
    command = [sys.executable, str(WORKER), task, str(memory), str(int(MOST_SECONDS))]
    try:
        answer = _unpacked(answer_of(command, _packed(arrays), MOST_SECONDS))
    except NoAnswer as failed:
        raise ComputationError(f"meshing the pad {_words(failed, memory)}.") from failed
    if "error" in answer:
        raise GeometryError(str(answer["error"]))
    return answer


def _words(failed: NoAnswer, memory: int) -> str:
    if failed.end == "time":
        return f"was stopped after {MOST_SECONDS:g} s: choose a greater mesh_size, or a simpler surface"
    if failed.end in ("memory", "SIGKILL"):
        return f"needed more than {memory / 2**30:.3g} GB of memory: choose a greater mesh_size"
    how = f"failed ({failed.last[:120]})" if failed.end == "error" else f"crashed ({failed.end})"
    return f"{how}: choose another mesh_size, or repair the surface"


def _packed(arrays: Mapping[str, object]) -> bytes:
    buffer = io.BytesIO()
    plain: dict[str, Any] = {name: np.asarray(value) for name, value in arrays.items()}
    np.savez(buffer, **plain)
    return buffer.getvalue()


def _unpacked(content: bytes) -> dict[str, np.ndarray]:
    with np.load(io.BytesIO(content), allow_pickle=False) as arrays:
        return dict(arrays)
