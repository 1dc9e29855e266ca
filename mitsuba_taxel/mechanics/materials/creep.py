"""Creep and relaxation of a viscoelastic silicone: measures of time in which the states of a pad change most evenly.

A force F(t) strains an incompressible linear solid with the relaxation function G of a Prony series as much as ::

    a(t) = int J(t - s) dF(s),    J(t) = 1 / (1 - sum of g_i) - sum of c_m exp(-l_m t)

strains an elastic solid at once, with the creep function J (J. D. Ferry, Viscoelastic Properties of Polymers, 1980,
chapter 3), while pressures follow F itself. Under a prescribed displacement F, strains follow F, and pressures the
integral of G(t - s) dF(s). The states of a real pad are similar: they are smooth functions of these integrals, even
where the load changes its direction and transients decay, whereas as functions of time they are sums of exponentials.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from mitsuba_taxel.base.caches import kept
from mitsuba_taxel.mechanics.materials.viscoelastic import Terms

BISECTIONS = 200
LEAST_START = 0.05
"""Rate at the start of a step, relative to its mean, below which creep is not used as a measure of time."""
LEAST_END = 1e-6
"""Rate at the end of a step, relative to its mean, below which derivatives with respect to the measure are not resolved
there."""
LEAST_BUMP = 1e-9
"""Deviation from a cubic polynomial that counts as rounding."""


@dataclass(frozen=True, eq=False)
class CreepResponse:
    """The response to a load that jumps to 1: ``lasting`` plus the sum of ``amplitudes`` exp(-``rates`` t).

    Attributes
    ----------
    lasting : float
        Response after a long time.
    rates : (k,) ndarray
        Rates of the k exponentials in 1/s.
    amplitudes : (k,) ndarray
        Amplitudes of the exponentials.
    creeps : bool
        True for the response of displacements to a force, False for the response of pressures to a displacement.
    """

    lasting: float
    rates: np.ndarray
    amplitudes: np.ndarray
    creeps: bool

    @classmethod
    @kept(16)
    def of(cls, prony: Terms, creeps: bool) -> CreepResponse:
        """The response of a Prony series.

        It is the relaxation function or the creep function. Rates of the creep function are the zeros of the relaxation
        function in Laplace space, found by bisection.
        """
        times = np.unique([time for _, time in prony])[::-1]
        weights = np.array([sum(weight for weight, term_time in prony if term_time == time) for time in times])
        remaining = 1 - float(weights.sum())
        if not (creeps and prony):
            return cls(remaining, 1 / times, weights, creeps)
        low, high = np.concatenate([[remaining / times[0]], 1 / times[:-1]]), 1 / times
        with np.errstate(divide="ignore"):
            for _ in range(BISECTIONS):
                rates = np.sqrt(low) * np.sqrt(high)
                below_one = (weights / (1 - rates[:, None] * times)).sum(axis=1) < 1
                low, high = np.where(below_one, rates, low), np.where(below_one, high, rates)
            amplitudes = 1 / (rates * (weights * times / (1 - rates[:, None] * times) ** 2).sum(axis=1))
        return cls(1 / remaining, rates, -amplitudes, creeps)

    def at_rest(self, components: int) -> np.ndarray:
        """Memory (k, C) of a load of C components that was always 0: zeros, one row for each of the k exponentials."""
        return np.zeros((len(self.rates), components))

    def after(self, memory: np.ndarray, change: np.ndarray, duration: float) -> np.ndarray:
        """Memory (k, C) of the load after it has changed linearly by ``change`` (C,) within ``duration`` s. A duration
        of 0 is a jump.
        """
        x = (self.rates * duration)[:, None]
        return np.exp(-x) * memory + np.where(x > 0, -np.expm1(-x) / np.where(x > 0, x, 1), 1.0) * change

    def measures(self, memory: np.ndarray, rate: np.ndarray, duration: float) -> Measures:
        """Measures of time within a step of a ``duration`` in s, in which the load changes at a ``rate`` (C,) per s."""
        responding, even, moves = self._growth(memory, rate, duration), Growth.even(duration), bool(rate.any())
        if moves and not self.creeps:
            return Measures(even, responding)
        times = _nodes(duration, 1 / float(self.rates.max()))[0]
        if responding is None or responding.rate(0.0) * duration < LEAST_START or np.any(responding.rate(times) < 0):
            responding = even
        return Measures(responding, even if moves else None)

    def _growth(self, memory: np.ndarray, rate: np.ndarray, duration: float) -> Growth | None:
        """The measure of time in which the response of the load changes evenly within a time step; None if nothing
        changes.

        The response is projected onto its total change, and scaled so that it grows from 0 to 1.
        """
        transients = self.amplitudes[:, None] * (rate - self.rates[:, None] * memory)
        steady = self.lasting * rate
        total = steady * duration - (np.expm1(-self.rates * duration) / self.rates) @ transients
        magnitude = float(np.linalg.norm(total))
        if not magnitude > np.finfo(float).tiny:
            return None
        direction = total / magnitude
        return Growth(duration, float(steady @ direction) / magnitude, transients @ direction / magnitude, self.rates)


@dataclass(frozen=True, eq=False)
class Growth:
    """A measure of time that grows from 0 to 1 within a time step, faster where the silicone creeps or relaxes faster.

    Its rate is ``steady`` plus the sum of ``amplitudes`` exp(-``rates`` t), in 1/s.
    """

    duration: float
    steady: float
    amplitudes: np.ndarray
    rates: np.ndarray

    @classmethod
    def even(cls, duration: float) -> Growth:
        """The measure of time that grows in proportion to time, over a step with a ``duration`` in s."""
        return cls(duration, 1 / duration, np.zeros(0), np.zeros(0))

    def rate(self, time: float | np.ndarray) -> np.ndarray:
        """Rate in 1/s at which the measure grows, at times in s since the start of the step."""
        return self.steady + np.exp(-np.multiply.outer(time, self.rates)) @ self.amplitudes

    def at(self, time: float | np.ndarray) -> np.ndarray:
        """Value of the measure, from 0 to 1, at times in s since the start of the step."""
        grown = -np.expm1(-np.multiply.outer(time, self.rates)) @ (self.amplitudes / self.rates)
        return np.multiply(time, self.steady) + grown

    @property
    def ends(self) -> bool:
        """Whether the measure has stopped growing at the end of the step: its rate there is 0 to machine precision."""
        return bool(self.rate(self.duration) * self.duration < LEAST_END)

    def time_at(self, fraction: float) -> float:
        """Time in s at which the measure has the value ``fraction``, by bisection. The measure must grow over the whole
        step."""
        low, high = 0.0, self.duration
        while low < (time := 0.5 * (low + high)) < high:
            low, high = (time, high) if self.at(time) < fraction else (low, time)
        return time

    def until(self, time: float) -> Growth:
        """The same measure of time for a shorter step, which ends at a ``time`` in s. It is scaled to be 1 at its end.
        """
        fraction = float(self.at(time))
        return Growth(time, self.steady / fraction, self.amplitudes / fraction, self.rates)

    def moments(self, times: np.ndarray) -> np.ndarray:
        """Fractions (k, 3) of a stress that grows within a step which are left at its end, after relaxation with k time
        constants ``times`` in s.

        The three columns are for stresses that grow in proportion to g, g² and g³, where g is this measure: integrals
        of exp(-(time to the end) / tau) over them.
        """
        shortest = np.append(times, 1 / self.rates).min()
        time, remaining, weight = _nodes(self.duration, float(shortest))
        fraction, rate = self.at(time), self.rate(time)
        rates_of_powers = np.stack([rate, 2 * fraction * rate, 3 * fraction**2 * rate])
        with np.errstate(under="ignore", over="ignore"):
            return np.exp(-np.multiply.outer(1 / times, remaining)) * weight @ rates_of_powers.T


@dataclass(frozen=True, eq=False)
class Measures:
    """Two measures of time within a time step, in which displacements and pressures change evenly.

    Attributes
    ----------
    main : Growth
        Measure for displacements.
    second : Growth or None
        Measure for pressures, and for a small fraction of displacements, because volumes respond to pressures
        immediately; None if pressures have no other measure.
    """

    main: Growth
    second: Growth | None

    def bump(self, time: float) -> tuple[float, float]:
        """Shape, over a time step, of the error of an interpolation that is cubic in the main measure of time, scaled
        to 1 where the main measure is 1/2.

        It is the residual of the second measure or, if there is none, of the fourth power of the main measure.

        Parameters
        ----------
        time : float
            Time since the start of the step, s.

        Returns
        -------
        value : float
            Value of the shape.
        rate : float
            Rate of the shape in 1/s.
        """
        if self._middle:
            value, rate = self._residual(time)
            return value / self._middle, rate / self._middle
        t, main_rate = float(self.main.at(time)), float(self.main.rate(time))
        return 16 * t**2 * (1 - t) ** 2, 32 * t * (1 - t) * (1 - 2 * t) * main_rate

    @cached_property
    def _middle(self) -> float:
        """Value of :meth:`_residual` where the main measure is 1/2. It is 0 if the residual is larger near an end of
        the step, or no larger than a rounding error.
        """
        if self.second is None or self.main.ends:
            return 0.0
        middle, *near_ends = (self._residual(self.main.time_at(fraction))[0] for fraction in (0.5, 0.1, 0.9))
        return middle if abs(middle) > max(LEAST_BUMP, *map(abs, near_ends)) else 0.0

    def _residual(self, time: float) -> tuple[float, float]:
        """The second measure less its cubic polynomial in the main measure, at a time in s, and its rate in 1/s."""
        assert self.second is not None
        main, second = self.main, self.second
        t, main_rate = float(main.at(time)), float(main.rate(time))
        first, last = (float(second.rate(end) / main.rate(end)) for end in (0.0, main.duration))
        cubic = t**2 * (3 - 2 * t) + t * (1 - t) * ((1 - t) * first - t * last)
        cubic_rate = 6 * t * (1 - t) + (1 - t) * (1 - 3 * t) * first + t * (3 * t - 2) * last
        return float(second.at(time)) - cubic, float(second.rate(time)) - main_rate * cubic_rate


OCTAVES = 110
"""Largest number of halvings of the intervals for numerical integration."""
_POINTS, _WEIGHTS = np.polynomial.legendre.leggauss(8)


def _nodes(duration: float, shortest: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Gauss quadrature over a time step: times since its start, times until its end, and weights, all in s.

    Intervals are halved towards both ends until they are much shorter than the ``shortest`` time constant in s.
    """
    count = min(max(math.ceil(math.log2(max(8 * duration / shortest, 1.0))), 1), OCTAVES)
    edges = duration * np.append(0.0, 0.5 ** np.arange(count, 0, -1))
    half = np.diff(edges)[:, None] / 2
    times, weight = (edges[:-1, None] + half + half * _POINTS).ravel(), (half * _WEIGHTS).ravel()
    return (
        np.concatenate([times, (duration - times)[::-1]]),
        np.concatenate([duration - times, times[::-1]]),
        np.concatenate([weight, weight[::-1]]),
    )
