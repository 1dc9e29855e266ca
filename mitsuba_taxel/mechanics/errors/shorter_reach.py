"""The error of a state by the distances from which its walls repel each other, and within which the law of its feet is
linear: from the same state with half of both."""

from __future__ import annotations

import time
from typing import NamedTuple

import numpy as np

from mitsuba_taxel.base.convergence import ERROR_SHARE
from mitsuba_taxel.mechanics import cache
from mitsuba_taxel.mechanics.continuation.pad_path import PadPath
from mitsuba_taxel.mechanics.continuation.state import StateComparison
from mitsuba_taxel.mechanics.equilibrium.loaded_pad import RESIDUAL_TOLERANCE
from mitsuba_taxel.mechanics.equilibrium.self_touching_pad import SelfTouchingPad
from mitsuba_taxel.mechanics.equilibrium.solution import Rejected

CLOSER = 0.5
"""Share of both, in that state."""
REMAINDER = 2.0
"""Error by the reach, which is proportional to it, relative to the change with half of it; that by the feet falls
faster with their size."""


class _Closer(NamedTuple):
    """A state with half the reach."""

    displacement: np.ndarray
    pressure: np.ndarray
    seconds: float


def with_reach(
    path: PadPath, found: StateComparison, value: np.ndarray, displacement: np.ndarray, pressure: np.ndarray
) -> StateComparison:
    """The comparison of a canonical state with that of a second mesh, and the error by the reach added to its
    deviations and to that of the force; nothing is known where the state with half the reach is not found."""
    deviate = found.deviate
    closer = None if deviate is None else _closer(path, value, displacement, pressure)
    if deviate is None or closer is None:
        return StateComparison(seconds=found.seconds)

    def both() -> np.ndarray:
        along, rest = deviate()
        remainder = REMAINDER * (closer.displacement - displacement) / ERROR_SHARE
        # Both parts of the remainder must not cancel by chance.
        return np.array([along, remainder + np.copysign(1.0, (rest * remainder).sum()) * rest])

    force_error = found.force_error
    if path.load.gives_displacement:
        here = path.force(value, displacement, pressure)
        there = path.force(value, closer.displacement, closer.pressure, CLOSER)
        force_error += REMAINDER * float(np.linalg.norm(there - here))
    return StateComparison(found.error, both, force_error, found.seconds + closer.seconds)


def _closer(path: PadPath, value: np.ndarray, displacement: np.ndarray, pressure: np.ndarray) -> _Closer | None:
    name = cache.key("closer", *path.key_parts, RESIDUAL_TOLERANCE, value.tolist())
    with cache.alone(name):
        arrays = cache.load(name)
        if arrays is None:
            began = time.perf_counter()
            try:
                moved, squeezed = _solved_closer(path, value, displacement, pressure)
            except Rejected:
                return None
            seconds = np.array(time.perf_counter() - began)
            arrays = {"displacement": moved, "pressure": squeezed, "seconds": seconds}
            cache.store(name, arrays)
    return _Closer(arrays["displacement"], arrays["pressure"], float(arrays["seconds"]))


def _solved_closer(
    path: PadPath, value: np.ndarray, displacement: np.ndarray, pressure: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Displacement and pressure of the state with half the reach; raises Rejected if it is not found."""
    if path.load.driven is not None:  # the body moves on until it presses as before
        driven, indenter_moved = path.driven, path.driven_to(value, None)
        closer, squeezed = _solved_closer(driven, indenter_moved, displacement, pressure)
        missing = float((value - driven.force(indenter_moved, closer, squeezed))[2])
        rate, stiffness = path.rate_by_depth(value)
        return closer - missing / stiffness * rate, squeezed
    *_, pad = path.segments.part_to(*path.segments.to(value)[-1])
    assert isinstance(pad, SelfTouchingPad)  # as the load goes on
    return pad.split(pad.closer(pad.gather(displacement, pressure), value))
