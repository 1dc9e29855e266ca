"""Memory that ends is an error in one line; a compiled solver that is let run out of it ends the process instead."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from mitsuba_taxel.base.errors import ComputationError

ROOM = 1e8
"""Bytes beside what a computation itself takes, for its threads and the rest of the process."""

_PROCESS, _MACHINE, _GROUP = Path("/proc/self/status"), Path("/proc/meminfo"), Path("/sys/fs/cgroup")


def require_memory(size: float, purpose: str) -> None:
    """Raise MemoryError if ``size`` bytes and some `ROOM` are more than is free."""
    free = free_memory()
    if size + ROOM > free:
        raise MemoryError(f"{purpose} takes {(size + ROOM) / 1e9:.2g} GB, and {free / 1e9:.2g} GB are free")


def free_memory() -> float:
    """Bytes that this process can still get, as far as Linux tells; infinite elsewhere."""
    return min(_left_by_limit(), _left_by_machine(), _left_by_group())


def _left_by_limit() -> float:
    """What limits on addresses and data (``ulimit -v``, ``-d``) leave; what is reserved and not filled is free."""
    try:
        import resource

        addresses, written = (
            math.inf if limit == resource.RLIM_INFINITY else limit
            for limit, _ in map(resource.getrlimit, (resource.RLIMIT_AS, resource.RLIMIT_DATA))
        )
        taken = dict(line.split(":") for line in _PROCESS.read_text().splitlines())
        size, data, filled = (1024 * float(taken[name].split()[0]) for name in ("VmSize", "VmData", "RssAnon"))
        return min(addresses - size, written - data) + max(data - filled, 0.0)
    except (ImportError, OSError, KeyError):
        return math.inf


def _left_by_machine() -> float:
    try:
        lines = dict(line.split(":") for line in _MACHINE.read_text().splitlines())
        return 1024 * sum(float(lines[name].split()[0]) for name in ("MemAvailable", "SwapFree"))
    except (OSError, KeyError):
        return math.inf


def _left_by_group() -> float:
    """What the process's control group leaves, where it has a limit; pages of files make room."""
    try:
        limit = float((_GROUP / "memory.max").read_text().replace("max", "inf"))
        used = float((_GROUP / "memory.current").read_text())
        kept = dict(line.split() for line in (_GROUP / "memory.stat").read_text().splitlines())
        return limit - used + float(kept["inactive_file"])
    except (OSError, KeyError):
        return math.inf


@contextmanager
def memory_for(purpose: str) -> Iterator[None]:
    """Let memory that ends be a ComputationError, which says for what."""
    try:
        yield
    except (MemoryError, RuntimeError) as error:
        if isinstance(error, RuntimeError) and "start new thread" not in str(error):
            raise
        raise ComputationError(
            f"there is not enough memory for {purpose} ({error}): larger finite elements or fewer cells need less."
        ) from error
