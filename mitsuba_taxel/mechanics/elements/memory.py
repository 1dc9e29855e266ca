"""Free memory. A lack of memory is reported as an error of one line, before it crashes a compiled solver."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from mitsuba_taxel.base.errors import ComputationError

ROOM = 1e8
"""Bytes kept free beside those of a computation, for its threads and the rest of the process."""

_PROCESS, _MACHINE, _GROUP = Path("/proc/self/status"), Path("/proc/meminfo"), Path("/sys/fs/cgroup")


def require_memory(size: float, purpose: str) -> None:
    """Raise MemoryError if an array of ``size`` bytes, and a reserve of `ROOM` bytes, exceed the free memory."""
    free = free_memory()
    if size + ROOM > free:
        raise MemoryError(f"{purpose} takes {(size + ROOM) / 1e9:.2g} GB, and {free / 1e9:.2g} GB are free")


def free_memory() -> float:
    """Memory that this process can still allocate, as reported by Linux.

    Returns
    -------
    float
        Bytes; infinite on other systems.
    """
    return min(_free_by_limit(), _free_by_machine(), _free_by_group())


def is_limited() -> bool:
    """Whether a limit on the addresses or the data of this process is set (``ulimit -v``, ``-d``)."""
    return math.isfinite(_free_by_limit())


def _free_by_limit() -> float:
    """Bytes that this process can still allocate within its limits of address space and data (``ulimit -v``, ``-d``).

    Reserved but unused memory counts as used: a solver reserves gigabytes for stacks, which nothing else can use.
    """
    try:
        import resource

        address_limit, data_limit = (
            math.inf if limit == resource.RLIM_INFINITY else limit
            for limit, _ in map(resource.getrlimit, (resource.RLIMIT_AS, resource.RLIMIT_DATA))
        )
        status = dict(line.split(":") for line in _PROCESS.read_text(encoding="utf-8").splitlines())
        size, data = (1024 * float(status[name].split()[0]) for name in ("VmSize", "VmData"))
        return max(min(address_limit - size, data_limit - data), 0.0)
    except (ImportError, OSError, KeyError):
        return math.inf


def _free_by_machine() -> float:
    """Free memory of the machine in bytes, including swap."""
    try:
        figures = dict(line.split(":") for line in _MACHINE.read_text(encoding="utf-8").splitlines())
        return 1024 * sum(float(figures[name].split()[0]) for name in ("MemAvailable", "SwapFree"))
    except (OSError, KeyError):
        return math.inf


def _free_by_group() -> float:
    """Bytes that this process can still allocate within the limit of its control group (cgroup); cached pages of files
    count as free."""
    try:
        limit = float((_GROUP / "memory.max").read_text(encoding="utf-8").replace("max", "inf"))
        used = float((_GROUP / "memory.current").read_text(encoding="utf-8"))
        cached = dict(line.split() for line in (_GROUP / "memory.stat").read_text(encoding="utf-8").splitlines())
        return limit - used + float(cached["inactive_file"])
    except (OSError, KeyError):
        return math.inf


@contextmanager
def memory_for(purpose: str) -> Iterator[None]:
    """Convert a `MemoryError` within the block to a `ComputationError` that states the purpose of the memory."""
    try:
        yield
    except (MemoryError, RuntimeError) as error:
        words = "".join(map(str, error.args))  # str(error) would solve other elements for the end of a load path
        if isinstance(error, RuntimeError) and "start new thread" not in words:
            raise
        raise ComputationError(
            f"there is not enough memory for {purpose} ({error}): larger finite elements or fewer cells need less."
        ) from error
