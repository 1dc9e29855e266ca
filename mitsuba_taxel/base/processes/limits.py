"""Limits of memory of the processes that this package starts, what a process has used, and limits of input."""

from __future__ import annotations

import resource
from pathlib import Path

MOST_HISTORY = 4000
"""Rows of a load history: each step of a path in time holds those before it."""


def memory_limit(most: int, kind: int = resource.RLIMIT_AS) -> int:
    """Bytes of memory for a new process: ``most``, or less if this process has a lower limit itself.

    Parameters
    ----------
    most : int
        Bytes.
    kind : int
        Of ``resource``: the address space by default.

    Returns
    -------
    int
        Bytes.
    """
    own = [limit for limit in resource.getrlimit(kind) if limit != resource.RLIM_INFINITY]
    return min([most, *own])


def peak_memory() -> float:
    """Peak memory of this process so far.

    Returns
    -------
    float
        In MB.
    """
    status = Path("/proc/self/status").read_text()
    return int(status.split("VmHWM:")[1].split()[0]) / 1024
