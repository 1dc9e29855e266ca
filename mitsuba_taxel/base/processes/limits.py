"""Limits of memory for worker processes, peak memory of this process, and limits of input."""

from __future__ import annotations

import resource
from pathlib import Path

MOST_HISTORY = 4000
"""Most rows of a load history: each step of a path in time contains all earlier rows."""


def memory_limit(most: int, kind: int = resource.RLIMIT_AS) -> int:
    """Limit of memory for a new process, which does not exceed the limit of this process.

    Parameters
    ----------
    most : int
        Limit in bytes.
    kind : int
        Constant of ``resource``; by default the address space is limited.

    Returns
    -------
    int
        Limit in bytes.
    """
    current = [limit for limit in resource.getrlimit(kind) if limit != resource.RLIM_INFINITY]
    return min([most, *current])


def peak_memory() -> float:
    """Peak memory of this process until now.

    Returns
    -------
    float
        In MB.
    """
    status = Path("/proc/self/status").read_text()
    return int(status.split("VmHWM:")[1].split()[0]) / 1024
