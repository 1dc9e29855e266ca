"""A history-dependent pad at a time, and between two such times."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from mitsuba_taxel.mechanics.elements.past import Relaxing


@dataclass(frozen=True, eq=False)
class Reached:
    """The pad at a ``time`` in s; arrays are those of the whole pad, except for the internal variables of a part.

    ``rate`` is that of the load, per s, on the way there; ``velocity`` that of the unknowns, displacements followed by
    pressures; both are NaN after a jump of the load. ``midway`` is what Newton's method would subtract from the
    unknowns in the middle of the last step, on a cubic between its ends; empty if that step leads to a row. ``further``
    is the length in s of the next step, as far as errors allow, or 0 where it must not lead beyond a row. ``missed`` is
    the relative error of the stress by time steps. ``traction`` (2 N, 3) in MPa is that of friction at nodes of the
    top, then of the outside; ``moved`` (C,) is the load, or where its force has moved an indenter.
    """

    time: float
    displacement: np.ndarray
    pressure: np.ndarray
    rate: np.ndarray
    velocity: np.ndarray
    midway: np.ndarray
    stress: np.ndarray
    held: np.ndarray
    error: np.ndarray
    slope: np.ndarray
    step: float
    further: float
    scale: float
    unjudged: float
    deviation: np.ndarray
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
        return Relaxing(self.stress, self.held, self.error, self.slope if self.slope.size else None, self.step)

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


class Passed(NamedTuple):
    """The shape of the pad on the way between two times: displacement (N, 3), pressure, rate of both as in `Reached`,
    and estimated error (N, 3) of the displacement by time steps and interpolation."""

    displacement: np.ndarray
    pressure: np.ndarray
    velocity: np.ndarray
    deviation: np.ndarray


def passed(start: Reached, end: Reached, time: float) -> Passed:
    """The shape within the step from ``start`` to ``end``.

    It is the quartic polynomial with the values and rates at both ends and, midway, the value after one step of
    Newton's method. The difference to a cubic is stated as its error.
    """
    if time == end.time:
        return Passed(end.displacement, end.pressure, end.velocity, end.deviation)
    length = end.time - start.time
    t = (time - start.time) / length
    bump, bump_rate = 16 * t**2 * (1 - t) ** 2, 32 * t * (1 - t) * (1 - 2 * t) / length
    change = end.unknowns - start.unknowns
    unknowns = start.unknowns + cubic(t, length, change, start.velocity, end.velocity) - bump * end.midway
    velocity = (
        6 * t * (1 - t) / length * change
        + (1 - t) * (1 - 3 * t) * start.velocity
        + t * (3 * t - 2) * end.velocity
        - bump_rate * end.midway
    )
    moved, pressed = np.split(unknowns, [end.displacement.size])
    off = bump * end.midway[: end.displacement.size].reshape(-1, 3)
    deviation = (1 - t) * start.deviation + t * end.deviation + off
    return Passed(moved.reshape(-1, 3), pressed, velocity, deviation)


def cubic(t: float, length: float, change: np.ndarray, first: np.ndarray, last: np.ndarray) -> np.ndarray:
    """Part of a ``change`` within a step of some ``length`` at a fraction ``t``, with the rates at both ends."""
    return t**2 * (3 - 2 * t) * change + length * t * (1 - t) * ((1 - t) * first - t * last)
