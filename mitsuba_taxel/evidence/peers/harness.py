"""Repeated runs of one program on one case: standard error, agreement with the reference value, and figure of merit."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass

import numpy as np
from scipy import stats

from mitsuba_taxel.evidence.peers import mitsuba_stock
from mitsuba_taxel.evidence.peers.cases import Estimator, PeerCase
from mitsuba_taxel.evidence.peers.plate_quadrature import plate_power
from mitsuba_taxel.evidence.rows.work_precision import TruthEstimate

FALSE_ALARM_RATE = 1e-4
"""Probability that a right result is reported to disagree with the reference value."""
_MOST_SAMPLES = 1 << 25
_TRUTH_SEEDS, _TRIAL_SEEDS = 1 << 20, 1 << 21  # different from the seeds of the runs


@dataclass(frozen=True)
class PeerResult:
    """Result of the runs of one program on one case.

    Attributes
    ----------
    error : float
        Relative standard error of one run, root mean square over taxels.
    bias : float
        Mean relative deviation, over all runs and taxels, from the reference values.
    z : float
        The bias divided by the combined standard error of runs and reference values.
    agrees : bool
        Whether ``z`` passes a t-test at :data:`FALSE_ALARM_RATE`.
    seconds : float
        Wall time of one run, in s.
    """

    error: float
    bias: float
    z: float
    agrees: bool
    seconds: float

    @property
    def figure_of_merit(self) -> float:
        """1 / (relative variance x seconds), in 1/s."""
        return 1 / (self.error**2 * self.seconds)


def samples_for(estimate: Estimator, seconds: float) -> int:
    """Choose the number of samples of a run, so that it takes a given time.

    Parameters
    ----------
    estimate : Estimator
        The estimator.
    seconds : float
        Approximate wall time of a run after warm-up.

    Returns
    -------
    int
        Samples per taxel, a power of two.
    """
    samples = 1 << 10
    while True:
        estimate(samples, _TRIAL_SEEDS)
        quickest = min(_timed(estimate, samples, _TRIAL_SEEDS + trial)[0] for trial in (1, 2, 3))
        if quickest > seconds / math.sqrt(2) or samples >= _MOST_SAMPLES:
            return samples
        samples *= 2 if quickest > seconds / 16 else 8


def repeat(estimate: Estimator, samples: int, runs: int, truth: TruthEstimate) -> PeerResult:
    """Run an estimator of readings with several seeds, and compare it with the reference values.

    If the reference values are exact, the variance is computed about them, so that it includes an error common to all
    runs; else about the mean of the runs.

    Parameters
    ----------
    estimate : Estimator
        The estimator, after warm-up.
    samples : int
        Samples per taxel.
    runs : int
        Number of seeds.
    truth : TruthEstimate
        Reference values.
    """
    timed = [_timed(estimate, samples, seed) for seed in range(runs)]
    deviation = np.array([power for _, power in timed]) / truth.power - 1
    exact = not truth.error.any()
    variance = np.mean(deviation**2) if exact else np.mean(deviation.var(axis=0, ddof=1))
    means = deviation.mean(axis=1)
    z = means.mean() / math.hypot(means.std(ddof=1) / math.sqrt(runs), truth.floor / math.sqrt(len(truth.power)))
    agrees = abs(z) < stats.t.isf(FALSE_ALARM_RATE / 2, runs - 1)
    seconds = sum(elapsed for elapsed, _ in timed) / runs
    return PeerResult(math.sqrt(variance), float(means.mean()), float(z), bool(agrees), seconds)


def truth_of(case: PeerCase, seconds: float) -> TruthEstimate:
    """Compute the reference values of a case: for the plate by quadrature, for pads as the mean of many runs of
    Mitsuba's own integrator `path`.

    Under an isotropic roof, paths from the phototransistor have unbounded variance, and `ptracer` is used, whose paths
    start at the LED.

    Parameters
    ----------
    case : PeerCase
        The case.
    seconds : float
        Approximate wall time in total.
    """
    if case.single_bounce:
        z, spacing = (float(case.parameters[name]) for name in ("z", "spacing"))
        power = plate_power(z, spacing, exponent=case.exponent)
        return TruthEstimate(np.array([power]), np.zeros(1), "quadrature")
    integrator = "ptracer" if case.isotropic else "path"
    estimate = mitsuba_stock.prepare(case, integrator, "multijitter")
    runs = 32
    samples = samples_for(estimate, seconds / runs)
    powers = np.array([estimate(samples, _TRUTH_SEEDS + run) for run in range(runs)])
    return TruthEstimate(powers.mean(axis=0), powers.std(axis=0, ddof=1) / math.sqrt(runs), integrator)


def _timed(estimate: Estimator, samples: int, seed: int) -> tuple[float, np.ndarray]:
    start = time.perf_counter()
    power = estimate(samples, seed)
    return time.perf_counter() - start, power
