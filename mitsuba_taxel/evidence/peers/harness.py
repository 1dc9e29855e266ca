"""Repeated runs of one system on one case: accuracy, agreement with the truth, figure of merit."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass

import numpy as np
from scipy import stats

from mitsuba_taxel.evidence.peers import mitsuba_stock
from mitsuba_taxel.evidence.peers.cases import Estimator, PeerCase
from mitsuba_taxel.evidence.peers.plate_quadrature import plate_power
from mitsuba_taxel.evidence.rows.work_precision import Truth

FALSE_ALARM_RATE = 1e-4
"""Probability that a correct row is reported to disagree with the truth."""
_MOST_SAMPLES = 1 << 25
_TRUTH_SEEDS, _TRIAL_SEEDS = 1 << 20, 1 << 21  # apart from those of the runs


@dataclass(frozen=True)
class PeerResult:
    """Result of the runs of one system on one case.

    Attributes
    ----------
    error : float
        Relative standard error of one run, root mean square over taxels.
    bias : float
        Mean relative deviation of all runs and taxels from the truth.
    z : float
        The bias in standard errors, of runs and truth together.
    agrees : bool
        Whether ``z`` passes a t-test at :data:`FALSE_ALARM_RATE`.
    seconds : float
        Wall time of one run.
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
    """The number of samples, a power of two, with which a warm run takes about ``seconds``."""
    samples = 1 << 10
    while True:
        estimate(samples, _TRIAL_SEEDS)
        quickest = min(_timed(estimate, samples, _TRIAL_SEEDS + trial)[0] for trial in (1, 2, 3))
        if quickest > seconds / math.sqrt(2) or samples >= _MOST_SAMPLES:
            return samples
        samples *= 2 if quickest > seconds / 16 else 8


def repeat(estimate: Estimator, samples: int, runs: int, truth: Truth) -> PeerResult:
    """Run a warm estimator with ``runs`` seeds.

    The variance is taken about the truth if that is exact, so that an error common to all runs shows, else about the
    mean of the runs.
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


def truth_of(case: PeerCase, seconds: float) -> Truth:
    """Quadrature for the plate; for pads the pooled mean of Mitsuba's own `path`, traced for about ``seconds``.

    Under an isotropic roof, paths from the phototransistor have unbounded variance: `ptracer`, from the LED, is used.
    """
    if case.single_bounce:
        z, spacing = (float(case.parameters[name]) for name in ("z", "spacing"))
        power = plate_power(z, spacing, exponent=case.exponent)
        return Truth(np.array([power]), np.zeros(1), "quadrature")
    integrator = "ptracer" if case.isotropic else "path"
    estimate = mitsuba_stock.prepare(case, integrator, "multijitter")
    runs = 32
    samples = samples_for(estimate, seconds / runs)
    powers = np.array([estimate(samples, _TRUTH_SEEDS + run) for run in range(runs)])
    return Truth(powers.mean(axis=0), powers.std(axis=0, ddof=1) / math.sqrt(runs), integrator)


def _timed(estimate: Estimator, samples: int, seed: int) -> tuple[float, np.ndarray]:
    start = time.perf_counter()
    power = estimate(samples, seed)
    return time.perf_counter() - start, power
