"""Number of threads of the mechanics; no result depends on it."""

from __future__ import annotations

import os

_chosen: int | None = None


def thread_count() -> int:
    """The number of cores of the machine, unless another number was set."""
    return _chosen or os.cpu_count() or 1


def set_thread_count(count: int) -> None:
    """Set the number of threads of this process, for processes that share a machine."""
    global _chosen
    _chosen = count
