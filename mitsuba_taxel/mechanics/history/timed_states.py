"""The states of a history-dependent pad under a sequence of loads with times.

From rest at t = 0, the load changes linearly to the value of each row until its time; rows of equal times are a jump. A
state depends only on the rows up to its time, and is bitwise independent of other requested states.

While the rate of the load is constant, steps may extend beyond rows; states at these rows are then interpolated.
"""

from __future__ import annotations

import math
import time as clock
from collections import OrderedDict
from dataclasses import replace
from functools import cached_property

import numpy as np

from mitsuba_taxel.base.errors import ComputationError
from mitsuba_taxel.geometry.mirror import Mirror
from mitsuba_taxel.mechanics import cache
from mitsuba_taxel.mechanics.contact.barriers.self_contact import Contact
from mitsuba_taxel.mechanics.contact.friction import FrictionState
from mitsuba_taxel.mechanics.continuation.pad_path import PadPath
from mitsuba_taxel.mechanics.elements.internal_variables import InternalVariables, StressUpdate
from mitsuba_taxel.mechanics.elements.solvers import available_solvers
from mitsuba_taxel.mechanics.equilibrium.feet import said_of
from mitsuba_taxel.mechanics.equilibrium.indented_pad import IndentedPad
from mitsuba_taxel.mechanics.equilibrium.loaded_pad import RESIDUAL_TOLERANCE, LoadedPad
from mitsuba_taxel.mechanics.equilibrium.pad_parts import new_pad
from mitsuba_taxel.mechanics.equilibrium.solution import History, Rejected, Solution
from mitsuba_taxel.mechanics.history.step_state import PathEnded, StepError, StepState, StepTooLong
from mitsuba_taxel.mechanics.history.time_state import (
    ON_ITS_WAY,
    Figures,
    LoadState,
    MidStep,
    Shape,
    StepControl,
    StepCubics,
    TimeState,
    shape_within,
)
from mitsuba_taxel.mechanics.history.time_steps import (
    INTERPOLATION_TOLERANCE,
    TIME_TOLERANCE,
    RowSteps,
    furthest,
    leaps,
    response,
)
from mitsuba_taxel.mechanics.history.timed_rows import LoadHistory, rate_is_new
from mitsuba_taxel.mechanics.materials.viscoelastic import Viscoelastic

KEPT = 3
"""Number of solved states that are kept in memory."""
AGAIN = 1.5
"""Length of the next step after a step that was too long, relative to the accepted length."""


class TimedStates:
    """Solved states of one history-dependent pad (viscoelastic or with friction) under one kind of load, cached on
    disk, a few in memory.

    Parameters
    ----------
    path : PadPath
        Load path of the same pad with the elastic law. It gives the mesh and the load, the mirror images of the nodes,
        and the bodies that the pad may touch.
    material : Viscoelastic
        The silicone.
    coarsening : int
        Length of steps under friction and with Mullins' effect, relative to the steps of the path: 1 or 2. See
        :class:`RowSteps`.
    fraction : float
        Largest distance at which two walls of a pad repel each other (the reach of their barrier), relative to the
        default; see :class:`SelfTouchingPad`.
    """

    def __init__(self, path: PadPath, material: Viscoelastic, coarsening: int = 1, fraction: float = 1.0) -> None:
        self._path, self._material, self._coarsening, self._fraction = path, material, coarsening, fraction
        self._moving = path.load.driven or path.load
        self._response = response(self._moving, material)
        self._known: OrderedDict[LoadHistory, TimeState] = OrderedDict()
        self._count: dict[LoadHistory, int] = {LoadHistory(): 0}
        self._mirrors: dict[LoadHistory, tuple[Mirror, ...]] = {}
        self._pads: dict[tuple[Mirror, ...], LoadedPad] = {}
        self._clear: set[tuple[bytes, LoadHistory]] = set()
        self._last: tuple[LoadHistory, tuple[TimeState, StepCubics]] | None = None

    def reached(self, rows: LoadHistory) -> TimeState:
        """State of the pad at the end of the given rows of the load.

        Parameters
        ----------
        rows : LoadHistory
            Rows of the load, from rest.

        Returns
        -------
        TimeState
            The state: solved, or interpolated within a step that extends beyond the last row.

        Raises
        ------
        ComputationError
            if the path ends before the last row.
        """
        end = self._solved(rows)
        if end.time <= (rows[-1][0] if rows else 0.0):
            return end

        # Within a step that leads beyond the last row: its shape is that of the cubics between the ends of the step.
        count, (time, value), shape = self._count[rows], rows[-1], self._shape(rows)
        (start, cubics), pad = self._cubics(rows[:count]), self._pad_for(rows)
        assert end.mid_step is not None
        elapsed, measure = time - start.time, cubics.measures.main
        t, growth = float(measure.at(elapsed)), measure.until(elapsed)

        # Internal variables follow the stress of the law, which is a parabola up to this time; the third power of the
        # stress is their error.
        variables = start.variables.on(pad.part, self._path.mesh, self._pad_for(rows[: count - 1]).part)
        start_velocity, velocity = (
            field[: end.shape.displacement.size].reshape(-1, 3)
            for field in (end.mid_step.start_velocity, shape.velocity)
        )
        stress_rate = pad.isochoric_rate(start.shape.displacement, start_velocity)
        stress_error = (1 - t) * variables.law_error + t * end.variables.law_error
        stress = pad.isochoric_stress(shape.displacement)
        variables = replace(variables, rate=stress_rate).after(self._material, elapsed, stress, growth)
        step_error = variables.parabolic_step_error(self._material, growth, t**3 * end.mid_step.cubic_stress)
        variables = variables.with_error(step_error).with_law_error(self._material, stress_error, growth)

        # Residual of the interpolated state.
        history = History(StressUpdate(1.0, variables.overstress(self._material), pad.part))
        unknowns, checked = pad.gather(shape.displacement, shape.pressure), end.figures.stability_checked
        try:
            solution = pad.figures_at(unknowns, np.array(value), 0, checked, history)
        except Rejected as rejection:
            ended = PathEnded(np.array(value), 0.0, f"cannot be loaded further ({rejection})")
            raise ComputationError(self._end(ended, time, 0.0)) from rejection
        error, scale = pad.size_of(variables.stress_error(self._material)), end.control.stress_scale
        memory = self._response.after(start.load.memory, elapsed * end.load.rate, elapsed)
        return replace(
            end,
            time=time,
            shape=shape,
            load=LoadState(np.array(value), end.load.rate, memory),
            variables=replace(variables, rate=pad.isochoric_rate(shape.displacement, velocity)),
            figures=Figures(
                min_jacobian=solution.min_jacobian,
                residual=solution.residual,
                iterations=0,
                stability_checked=checked,
                seconds=end.figures.seconds,
                uncertainty=(1 - t) * start.figures.uncertainty + t * end.figures.uncertainty,
                stress_error=error / scale if scale else 0.0,
            ),
        )

    def _cubics(self, rows: LoadHistory) -> tuple[TimeState, StepCubics]:
        """The state before the last time step, and the cubic polynomials that interpolate within this step. The step
        ends at the last row or later."""
        if self._last is None or self._last[0] != rows:
            start, end = self._before(rows), self._kept(rows)
            assert end.mid_step is not None
            measures = self._response.measures(start.load.memory, end.load.rate, end.time - start.time)
            ends = start.shape.unknowns, end.shape.unknowns, end.mid_step.start_velocity, end.shape.velocity
            self._last = rows, (start, StepCubics(measures, end.shape.displacement.size, *ends))
        return self._last[1]

    def _shape(self, rows: LoadHistory) -> Shape:
        """Displacements and pressures of the pad at the end of some rows."""
        end = self._solved(rows)
        if end.time <= rows[-1][0]:
            return end.shape
        start, cubics = self._cubics(rows[: self._count[rows]])
        return shape_within(start, end, cubics, rows[-1][0])

    def _solved(self, rows: LoadHistory) -> TimeState:
        """First solved state at or after the time of the last row. The state at the last row is interpolated from it if
        it is later.
        """
        done = len(rows)
        while done and rows[:done] not in self._count and not cache.holds(self._name(rows[:done])):
            done -= 1
        done = self._count.get(rows[:done], done)
        at = self._kept(rows[:done])
        for count in range(done + 1, len(rows) + 1):
            time, value = rows[count - 1]
            if not (at.time >= time and at.on_its_way(time, np.array(value))):
                at, done = self._stored(rows[:count]), count
            self._count[rows[:count]] = done
        return at

    def _stored(self, rows: LoadHistory) -> TimeState:
        """The state solved for the last row: read from disk, or solved by a time step if it is not there."""
        name = self._name(rows)
        with cache.alone(name):
            arrays = cache.load(name)  # another process may have solved it in the meantime
            if arrays is not None:
                at = TimeState.from_arrays(arrays)
            else:
                at = self._next(self._before(rows), rows)
                cache.store(name, cache.arrays_of(at))
        self._known[rows] = at
        self._count[rows] = len(rows)
        if len(self._known) > KEPT:
            self._known.popitem(last=False)
        return at

    def _before(self, rows: LoadHistory) -> TimeState:
        """The state from which the step to the last row starts."""
        (time, value), before = rows[-1], self._solved(rows[:-1])
        return before if before.on_its_way(time, np.array(value)) else self.reached(rows[:-1])

    def _kept(self, rows: LoadHistory) -> TimeState:
        if not rows:
            return self._rest
        return self._known[rows] if rows in self._known else self._stored(rows)

    def _next(self, before: TimeState, rows: LoadHistory) -> TimeState:
        """Solve the state at the end of the last row, or later, from the state at the end of the previous row, or
        later.
        """
        (time, row), longest = rows[-1], math.inf
        value, last, duration = np.array(row), rows[-2][0] if len(rows) > 1 else 0.0, rows[-1][0] - before.time

        # The length of a first step beyond the last row; 0 if the load's rate is new and may not last.
        pad, length = self._pad_for(rows), 0.0
        if before.on_its_way(time, value):
            length = before.control.next_length
        elif leaps(pad, self._material) and duration > 0 and not rate_is_new(rows[:-1]):
            length = furthest(pad, self._response, (value - before.load.value) / duration)

        # The step must lead to the next row at least; otherwise it ends at this row.
        least = 2 * time - last - before.time
        while length > (1 - ON_ITS_WAY) * least > 0:
            rate = (value - before.load.value) / (time - before.time)
            try:
                return self._moved(before, rows, before.load.value + length * rate, length, beyond=True)
            except StepTooLong as too_long:
                length *= too_long.factor
                longest = AGAIN * length
        end = self._moved(before, rows, value, time - before.time)
        return replace(end, control=replace(end.control, next_length=min(end.control.next_length, longest)))

    def _moved(
        self,
        before: TimeState,
        rows: LoadHistory,
        value: np.ndarray,
        duration: float,
        steps: int | None = None,
        beyond: bool = False,
    ) -> TimeState:
        """State of the pad after the load has changed to ``value``; ``steps`` is the number of steps under friction.

        With ``beyond``, the change ends after the last row: it is a single step, within which states may be
        interpolated.
        """
        began = clock.perf_counter()
        start_value = before.load.value
        pad, earlier = self._pad_for(rows), self._pad_for(rows[:-1])
        change = value - start_value
        rate = change / duration if duration > 0 else np.full(len(change), np.nan)

        # The state before, on the part of the pad between the mirrors of all rows: if the load changes as before, its
        # velocity is known, and the rate of its stress.
        variables, velocity = before.variables, None
        if self._material.has_memory:
            variables = variables.on(pad.part, self._path.mesh, earlier.part)
        if np.allclose(rate, before.load.rate, rtol=1e-9, atol=0):
            moving, pressing = np.split(before.shape.velocity, [before.shape.displacement.size])
            velocity = pad.gather(moving.reshape(-1, 3), pressing)
        else:
            variables = replace(variables, rate=None)
        friction_state, judged = None, self._path.judged
        if isinstance(pad, IndentedPad) and pad.friction:
            nodes, count, traction, judged = pad.part.nodes, len(self._path.mesh.points), before.traction, False
            on_part = traction[np.concatenate([nodes, count + nodes])] if len(traction) else traction
            friction_state = FrictionState(
                pad.friction.slip_position(before.shape.displacement[nodes], start_value),
                pad.model.indentation.at_nodes(on_part),
            )
        unknowns = pad.gather(before.shape.displacement, before.shape.pressure)
        start = StepState(
            fraction=0.0,
            solution=Solution(unknowns, 1.0, 0.0, 0, True),
            variables=variables,
            velocity=velocity,
            unchecked=before.control.unchecked,
            friction_state=friction_state,
            load_memory=before.load.memory,
            error=StepError(np.zeros(pad.unknowns), before.figures.uncertainty),
        )

        # Solve.
        scale, load = before.control.stress_scale, (start_value, change)
        row_steps = RowSteps(pad, self._material, start, load, duration, scale, judged, self._coarsening, steps)
        try:
            end = row_steps.single(self._touch) if beyond else row_steps.run(self._touch)
        except PathEnded as ended:
            raise ComputationError(self._end(ended, before.time, duration)) from None

        # The state at the end, of the whole pad.
        displacement, pressure = pad.split(end.unknowns)
        traction = np.zeros((0, 3))
        if end.friction_state is not None:
            top, outside = np.split(pad.model.indentation.nodal(end.friction_state.traction), 2)
            zero = np.zeros(pad.part.mesh.corner_count)
            traction = np.concatenate([pad.part.expand(field, zero)[0] for field in (top, outside)])
        mid_step = None
        if beyond and end.mid_step:
            mid_step = MidStep(
                start_velocity=self._stacked(pad, end.mid_step.start_velocity),
                correction=self._stacked(pad, end.mid_step.correction),
                remainder=pad.split(end.mid_step.remainder)[0],
                cubic_stress=end.mid_step.cubic_stress,
            )
        scale = row_steps.stress_scale
        error = pad.size_of(end.variables.stress_error(self._material)) if self._material.prony else 0.0
        memory = self._response.at_rest(len(value)) if end.load_memory is None else end.load_memory
        deviation = pad.split(row_steps.deviation(end))[0]
        return TimeState(
            time=before.time + duration if beyond else rows[-1][0],
            shape=Shape(displacement, pressure, self._stacked(pad, end.velocity), deviation),
            load=LoadState(value, rate, memory),
            variables=end.variables,
            traction=traction,
            control=StepControl(next_length=end.next_length, stress_scale=scale, unchecked=end.unchecked),
            figures=Figures(
                min_jacobian=end.solution.min_jacobian,
                residual=end.solution.residual,
                iterations=end.solution.iterations,
                stability_checked=end.solution.stability_checked,
                seconds=before.figures.seconds + clock.perf_counter() - began,
                uncertainty=0.0 if end.error is None else end.error.uncertainty,
                stress_error=error / scale if scale else 0.0,
            ),
            mid_step=mid_step,
        )

    @cached_property
    def _rest(self) -> TimeState:
        mesh, pad, components = self._path.mesh, self._pad_for(LoadHistory()), self._path.load.components
        points = pad.model.assembly.elements.weight.shape if self._material.has_memory else (0, 0)
        nowhere, pressure = np.zeros_like(mesh.points), np.zeros(mesh.corner_count)
        return TimeState(
            time=0.0,
            shape=Shape(nowhere, pressure, self._stacked(pad, None), nowhere),
            load=LoadState(np.zeros(components), np.full(components, np.nan), self._response.at_rest(components)),
            variables=InternalVariables.at_rest(self._material, *points),
            traction=np.zeros((0, 3)),
            control=StepControl(next_length=0.0, stress_scale=0.0, unchecked=0.0),
            figures=Figures(
                min_jacobian=1.0,
                residual=0.0,
                iterations=0,
                stability_checked=True,
                seconds=0.0,
                uncertainty=0.0,
                stress_error=0.0,
            ),
        )

    def _stacked(self, pad: LoadedPad, unknowns: np.ndarray | None) -> np.ndarray:
        """Displacements of the whole pad, then its pressures, in one vector; NaN if ``unknowns`` is None."""
        if unknowns is None:
            return np.full(1, np.nan)
        displacement, pressure = pad.split(unknowns)
        return np.concatenate([displacement.ravel(), pressure])

    def _pad_for(self, rows: LoadHistory) -> LoadedPad:
        """The part of the pad that is bounded by the planes of symmetry (mirrors) that the loads of all rows have in
        common.
        """
        images, start = self._path.images, len(rows)
        while start and rows[:start] not in self._mirrors:
            start -= 1
        mirrors = self._mirrors[rows[:start]] if start else tuple(images)
        for count in range(start + 1, len(rows) + 1):
            value = np.array(rows[count - 1][1])
            if len(value) > 1:
                mirrors = tuple(mirror for mirror in mirrors if np.array_equal(mirror.image(value), value))
            self._mirrors[rows[:count]] = mirrors
        if mirrors not in self._pads:
            # Not a shared pad, because this one has a history.
            arguments = self._path.mesh, self._path.material, self._moving, mirrors, images
            self._pads[mirrors] = new_pad(*arguments, bodies=self._path.bodies, fraction=self._fraction)
        return self._pads[mirrors]

    def _touch(self, pad: LoadedPad, unknowns: np.ndarray) -> Contact | None:
        displacement = pad.split(unknowns)[0]
        return (self._path.contact.find_package if pad.load.self_contact else pad.contact.find)(displacement)

    def _end(self, ended: PathEnded, start: float, duration: float) -> str:
        load = self._moving
        value = ", ".join(f"{number:.4g}" for number in ended.value)
        shown = f"({value})" if len(ended.value) == 3 else value
        time = start + ended.fraction * duration
        when = f", {time:.4g} s" if self._material.prony else ""
        said = ended.contact and said_of(ended.contact.what, self._path.mesh, np.array(ended.contact.place))
        return f"the pad {ended.reason}: the load path ends at {load.quantity} = {shown} {load.unit}{when}.{said or ''}"

    def _name(self, rows: LoadHistory) -> str:
        path = self._path
        numerics = [
            path.judged,
            RESIDUAL_TOLERANCE,
            TIME_TOLERANCE,
            INTERPOLATION_TOLERANCE,
            available_solvers()[0],
            self._coarsening,
            self._fraction,
        ]
        softening = self._material.softening
        memory = self._material.prony, None if softening is None else softening.constants
        return cache.key("timed", path.key_parts, memory, numerics, rows.digest.hex())
