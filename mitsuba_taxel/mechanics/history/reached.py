"""A history-dependent pad at a time, and between two such times."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from mitsuba_taxel.mechanics.elements.past import Relaxing
from mitsuba_taxel.mechanics.materials.creep import Measures


@dataclass(frozen=True, eq=False)
class Reached:
    """The pad at a ``time`` in s; arrays are those of the whole pad, except for the internal variables of a part.

    ``rate`` is that of the load, per s, on the way there; ``velocity`` that of the unknowns, displacements followed by
    pressures; both are NaN after a jump of the load. ``further`` is the length in s of the next step, as far as errors
    allow, or 0 where it must not lead beyond a row. ``recalled`` is the memory of the load of
    :class:`~mitsuba_taxel.mechanics.materials.creep.CreepResponse`, ``doubt`` the sum in mm of what each step's error
    moves most, as far as it lasts, and ``missed`` the relative error of the stress by time steps. ``traction`` (2 N, 3)
    in MPa is that of friction at nodes of the top, then of the outside; ``moved`` (C,) is the load, or where its force
    has moved an indenter. The following are empty if the last step leads to a row: ``begun``, the velocity at its
    start; ``midway``, what Newton's method would subtract from the unknowns in its middle, on a cubic between its ends;
    ``left`` (N, 3), what it would then add to the displacements a quarter of the way from an end, where that is more;
    and ``bend`` of :meth:`Relaxing.missed_on`.
    """

    time: float
    displacement: np.ndarray
    pressure: np.ndarray
    rate: np.ndarray
    velocity: np.ndarray
    begun: np.ndarray
    midway: np.ndarray
    left: np.ndarray
    bend: np.ndarray
    stress: np.ndarray
    held: np.ndarray
    error: np.ndarray
    off: np.ndarray
    slope: np.ndarray
    step: float
    recalled: np.ndarray
    further: float
    scale: float
    unjudged: float
    deviation: np.ndarray
    doubt: float
    missed: float
    traction: np.ndarray
    moved: np.ndarray
    min_jacobian: float
    residual: float
    iterations: int
    stability_checked: bool
    seconds: float

    @property
    def relaxing(self) -> Relaxing:
        """The internal variables."""
        slope = self.slope if self.slope.size else None
        return Relaxing(self.stress, self.held, self.error, self.off, slope, self.step)

    @property
    def unknowns(self) -> np.ndarray:
        """Displacements, then pressures, in one row."""
        return np.concatenate([self.displacement.ravel(), self.pressure])

    def on_its_way(self, time: float, value: np.ndarray) -> bool:
        """Whether a load whose rate does not change has a ``value`` at another time."""
        if not np.all(np.isfinite(self.rate)):
            return False
        then = self.moved + (time - self.time) * self.rate
        scale = max(float(np.abs(self.moved).max()), float(np.abs(value).max()))
        return bool(np.abs(then - value).max() <= ON_ITS_WAY * scale)


ON_ITS_WAY = 1e-9
"""Relative deviation of a load from a straight line in time that is not one of its own."""


LEFT = 0.25
"""Share of the way, from either end, at which the error of states between two times is measured."""


class Passed(NamedTuple):
    """The shape of the pad on the way between two times: displacement (N, 3), pressure, rate of both as in `Reached`,
    and estimated error (N, 3) of the displacement by time steps and interpolation."""

    displacement: np.ndarray
    pressure: np.ndarray
    velocity: np.ndarray
    deviation: np.ndarray


def passed(start: Reached, end: Reached, way: Way, time: float) -> Passed:
    """The shape within the step from ``start`` to ``end``.

    It is that of their ``way`` with, midway, the value after one step of Newton's method. What such a step would then
    add a quarter of the way from an end is stated as its error.
    """
    since = time - start.time
    bump, bump_rate = way.measures.bump(since)
    moved, pressed = np.split(way.at(since) - bump * end.midway, [end.displacement.size])
    t = float(way.measures.main.at(since))
    deviation = added((1 - t) * start.deviation, t * end.deviation)
    deviation = added(deviation, t * (1 - t) / (LEFT * (1 - LEFT)) * end.left)
    return Passed(moved.reshape(-1, 3), pressed, way.rate(since) - bump_rate * end.midway, deviation)


def added(error: np.ndarray, further: np.ndarray) -> np.ndarray:
    """An estimated error and a further one, which may have either sign, so that they do not cancel."""
    return error + (further if np.vdot(error, further) >= 0 else -further)


class Way:
    """Cubic polynomials in the main measure of a step, with the values of the unknowns at both ends and their rates per
    s. Where rates by that measure are not resolved at the end, they are parabolas.

    Pressures are such polynomials in addition to a straight line in the other measure, if there is one.

    Parameters
    ----------
    displacements : int
        Number of displacements among the unknowns; they come first.
    """

    def __init__(
        self,
        measures: Measures,
        displacements: int,
        start: np.ndarray,
        end: np.ndarray,
        first: np.ndarray,
        last: np.ndarray,
    ) -> None:
        self.measures, self._start, main, other = measures, start, measures.main, measures.other
        change = end - start
        self._other = change * float(other is not None)
        self._other[:displacements] = 0.0
        self._main = change - self._other
        if other is not None:
            first, last = first - other.rate(0.0) * self._other, last - other.rate(main.duration) * self._other
        self._first = first / main.rate(0.0)
        self._last = 2 * self._main - self._first if main.ends else last / main.rate(main.duration)

    def at(self, time: float) -> np.ndarray:
        """The unknowns at a time in s since the start."""
        main, other = self.measures.main, self.measures.other
        t = float(main.at(time))
        bent = t * (1 - t) * ((1 - t) * self._first - t * self._last)
        beside = 0.0 if other is None else other.at(time) * self._other
        return self._start + t**2 * (3 - 2 * t) * self._main + bent + beside

    def rate(self, time: float) -> np.ndarray:
        """Their rate per s."""
        main, other = self.measures.main, self.measures.other
        t = float(main.at(time))
        bent = (1 - t) * (1 - 3 * t) * self._first + t * (3 * t - 2) * self._last
        beside = 0.0 if other is None else other.rate(time) * self._other
        return float(main.rate(time)) * (6 * t * (1 - t) * self._main + bent) + beside
