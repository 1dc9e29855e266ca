"""Concurrent computation of the paper's four cell shapes. Each stage determines the settings of the next."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, wait
from concurrent.futures.process import BrokenProcessPool
from pathlib import Path
from typing import Any

from mitsuba_taxel.base.errors import ComputationError
from mitsuba_taxel.evidence.paper.paper_studies import PaperStudies, add_seconds
from mitsuba_taxel.studies.run import processes

COSTLIEST_FIRST = ("hemispheric", "spherical", "cylindrical", "parallelepiped")

MOST_AT_ONCE = 2 * len(COSTLIEST_FIRST)
"""Number of processes that are busy most of the time."""

ShapePart = Callable[[PaperStudies, str], Any]
"""Computes missing studies of one shape."""


def compute_shapes(
    folder: Path, stages: Sequence[Sequence[ShapePart]], workers: int, announce: Callable[[str], None]
) -> dict[str, float]:
    """Compute the missing studies of all cell shapes, in at most ``workers`` processes.

    Parameters
    ----------
    stages : Sequence[Sequence[ShapePart]]
        Computations of each stage, which depend on earlier stages of the same shape only. They must be picklable.
    announce : Callable[[str], None]
        See :class:`PaperStudies`. It must be picklable.

    Returns
    -------
    dict[str, float]
        Computing time of the studies in s, by stage, summed over processes.

    Raises
    ------
    InputError, ComputationError
        the first error of a computation, which ends all others; or if a process died.
    """
    count = min(workers, MOST_AT_ONCE)
    executor = processes.start(count, sharing=count)
    seconds: dict[str, float] = {}
    waiting = {cell: list(stages) for cell in COSTLIEST_FIRST}
    running: dict[Future[dict[str, float]], str] = {}

    def advance(cell: str) -> None:
        while waiting[cell] and cell not in running.values():
            for computation in waiting[cell].pop(0):
                running[executor.submit(_computed, folder, computation, cell, announce)] = cell

    try:
        for cell in COSTLIEST_FIRST:
            advance(cell)
        while running:
            for future in wait(running, return_when=FIRST_COMPLETED).done:
                cell = running.pop(future)
                add_seconds(seconds, future.result())
                advance(cell)
    except BrokenProcessPool as error:
        raise ComputationError("a worker process died, probably for lack of memory: use fewer workers.") from error
    finally:
        processes.end(executor)
    return seconds


def _computed(folder: Path, computation: ShapePart, cell: str, announce: Callable[[str], None]) -> dict[str, float]:
    store = PaperStudies(folder, announce)
    computation(store, cell)
    return store.seconds
