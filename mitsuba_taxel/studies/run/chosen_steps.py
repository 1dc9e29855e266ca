"""Choice of load steps for a force that is given as a range without a step size: as few as the curves need.

Between two steps, a curve is interpolated by the cubic Hermite polynomial of their readings and slopes. The reading in
the middle is computed as well, and becomes a step. If it deviates from the polynomial, both halves are examined;
otherwise the polynomials through all three steps are about sixteen times as accurate as the first.

Where light is by random paths, the steps are those of a smooth curve through noisy readings: Chebyshev points, which
are dense at the ends. Pilot runs show whether a few of them resolve the curve, or more are needed.
"""

from __future__ import annotations

import gc
from collections.abc import Mapping
from dataclasses import replace
from functools import cached_property
from typing import Any

import numpy as np

from mitsuba_taxel.backend import in_turn
from mitsuba_taxel.base.errors import ComputationError, InputError
from mitsuba_taxel.sensing.measurement import LIGHT_ERROR
from mitsuba_taxel.sensing.reading.runs import prepare
from mitsuba_taxel.sensing.scene.description import Scene
from mitsuba_taxel.studies.plan.batch import Batch
from mitsuba_taxel.studies.plan.job import describe
from mitsuba_taxel.studies.plan.vary import Axis, combinations
from mitsuba_taxel.studies.run.curve_pilot import FIRST_PILOT, CurvePilot
from mitsuba_taxel.studies.store.provenance import provenance

SLOPE_ERROR = 0.01
"""Default tolerance, relative to the largest slope of a curve."""
MOST_HALVINGS = 6
PATHS_SLOPE_ERROR = 0.03
"""The same where light is by random paths."""
COUNTS = (5, 9, 17)
"""Numbers of steps by random paths; each contains the steps of the one before."""
MOST_CURVES = 4
"""Number of curves, spread evenly over a study, whose steps are determined; all curves get the union of these steps."""


@in_turn
def with_chosen_steps(batch: Batch) -> Batch:
    """Choose the steps of a force that is given as a range without a step size.

    The result also requests derivatives with respect to that force. A batch without such a range is returned unchanged.

    Raises
    ------
    InputError
        if there are two open ranges, or a scene is refused.
    ComputationError
        if the load path fails, or a curve has a kink.
    """
    open_axes = [axis for axis in batch.axes if axis.is_open]
    if not open_axes:
        return batch
    if len(open_axes) > 1:
        names = " and ".join(axis.dim for axis in open_axes)
        raise InputError(
            f"{names} have no step: only one of them may be without one; give the others a step, start:stop:step."
        )
    (axis,) = open_axes

    # Steps, as fractions of the range, of some curves spread evenly over the other dimensions.
    other_axes = [dimension for dimension in batch.axes if dimension is not axis]
    curves = [values for _, values in combinations(other_axes)]
    chosen = np.unique(np.linspace(0, len(curves) - 1, MOST_CURVES).round().astype(int))
    steps = sorted({step for number in chosen for step in _steps(batch, axis, curves[number])})

    # The range is replaced by the values at these fractions.
    start, stop = (float(word) for word in axis.values[axis.dim])
    words = [f"{start + fraction * (stop - start):.10g}" for fraction in steps]
    filled = axis._replace(values={axis.dim: words}, is_open=False)
    axes = tuple(filled if dimension is axis else dimension for dimension in batch.axes)
    return replace(batch, axes=axes, derivatives=tuple(dict.fromkeys((*batch.derivatives, axis.dim))))


def _steps(batch: Batch, axis: Axis, fixed: Mapping[str, str]) -> list[float]:
    """Steps of one curve, as sorted fractions of the range of ``axis``."""
    from mitsuba_taxel.sensing.diffuse.diffuse_cells import NotFollowed
    from mitsuba_taxel.sensing.diffuse.diffuse_taxels import NotDiffuse

    curve = _StepCurve(batch, axis, fixed)
    try:
        return curve.steps()
    except (NotDiffuse, NotFollowed):
        return curve.steps_by_paths()


class _StepCurve:
    """Readings of all taxels along one force, from which load steps are chosen.

    Parameters
    ----------
    batch : Batch
        Study of the scene.
    axis : Axis
        The force's dimension, whose values are the two ends of its range.
    fixed : Mapping[str, str]
        Values of the other varied parameters.
    """

    def __init__(self, batch: Batch, axis: Axis, fixed: Mapping[str, str]) -> None:
        self._batch, self._name, self._fixed = batch, axis.dim, fixed
        self._ends = [float(word) for word in axis.values[axis.dim]]
        self._readings: dict[float, tuple[np.ndarray, np.ndarray]] = {}  # by fraction; see _read

    def steps(self) -> list[float]:
        """The chosen load steps of the curve, as sorted fractions of the range of the force.

        Raises
        ------
        ComputationError
            if the curve is not resolved after `MOST_HALVINGS` halvings, as at a kink.
        """
        self._readings = {fraction: self._read(fraction) for fraction in (0.0, 0.5, 1.0)}
        intervals = [(0.0, 1.0)] if self._ends[0] != self._ends[1] else []
        # Intervals whose middle deviates from the interpolation are halved.
        for _ in range(MOST_HALVINGS):
            intervals = [half for ends in intervals if not self._follows(*ends) for half in _halves(*ends)]
            for lower, upper in intervals:
                self._readings[(lower + upper) / 2] = self._read((lower + upper) / 2)
        for lower, upper in intervals:
            if not self._follows(lower, upper):
                force = self._ends[0] + (lower + upper) / 2 * (self._ends[1] - self._ends[0])
                raise ComputationError(
                    f"steps of {self._name} cannot be chosen: {MOST_HALVINGS} halvings of its range do not resolve the "
                    f"curve at {force:.4g}; give a step, as start:stop:step."
                )
        return sorted(self._readings)

    def steps_by_paths(self) -> list[float]:
        """The chosen load steps if light is traced by random paths, as sorted fractions of the range of the force.

        They come from the cache of an earlier run if it holds them.
        """
        from mitsuba_taxel.mechanics import cache

        batch, (start, stop) = self._batch, self._ends
        about = [batch.points, batch.target_slope, batch.seed, batch.mesh_size, self._ends, dict(self._fixed)]
        name = cache.key("steps by paths", self._origin, self._name, batch.defines, about)
        arrays = cache.load(name)
        if arrays is None:
            target = batch.target_slope or PATHS_SLOPE_ERROR
            pilot = CurvePilot(lambda force: batch.scene(self._values(force)), batch.seed)
            for count in COUNTS:
                fractions = (1 - np.cos(np.pi * np.arange(count) / (count - 1))) / 2
                forces = (start + fractions * (stop - start)).tolist()
                if count == COUNTS[0] and batch.target_slope and not batch.points:
                    pilot.points_for(forces, target)  # as many points as show whether the steps resolve the curve
                _, fit, is_bent = pilot.errors(forces, max(pilot.points, FIRST_PILOT))
                if fit <= target / 2 or not is_bent:
                    break
            arrays = {"fractions": fractions}
            cache.store(name, arrays)
        return arrays["fractions"].tolist()

    def _values(self, force: float) -> dict[str, str]:
        return {**self._fixed, self._name: f"{force:.10g}"}

    def _read(self, fraction: float) -> tuple[np.ndarray, np.ndarray]:
        """Readings and slopes at a fraction of the range, from the cache of an earlier run if it holds them.

        Returns
        -------
        power : numpy.ndarray
            (T,) W.
        slopes : numpy.ndarray
            (2, T) W, derivatives with respect to the fraction towards smaller and towards larger fractions, which
            differ at a kink.
        """
        from mitsuba_taxel.mechanics import cache

        start, stop = self._ends
        values = self._values(start + fraction * (stop - start))
        scene = self._batch.scene(values)
        name = cache.key("reading and slopes", self._origin, self._name, scene.parameters, scene.mesh_size)
        arrays = cache.load(name)
        if arrays is None:
            arrays = self._computed(scene, values)
            cache.store(name, arrays)
        return arrays["power"], arrays["slopes"][:: 1 if stop > start else -1] * (stop - start)

    @cached_property
    def _origin(self) -> list[Any]:
        """Everything except the load on which the readings depend: scene content, code and versions. It is part of the
        cache's key."""
        origin = provenance(self._batch)
        return [origin[name] for name in ("scene_content", "code", "versions")]

    def _computed(self, scene: Scene, values: Mapping[str, str]) -> dict[str, np.ndarray]:
        """Compute the readings (T,) of T taxels in W, and their slopes (2, T) in W/N: towards smaller and towards
        larger forces."""
        from mitsuba_taxel.sensing.derivatives.diffuse_derivatives import COARSE, derivatives_by
        from mitsuba_taxel.sensing.derivatives.scene_rates import rates
        from mitsuba_taxel.sensing.diffuse.diffuse_cells import NotFollowed
        from mitsuba_taxel.sensing.diffuse.diffuse_taxels import NotDiffuse

        try:
            change = rates(scene, self._name)
            sides = [replace(change, side=side) for side in (-1, 1)]
            derivatives = derivatives_by(sides, prepare(scene).scene, False, COARSE, of_light_alone=True)
        except (NotDiffuse, NotFollowed):  # random paths choose the steps
            raise
        except (InputError, ComputationError) as error:
            raise type(error)(f"{describe(values, self._batch.roles)}: {error}") from error
        finally:
            gc.collect()
        return {"power": derivatives.power, "slopes": derivatives.values.T}

    def _follows(self, lower: float, upper: float) -> bool:
        """Whether reading and slope in the middle of an interval agree with the cubic polynomial through its ends."""
        (a, (_, slope_a)), (b, (slope_b, _)) = self._readings[lower], self._readings[upper]
        value, slopes = self._readings[(lower + upper) / 2]
        length = upper - lower
        # Value and derivative of the Hermite polynomial in the middle, minus the computed ones.
        deviation = np.abs((a + b) / 2 + length * (slope_a - slope_b) / 8 - value)
        slope_deviation = np.abs(1.5 * (b - a) / length - (slope_a + slope_b) / 4 - slopes)
        # Readings are compared with their own size, slopes with the steepest of the curve.
        steepest = max(np.abs(rate).max() for _, rate in self._readings.values())
        slope_error = self._batch.target_slope or SLOPE_ERROR
        close = deviation <= (self._batch.target_error or LIGHT_ERROR) * np.abs(value)
        return bool(np.all(close & (slope_deviation <= slope_error * steepest)))


def _halves(lower: float, upper: float) -> tuple[tuple[float, float], tuple[float, float]]:
    middle = (lower + upper) / 2
    return (lower, middle), (middle, upper)
