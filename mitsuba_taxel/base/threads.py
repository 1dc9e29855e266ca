"""How many threads the mechanics computes with. No result depends on it."""

from __future__ import annotations

import os

_chosen: int | None = None


def thread_count() -> int:
    """As many as the machine has cores, unless another number was chosen."""
    return _chosen or os.cpu_count() or 1


def set_thread_count(count: int) -> None:
    """Choose the number of threads of this process, for one that shares the machine with others."""
    global _chosen
    _chosen = count
