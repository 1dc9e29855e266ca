"""Limits of the processes that this package starts."""

from __future__ import annotations

import resource


def memory_limit(most: int, kind: int = resource.RLIMIT_AS) -> int:
    """Bytes of memory for a new process: ``most``, or less if this process has a lower limit itself."""
    own = [limit for limit in resource.getrlimit(kind) if limit != resource.RLIM_INFINITY]
    return min([most, *own])
