"""How a viscoelastic silicone creeps and relaxes: measures of time in which the states of a pad change most evenly.

If a load F(t) is a force, it strains an incompressible linear solid with the relaxation function G of a Prony series as
much as the load ::

    a(t) = int J(t - s) dF(s),    J(t) = 1 / (1 - sum of g_i) - sum of c_m exp(-l_m t)

strains an elastic one at once, with the creep function J (J. D. Ferry, Viscoelastic Properties of Polymers, 1980,
chapter 3), while pressures follow F itself. If it is a displacement, strains follow F, and pressures the integral of
G(t - s) dF(s). The states of a real pad are nearly such ones: they are smooth functions of these integrals through
transients of the series and turns of the load, while in time they are sums of exponentials.
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
"""Rate at the start of a step, relative to the mean one, below which creep is no measure of time in it."""
LEAST_END = 1e-6
"""The same at the end of a step, below which rates by the measure are not resolved there."""
LEAST_BUMP = 1e-9
"""Deviation from a cubic polynomial that is one of rounding."""


@dataclass(frozen=True, eq=False)
class CreepResponse:
    """The response to a load that jumps to 1: ``lasting`` plus the sum of ``amounts`` exp(-``rates`` t), rates in 1/s.

    Attributes
    ----------
    creeps : bool
        Whether displacements respond so, to a force; else pressures do, to a displacement.
    """

    lasting: float
    rates: np.ndarray
    amounts: np.ndarray
    creeps: bool

    @classmethod
    @kept(16)
    def of(cls, prony: Terms, creeps: bool) -> CreepResponse:
        """Of a Prony series: its relaxation function, or its creep function by the zeros of that in Laplace space."""
        times = np.unique([time for _, time in prony])[::-1]
        shares = np.array([sum(share for share, of in prony if of == time) for time in times])
        left = 1 - float(shares.sum())
        if not (creeps and prony):
            return cls(left, 1 / times, shares, creeps)
        low, high = np.concatenate([[left / times[0]], 1 / times[:-1]]), 1 / times
        with np.errstate(divide="ignore"):
            for _ in range(BISECTIONS):
                rates = np.sqrt(low) * np.sqrt(high)
                above = (shares / (1 - rates[:, None] * times)).sum(axis=1) < 1
                low, high = np.where(above, rates, low), np.where(above, high, rates)
            amounts = 1 / (rates * (shares * times / (1 - rates[:, None] * times) ** 2).sum(axis=1))
        return cls(1 / left, rates, -amounts, creeps)

    def at_rest(self, components: int) -> np.ndarray:
        """(k, C) memory of a load that was always 0: for each rate l, the integral of exp(-l (t - s)) dF(s)."""
        return np.zeros((len(self.rates), components))

    def after(self, memory: np.ndarray, change: np.ndarray, duration: float) -> np.ndarray:
        """The memory after a linear ``change`` (C,) of the load, or a jump if that takes no time."""
        x = (self.rates * duration)[:, None]
        return np.exp(-x) * memory + np.where(x > 0, -np.expm1(-x) / np.where(x > 0, x, 1), 1.0) * change

    def measures(self, memory: np.ndarray, rate: np.ndarray, duration: float) -> Measures:
        """Of a step with a ``rate`` of the load per s."""
        responding, even, moves = self._growth(memory, rate, duration), Growth.even(duration), bool(rate.any())
        if moves and not self.creeps:
            return Measures(even, responding)
        times = _nodes(duration, 1 / float(self.rates.max()))[0]
        if responding is None or responding.rate(0.0) * duration < LEAST_START or np.any(responding.rate(times) < 0):
            responding = even
        return Measures(responding, even if moves else None)

    def _growth(self, memory: np.ndarray, rate: np.ndarray, duration: float) -> Growth | None:
        """The response of a step, along its change; None without one."""
        parts = self.amounts[:, None] * (rate - self.rates[:, None] * memory)
        steady = self.lasting * rate
        whole = steady * duration - (np.expm1(-self.rates * duration) / self.rates) @ parts
        size = float(np.linalg.norm(whole))
        if not size > np.finfo(float).tiny:
            return None
        along = whole / size
        return Growth(duration, float(steady @ along) / size, parts @ along / size, self.rates)


@dataclass(frozen=True, eq=False)
class Growth:
    """What grows from 0 to 1 within a step of some ``duration`` in s, at a rate of ``steady`` plus the sum of ``parts``
    exp(-``rates`` t) per s."""

    duration: float
    steady: float
    parts: np.ndarray
    rates: np.ndarray

    @classmethod
    def even(cls, duration: float) -> Growth:
        """Time itself."""
        return cls(duration, 1 / duration, np.zeros(0), np.zeros(0))

    def rate(self, time: float | np.ndarray) -> np.ndarray:
        """Per s, at times in s since the start of the step."""
        return self.steady + np.exp(-np.multiply.outer(time, self.rates)) @ self.parts

    def at(self, time: float | np.ndarray) -> np.ndarray:
        """The share at times in s since the start of the step."""
        grown = -np.expm1(-np.multiply.outer(time, self.rates)) @ (self.parts / self.rates)
        return np.multiply(time, self.steady) + grown

    @property
    def ends(self) -> bool:
        """Whether rates at the end of the step are too small to be told from none."""
        return bool(self.rate(self.duration) * self.duration < LEAST_END)

    def time_at(self, share: float) -> float:
        """Time in s at which a growing growth has a value between 0 and 1."""
        low, high = 0.0, self.duration
        while low < (time := 0.5 * (low + high)) < high:
            low, high = (time, high) if self.at(time) < share else (low, time)
        return time

    def until(self, time: float) -> Growth:
        """The same of the first part of the step, until a ``time`` in s."""
        share = float(self.at(time))
        return Growth(time, self.steady / share, self.parts / share, self.rates)

    def moments(self, times: np.ndarray) -> np.ndarray:
        """(k, 3) what is left at the end of the step of gains of the growth, its square and its cube, with relaxation
        times (k,): integrals of exp(-(time to the end) / tau) over each."""
        first = np.append(times, 1 / self.rates).min()
        time, left, weight = _nodes(self.duration, float(first))
        share, rate = self.at(time), self.rate(time)
        gains = np.stack([rate, 2 * share * rate, 3 * share**2 * rate])
        with np.errstate(under="ignore", over="ignore"):
            return np.exp(-np.multiply.outer(1 / times, left)) * weight @ gains.T


@dataclass(frozen=True, eq=False)
class Measures:
    """Two measures of time within a step.

    Attributes
    ----------
    main : Growth
        Of displacements.
    other : Growth or None
        Of pressures, and of a small share of displacements, as volumes respond to pressures at once; None if these do
        not change by a measure of their own.
    """

    main: Growth
    other: Growth | None

    def bump(self, time: float) -> tuple[float, float]:
        """Shape of what a cubic polynomial in the main measure leaves, 1 midway, at a time in s since the start; its
        rate per s.

        It is that of the other measure less its cubic or, if there is none, of the fourth power.
        """
        if self._half:
            value, rate = self._of_other(time)
            return value / self._half, rate / self._half
        t, pace = float(self.main.at(time)), float(self.main.rate(time))
        return 16 * t**2 * (1 - t) ** 2, 32 * t * (1 - t) * (1 - 2 * t) * pace

    @cached_property
    def _half(self) -> float:
        """What :meth:`_of_other` leaves midway, where that is most; else 0."""
        if self.other is None or self.main.ends:
            return 0.0
        half, *others = (self._of_other(self.main.time_at(share))[0] for share in (0.5, 0.1, 0.9))
        return half if abs(half) > max(LEAST_BUMP, *map(abs, others)) else 0.0

    def _of_other(self, time: float) -> tuple[float, float]:
        """What a cubic polynomial in the main measure leaves of the other one, and its rate per s."""
        assert self.other is not None
        main, other = self.main, self.other
        t, pace = float(main.at(time)), float(main.rate(time))
        first, last = (float(other.rate(end) / main.rate(end)) for end in (0.0, main.duration))
        value = t**2 * (3 - 2 * t) + t * (1 - t) * ((1 - t) * first - t * last)
        rate = 6 * t * (1 - t) + (1 - t) * (1 - 3 * t) * first + t * (3 * t - 2) * last
        return float(other.at(time)) - value, float(other.rate(time)) - pace * rate


OCTAVES = 110
"""Most halvings of the parts of a step for numerical integration."""
_POINTS, _WEIGHTS = np.polynomial.legendre.leggauss(8)


def _nodes(duration: float, shortest: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Times since the start of a step, until its end, and weights of Gauss's rule on parts that halve towards both ends
    until they are much shorter than the ``shortest`` time in s of exponentials there."""
    count = min(max(math.ceil(math.log2(max(8 * duration / shortest, 1.0))), 1), OCTAVES)
    edges = duration * np.append(0.0, 0.5 ** np.arange(count, 0, -1))
    half = np.diff(edges)[:, None] / 2
    near, weight = (edges[:-1, None] + half + half * _POINTS).ravel(), (half * _WEIGHTS).ravel()
    return (
        np.concatenate([near, (duration - near)[::-1]]),
        np.concatenate([duration - near, near[::-1]]),
        np.concatenate([weight, weight[::-1]]),
    )
