"""Work-precision diagrams: error against computing time, and the slope of the error."""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

now = time.process_time
"""Function that returns the CPU seconds of the process, summed over threads; they depend little on other load of the
machine."""
WARM = 2.5
"""Runs that take longer than this multiple of the shortest run are not dominated by their launch."""
ABOVE_FLOOR = 1.5
"""Errors above this multiple of the reference's error are significant."""

FEWEST_POINTS = 3
"""Minimum number of points for a slope; the scatter of two points is unknown."""
LEAST_SPAN = 2.0
"""Minimum ratio between the seconds of the last and of the first point of a curve, for a slope."""


@dataclass(frozen=True)
class WorkPoint:
    """A point of a work-precision diagram: error and computing time of one method with one setting.

    Attributes
    ----------
    setting : str
        Value of the varied quantity, in words.
    seconds : float
        CPU time of one run, in s.
    error : float
        Relative error against the reference, root mean square over taxels and runs.
    stated : float
        Relative error that the method states; NaN if it states none.
    floor : float
        Relative error of the reference value; smaller errors are not significant.
    reference : str
        Description of the reference value.
    runs : int
        Number of runs with different seeds.
    readings : int
        Number of values over which the root mean square `error` is taken.
    shares : dict[str, float]
        Further columns by heading, such as parts of the error and seconds of each stage.
    remark : str
        Note for the reader.
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
        """The error to plot: the larger of `error` and the error of the reference, as smaller errors are not
        significant."""
        return max(self.error, self.floor)


@dataclass(frozen=True)
class ErrorCurve:
    """Error against computing time of one method: its points, in the order of increasing work.

    Attributes
    ----------
    part : str
        ``optics``, ``mechanics`` or ``chain``.
    launched : bool
        Whether each run has a launch overhead: a fixed time, independent of the setting.
    remark : str
        Note for the reader, or the reason why there are no points.
    """

    part: str
    method: str
    points: Sequence[WorkPoint]
    launched: bool = False
    remark: str = ""


class Slope(NamedTuple):
    """Slope d log(error) / d log(seconds) of a curve, with its standard error; NaN if there are too few points or they
    are too close."""

    value: float
    standard_error: float


def slope(curve: ErrorCurve) -> Slope:
    """Fit the slope of a method's error against its computing time on logarithmic axes, by weighted least squares.

    For methods with a launch overhead, the time of the shortest run, which is mostly overhead, is subtracted from all
    times, and only points of more than :data:`WARM` times this time are used. Points whose error is not well above that
    of the reference are left out. Each point is weighted by its number of readings, which determines the uncertainty of
    a root mean square. The standard error follows from these weights, and is larger if the points scatter more.
    """
    # Points after warm-up with significant errors.
    launch = min((point.seconds for point in curve.points), default=0.0) if curve.launched else 0.0
    points = [point for point in curve.points if point.error > ABOVE_FLOOR * point.floor]
    points = [point for point in points if point.seconds > WARM * launch]
    if len(points) < FEWEST_POINTS or points[-1].seconds < LEAST_SPAN * points[0].seconds:
        return Slope(math.nan, math.nan)
    # Weighted linear regression of the logarithms.
    x = np.log([point.seconds - launch for point in points])
    y = np.log([point.error for point in points])
    weight = np.array([2.0 * point.readings for point in points])  # 1 / variance of the logarithm of a root mean square
    x = x - np.average(x, weights=weight)
    spread = weight @ x**2
    value = weight @ (x * y) / spread
    residual = y - np.average(y, weights=weight) - value * x
    scatter = math.sqrt(weight @ residual**2 / (len(points) - 2))
    return Slope(float(value), float(max(scatter, 1.0) / math.sqrt(spread)))


@dataclass(frozen=True)
class TruthEstimate:
    """Reference values of the readings of T taxels.

    Attributes
    ----------
    power, error : (T,) ndarray
        Power of each taxel and its standard error, in W.
    name : str
        Description of how the reference was computed.
    """

    power: np.ndarray
    error: np.ndarray
    name: str

    @property
    def floor(self) -> float:
        """Relative error of the reference values, below which an error of a method is not significant: root mean square
        over the taxels.
        """
        return relative_rms(self.error, self.power)


def relative_rms(error: np.ndarray, power: np.ndarray) -> float:
    """Root mean square of the relative errors of readings, over the taxels that receive light.

    Parameters
    ----------
    error : (..., T) ndarray
        Errors in W of each of T taxels, possibly of several runs.
    power : (T,) ndarray
        Power of each taxel in W.
    """
    lit = power > 0
    return float(np.sqrt(np.mean((error[..., lit] / power[lit]) ** 2))) if lit.any() else math.nan
