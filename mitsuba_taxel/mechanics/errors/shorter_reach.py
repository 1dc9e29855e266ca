"""Error of a state due to two lengths of the model: the range of contact forces, and the size of the feet, where the
material law is linear. The state is solved again with half of both lengths.
"""

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
"""Reach and size of the feet in that state, relative to the usual ones."""
REMAINDER = 2.0
"""Error due to the reach, relative to the change with half the reach: the error is proportional to the reach, and falls
faster with the size of the feet."""


class _Closer(NamedTuple):
    """Solves a state with half the range of contact forces, and half the radius of the feet."""

    displacement: np.ndarray
    pressure: np.ndarray
    seconds: float


def with_reach(
    path: PadPath, comparison: StateComparison, value: np.ndarray, displacement: np.ndarray, pressure: np.ndarray
) -> StateComparison:
    """Add the error due to the reach of the barriers (repulsive forces between walls) to a comparison with a second
    mesh.

    Parameters
    ----------
    path : PadPath
        Path of the state.
    comparison : StateComparison
        Comparison with a second mesh.
    value : ndarray
        Value of the load.
    displacement : (N, 3) ndarray
        Displacement of the state, mm.
    pressure : (corners,) ndarray
        Pressure of the state, MPa.

    Returns
    -------
    StateComparison
        Comparison with unknown errors if the state with half the reach is not found.
    """
    deviate = comparison.deviate
    closer = None if deviate is None else _closer(path, value, displacement, pressure)
    if deviate is None or closer is None:
        return StateComparison(seconds=comparison.seconds)

    def both() -> np.ndarray:
        along, rest = deviate()
        remainder = REMAINDER * (closer.displacement - displacement) / ERROR_SHARE
        # The two contributions to the remainder must not cancel by chance.
        return np.array([along, remainder + np.copysign(1.0, (rest * remainder).sum()) * rest])

    force_error = comparison.force_error
    if path.load.gives_displacement:
        here = path.force(value, displacement, pressure)
        there = path.force(value, closer.displacement, closer.pressure, CLOSER)
        force_error += REMAINDER * float(np.linalg.norm(there - here))
    return StateComparison(comparison.error, both, force_error, comparison.seconds + closer.seconds)


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
    if path.load.driven is not None:  # the body moves until its force is as before
        driven, indenter_moved = path.driven, path.driven_to(value, None)
        closer, squeezed = _solved_closer(driven, indenter_moved, displacement, pressure)
        missing = float((value - driven.force(indenter_moved, closer, squeezed))[2])
        rate, stiffness = path.rate_by_depth(value)
        return closer - missing / stiffness * rate, squeezed
    *_, pad = path.segments.part_to(*path.segments.to(value)[-1])
    assert isinstance(pad, SelfTouchingPad)  # loads with self_contact
    return pad.split(pad.closer(pad.gather(displacement, pressure), value))
