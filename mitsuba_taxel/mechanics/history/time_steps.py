"""Time steps between two rows of a load, short enough that the stress changes smoothly within each step.

Within a step, the stress of the law is a parabola over the :class:`Growth` of the step, which begins with the rate of
the stress. In contact with an indenter, or of the pad with itself, the stress is linear in time.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from mitsuba_taxel.mechanics.contact.barriers.self_contact import Contact
from mitsuba_taxel.mechanics.elements.loads import Load
from mitsuba_taxel.mechanics.equilibrium.indented_pad import IndentedPad
from mitsuba_taxel.mechanics.equilibrium.linearised import Linearised
from mitsuba_taxel.mechanics.equilibrium.loaded_pad import LoadedPad
from mitsuba_taxel.mechanics.equilibrium.natural_step import NATURAL_STRAIN
from mitsuba_taxel.mechanics.equilibrium.solution import History, Rejected
from mitsuba_taxel.mechanics.history.step_state import PartMidStep, PathEnded, StepError, StepState, StepTooLong
from mitsuba_taxel.mechanics.history.time_state import QUARTER, StepCubics
from mitsuba_taxel.mechanics.materials.creep import CreepResponse, Measures
from mitsuba_taxel.mechanics.materials.viscoelastic import Viscoelastic

TIME_TOLERANCE = 1e-3
"""Allowed error of the stress per step, relative to the largest so far, root mean square over the pad."""
INTERPOLATION_TOLERANCE = 1e-4
"""Allowed error of states within a step that leads beyond rows, root mean square over the pad, relative to the largest
displacement or pressure. The error is the step that Newton's method would add a quarter of the way from an end."""
TICKS = 64
"""A step without an equilibrium is halved until it is this number of times shorter than the time since the row before,
or than the shortest relaxation time if that is longer; then the path ends."""
MOST_GROWTH, LEAST_CUT, MOST_CUT, CAUTION = 4.0, 0.5, 0.02, 0.8
"""Limits of the ratio of successive step lengths: the largest increase, the largest and the smallest ratio for a step
that is repeated, and the safety factor."""
DOUBT = 0.3
"""Relative uncertainty of the estimated error of a step."""
HELD = 10.0
"""Longest step under a constant load, relative to the longest time constant of the response."""
SHORTEST = 1e-15
"""Fraction of the interval between two rows below which a step is not shortened."""

Touch = Callable[[LoadedPad, np.ndarray], Contact | None]


class RowSteps:
    """The time steps from one row of a load to the next, for a history-dependent pad.

    Parameters
    ----------
    pad : LoadedPad
        The part of the pad between the mirrors of the load.
    material : Viscoelastic
        The silicone.
    start : StepState
        State at the start.
    load : tuple[ndarray, ndarray]
        Value of the load at the start, and its change.
    duration : float
        Duration in s; 0 for a jump.
    stress_scale : float
        Largest stress so far, root mean square over the pad, MPa; the attribute of this name includes the stress of
        these steps.
    judged : bool
        Whether stability is tested against all displacements, not only against those with the symmetry of the load.
    coarsening : int
        Length of steps under friction and with Mullins' effect, relative to the steps of the path: 1 or 2.
    count : int, optional
        Number of these steps; by default it follows from the length of the movement.
    """

    def __init__(
        self,
        pad: LoadedPad,
        material: Viscoelastic,
        start: StepState,
        load: tuple[np.ndarray, np.ndarray],
        duration: float,
        stress_scale: float,
        judged: bool,
        coarsening: int = 1,
        count: int | None = None,
    ) -> None:
        self._pad, self._material, self._start, self._load = pad, material, start, load
        self._duration, self.stress_scale, self._tolerance = duration, stress_scale, coarsening**2 * TIME_TOLERANCE
        steps = float(np.linalg.norm(load[1])) / pad.step
        if material.softening is not None or (isinstance(pad, IndentedPad) and pad.friction):
            steps = (2 * math.ceil(steps) if count is None else count) / coarsening
        self._longest = 1 / max(steps, 1.0)
        self._leaps, self._response = leaps(pad, material), response(pad.load, material)
        self._furthest = furthest(pad, self._response, load[1] / duration) if self._leaps and duration else 0.0
        self._quickest = min(material.times) / duration if material.prony and duration else math.inf
        self._near: Linearised | None = None
        self._judged = judged

    def run(self, touch: Touch) -> StepState:
        """The state at the end of the interval between two rows, in as many time steps as the error requires.

        Where the stress is taken as linear in time within each step, the error of a step follows from two steps. So the
        error of the first step after a change of the load's rate is known only after the second step. If the error of
        either step is too large, both steps are repeated.

        Parameters
        ----------
        touch : Callable[[LoadedPad, ndarray], Contact or None]
            Finds contacts.

        Returns
        -------
        StepState
            State at the end.

        Raises
        ------
        PathEnded
            if there is no further state.
        """
        here, before = self._start, None

        def ended(reason: str, contact: Contact | None = None) -> PathEnded:
            return PathEnded(self._load[0] + here.fraction * self._load[1], here.fraction, reason, contact)

        try:
            here = self._with_start_velocity(here)
        except Rejected as rejection:
            raise ended(f"cannot be loaded further ({rejection})") from rejection

        # If the rate of a first step is unknown, the step covers half of the interval, so that the second step gives
        # its error.
        length = 0.5 if self._duration and here.variables.rate is None else 1.0
        while here.fraction < 1:
            # Solve; without an equilibrium, in a shorter step.
            length = min(length, self._longest, 1 - here.fraction)
            fraction = 1.0 if here.fraction + 1.001 * length > 1 else here.fraction + length
            try:
                after = self._step(here, fraction)
            except Rejected as rejection:
                length /= 2
                if length < max(min(self._longest, max(here.fraction, self._quickest)) / TICKS, SHORTEST):
                    raise ended(f"cannot be loaded further ({rejection})") from rejection
                continue

            # Repeat a step that is not accurate, together with the step before if the errors of both were estimated
            # together.
            error, after = self._error_estimate(before, here, after)
            if error > self._tolerance and length > SHORTEST:
                here, before = (before or here), None
                length *= min(max(self._length_factor(error, after), MOST_CUT), LEAST_CUT)
                continue

            # The pad must touch nothing.
            contact = touch(self._pad, after.unknowns)
            if contact:
                location = ", ".join(f"{number:.4g}" for number in contact.place)
                raise ended(f"touches {contact.what} near ({location}) mm, which is outside the model", contact)

            # The length of the next step.
            first = here.variables.rate is None and self._duration
            before, here = (here if first else None), after
            if not first:
                length *= min(max(self._length_factor(error, after), LEAST_CUT), MOST_GROWTH)
        return replace(here, next_length=min(length * self._duration, self._furthest))

    def single(self, touch: Touch) -> StepState:
        """The state at the end of the interval by a single time step, within which states may be interpolated.

        Parameters
        ----------
        touch : Callable[[LoadedPad, ndarray], Contact or None]
            Finds contacts.

        Returns
        -------
        StepState
            State at the end.

        Raises
        ------
        StepTooLong
            if states within the step cannot be interpolated accurately enough.
        """
        try:
            here = self._with_start_velocity(self._start)
            after = self._step(here, 1.0)
        except Rejected as rejection:
            raise StepTooLong(LEAST_CUT) from rejection
        error, judged = self._error_estimate(None, here, after)
        if touch(self._pad, after.unknowns):
            raise StepTooLong(LEAST_CUT)
        factor = min(self._length_factor(error, after), MOST_GROWTH)
        if factor < CAUTION:
            raise StepTooLong(max(factor, MOST_CUT))
        return replace(judged, next_length=min(factor * self._duration, self._furthest))

    def _length_factor(self, error: float, after: StepState) -> float:
        """Factor by which the next step is longer than a step that had an ``error``.

        Errors of time steps are proportional to the second or third power of the length, errors of the interpolation to
        its fourth power.
        """
        if after.mid_step is None:
            return CAUTION * math.sqrt(self._tolerance / error) if error else MOST_GROWTH
        ratio = max((error / self._tolerance) ** (1 / 3), (after.mid_step.error / INTERPOLATION_TOLERANCE) ** 0.25)
        return CAUTION / ratio if ratio else MOST_GROWTH

    def _step(self, here: StepState, fraction: float) -> StepState:
        """The state at a ``fraction`` of the interval, by one step.

        The overstress of a Prony series follows the stress of the law by convolution integrals, which are exact for
        stress that is linear, or a parabola, over the step (R. L. Taylor, K. S. Pister and G. L. Goudreau, Int. J.
        Numer. Meth. Eng. 2, 1970; J. C. Simo and T. J. R. Hughes, Computational Inelasticity, 1998, chapter 10). So the
        stress at the end of the step is a fraction of the stress of the law at the end, plus a term that is known
        beforehand.
        """
        pad, time = self._pad, (fraction - here.fraction) * self._duration
        value = self._load[0] + fraction * self._load[1]

        # The measure over which the stress of the law is a parabola: the response of a linear pad to this load.
        measures = None
        if self._leaps and time:
            assert here.load_memory is not None
            measures = self._response.measures(here.load_memory, self._load[1] / self._duration, time)
        growth = measures.main if measures else None
        stress_update = None
        if self._material.has_memory:
            stress_update = here.variables.stress_update(self._material, time, pad.part, growth)
        history = History(stress_update, here.friction_state)

        # Predict by the velocity, and solve.
        guess = here.unknowns
        if here.velocity is not None:
            ahead = (1 / growth.rate(0.0) if growth else min(time, here.variables.step)) * here.velocity
            guess = pad.towards(guess, guess + ahead)
        solution, self._near = pad.solve_after(guess, value, self._near, history)

        # Check displacements without the symmetry of the load, which takes long, only after the pad has moved enough.
        largest = float(np.abs(solution.unknowns - here.unknowns)[: pad.numbering.displacements].max())
        unchecked = here.unchecked + largest
        if self._judged and (unchecked > NATURAL_STRAIN * pad.height or fraction == 1):
            self._near = pad.stable_tangent(solution.unknowns, value, self._near, history)
            unchecked = 0.0
        elif growth is not None:
            self._near = pad.tangent_at(solution.unknowns, value, self._near, history)

        # Internal variables, friction, and the memory of the load at the end.
        variables, elements = here.variables, pad.model.assembly.elements
        displacement = pad.numbering.split(solution.unknowns)[0]
        if self._material.prony:
            stress = elements.isochoric_stress(displacement)
            variables = variables.after(self._material, time, stress, growth)
        elif self._material.softening is not None:
            variables = variables.after_energy(elements.isochoric_energy(displacement))
        friction_state = (
            pad.friction_state_at(solution.unknowns, value, history) if isinstance(pad, IndentedPad) else None
        )
        memory = None
        if self._leaps:
            assert here.load_memory is not None
            memory = self._response.after(here.load_memory, (fraction - here.fraction) * self._load[1], time)
        velocity = (solution.unknowns - here.unknowns) / time if time and not self._leaps else None
        after = StepState(
            fraction=fraction,
            solution=solution,
            variables=variables,
            velocity=velocity,
            unchecked=unchecked,
            friction_state=friction_state,
            load_memory=memory,
        )
        if measures is None:
            return after

        # The velocity at the end, from the tangent there, and the middle of the step if states within the step may be
        # requested.
        rate = self._load[1] / self._duration
        stress_rate = here.variables.rate_by_duration(self._material, measures.main, variables.stress)
        after = self._with_velocity(after, pad.rate_in_time(self._near, solution.unknowns, rate, value, stress_rate))
        return replace(after, mid_step=self._mid_step(here, after, measures))

    def _with_start_velocity(self, here: StepState) -> StepState:
        """State at the start of the interval; its velocity is computed if it is needed but not yet known."""
        if not (self._leaps and self._duration and here.velocity is None):
            return here
        pad, variables, (value, change) = self._pad, here.variables, self._load
        history = History(variables.stress_update(self._material, 0.0, pad.part))
        self._near = pad.tangent_at(here.unknowns, value, None, history)
        stress_rate = -variables.relaxation_rate(self._material)
        velocity = pad.rate_in_time(self._near, here.unknowns, change / self._duration, value, stress_rate)
        return self._with_velocity(here, velocity)

    def _with_velocity(self, state: StepState, velocity: np.ndarray) -> StepState:
        """Copy of a state with a ``velocity``, and with the rate of stress that follows from it."""
        displacement, moving = (self._pad.numbering.split(field)[0] for field in (state.unknowns, velocity))
        stress_rate = self._pad.model.assembly.elements.isochoric_rate(displacement, moving)
        return replace(state, velocity=velocity, variables=replace(state.variables, rate=stress_rate))

    def _mid_step(self, here: StepState, after: StepState, measures: Measures) -> PartMidStep:
        """The state in the middle of a step, and the remaining error of the interpolation; raises Rejected if there is
        none."""
        pad, growth, tangent = self._pad, measures.main, self._near
        assert here.velocity is not None and after.velocity is not None and tangent is not None
        size, ends = pad.numbering.displacements, (here.unknowns, after.unknowns)
        cubics = StepCubics(measures, size, *ends, here.velocity, after.velocity)

        def correction(time: float, unknowns: np.ndarray) -> np.ndarray:
            """Correction by which Newton's method would change the interpolated unknowns at a time in s since the start
            of a time step.
            """
            stress_update = here.variables.stress_update(self._material, time, pad.part, growth.until(time))
            value = self._load[0] + (here.fraction + time / self._duration) * self._load[1]
            step = pad.correction(tangent, unknowns, value, History(stress_update))
            if step is None:
                raise Rejected("an element would be inverted within the step")
            return step

        # In the middle, cubics are corrected; the remaining error is measured a quarter of the step from each end.
        middle = growth.time_at(0.5)
        mid_correction, remainder, error = correction(middle, cubics.at(middle)), np.zeros(size), 0.0
        for fraction in (QUARTER, 1 - QUARTER):
            time = growth.time_at(fraction)
            unknowns = cubics.at(time) - measures.bump(time)[0] * mid_correction
            residual = correction(time, unknowns)
            for of_field, field in zip(np.split(residual, [size]), np.split(unknowns, [size]), strict=True):
                error = max(error, math.sqrt(np.square(of_field).mean()) / (np.abs(field).max() or 1.0))
            remainder = max(remainder, -residual, key=lambda field: float(np.abs(field[:size]).max()))

        # The deviation of the stress in the middle from a parabola is 1/8 of the coefficient of the third power.
        stress = pad.model.assembly.elements.isochoric_stress(
            pad.numbering.split(cubics.at(middle) - mid_correction)[0]
        )
        cubic = 8 * (here.variables.mid_stress(after.variables.stress, growth) - stress)
        return PartMidStep(growth, here.velocity, mid_correction, remainder, error, cubic)

    def _error_estimate(self, before: StepState | None, here: StepState, after: StepState) -> tuple[float, StepState]:
        """Relative error of the stress due to the last step (or the first two steps). Also returns the state, with this
        error added to its internal variables."""
        pad, variables = self._pad, after.variables
        if not self._material.prony:
            return 0.0, after
        self.stress_scale = max(self.stress_scale, pad.size_of(variables.stress))
        if not self.stress_scale:
            return 0.0, after

        # Steps that are linear in time: by the second derivative over this step and the one before.
        if not self._leaps:
            if variables.rate is None or here.variables.rate is None:
                return 0.0, after
            curvature = variables.curvature(here.variables)
            step_error = variables.linear_step_error(self._material, curvature)
            error = pad.size_of(step_error.sum(axis=0))
            if before is not None:
                previous = here.variables.linear_step_error(self._material, curvature)
                error = max(error, pad.size_of(previous.sum(axis=0)))
                step_error = step_error + self._material.over(variables.step).decay[:, None, None, None] * previous
            return error / self.stress_scale, replace(after, variables=variables.with_error(step_error))

        # Otherwise by the third power of the stress, which follows from the middle of the step.
        assert self._near is not None
        growth, error = None, 0.0
        uncertainty = 0.0 if here.error is None else here.error.uncertainty
        uncertainty *= math.exp(-variables.step * float(self._response.rates.min()))
        if after.mid_step is not None:
            growth = after.mid_step.growth
            step_error = variables.parabolic_step_error(self._material, growth, after.mid_step.cubic_stress)
            own = pad.response(self._near, after.unknowns, step_error.sum(axis=0))
            error = pad.size_of(step_error.sum(axis=0)) / self.stress_scale
            uncertainty += float(np.abs(own[: pad.numbering.displacements]).max())
            variables = variables.with_error(step_error)

        # Errors of the terms displace the pad. This changes the stress of the law, to which the terms respond.
        deviation = pad.response(self._near, after.unknowns, variables.error.sum(axis=0))
        displacement, displaced = (pad.numbering.split(field)[0] for field in (after.unknowns, deviation))
        stress_error = pad.model.assembly.elements.isochoric_rate(displacement, displaced)
        variables = variables.with_law_error(self._material, stress_error, growth)
        return error, replace(after, variables=variables, error=StepError(deviation, uncertainty))

    def deviation(self, end: StepState) -> np.ndarray:
        """Estimated error (unknowns,) of the state at the end due to the time steps so far.

        The error of each step is known to a fraction `DOUBT`. Errors of steps may cancel; these uncertainties do not.
        """
        if end.error is not None:
            deviation = end.error.deviation
            largest = float(np.abs(deviation[: self._pad.numbering.displacements]).max())
            return deviation * (1 + DOUBT * end.error.uncertainty / largest) if largest else deviation
        error = end.variables.error.sum(axis=0)
        if self._near is None or not error.any():
            return np.zeros(self._pad.unknowns)
        return self._pad.response(self._near, end.unknowns, error)


def leaps(pad: LoadedPad, material: Viscoelastic) -> bool:
    """Whether a single time step may span several rows of the load.

    Parameters
    ----------
    pad : LoadedPad
        The part of the pad.
    material : Viscoelastic
        The silicone.

    Returns
    -------
    bool
        True if the silicone relaxes, and states between the nodes of a path are interpolated rather than solved.
    """
    return bool(material.prony) and not pad.solves_between


def response(load: Load, material: Viscoelastic) -> CreepResponse:
    """How the pad responds when its load jumps to 1: creep under a force or pressure, relaxation under a displacement.

    Parameters
    ----------
    load : Load
        Kind of load.
    material : Viscoelastic
        The silicone.

    Returns
    -------
    CreepResponse
        Response of the displacements to a force, or of the pressures to a prescribed displacement.
    """
    return CreepResponse.of(material.prony, not load.gives_displacement)


def furthest(pad: LoadedPad, to_load: CreepResponse, rate: np.ndarray) -> float:
    """Longest time step, in s, that may span several rows of the load.

    Parameters
    ----------
    pad : LoadedPad
        The part of the pad.
    to_load : CreepResponse
        Response to the load.
    rate : (c,) ndarray
        Rate of the load, per s.

    Returns
    -------
    float
        Length of the step in s.
    """
    speed = float(np.linalg.norm(rate))
    return pad.step / speed if speed else HELD / float(to_load.rates.min())
