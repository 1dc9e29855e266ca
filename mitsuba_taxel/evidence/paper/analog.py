"""The paper's own procedure: 60 000 rays counted at each force, and the maximum slope of the curves."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np
import xarray as xr
from scipy.stats import chi2

from mitsuba_taxel.evidence.paper import paper
from mitsuba_taxel.evidence.paper.paper_studies import PaperStudies
from mitsuba_taxel.evidence.paper.scenes import CENTRE, write_scene
from mitsuba_taxel.evidence.paper.slopes import curves
from mitsuba_taxel.sensing import Scene, measure
from mitsuba_taxel.sensing.reading.runs import prepare
from mitsuba_taxel.studies.plan.files import make_folder

RUNS = 3
"""Number of runs, of 32 repetitions each."""
RAYS = 1 << 16
"""Rays of each repetition: the power of two next to the paper's 60 000."""
REPETITIONS = 2_000
"""Repetitions of the emulation by binomial counts."""


def counted(store: PaperStudies, cell: str) -> xr.Dataset:
    """Power (fz, replicate) of the centre taxel by counted rays over the paper's normal forces.

    Each replicate is one repetition of the paper's procedure. Every force has independent random numbers, like new
    rays.
    """
    scene = store.folder / "analog" / "centre.xml"
    forces = np.arange(0, paper.NORMAL_FORCE + paper.FORCE_STEP / 2, paper.FORCE_STEP)

    def compute() -> xr.Dataset:
        make_folder(scene.parent)
        write_scene(scene, (CENTRE,))
        rows = [_repetitions(scene, {"cell": cell, "fz": -force}, number) for number, force in enumerate(forces)]
        return xr.Dataset({"power": (["fz", "replicate"], np.array(rows), {"units": "W"})}, {"fz": -forces})

    return store.study(f"analog/{cell}", {"fz": (-forces).tolist(), "rays": RAYS, "runs": RUNS}, compute)


def _repetitions(scene: Path, defines: dict[str, object], number: int) -> np.ndarray:
    """Readings (32 x RUNS,) of one scene; ``number`` selects its random numbers."""
    prepared = prepare(Scene(scene, {**defines, "integrator": "analog_tracer"}))
    seeds = range(number * RUNS, (number + 1) * RUNS)
    return np.concatenate([measure(prepared, points=RAYS, seed=seed).replicates[:, 0] for seed in seeds])


class EmulatedSlope(NamedTuple):
    """Result of the procedure: mean and standard deviation of its maximum slope over repetitions, in W/N.

    Attributes
    ----------
    error : float
        Standard error of the mean.
    """

    mean: float
    spread: float
    error: float
    repetitions: int


def max_slopes(force: np.ndarray, power: np.ndarray) -> np.ndarray:
    """The maximum slope in magnitude (repetitions,), W/N, of each repetition.

    Parameters
    ----------
    force : (F,) ndarray
        Forces in N.
    power : (F, repetitions) ndarray
        Power in W. With shape (F, repetitions, taxels), the result is the largest slope of all taxels.
    """
    steps = np.abs(np.diff(power.reshape(*power.shape[:2], -1), axis=0))
    return (steps / np.abs(np.diff(force))[:, None, None]).max(axis=(0, 2))


def summary(slopes: np.ndarray) -> EmulatedSlope:
    """Mean and spread of the maximum slopes (repetitions,) of the procedure."""
    spread = float(slopes.std(ddof=1))
    return EmulatedSlope(float(slopes.mean()), spread, spread / np.sqrt(len(slopes)), len(slopes))


def binomial(power: np.ndarray, rays: int, repetitions: int, seed: int = 0) -> np.ndarray:
    """Readings (F, repetitions, taxels) as counts of ``rays`` rays, of which fractions ``power`` (F, taxels) reach the
    taxels."""
    random = np.random.default_rng(seed)
    shape = (len(power), repetitions, power.shape[1])
    return random.binomial(rays, np.clip(power, 0, 1)[:, None, :], shape) / rays


class CountingTest(NamedTuple):
    """Test whether readings scatter like counts: their variances over p (1 - p) / n, and the p-value of the mean.

    Attributes
    ----------
    ratio : float
        Mean over the readings of variance / (p (1 - p) / n).
    p : float
        Two-sided p-value of a chi-square distribution.
    """

    ratio: float
    p: float


def counting_test(samples: np.ndarray, rays: int) -> CountingTest:
    """Compare the scatter of counted readings with that of binomial counts.

    Parameters
    ----------
    samples : (readings, repetitions) ndarray
        Independent readings in W of an LED of 1 W.
    rays : int
        Number of rays of each reading.
    """
    p = samples.mean(axis=1)
    ratios = samples.var(axis=1, ddof=1) / (p * (1 - p) / rays)
    freedom = samples.size - len(samples)
    tail = chi2.cdf(ratios.sum() * (samples.shape[1] - 1), freedom)
    return CountingTest(float(ratios.mean()), float(2 * min(tail, 1 - tail)))


def emulated(study: xr.Dataset, force: str) -> EmulatedSlope:
    """Results of the paper's procedure, with 60 000 rays for each reading, applied to the curves of all taxels of a
    study.
    """
    curve = curves(study, force)
    forces = np.arange(curve.force[0], curve.force[-1] + paper.FORCE_STEP / 2, paper.FORCE_STEP)
    return summary(max_slopes(forces, binomial(curve.power(forces), paper.RAYS, REPETITIONS)))
