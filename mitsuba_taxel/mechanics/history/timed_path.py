"""The states of a history-dependent pad under a sequence of loads with times.

From rest at t = 0, the load changes linearly to the value of each row until its time; rows of equal times are a jump. A
state depends on the rows up to its own alone, and is bitwise the same whichever others are requested.

While a load goes on at the same rate, steps may lead beyond the rows, between which states are then interpolated.
"""

from __future__ import annotations

import math
import time as clock
from collections import OrderedDict
from collections.abc import Callable
from dataclasses import replace
from functools import cached_property, partial

import numpy as np

from mitsuba_taxel.base.caches import kept
from mitsuba_taxel.base.convergence import ERROR_SHARE
from mitsuba_taxel.base.errors import ComputationError
from mitsuba_taxel.geometry.mirror import Mirror
from mitsuba_taxel.mechanics import cache
from mitsuba_taxel.mechanics.contact.feet import said_of, where_linear
from mitsuba_taxel.mechanics.contact.friction import Rubbed
from mitsuba_taxel.mechanics.contact.indentation import Indentation
from mitsuba_taxel.mechanics.contact.self_contact import Contact, ContactTest
from mitsuba_taxel.mechanics.continuation.load_path_ends import refuse_at_rest
from mitsuba_taxel.mechanics.continuation.pad_path import LOCK, PadPath
from mitsuba_taxel.mechanics.continuation.state import State, StateComparison, ViscoelasticMemory
from mitsuba_taxel.mechanics.elements.nodal_forces import glued_force
from mitsuba_taxel.mechanics.elements.past import Past, Relaxing, spread
from mitsuba_taxel.mechanics.elements.solvers import available_solvers
from mitsuba_taxel.mechanics.equilibrium.indented_pad import IndentedPad
from mitsuba_taxel.mechanics.equilibrium.loaded_pad import RESIDUAL_TOLERANCE, LoadedPad
from mitsuba_taxel.mechanics.equilibrium.pad_parts import new_pad
from mitsuba_taxel.mechanics.equilibrium.solution import Rejected
from mitsuba_taxel.mechanics.errors.second_meshes import second_meshes, share_of
from mitsuba_taxel.mechanics.errors.shorter_reach import REMAINDER
from mitsuba_taxel.mechanics.history.reached import ON_ITS_WAY, Passed, Reached, Way, passed
from mitsuba_taxel.mechanics.history.time_steps import (
    INTERPOLATION_TOLERANCE,
    TIME_TOLERANCE,
    Ended,
    Moment,
    Stretch,
    TooLong,
    furthest,
    leaps,
    response,
)
from mitsuba_taxel.mechanics.history.timed_rows import Row, rubs
from mitsuba_taxel.mechanics.materials.viscoelastic import Viscoelastic
from mitsuba_taxel.mechanics.results.roof_error import NO_ERROR, RoofComparison

KEPT = 3
"""Number of solved states that stay in memory."""
AGAIN = 1.5
"""A step that was too long is next tried at this multiple of the length that would do."""


class TimedPath:
    """States of one history-dependent pad under one kind of load, cached on disk, a few in memory.

    Parameters
    ----------
    path : PadPath
        Path of the same elastic pad, for its mesh and the comparison with another mesh.
    coarsening : int
        As in :class:`Stretch`.
    share : float
        Of the reach of contact, as of a :class:`SelfTouchingPad`.
    """

    def __init__(self, path: PadPath, material: Viscoelastic, coarsening: int = 1, share: float = 1.0) -> None:
        self._path, self._material, self._coarsening, self._share = path, material, coarsening, share
        self._moving = path.load.driven or path.load
        self._response = response(self._moving, material)
        self._known: OrderedDict[tuple[Row, ...], Reached] = OrderedDict()
        self._count: dict[tuple[Row, ...], int] = {(): 0}
        self._pads: dict[tuple[Mirror, ...], LoadedPad] = {}
        self._clear: set[tuple[bytes, tuple[Row, ...]]] = set()
        self._last: tuple[tuple[Row, ...], tuple[Reached, Way]] | None = None

    @classmethod
    @kept(4)
    def of(cls, path: PadPath, material: Viscoelastic) -> TimedPath:
        """The shared path of a pad and material."""
        return cls(path, material)

    def state(self, rows: tuple[Row, ...], obstacles: np.ndarray | None = None) -> State:
        """The deformed pad at the end of some rows, in which it must not touch ``obstacles``."""
        if obstacles is not None:
            self._refuse_contact(rows, obstacles)
        path = self._path
        if path.bodies is not None:
            refuse_at_rest(path.contact.at_rest)
        time, value = rows[-1]
        if path.load == self._moving:
            self._refuse_unresolved(None, np.array(value))
        at = self.reached(rows)
        self._refuse_unresolved(at.displacement, at.moved)
        figures = (at.min_jacobian, at.residual, at.iterations, at.stability_checked, at.seconds)
        memory = None
        if self._material.prony:
            memory = ViscoelasticMemory(time, partial(self._overstress, rows), at.deviation, at.missed)
        return State(
            path.mesh, path.material, path.load, np.array(value), at.displacement, at.pressure, *figures,
            second_mesh=partial(self._comparison, rows), memory=memory, traction=at.traction,
            indenter_moved=None if self._moving.indenter is None else at.moved, bodies=path.bodies,
        )  # fmt: skip

    def _refuse_unresolved(self, displacement: np.ndarray | None, moved: np.ndarray) -> None:
        if self._moving.indenter is not None:
            driven = self._path if self._path.load.driven is None else self._path.driven
            driven.refuse_unresolved(moved, displacement)

    def reached(self, rows: tuple[Row, ...]) -> Reached:
        """The pad at the end of some rows."""
        at = self._solved(rows)
        if at.time <= (rows[-1][0] if rows else 0.0):
            return at
        count, (time, value), shape = self._count[rows], rows[-1], self._passed(rows)
        (start, way), pad = self._way(rows[:count]), self._pad_for(rows)
        before = start.relaxing.spread(self._pad_for(rows[: count - 1]).part, self._path.mesh, pad.part)
        begun, moving = (v[: at.displacement.size].reshape(-1, 3) for v in (at.begun, shape.velocity))
        before = replace(before, slope=pad.isochoric_rate(start.displacement, begun))
        passed, course = time - start.time, way.measures.main
        t = float(course.at(passed))
        part, bend = course.until(passed), t**3 * at.bend
        relaxing = before.after(self._material, passed, pad.isochoric_stress(shape.displacement), part)
        relaxing = relaxing.off_by(relaxing.missed_on(self._material, part, bend))
        relaxing = relaxing.followed(self._material, (1 - t) * before.off + t * at.off, part)
        pad.past = Past(1.0, relaxing.overstress(self._material), pad.part)
        unknowns = pad.gather(shape.displacement, shape.pressure)
        try:
            state = pad.near_balance(unknowns, np.array(value), 0, at.stability_checked)
        except Rejected as rejection:
            ended = Ended(np.array(value), 0.0, f"cannot be loaded further ({rejection})")
            raise ComputationError(self._end(ended, time, 0.0)) from rejection
        error = pad.size_of(relaxing.stress_error(self._material))
        return replace(
            at,
            time=time,
            moved=np.array(value),
            displacement=shape.displacement,
            pressure=shape.pressure,
            velocity=shape.velocity,
            deviation=shape.deviation,
            missed=error / at.scale if at.scale else 0.0,
            min_jacobian=state.min_jacobian,
            residual=state.residual,
            iterations=0,
            stress=relaxing.stress,
            held=relaxing.held,
            error=relaxing.error,
            off=relaxing.off,
            doubt=(1 - t) * start.doubt + t * at.doubt,
            slope=pad.isochoric_rate(shape.displacement, moving),
            step=relaxing.step,
            recalled=self._response.after(start.recalled, passed * at.rate, passed),
        )

    def _way(self, rows: tuple[Row, ...]) -> tuple[Reached, Way]:
        """The state before the step to the last row and beyond, and the way from there."""
        if self._last is None or self._last[0] != rows:
            start, end = self._before(rows), self._kept(rows)
            measures = self._response.measures(start.recalled, end.rate, end.time - start.time)
            ends = start.unknowns, end.unknowns, end.begun, end.velocity
            self._last = rows, (start, Way(measures, end.displacement.size, *ends))
        return self._last[1]

    def _passed(self, rows: tuple[Row, ...]) -> Passed:
        """The shape of the pad at the end of some rows."""
        at = self._solved(rows)
        if at.time <= rows[-1][0]:
            return Passed(at.displacement, at.pressure, at.velocity, at.deviation)
        start, way = self._way(rows[: self._count[rows]])
        return passed(start, at, way, rows[-1][0])

    def _solved(self, rows: tuple[Row, ...]) -> Reached:
        """The last state that is solved for some rows: at the end of these, or beyond."""
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

    def _stored(self, rows: tuple[Row, ...]) -> Reached:
        """The state of :meth:`_solved` that is solved for the last row."""
        name = self._name(rows)
        with cache.alone(name):
            arrays = cache.load(name)  # another process may have solved it in the meantime
            if arrays is not None:
                at = Reached(**cache.values_of(arrays))
            else:
                at = self._next(self._before(rows), rows)
                cache.store(name, cache.arrays_of(at))
        self._known[rows] = at
        self._count[rows] = len(rows)
        if len(self._known) > KEPT:
            self._known.popitem(last=False)
        return at

    def _before(self, rows: tuple[Row, ...]) -> Reached:
        """The state from which the step to the last row sets out."""
        (time, value), before = rows[-1], self._solved(rows[:-1])
        return before if before.on_its_way(time, np.array(value)) else self.reached(rows[:-1])

    def _kept(self, rows: tuple[Row, ...]) -> Reached:
        if not rows:
            return self._rest
        return self._known[rows] if rows in self._known else self._stored(rows)

    def _next(self, before: Reached, rows: tuple[Row, ...]) -> Reached:
        """The pad at the end of the last row or beyond, from its state at the end of the row before or beyond."""
        (time, row), most = rows[-1], math.inf
        value, last = np.array(row), rows[-2][0] if len(rows) > 1 else 0.0
        length, least = self._further(before, rows), 2 * time - last - before.time  # to the next row at least
        while length > (1 - ON_ITS_WAY) * least > 0:
            way = (value - before.moved) / (time - before.time)
            try:
                return self._moved(before, rows, before.moved + length * way, length, leaps=True)
            except TooLong as too_long:
                length *= too_long.share
                most = AGAIN * length
        at = self._moved(before, rows, value, time - before.time)
        return replace(at, further=min(at.further, most))

    def _further(self, before: Reached, rows: tuple[Row, ...]) -> float:
        """Length in s of a first step beyond the last row; 0 if the load's rate is new and may not last."""
        (time, row), pad = rows[-1], self._pad_for(rows)
        if before.on_its_way(time, np.array(row)):
            return before.further
        duration = time - before.time
        if not (leaps(pad, self._material) and duration > 0) or _turns(rows[:-1]):
            return 0.0
        return furthest(pad, self._response, (np.array(row) - before.moved) / duration)

    def _moved(
        self,
        before: Reached,
        rows: tuple[Row, ...],
        value: np.ndarray,
        duration: float,
        steps: int | None = None,
        leaps: bool = False,
    ) -> Reached:
        """The pad after the load changed to ``value``; ``steps`` are those under friction.

        If it ``leaps``, it does so in one step, between whose ends states may be interpolated.
        """
        began = clock.perf_counter()
        start_value = before.moved
        pad, earlier = self._pad_for(rows), self._pad_for(rows[:-1])
        change = value - start_value
        rate = change / duration if duration > 0 else np.full(len(change), np.nan)
        goes_on = np.allclose(rate, before.rate, rtol=1e-9, atol=0)
        relaxing = before.relaxing
        if self._material.prony:
            relaxing = relaxing.spread(earlier.part, self._path.mesh, pad.part)
        velocity = None
        if goes_on:
            moved, pressed = np.split(before.velocity, [before.displacement.size])
            velocity = pad.gather(moved.reshape(-1, 3), pressed)
        else:
            relaxing = replace(relaxing, slope=None)
        start = Moment(pad.gather(before.displacement, before.pressure), relaxing, velocity, before.unjudged)
        start = replace(start, recalled=before.recalled, doubt=before.doubt)
        judged = self._path.judged
        if isinstance(pad, IndentedPad) and pad.friction:
            start = replace(start, rubbed=self._rubbed(pad, before, start_value))
            judged = False
        load = start_value, change
        stretch = Stretch(pad, self._material, start, load, duration, before.scale, judged, self._coarsening, steps)
        try:
            end = stretch.leap(self._touch) if leaps else stretch.run(self._touch)
        except Ended as ended:
            raise ComputationError(self._end(ended, before.time, duration)) from None
        displacement, pressure = pad.split(end.unknowns)
        beyond = (np.zeros(0),) * 4
        if leaps and end.midway:
            begun, found = (self._stacked(pad, field) for field in (end.midway.begun, end.midway.found))
            beyond = begun, found, pad.split(end.midway.left)[0], end.midway.bend
        error = pad.size_of(end.relaxing.stress_error(self._material)) if self._material.prony else 0.0
        return Reached(
            before.time + duration if leaps else rows[-1][0],
            displacement,
            pressure,
            rate,
            self._stacked(pad, end.velocity),
            *beyond,
            end.relaxing.stress,
            end.relaxing.held,
            end.relaxing.error,
            end.relaxing.off,
            np.zeros(0) if end.relaxing.slope is None else end.relaxing.slope,
            end.relaxing.step,
            self._response.at_rest(len(value)) if end.recalled is None else end.recalled,
            end.further,
            stretch.scale,
            end.unjudged,
            pad.split(stretch.deviation(end))[0],
            end.doubt,
            error / stretch.scale if stretch.scale else 0.0,
            self._traction(pad, end),
            value,
            end.min_jacobian,
            end.residual,
            end.iterations,
            end.stability_checked,
            before.seconds + clock.perf_counter() - began,
        )

    @cached_property
    def _rest(self) -> Reached:
        mesh, pad = self._path.mesh, self._pad_for(())
        points = pad.model.assembly.elements.weight.shape if self._material.prony else (0, 0)
        relaxing = Relaxing.at_rest(self._material, *points)
        recalled = self._response.at_rest(self._path.load.components)
        nowhere, unknown = np.zeros_like(mesh.points), np.full(self._path.load.components, np.nan)
        empty = np.zeros(0)
        none, moved = np.zeros(mesh.corner_count), np.zeros(self._path.load.components)
        variables = relaxing.stress, relaxing.held, relaxing.error, relaxing.off, empty, 0.0, recalled
        return Reached(
            0.0, nowhere, none, unknown, self._stacked(pad, None), empty, empty, empty, empty, *variables, 0.0, 0.0,
            0.0, nowhere, 0.0, 0.0, np.zeros((0, 3)), moved, 1.0, 0.0, 0, True, 0.0,
        )  # fmt: skip

    def _rubbed(self, pad: IndentedPad, before: Reached, moved: np.ndarray) -> Rubbed:
        """History of friction at the end of a row, on another part of the pad."""
        assert pad.friction is not None
        nodes, count = pad.part.nodes, len(self._path.mesh.points)
        on_part = before.traction[np.concatenate([nodes, count + nodes])] if len(before.traction) else before.traction
        place = pad.friction.place(before.displacement[nodes], moved)
        return Rubbed(place, pad.model.indentation.at_nodes(on_part))

    def _traction(self, pad: LoadedPad, end: Moment) -> np.ndarray:
        """Traction of :class:`Reached`, from that of the solved part."""
        if end.rubbed is None:
            return np.zeros((0, 3))
        top, outside = np.split(pad.model.indentation.nodal(end.rubbed.traction), 2)
        none = np.zeros(pad.part.mesh.corner_count)
        return np.concatenate([pad.part.expand(field, none)[0] for field in (top, outside)])

    def _stacked(self, pad: LoadedPad, unknowns: np.ndarray | None) -> np.ndarray:
        """Displacements of the whole pad, then its pressures, in one row; NaN for None."""
        if unknowns is None:
            return np.full(1, np.nan)
        displacement, pressure = pad.split(unknowns)
        return np.concatenate([displacement.ravel(), pressure])

    def _pad_for(self, rows: tuple[Row, ...]) -> LoadedPad:
        """The part of the pad between the common mirrors of the loads of all rows."""
        values = [np.array(value) for _, value in rows]
        images = self._path.images
        mirrors = tuple(
            mirror for mirror in images if all(len(v) == 1 or np.array_equal(mirror.image(v), v) for v in values)
        )
        if mirrors not in self._pads:
            # A shared one must not have a history.
            parts = self._path.mesh, self._path.material, self._moving, mirrors, images
            self._pads[mirrors] = new_pad(*parts, bodies=self._path.bodies, share=self._share)
        return self._pads[mirrors]

    def _touch(self, pad: LoadedPad, unknowns: np.ndarray) -> Contact | None:
        displacement = pad.split(unknowns)[0]
        return (self._path.contact.find_package if pad.load.self_contact else pad.contact.find)(displacement)

    def _end(self, ended: Ended, start: float, duration: float) -> str:
        load = self._moving
        value = ", ".join(f"{number:.4g}" for number in ended.value)
        shown = f"({value})" if len(ended.value) == 3 else value
        time = start + ended.share * duration
        when = f", {time:.4g} s" if self._material.prony else ""
        said = ended.contact and said_of(ended.contact.what, self._path.mesh, np.array(ended.contact.place))
        return f"the pad {ended.reason}: the load path ends at {load.quantity} = {shown} {load.unit}{when}.{said or ''}"

    def _refuse_contact(self, rows: tuple[Row, ...], obstacles: np.ndarray) -> None:
        """Raise if a pad touches obstacles at the end of one of the rows; rows without contact are checked once."""
        key, test = obstacles.tobytes(), None
        for count in range(1, len(rows) + 1):
            if (key, rows[:count]) in self._clear:
                continue
            test = test or ContactTest(self._path.mesh, obstacles)
            found = test.find_package(self._passed(rows[:count]).displacement)
            if found:
                at, time = self.reached(rows[:count]).moved, rows[count - 1][0]
                raise ComputationError(self._end(Ended(at, 0.0, f"touches {found.what}"), time, 0.0))
            self._clear.add((key, rows[:count]))

    def _comparison(self, rows: tuple[Row, ...]) -> StateComparison:
        """Comparison with the same rows on the first other mesh that reaches them, and in longer steps."""
        with LOCK:
            at, mesh = self.reached(rows), self._path.mesh
            if not at.displacement.any():
                return StateComparison(NO_ERROR, partial(np.zeros, (2, *mesh.points.shape)), 0.0, 0.0)

            def told(second: PadPath, comparison: RoofComparison) -> StateComparison:
                other = self.of(second, self._material)
                there, longer = other.reached(rows), self._longer.reached(rows)
                other._refuse_unresolved(there.displacement, there.moved)
                closer = self._closer.reached(rows)
                deviations, of_force = comparison.deviations, 0.0
                if self._path.load.gives_displacement:
                    force = self._board_force(rows, at)
                    of_steps, of_reach = (
                        0.0 if reached is at else float(np.linalg.norm(one._board_force(rows, reached) - force))
                        for one, reached in ((self, longer), (self._closer, closer))
                    )
                    of_mesh = comparison.force_error(force, other._board_force(rows, there))
                    of_force = of_mesh + of_steps + REMAINDER * of_reach
                    deviations = partial(deviations, of_force=share_of(of_mesh, force))
                return StateComparison(
                    comparison.error(at.displacement, there.displacement),
                    partial(self._deviations, deviations, at, there, longer, closer),
                    of_force,
                    there.seconds + sum(other.seconds for other in (longer, closer) if other is not at),
                )

            return second_meshes(self._path).first(told) or StateComparison()

    @cached_property
    def _longer(self) -> TimedPath:
        """The path in steps of twice the length under friction, whose error is proportional to it; else this path."""
        return type(self)(self._path, self._material, 2) if rubs(self._path.load) else self

    @cached_property
    def _closer(self) -> TimedPath:
        """The path with half the reach of contact where it goes on; else this path."""
        return type(self)(self._path, self._material, 1, 0.5) if self._path.load.self_contact else self

    def _deviations(
        self, deviations: Callable[..., np.ndarray], at: Reached, there: Reached, longer: Reached, closer: Reached
    ) -> np.ndarray:
        """Deviations of the elements, with those of time steps, of steps under friction, and by the reach of contact
        added to the remainder."""
        found = deviations(at.displacement, there.displacement)
        found[1] += (at.deviation + at.displacement - longer.displacement) / ERROR_SHARE
        found[1] += REMAINDER * (closer.displacement - at.displacement) / ERROR_SHARE
        return found

    def _overstress(self, rows: tuple[Row, ...], at: Reached | None = None) -> np.ndarray:
        """(m, q, 6) MPa, of :class:`ViscoelasticMemory`."""
        at = self.reached(rows) if at is None else at
        return spread(at.relaxing.overstress(self._material), self._pad_for(rows).part, self._path.mesh)

    def _board_force(self, rows: tuple[Row, ...], at: Reached) -> np.ndarray:
        self_contact = self._path.load.self_contact  # where the board may hold the pad beside the glue, too
        if self_contact and self._moving.indenter is not None:
            body = Indentation(self._path.mesh, self._moving.indenter, self._path.material.youngs_modulus)
            return -body.pressing(at.displacement, at.moved, traction=body.at_nodes(at.traction)).force
        overstress, path = self._overstress(rows, at) if self._material.prony else None, self._path
        solved = path.mesh, path.material, at.displacement, at.pressure, overstress
        if not self_contact:
            return glued_force(*solved)
        return -glued_force(*solved, region="top", linear=where_linear(path.mesh, path.load, self._share))

    def _name(self, rows: tuple[Row, ...]) -> str:
        path = self._path
        numerics = [
            path.judged,
            RESIDUAL_TOLERANCE,
            TIME_TOLERANCE,
            INTERPOLATION_TOLERANCE,
            available_solvers()[0],
            self._coarsening,
            self._share,
        ]
        return cache.key("timed", path.key_parts, self._material.prony, numerics, rows)


def _turns(rows: tuple[Row, ...]) -> bool:
    """Whether the last rate of the load lasted for one of these rows only, so that the next may too."""
    if not rows or rows[-1][0] == (rows[-2][0] if len(rows) > 1 else 0.0):
        return False  # there is none yet, or it jumped
    points = [(0.0, np.zeros(len(rows[0][1]))), *rows][-3:]
    if len(points) < 3:
        return True
    times, values = np.array([time for time, _ in points]), np.array([value for _, value in points])
    (first, second), (before, after) = np.diff(times), np.diff(values, axis=0)
    return not np.allclose(before * second, after * first, rtol=1e-9, atol=0)
