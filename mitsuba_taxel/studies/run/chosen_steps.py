"""Choice of the steps of a force that a study leaves open: as few as its curves and their slopes need.

Between two steps, a curve is interpolated by the cubic Hermite polynomial of their readings and slopes. Where a reading
in between deviates from it, it becomes a step, and both halves are examined; otherwise the cubics through all three
steps are about sixteen times as accurate.
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
from mitsuba_taxel.studies.store.provenance import provenance

SLOPE_ERROR = 0.01
"""Default tolerance, relative to the largest slope of a curve."""
MOST_HALVINGS = 6
MOST_CURVES = 4
"""Number of curves, spread evenly over a study, whose steps are determined; all curves get the steps of all of them."""


@in_turn
def with_chosen_steps(batch: Batch) -> Batch:
    """The batch with values of the force that it leaves open, and with the derivatives by it.

    Raises
    ------
    InputError
        if readings have no derivative by it: with mirrors, a step has to be given.
    ComputationError
        if the load path fails, or a curve has a kink.
    """
    open_axes = [axis for axis in batch.axes if axis.is_open]
    if not open_axes:
        return batch
    if len(open_axes) > 1:
        names = " and ".join(axis.dim for axis in open_axes)
        raise InputError(f"{names} have no step: only one force may be without.")
    (axis,) = open_axes
    others = [one for one in batch.axes if one is not axis]
    curves = [values for _, values in combinations(others)]
    chosen = np.unique(np.linspace(0, len(curves) - 1, MOST_CURVES).round().astype(int))
    steps = sorted({step for number in chosen for step in _Curve(batch, axis, curves[number]).steps()})
    start, stop = (float(word) for word in axis.values[axis.dim])
    words = [f"{start + share * (stop - start):.10g}" for share in steps]
    filled = tuple(axis._replace(values={axis.dim: words}, is_open=False) if one is axis else one for one in batch.axes)
    return replace(batch, axes=filled, derivatives=tuple(dict.fromkeys((*batch.derivatives, axis.dim))))


class _Curve:
    """Readings of all taxels along one force, other parameters being fixed."""

    def __init__(self, batch: Batch, axis: Axis, others: Mapping[str, str]) -> None:
        self._batch, self._name, self._others = batch, axis.dim, others
        self._ends = [float(word) for word in axis.values[axis.dim]]
        self._known: dict[float, tuple[np.ndarray, np.ndarray]] = {}  # readings, and slopes before and behind

    def steps(self) -> list[float]:
        """Steps, as fractions of the range."""
        self._known = {share: self._read(share) for share in (0.0, 0.5, 1.0)}
        left = [(0.0, 1.0)] if self._ends[0] != self._ends[1] else []
        for _ in range(MOST_HALVINGS):
            left = [half for ends in left if not self._follows(*ends) for half in _halves(*ends)]
            for one, other in left:
                self._known[(one + other) / 2] = self._read((one + other) / 2)
        for one, other in left:
            if not self._follows(one, other):
                near = self._ends[0] + (one + other) / 2 * (self._ends[1] - self._ends[0])
                raise ComputationError(
                    f"{self._name} needs a step, start:stop:step: {MOST_HALVINGS} halvings do not resolve {near:.4g}."
                )
        return sorted(self._known)

    def _read(self, share: float) -> tuple[np.ndarray, np.ndarray]:
        """Readings (T,) in W, and slopes (2, T) by the fraction of the range where a smaller one ends and a larger one
        begins, which differ at a kink; from disk, if an earlier run has read them."""
        from mitsuba_taxel.mechanics import cache

        start, stop = self._ends
        values = {**self._others, self._name: f"{start + share * (stop - start):.10g}"}
        scene = self._batch.scene(values)
        name = cache.key("reading and slopes", self._origin, self._name, scene.parameters, scene.mesh_size)
        arrays = cache.load(name)
        if arrays is None:
            arrays = self._computed(scene, values)
            cache.store(name, arrays)
        return arrays["power"], arrays["slopes"][:: 1 if stop > start else -1] * (stop - start)

    @cached_property
    def _origin(self) -> list[Any]:
        """What readings depend on in addition to values."""
        origin = provenance(self._batch)
        return [origin[name] for name in ("scene_content", "code", "versions")]

    def _computed(self, scene: Scene, values: Mapping[str, str]) -> dict[str, np.ndarray]:
        from mitsuba_taxel.sensing.derivatives.diffuse_derivatives import COARSE, derivatives_by
        from mitsuba_taxel.sensing.derivatives.scene_rates import rates
        from mitsuba_taxel.sensing.diffuse.diffuse_taxels import NotDiffuse

        try:
            change = rates(scene, self._name)
            sides = [replace(change, side=side) for side in (-1, 1)]
            found = derivatives_by(sides, prepare(scene).scene, False, COARSE, of_light_alone=True)
        except NotDiffuse as error:
            raise InputError(f"{self._name} needs a step, start:stop:step: {error}") from error
        except (InputError, ComputationError) as error:
            raise type(error)(f"{describe(values, self._batch.roles)}: {error}") from error
        finally:
            gc.collect()
        return {"power": found.power, "slopes": found.values.T}

    def _follows(self, one: float, other: float) -> bool:
        """Whether the reading between two steps agrees with the cubic through them."""
        (a, (_, slope_a)), (b, (slope_b, _)) = self._known[one], self._known[other]
        value, slopes = self._known[(one + other) / 2]
        length = other - one
        off = np.abs((a + b) / 2 + length * (slope_a - slope_b) / 8 - value)
        slope_off = np.abs(1.5 * (b - a) / length - (slope_a + slope_b) / 4 - slopes)
        steepest = max(np.abs(rate).max() for _, rate in self._known.values())
        slope_error = self._batch.target_slope or SLOPE_ERROR
        close = off <= (self._batch.target_error or LIGHT_ERROR) * np.abs(value)
        return bool(np.all(close & (slope_off <= slope_error * steepest)))


def _halves(one: float, other: float) -> tuple[tuple[float, float], tuple[float, float]]:
    middle = (one + other) / 2
    return (one, middle), (middle, other)
