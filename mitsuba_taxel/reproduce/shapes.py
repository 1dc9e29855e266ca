"""The paper's four shapes at once. The studies of one shape follow its load paths, one after the other."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import as_completed
from concurrent.futures.process import BrokenProcessPool
from pathlib import Path
from typing import Any

from mitsuba_taxel.errors import ComputationError
from mitsuba_taxel.reproduce.store import Store, add_seconds
from mitsuba_taxel.studies import processes

COSTLIEST_FIRST = ("hemispheric", "spherical", "cylindrical", "parallelepiped")

ShapePart = Callable[[Store, str], Any]
"""Computes what is missing of the studies of one shape."""


def compute_shapes(
    folder: Path, parts: Sequence[ShapePart], workers: int, announce: Callable[[str], None]
) -> dict[str, float]:
    """Compute what is missing of parts, each shape in one of at most ``workers`` processes.

    Parameters
    ----------
    parts, announce : must be such as can be sent to a process; for :class:`Store`

    Returns
    -------
    Seconds that studies took by stage, summed over processes.

    Raises
    ------
    InputError, ComputationError
        the first of a shape, which ends all others, or that a process died.
    """
    count = min(workers, len(COSTLIEST_FIRST))
    executor = processes.start(count, sharing=count)
    seconds: dict[str, float] = {}
    try:
        shapes = [executor.submit(_shape, folder, parts, cell, announce) for cell in COSTLIEST_FIRST]
        for shape in as_completed(shapes):
            add_seconds(seconds, shape.result())
    except BrokenProcessPool as error:
        raise ComputationError("a process died that computed a shape: fewer workers need less memory.") from error
    finally:
        processes.end(executor)
    return seconds


def _shape(folder: Path, parts: Sequence[ShapePart], cell: str, announce: Callable[[str], None]) -> dict[str, float]:
    store = Store(folder, announce)
    for part in parts:
        part(store, cell)
    return store.seconds
