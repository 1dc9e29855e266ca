"""The state of a history-dependent pad at a time, and the interpolation between two such states."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from mitsuba_taxel.mechanics import cache
from mitsuba_taxel.mechanics.elements.internal_variables import InternalVariables
from mitsuba_taxel.mechanics.materials.creep import Measures

ON_ITS_WAY = 1e-9
"""Relative deviation of a load from a straight line in time that counts as rounding."""
QUARTER = 0.25
"""Fraction of a step, from either end, at which the error of states between its ends is measured."""


@dataclass(frozen=True, eq=False)
class Shape:
    """Displacements and pressures of the whole pad at a time, with their rates and the estimated error.

    Attributes
    ----------
    displacement : (N, 3) ndarray
        Displacements of the nodes in mm.
    pressure : (corners,) ndarray
        Pressures in MPa.
    velocity : (3 N + corners,) ndarray
        Rate per s of displacements, then pressures; (1,) NaN after a jump of the load.
    deviation : (N, 3) ndarray
        Estimated error of the displacement, in mm, by time steps and by interpolation between them.
    """

    displacement: np.ndarray
    pressure: np.ndarray
    velocity: np.ndarray
    deviation: np.ndarray

    @property
    def unknowns(self) -> np.ndarray:
        """Displacements, then pressures, as one vector."""
        return np.concatenate([self.displacement.ravel(), self.pressure])


@dataclass(frozen=True, eq=False)
class LoadState:
    """The load of a history-dependent pad at a time: its value, rate and memory.

    Attributes
    ----------
    value : (c,) ndarray
        The load or, under a force on an indenter, the displacement of the indenter.
    rate : (c,) ndarray
        Rate of the load per s, before this time; NaN after a jump.
    memory : ndarray
        Memory of :class:`~mitsuba_taxel.mechanics.materials.creep.CreepResponse`.
    """

    value: np.ndarray
    rate: np.ndarray
    memory: np.ndarray


@dataclass(frozen=True, eq=False)
class MidStep:
    """The state of the whole pad in the middle of a time step, as corrections to the interpolation between its ends.

    Attributes
    ----------
    start_velocity : (3 N + corners,) ndarray
        Rates of the unknowns per s at the start of the step.
    correction : (3 N + corners,) ndarray
        Correction by a step of Newton's method, at the middle of the step, to the cubic interpolation between its ends.
    remainder : (N, 3) ndarray
        Further correction of the displacements in mm, a quarter of the step from its start or from its end, whichever
        is larger.
    cubic_stress : (m, q, 6) ndarray
        Coefficient of the third power of the growth in the stress, MPa; ``cubic`` of
        :meth:`InternalVariables.parabolic_step_error`.
    """

    start_velocity: np.ndarray
    correction: np.ndarray
    remainder: np.ndarray
    cubic_stress: np.ndarray


@dataclass(frozen=True, eq=False)
class StepControl:
    """Data of the last time step from which the length of the next step is chosen.

    Attributes
    ----------
    next_length : float
        Length of the next step that errors allow, in s; 0 if a step must not span several rows.
    stress_scale : float
        Largest stress so far, root mean square over the pad, in MPa.
    unchecked : float
        Largest displacement in mm since displacements without the symmetry of the load were last checked.
    """

    next_length: float
    stress_scale: float
    unchecked: float


@dataclass(frozen=True, eq=False)
class Figures:
    """Quality of a solved state: residual, smallest volume ratio and errors, as in
    :class:`~mitsuba_taxel.mechanics.continuation.state.State`.

    Errors due to time steps: ``uncertainty`` in mm is the sum, over all steps, of the largest displacement that the
    error of a step causes (see :class:`~mitsuba_taxel.mechanics.history.step_state.StepError`); ``stress_error`` is the
    relative error of the stress.
    """

    min_jacobian: float
    residual: float
    iterations: int
    stability_checked: bool
    seconds: float
    uncertainty: float
    stress_error: float


@dataclass(frozen=True, eq=False)
class TimeState:
    """The pad at a ``time`` in s, with the internal variables of the solved part of the pad.

    ``traction`` (2 N, 3) in MPa is the traction of friction at nodes of the top, then of the outside. ``mid_step`` is
    None if the last step ends at a row.
    """

    time: float
    shape: Shape
    load: LoadState
    variables: InternalVariables
    traction: np.ndarray
    control: StepControl
    figures: Figures
    mid_step: MidStep | None = None

    def on_its_way(self, time: float, value: np.ndarray) -> bool:
        """Whether the load has a given value at another time, if it continues to change at its present rate.

        Parameters
        ----------
        time : float
            Time in s.
        value : (c,) ndarray
            Value of the load, in N, mm or MPa.

        Returns
        -------
        bool
            True if it has this value, up to rounding errors.
        """
        if not np.all(np.isfinite(self.load.rate)):
            return False
        then = self.load.value + (time - self.time) * self.load.rate
        scale = max(float(np.abs(self.load.value).max()), float(np.abs(value).max()))
        return bool(np.abs(then - value).max() <= ON_ITS_WAY * scale)

    @classmethod
    def from_arrays(cls, arrays: dict[str, np.ndarray]) -> TimeState:
        """Restore a state from the arrays of :func:`~mitsuba_taxel.mechanics.cache.arrays_of`."""
        values: dict[str, Any] = cache.values_of(arrays)
        return cls(
            time=values["time"],
            shape=Shape(**values["shape"]),
            load=LoadState(**values["load"]),
            variables=InternalVariables(**values["variables"]),
            traction=values["traction"],
            control=StepControl(**values["control"]),
            figures=Figures(**values["figures"]),
            mid_step=MidStep(**values["mid_step"]) if "mid_step" in values else None,
        )


def shape_within(start: TimeState, end: TimeState, cubics: StepCubics, time: float) -> Shape:
    """Displacements and pressures at a time within a time step that spans several rows of the load.

    They follow cubic polynomials between both ends of the step, corrected at the middle of the step by one step of
    Newton's method. The error is the further step of Newton's method, a quarter of the time step from one of its ends.

    Parameters
    ----------
    start : TimeState
        State at the start of the step.
    end : TimeState
        State at the end of the step.
    cubics : StepCubics
        Cubics between both.
    time : float
        Time in s.

    Returns
    -------
    Shape
        Displacements and pressures at that time, with their estimated error.
    """
    assert end.mid_step is not None  # the step leads beyond a row
    elapsed = time - start.time
    bump, bump_rate = cubics.measures.bump(elapsed)
    unknowns = cubics.at(elapsed) - bump * end.mid_step.correction
    displacement, pressure = np.split(unknowns, [end.shape.displacement.size])
    velocity = cubics.rate(elapsed) - bump_rate * end.mid_step.correction

    # Errors at both ends, and the error of the interpolation: a parabola that equals the remainder a quarter of the
    # step from an end.
    t = float(cubics.measures.main.at(elapsed))
    deviation = without_cancelling((1 - t) * start.shape.deviation, t * end.shape.deviation)
    parabola = t * (1 - t) / (QUARTER * (1 - QUARTER))
    deviation = without_cancelling(deviation, parabola * end.mid_step.remainder)
    return Shape(displacement.reshape(-1, 3), pressure, velocity, deviation)


def without_cancelling(error: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Sum of two estimated errors. The sign of the second error is unknown; it is chosen so that the errors do not
    cancel.
    """
    return error + (other if np.vdot(error, other) >= 0 else -other)


class StepCubics:
    """Interpolation of the unknowns within a time step, from the values and rates at both ends: cubic polynomials in
    its main measure of time (see :class:`Measures`). Parabolas replace them if rates with respect to that measure are
    not resolved at the end.

    Pressures also have a linear term in the other measure, if there is one.

    Parameters
    ----------
    measures : Measures
        Measures of the step.
    displacements : int
        Number of displacements among the unknowns; they come first.
    start, end : (n,) ndarray
        Unknowns at the start and at the end.
    start_rate, end_rate : (n,) ndarray
        Their rates per s.
    """

    def __init__(
        self,
        measures: Measures,
        displacements: int,
        start: np.ndarray,
        end: np.ndarray,
        start_rate: np.ndarray,
        end_rate: np.ndarray,
    ) -> None:
        self.measures, self._start, main, second = measures, start, measures.main, measures.second
        change = end - start
        self._other = change * float(second is not None)
        self._other[:displacements] = 0.0
        self._main = change - self._other
        if second is not None:
            start_rate = start_rate - second.rate(0.0) * self._other
            end_rate = end_rate - second.rate(main.duration) * self._other
        self._first = start_rate / main.rate(0.0)
        self._last = 2 * self._main - self._first if main.ends else end_rate / main.rate(main.duration)

    def at(self, elapsed: float) -> np.ndarray:
        """The unknowns at a time in s since the start of the step."""
        main, second = self.measures.main, self.measures.second
        t = float(main.at(elapsed))
        bent = t * (1 - t) * ((1 - t) * self._first - t * self._last)
        straight = 0.0 if second is None else second.at(elapsed) * self._other
        return self._start + t**2 * (3 - 2 * t) * self._main + bent + straight

    def rate(self, elapsed: float) -> np.ndarray:
        """Rates of the unknowns per s, at a time since the start of the step."""
        main, second = self.measures.main, self.measures.second
        t = float(main.at(elapsed))
        bent = (1 - t) * (1 - 3 * t) * self._first + t * (3 * t - 2) * self._last
        straight = 0.0 if second is None else second.rate(elapsed) * self._other
        return float(main.rate(elapsed)) * (6 * t * (1 - t) * self._main + bent) + straight
