"""The procedure of the paper: 60 000 rays are counted at each force, and the maximum slope of the curve is reported."""

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
    """Power of the centre taxel by counted rays, over the dimensions ``fz`` (the paper's normal forces) and
    ``replicate``.

    Each replicate is a repetition of the paper's procedure. Every force has independent random numbers.
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
    """Readings (32 x RUNS,) of one scene in W, from independent repetitions; ``number`` selects the random numbers."""
    prepared = prepare(Scene(scene, {**defines, "integrator": "analog_tracer"}))
    seeds = range(number * RUNS, (number + 1) * RUNS)
    return np.concatenate([measure(prepared, points=RAYS, seed=seed).replicates[:, 0] for seed in seeds])


class EmulatedSlope(NamedTuple):
    """Maximum slope of a reading as the paper's procedure gives it: mean and standard deviation over repetitions, in
    W/N.

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
    """Largest magnitude of the slope in each repetition, W/N, as an array (repetitions,). Slopes are differences
    between successive forces.

    Parameters
    ----------
    force : (F,) ndarray
        F forces in N.
    power : (F, repetitions) ndarray
        Power in W. With the shape (F, repetitions, taxels), the result is the largest slope of all taxels.
    """
    steps = np.abs(np.diff(power.reshape(*power.shape[:2], -1), axis=0))
    return (steps / np.abs(np.diff(force))[:, None, None]).max(axis=(0, 2))


def summary(slopes: np.ndarray) -> EmulatedSlope:
    """Mean and standard deviation of the maximum slopes (repetitions,)."""
    spread = float(slopes.std(ddof=1))
    return EmulatedSlope(float(slopes.mean()), spread, spread / np.sqrt(len(slopes)), len(slopes))


def binomial(power: np.ndarray, rays: int, repetitions: int, seed: int = 0) -> np.ndarray:
    """Draw readings (F, repetitions, taxels) as counts of ``rays`` rays; each ray reaches a taxel with the probability
    ``power`` (F, taxels), at each of F forces."""
    random = np.random.default_rng(seed)
    shape = (len(power), repetitions, power.shape[1])
    return random.binomial(rays, np.clip(power, 0, 1)[:, None, :], shape) / rays


class CountingTest(NamedTuple):
    """Test whether readings scatter as counts of rays do: with the variance p (1 - p) / n for a reading p by n rays.

    Attributes
    ----------
    ratio : float
        Observed variance divided by p (1 - p) / n, averaged over the readings.
    p : float
        Two-sided p-value of this ratio, from a chi-square distribution.
    """

    ratio: float
    p: float


def counting_test(samples: np.ndarray, rays: int) -> CountingTest:
    """Compare the scatter of counted readings with that of a binomial distribution.

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
    """Apply the paper's procedure, with 60 000 rays for each reading, to the curves of all taxels of a study.
    """
    curve = curves(study, force)
    forces = np.arange(curve.force[0], curve.force[-1] + paper.FORCE_STEP / 2, paper.FORCE_STEP)
    return summary(max_slopes(forces, binomial(curve.power(forces), paper.RAYS, REPETITIONS)))
