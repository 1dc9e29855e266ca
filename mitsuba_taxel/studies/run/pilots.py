"""Numbers of points and mesh sizes for the scenes of a batch, from pilot runs of some of them."""

from __future__ import annotations

import math
import time
from collections.abc import Iterator, Mapping

import numpy as np

from mitsuba_taxel.backend import in_turn
from mitsuba_taxel.base.errors import ComputationError, InputError
from mitsuba_taxel.sensing import Scene
from mitsuba_taxel.sensing.measurement import LIGHT_ERROR
from mitsuba_taxel.sensing.reading.prepared_scenes import Settings
from mitsuba_taxel.sensing.reading.runs import FIRST_POINTS, MOST_POINTS, Clock, Run, prepare
from mitsuba_taxel.sensing.targets import points_for, prepare_for, without_random_numbers
from mitsuba_taxel.studies.plan.batch import Batch
from mitsuba_taxel.studies.plan.job import describe
from mitsuba_taxel.studies.plan.vary import combinations, curve_dimension

MOST_PILOT_CURVES = 8
"""Number of curves, spread evenly over a study, whose scenes determine the number of points."""


@in_turn
def piloted_settings(batch: Batch, machines: int) -> Settings:
    """Choose the number of points and the mesh size of a batch by pilot runs of some of its scenes.

    The first, middle and last scene of some curves must reach the target error. Without a target error, the relative
    error of the light alone must be 0.005 or less, on the mesh that the scene sets. The number of points is 0 if no
    pilot scene needs random paths; irradiance maps, and a time budget without a target, always need them. A time budget
    limits the points to those that can be traced in the remaining time.

    Parameters
    ----------
    batch : Batch
        Study whose settings are determined.
    machines : int
        Speed of the processes that compute the study, relative to this machine.

    Returns
    -------
    Settings
        Points for each taxel and replicate, and mesh size in mm or None.

    Raises
    ------
    InputError, ComputationError
        if no pilot scene can be read; the error is that of the first.
    """
    pilot = _Pilot(batch, machines)
    failed = []
    for values in _pilot_scenes(batch):
        try:
            pilot.read(values)
        except (InputError, ComputationError) as error:
            failed.append(type(error)(f"{describe(values, batch.roles)}: {error}"))
    if not pilot.points:
        raise failed[0]
    return Settings(min(max(pilot.points), pilot.affordable_points()), pilot.mesh_size)


class _Pilot:
    """Required settings and costs of the pilot scenes of a batch, collected by calls of :meth:`read`."""

    def __init__(self, batch: Batch, machines: int) -> None:
        self.batch, self.machines = batch, machines
        self.random = batch.maps or (batch.time_budget is not None and batch.target_error is None)
        self.clock = Clock(batch.time_budget)
        self.points: list[int] = []
        self.mesh_size = batch.mesh_size
        self._seconds: list[tuple[float, float]] = []  # by scene, see _costs

    def read(self, values: Mapping[str, str]) -> None:
        """Determine, by a pilot run, the points and the mesh size of the scene with these values, starting from the
        mesh size of the earlier scenes.
        """
        scene = self.batch.scene(values).with_mesh_size(self.mesh_size)
        # Without a target: points for the light alone, none if light without random numbers is accurate enough.
        if self.batch.target_error is None:
            ready = prepare(scene)
            certain = None if self.random else without_random_numbers(ready, mechanics_error=False)
            enough = certain is not None and certain.light_share <= LIGHT_ERROR
            points = 0 if enough else points_for(ready, LIGHT_ERROR)
        # With a target: points and mesh for the total error, in the share of the time budget that one curve has.
        else:
            curves = math.prod(axis.size for axis in self.batch.axes) / self._curve_size
            allowed = None if self.batch.time_budget is None else Clock(self.clock.left / curves)
            target, seed = self.batch.target_error, self.batch.seed
            points, self.mesh_size = prepare_for(scene, target, seed, allowed, self.random).settings
        if self.batch.time_budget is not None and points:
            self._seconds.append(self._costs(scene.with_mesh_size(self.mesh_size)))
        self.points.append(points)

    def _costs(self, scene: Scene) -> tuple[float, float]:
        """Computing times of a scene in s: everything before light is traced, and tracing the first points."""
        start = time.perf_counter()
        run = Run(prepare(scene), self.batch.seed)
        without_tracing = time.perf_counter() - start
        run.extend_to(FIRST_POINTS)
        return without_tracing, run.seconds

    def affordable_points(self) -> int:
        """Points for each taxel and replicate that can be traced in the remaining time budget."""
        if not self._seconds:
            return MOST_POINTS
        jobs = math.prod(axis.size for axis in self.batch.axes)
        without_tracing, tracing = np.mean(self._seconds, axis=0)
        steps = (self.clock.left * self.machines / jobs - without_tracing) / tracing
        return int(min(FIRST_POINTS * 2 ** math.floor(math.log2(max(steps, 1))), MOST_POINTS))

    @property
    def _curve_size(self) -> int:
        """Number of scenes along the dimension that readings are plotted against."""
        curve = curve_dimension(self.batch.axes)
        return next(axis.size for axis in self.batch.axes if axis.dim == curve)


def _pilot_scenes(batch: Batch) -> Iterator[dict[str, str]]:
    """Values of the varied parameters of the first, middle and last scene of some curves, spread evenly."""
    dims = [axis.dim for axis in batch.axes]
    curve = dims.index(curve_dimension(batch.axes))
    count = batch.axes[curve].size
    ends = sorted({0, count // 2, count - 1})
    starts = [index for index, _ in combinations(batch.axes) if index[curve] == 0]
    chosen = np.unique(np.linspace(0, len(starts) - 1, MOST_PILOT_CURVES).round().astype(int))
    for start in (starts[i] for i in chosen):
        for end in ends:
            index = (*start[:curve], end, *start[curve + 1 :])
            positions = zip(batch.axes, index, strict=True)
            yield {name: words[i] for axis, i in positions for name, words in axis.values.items()}
