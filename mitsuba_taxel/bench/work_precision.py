"""Error against time: the points of a work-precision diagram, and how steeply the error falls."""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

now = time.process_time
"""Seconds of all processors together, so that what else a machine does meanwhile matters little."""
WARM = 2.5
"""Times the seconds of the shortest run, from which a run is about its work and no longer about being launched."""
ABOVE_FLOOR = 1.5
"""Times the reference's own error, above which an error is that of the method."""

FEWEST_POINTS = 3
"""From which a slope can be told: how much two scatter is not seen."""
LEAST_SPAN = 2.0
"""Times the seconds of its first point that the last of a curve must have taken, for a slope to be told."""


@dataclass(frozen=True)
class Point:
    """What one method gave with one setting.

    Attributes
    ----------
    setting : str
        What was varied, in words.
    seconds : float
        Of one run.
    error : float
        Relative, against the reference; root mean square over taxels and runs.
    stated : float
        Relative error that the method itself states; not a number where it states none.
    floor : float
        Relative error of the reference: nothing is claimed below it.
    reference : str
        What the error was taken against.
    runs : int
        With seeds of their own.
    readings : int
        Numbers that `error` is the root mean square of.
    shares : dict[str, float]
        Further columns by name: parts of the errors, seconds by stage.
    remark : str
        What the reader must know besides.
    """

    setting: str
    seconds: float
    error: float
    stated: float
    floor: float
    reference: str
    runs: int
    readings: int
    shares: dict[str, float] = field(default_factory=dict)
    remark: str = ""

    @property
    def shown(self) -> float:
        """The error that can be claimed."""
        return max(self.error, self.floor)


@dataclass(frozen=True)
class Curve:
    """One method's points in order of their work.

    Attributes
    ----------
    part : str
        ``optics``, ``mechanics`` or ``chain``.
    launched : bool
        Whether a run has a launch that costs time before any work is done.
    remark : str
        What the reader must know besides, or why there are no points.
    """

    part: str
    method: str
    points: Sequence[Point]
    launched: bool = False
    remark: str = ""


class Slope(NamedTuple):
    """d log(error) / d log(seconds) with one standard error; not numbers where the points are too few or too close."""

    value: float
    standard_error: float


def slope(curve: Curve) -> Slope:
    """How steeply a method's error falls with its seconds, by least squares over the points after warm-up.

    Of a method that is launched the seconds of its shortest run, which did next to nothing, are taken off, and points
    count from :data:`WARM` times these. Points not well above the reference's error do not count. Each point weighs as
    much as the root mean square of so many readings is known; the standard error is that of these weights, or
    larger where the points scatter more.
    """
    launch = min((point.seconds for point in curve.points), default=0.0) if curve.launched else 0.0
    used = [point for point in curve.points if point.error > ABOVE_FLOOR * point.floor]
    used = [point for point in used if point.seconds > WARM * launch]
    if len(used) < FEWEST_POINTS or used[-1].seconds < LEAST_SPAN * used[0].seconds:
        return Slope(math.nan, math.nan)
    x = np.log([point.seconds - launch for point in used])
    y = np.log([point.error for point in used])
    weight = np.array([2.0 * point.readings for point in used])  # 1 / variance of the logarithm of a mean square's root
    x = x - np.average(x, weights=weight)
    spread = weight @ x**2
    value = weight @ (x * y) / spread
    left = y - np.average(y, weights=weight) - value * x
    scatter = math.sqrt(weight @ left**2 / (len(used) - 2))
    return Slope(float(value), float(max(scatter, 1.0) / math.sqrt(spread)))


@dataclass(frozen=True)
class Truth:
    """(T,) power in W that estimates are judged by, its own standard error, and where it comes from."""

    power: np.ndarray
    error: np.ndarray
    name: str

    @property
    def floor(self) -> float:
        """Its relative error, root mean square over taxels: no smaller error can be claimed."""
        return relative_rms(self.error, self.power)


def relative_rms(error: np.ndarray, power: np.ndarray) -> float:
    """Root mean square of errors (..., T) relative to a power (T,), over the taxels that receive light."""
    lit = power > 0
    return float(np.sqrt(np.mean((error[..., lit] / power[lit]) ** 2))) if lit.any() else math.nan
