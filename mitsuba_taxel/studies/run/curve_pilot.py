"""Pilot runs of random paths along a force: they estimate the noise of slopes, and whether the loads resolve the curve.

The readings of a pilot share their random numbers, as those of a study do. The random numbers differ from those of the
study.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np

from mitsuba_taxel.base.replicates import standard_error
from mitsuba_taxel.characterise.experiment import Branch
from mitsuba_taxel.characterise.fitted_curve import FEWEST, fitted_slopes
from mitsuba_taxel.characterise.slopes import slopes
from mitsuba_taxel.sensing.reading.paired import can_be_paired, paired_with, quieter
from mitsuba_taxel.sensing.reading.runs import FIRST_POINTS, MOST_POINTS, Prepared, Run, derived_seed, prepare
from mitsuba_taxel.sensing.scene.description import Scene

PILOT = 24
"""Index of the pilots' random numbers among those derived from a seed."""
LIGHT_PART = 0.8
"""Fraction of a target error of slopes for the light; the rest of the squares is for the finite elements."""
FIRST_PILOT = 4 * FIRST_POINTS
"""Points of the first pilot, per taxel and replicate."""
ENOUGH = 8
"""Largest factor from the points of a pilot to those that it recommends."""
MOST_LOADS = 5
"""Number of loads of a pilot, spread evenly over the loads of a curve."""


class CurvePilot:
    """A pilot run at some loads along one force, from which the noise of slopes is estimated.

    Parameters
    ----------
    at : Callable[[float], Scene]
        The scene under a force in N.
    seed : int
        Seed of the study.
    """

    change: float
    """Change in W along the forces of the last call, of the taxel that changes most."""
    power: float
    """Its reading at the first force, W."""
    points: int
    """Points of the last call, 0 before the first."""
    _base: Prepared | None

    def __init__(self, at: Callable[[float], Scene], seed: int) -> None:
        self.points, self._base = 0, None
        self._at, self._seed, self._runs = at, derived_seed(seed, PILOT), dict[float, Run]()

    def errors(self, forces: Sequence[float], points: int) -> tuple[float, float, bool]:
        """Relative errors of the mean and the largest slope of the readings, due to noise and due to the fitted curve.

        Parameters
        ----------
        forces : sequence of float
            Two or more loads in N.
        points : int
            Number of points per taxel and replicate, at least as many as in earlier calls.

        Returns
        -------
        noise, fit : float
            Larger error of the two slopes, relative to the slope of the steepest taxel: due to noise, and due to the
            fit. ``fit`` is 0 with fewer loads than a fit needs.
        is_bent : bool
            Whether more loads, rather than more points, are needed for the curve.
        """
        self.points = points
        for force in forces:
            if force not in self._runs:
                self._runs[force] = Run(self._prepared(force, forces), self._seed)
            self._runs[force].extend_to(points)
        loads, samples = np.array(forces), np.array([self._runs[force].powers for force in forces])
        change = samples[-1] - samples[0]
        mean = change / (loads[-1] - loads[0])
        most = int(np.abs(change.mean(axis=0)).argmax())
        self.change, self.power = (float(abs(power.mean(axis=0)[most])) for power in (change, samples[0]))
        noise, fit = _relative(standard_error(mean), mean.mean(axis=0)), 0.0
        is_bent = False
        if len(loads) >= FEWEST:
            largest = slopes(Branch(loads, samples, is_fitted=True))
            curve = fitted_slopes(loads, samples, largest.max_slope_at)
            noise = max(noise, _relative(np.diagonal(curve.noise), largest.max_slope))
            fit = _relative(np.diagonal(curve.fit_error), largest.max_slope)
            is_bent = fit > _relative(np.diagonal(curve.interpolation_noise), largest.max_slope)
        return noise, fit, is_bent

    def _prepared(self, force: float, forces: Sequence[float]) -> Prepared:
        """The scene under a force, with the base state of the study."""
        base = self._at(max(forces, key=abs))
        if self._base is None:
            self._base = prepare(base)
        if not can_be_paired(self._base):
            return prepare(self._at(force))
        return quieter(paired_with(base, self._base, self._at(force)))

    def points_for(self, forces: Sequence[float], target: float, least: int = FIRST_PILOT) -> int:
        """Number of points with which the noise of the light stays within its share of a target error of the slopes.

        Parameters
        ----------
        forces : sequence of float
            Loads in N of the study.
        target : float
            Relative error of the mean and the largest slope.
        least : int
            Points of the first pilot.

        Returns
        -------
        int
            Number of points per taxel and replicate: a power of two, at most `MOST_POINTS`.
        """
        chosen = np.unique(np.linspace(0, len(forces) - 1, MOST_LOADS).round().astype(int))
        points, forces = least, [forces[number] for number in chosen]
        while True:
            noise, fit, is_bent = self.errors(forces, points)
            # Noise falls at least with the root of the number of points, and the error of the fit with it, unless the
            # loads do not resolve the curve.
            error = noise if is_bent else math.hypot(noise, fit)
            factor = (error / (LIGHT_PART * target)) ** 2
            if factor <= ENOUGH or points >= MOST_POINTS:
                return min(points * _power_of_two(factor), MOST_POINTS)
            points = min(points * _power_of_two(factor / ENOUGH), MOST_POINTS)


def _relative(error: np.ndarray, slope: np.ndarray) -> float:
    steepest = np.abs(slope).max()
    return float(error.max() / steepest) if steepest > 0 else math.inf if error.any() else 0.0


def _power_of_two(factor: float) -> int:
    """Round a factor up to a power of two, from 1 to `MOST_POINTS`."""
    return 1 << math.ceil(math.log2(min(max(factor, 1.0), MOST_POINTS)))
