"""Number of threads for finite elements and light; results do not depend on it."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar

_Item = TypeVar("_Item")
_Result = TypeVar("_Result")

_chosen: int | None = None


def thread_count() -> int:
    """Number of threads: the number of cores of the machine, unless another number is set.

    Returns
    -------
    int
        Number of threads, at least 1.
    """
    return _chosen or os.cpu_count() or 1


def set_thread_count(count: int) -> None:
    """Set the number of threads of this process, for processes that share a machine.

    Parameters
    ----------
    count : int
        Number of threads, at least 1.
    """
    global _chosen
    _chosen = count


def side_by_side(work: Callable[[_Item], _Result], items: Sequence[_Item]) -> list[_Result]:
    """Apply a function to each item in several threads; this saves time as NumPy releases Python's global lock.

    Parameters
    ----------
    work : Callable
        Function of an item.
    items : sequence
        Arguments of the function.

    Returns
    -------
    list
        Results in the order of the items.
    """
    threads = min(thread_count(), len(items))
    if threads < 2:
        return [work(item) for item in items]
    with ThreadPoolExecutor(threads) as pool:
        return list(pool.map(work, items))
