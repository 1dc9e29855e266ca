"""Error of the light against computing time, for every integrator that supports a scene; an independent integrator
gives the reference."""

from __future__ import annotations

import gc
import math
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from mitsuba_taxel.base.errors import ComputationError, InputError
from mitsuba_taxel.base.replicates import standard_error
from mitsuba_taxel.evidence.accuracy.methods import (
    METHODS,
    Estimate,
    Estimator,
    Method,
    estimator,
    is_bounded,
    offset_share,
    stray_light,
)
from mitsuba_taxel.evidence.rows.work_precision import ErrorCurve, TruthEstimate, WorkPoint, now, relative_rms
from mitsuba_taxel.sensing.reading.runs import derived_seed
from mitsuba_taxel.sensing.scene.description import Scene

FEWEST_SEEDS, MOST_SEEDS = 4, 16
"""Smallest and largest number of runs with each number of samples; all runs have different seeds."""
LARGEST_SHARE = 1 / 8
"""Largest fraction of a method's time for the runs with one number of samples, beyond the smallest number of runs."""
FIRST_SAMPLES = 1 << 7
"""First number of samples: so few that the time of a run is that of its launch."""
REFERENCE_TIME = 4.0
"""Time of a reference, relative to that of a method, whose longest run takes at most an eighth of its time."""
UNBIASED = ("taxel_tracer", "taxel_path")
"""Preferred integrators for references: their weights are bounded, and they benefit from quasi-random points."""
SIGNIFICANT = 5.0
"""Smallest deviation that is reported, in standard errors."""


@dataclass(frozen=True)
class SampleRuns:
    """Runs of one method with one number of samples: powers (K, T) and stated errors (K, T) in W of T taxels in K runs,
    and the CPU seconds of one run."""

    samples: int
    power: np.ndarray
    stated: np.ndarray
    seconds: float


@dataclass(frozen=True)
class _Trial:
    """Runs of one method, or the reason why the method does not support the scene."""

    method: Method
    rungs: Sequence[SampleRuns]
    reason: str = ""

    @property
    def sees_all(self) -> bool:
        """Whether the method is unbiased and found light: the expected value of its estimates is then the power of the
        taxels.
        """
        return self.method.strategy == "all" and bool(self.rungs) and bool(self.rungs[-1].power.any())

    @property
    def scatter(self) -> float:
        """Relative standard deviation of a reading by this method after one second of CPU time, scaled from its longest
        runs."""
        last = self.rungs[-1]
        return relative_rms(last.power.std(axis=0, ddof=1), last.power.mean(axis=0)) * math.sqrt(last.seconds)


def optics_curves(
    scene: Scene, seconds: float, starting: Callable[[str], None]
) -> tuple[list[ErrorCurve], TruthEstimate]:
    """Measure the error of readings against CPU time for each method. Returns the curves, and the reference values for
    `taxel_tracer`.

    Parameters
    ----------
    scene : Scene
        The scene.
    seconds : float
        CPU time of each method; each of two references takes :data:`REFERENCE_TIME` times as long.
    starting : Callable[[str], None]
        Called with the name of each step.

    Raises
    ------
    ComputationError
        if no light is found, or if fewer than two independent integrators support the scene.
    """
    # Run all methods, and two references by methods of different families.
    stray = stray_light(scene)
    trials, references = [], {}
    with tempfile.TemporaryDirectory() as folder:
        for number, method in enumerate(METHODS, start=1):
            starting(f"optics {number}/{len(METHODS)}: {method.name}")
            trials.append(_trial(method, scene, Path(folder), stray, seconds))
        for trial in _referees(trials):
            starting(f"optics: reference by {trial.method.name}")
            estimate = estimator(trial.method, scene, Path(folder), stray)
            samples = trial.rungs[-1].samples
            truth = reference(trial.method.name, estimate, samples, REFERENCE_TIME * seconds)
            if not trial.method.is_ours:
                truth = replace(truth, error=np.hypot(truth.error, offset_share(scene) * truth.power))
            references[trial.method] = truth
    # Each method is compared with the reference of the other family.
    unbounded = not is_bounded(scene)
    curves = [_curve(trial, _independent_reference(references, trial.method), unbounded) for trial in trials]
    return curves, _independent_reference(references, METHODS[0])


def _trial(method: Method, scene: Scene, folder: Path, stray: float, seconds: float) -> _Trial:
    gc.collect()  # a live scene adds its plugins to the kernels of every other
    try:
        estimate = estimator(method, scene, folder, stray)
        return _Trial(method, list(rungs(estimate, seconds, method.most_samples)))
    except InputError as reason:
        return _Trial(method, [], str(reason))
    except RuntimeError as reason:
        return _Trial(method, [], str(reason).strip().splitlines()[-1])


def rungs(
    estimate: Estimator, seconds: float, most_samples: int, first_samples: int = FIRST_SAMPLES
) -> Iterator[SampleRuns]:
    """Run an estimator of readings with successively doubled numbers of samples. The time of compilation is excluded.

    Parameters
    ----------
    estimate : Estimator
        The estimator.
    seconds : float
        Approximate CPU time in total.
    most_samples : int
        Largest number of samples per taxel.
    first_samples : int
        Smallest number of samples per taxel.

    Yields
    ------
    SampleRuns
        Runs with one number of samples, and the median of their times.
    """
    estimate(FIRST_SAMPLES, 0)
    samples, total_seconds, run_seconds = FIRST_SAMPLES, 0.0, 0.0
    while samples <= most_samples and total_seconds + 2 * FEWEST_SEEDS * run_seconds <= seconds:
        runs: list[Estimate] = []
        times: list[float] = []
        while len(runs) < FEWEST_SEEDS or (len(runs) < MOST_SEEDS and sum(times) < LARGEST_SHARE * seconds):
            start = now()
            runs.append(estimate(samples, derived_seed(samples, len(runs))))
            times.append(now() - start)
        run_seconds = float(np.median(times))
        total_seconds += run_seconds * len(runs)
        yield SampleRuns(
            samples, np.array([run.power for run in runs]), np.array([run.stated for run in runs]), run_seconds
        )
        samples *= 2


def reference(name: str, estimate: Estimator, samples: int, seconds: float) -> TruthEstimate:
    """Compute reference values as the mean of long runs with different seeds.

    Parameters
    ----------
    name : str
        Description of the reference.
    estimate : Estimator
        The estimator.
    samples : int
        Samples per taxel of each run.
    seconds : float
        CPU time in s; at least :data:`FEWEST_SEEDS` runs are made in any case.
    """
    powers: list[np.ndarray] = []
    start = now()
    while len(powers) < FEWEST_SEEDS or now() - start < seconds:
        powers.append(estimate(samples, derived_seed(samples, MOST_SEEDS + len(powers))).power)
    return TruthEstimate(np.mean(powers, axis=0), standard_error(np.array(powers)), name)


def _referees(trials: Sequence[_Trial]) -> list[_Trial]:
    """Choose the two methods that give the reference values. They have different integrators: those in :data:`UNBIASED`
    if possible, else those with the least noise."""
    best: dict[str, _Trial] = {}
    for trial in sorted((trial for trial in trials if trial.sees_all), key=_preference):
        best.setdefault(trial.method.integrator, trial)
    if len(best) < 2:
        reasons = "; ".join(f"{trial.method.name}: {trial.reason or 'no light found'}" for trial in trials)
        raise ComputationError(
            f"fewer than two independent methods support the scene, so no method can be judged: {reasons}."
        )
    return list(best.values())[:2]


def _preference(trial: _Trial) -> tuple[bool, float]:
    return trial.method.integrator not in UNBIASED, trial.scatter


def _independent_reference(references: Mapping[Method, TruthEstimate], method: Method) -> TruthEstimate:
    return next(truth for candidate, truth in references.items() if candidate.integrator != method.integrator)


def _curve(trial: _Trial, truth: TruthEstimate, unbounded: bool) -> ErrorCurve:
    method = trial.method
    points = [rung_point(rung, truth) for rung in trial.rungs]
    remarks = [trial.reason] if trial.reason else []
    if unbounded and method.integrator == "path":
        remarks.append(
            "with isotropic walls, the weights of paths from the detector are unbounded: the error may fall slowly"
        )
    if trial.rungs and not trial.rungs[-1].power.any():
        return ErrorCurve("optics", method.name, [], remark="this method finds no light in this scene")
    bias, z = _bias(trial.rungs, truth) if trial.rungs else (0.0, 0.0)
    if abs(z) > SIGNIFICANT:
        remarks.append(f"deviates by {bias:+.1g} of the reference ({z:+.0f} standard errors)")
    return ErrorCurve("optics", method.name, points, launched=True, remark="; ".join(remarks))


def rung_point(rung: SampleRuns, truth: TruthEstimate) -> WorkPoint:
    """Compute the error of runs with one number of samples as a point of the diagram.

    Parameters
    ----------
    rung : SampleRuns
        The runs.
    truth : TruthEstimate
        Reference values.
    """
    return WorkPoint(
        setting=f"{rung.samples} samples",
        seconds=rung.seconds,
        error=relative_rms(rung.power - truth.power, truth.power),
        stated=relative_rms(rung.stated, truth.power),
        floor=truth.floor,
        reference=truth.name,
        runs=len(rung.power),
        readings=len(rung.power) * int((truth.power > 0).sum()),
    )


def _bias(rungs: Sequence[SampleRuns], truth: TruthEstimate) -> tuple[float, float]:
    """Bias of a method: mean relative deviation of all its runs from the reference, weighted by the number of samples.
    Also returns the deviation in standard errors."""
    lit = truth.power > 0
    runs = np.concatenate([(rung.power[:, lit] / truth.power[lit] - 1).mean(axis=1) for rung in rungs])
    weight = np.concatenate([np.full(len(rung.power), float(rung.samples)) for rung in rungs])
    mean = np.average(runs, weights=weight)
    scatter = math.sqrt(np.sum((weight * (runs - mean)) ** 2)) / weight.sum()
    reference_error = float(np.linalg.norm(truth.error[lit] / truth.power[lit])) / lit.sum()
    error = math.hypot(scatter, reference_error)
    return float(mean), float(mean / error) if error else 0.0
