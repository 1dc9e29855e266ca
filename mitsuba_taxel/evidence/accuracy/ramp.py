"""CPU time of a load ramp with many rows (times), for a viscoelastic pad, and for an elastic pad with and without
interpolation between solved states."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from mitsuba_taxel.evidence.accuracy.mechanics import from_nothing
from mitsuba_taxel.mechanics import NeoHookean, Viscoelastic, load_path
from mitsuba_taxel.mechanics.continuation.pad_path import pad_path
from mitsuba_taxel.mechanics.elements.loads import SPREAD_FORCE
from mitsuba_taxel.mechanics.history.timed_path import TimedPath
from mitsuba_taxel.mechanics.history.timed_rows import LoadHistory
from mitsuba_taxel.mechanics.materials.viscoelastic import Elastic
from mitsuba_taxel.mechanics.meshes import pad_mesh
from mitsuba_taxel.pads import Pad

ROWS, FORCE, DURATION = 40, -10.0, 20.0
"""Number of rows; force in N and time in s of the last row."""
SERIES = ((0.2, 1.0), (0.1, 10.0))


class Ramp(NamedTuple):
    """CPU time that a load growing in many steps (a ramp) takes, for three kinds of solution; only the mesh is cached.

    Attributes
    ----------
    viscoelastic : float
        CPU seconds of a viscoelastic pad.
    elastic : float
        CPU seconds of an elastic pad, whose rows are interpolated between a few solved states.
    each : float
        CPU seconds of an elastic pad that is solved at every row of the ramp.
    """

    viscoelastic: float
    elastic: float
    each: float


def ramp(pad: Pad) -> Ramp:
    """Measure the CPU time of a load that grows in many steps (a ramp): for a viscoelastic pad, an elastic pad, and an
    elastic pad without interpolation.
    """
    law, size = NeoHookean(), pad.default_mesh_size
    values = FORCE * np.arange(1, ROWS + 1)[:, None] / ROWS * [0.0, 0.0, 1.0]
    times = DURATION * np.arange(1, ROWS + 1) / ROWS
    rows = LoadHistory((float(row_time), tuple(value.tolist())) for row_time, value in zip(times, values, strict=True))

    def solve_rows() -> None:
        path = TimedPath(pad_path(pad, law, SPREAD_FORCE, size), Elastic(law))
        for count in range(1, ROWS + 1):
            path.state(rows[:count])

    return Ramp(
        _cpu_seconds(pad, size, lambda: load_path(pad, Viscoelastic(law, SERIES), values, times=times, mesh_size=size)),
        _cpu_seconds(pad, size, lambda: load_path(pad, law, values, mesh_size=size)),
        _cpu_seconds(pad, size, solve_rows),
    )


def _cpu_seconds(pad: Pad, mesh_size: float, run: Callable[[], object]) -> float:
    with from_nothing():
        pad_mesh(pad, mesh_size)
        start = time.process_time()
        run()
        return time.process_time() - start
