"""Coverage of the stated errors of figures of merit, on synthetic bench recordings with several force histories and
kinds of noise."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np

from mitsuba_taxel.characterise import Branch, Experiment, Measurement, characteristics, recorded_experiment
from mitsuba_taxel.characterise.experiment import since

MOVES = ("stairs", "ramp", "triangle", "sine", "mixture")
NOISES = ("white", "correlated by 0.3", "correlated by 0.5", "hidden by steps", "as large as steps")
LARGEST = 10.0
"""Largest force in N."""
STEP = 3.3 / 4096
"""Step of the converter, in V."""
MOST_ROWS = 20_000


def record_cases() -> dict[str, Callable[[int], dict[str, float]]]:
    """All cases by name. A case is a function of a seed that returns the error of each figure of merit of a recording,
    divided by its stated error."""
    kinds = [(move, noise, 2) for move in MOVES for noise in NOISES] + [("ramp", "white", cycles) for cycles in (3, 10)]
    return {
        f"record: {move}, noise {noise}, {cycles} cycles": partial(_deviations, move, noise, cycles)
        for move, noise, cycles in kinds
    }


def _deviations(move: str, noise: str, cycles: int, seed: int) -> dict[str, float]:
    """True error divided by stated error, for the first value of each figure of merit, which belongs to the first
    loading."""
    experiment = recorded_experiment(made_up_record(move, noise, cycles, seed))
    table, exact = (
        characteristics([record]).groupby("figure").first() for record in (experiment, _without_noise(experiment))
    )
    error = table.error.where(table.error > 0)
    return ((table.value - exact.value) / error).to_dict()


def made_up_record(move: str, noise: str, cycles: int, seed: int) -> Measurement:
    """Make a synthetic recording with noise of voltage and force. The voltage changes by 0.3 V at 10 N, with curvature
    and a hysteresis of 5 %.

    Parameters
    ----------
    move : str
        Force history, one of :data:`MOVES`.
    noise : str
        Kind of the noise, one of :data:`NOISES`.
    cycles : int
        Number of load cycles.
    seed : int
        Seed of the noise and of random parameters of the force history.
    """
    # Voltage with its noise, rounded to steps of the converter if these matter.
    random = np.random.default_rng(seed)
    fraction, falls = _force_course(move, cycles, random)
    volts = 10 ** random.uniform(-4, -2.5)
    scatter = random.normal(size=fraction.size)
    if noise.startswith("correlated by "):
        scatter = _correlated(float(noise.removeprefix("correlated by ")), fraction.size, random)
    stepped = noise in ("hidden by steps", "as large as steps")
    if stepped:
        volts = STEP / 40 if noise == "hidden by steps" else STEP * random.uniform(0.2, 1.5)
    voltage = _true_voltage(fraction, falls) + volts * scatter
    if stepped:
        voltage = (np.floor(voltage / STEP) + 0.5) * STEP
    # Force with its noise.
    newtons = LARGEST * 10 ** random.uniform(-4.5, -2.5) * (random.random() > 0.2)  # none in one of five
    force = LARGEST * fraction + newtons * random.normal(size=fraction.size)
    time = np.arange(fraction.size) / 50
    return Measurement(time, force[:, None], ("fz",), voltage[:, None], np.array([1]), "made up")


def _true_voltage(fraction: np.ndarray, falls: np.ndarray | float) -> np.ndarray:
    """Exact voltage in V at a fraction of the largest force; ``falls`` is 1 during unloading, else 0."""
    bend = fraction * (1 - fraction)
    return 1.2 + 0.3 * (fraction - 0.3 * bend + 0.2 * bend * falls)


def _without_noise(experiment: Experiment) -> Experiment:
    """Copy an experiment with exact voltages at the forces of its points."""
    runs = []
    for run in experiment.runs:
        falls = float(abs(run.force[-1]) < abs(run.force[0]))
        runs.append(Branch(run.force, _true_voltage(run.force / LARGEST, falls)[:, None, None]))
    rest_value = np.full((1, 1), _true_voltage(np.zeros(1), 0.0)[0])  # at no force, wherever the points are
    return replace(experiment, runs=since(rest_value, runs), rest=rest_value)


def _correlated(correlation: float, count: int, random: np.random.Generator) -> np.ndarray:
    """Noise (count,) of unit variance, with a given correlation of neighbouring values: a first-order autoregressive
    process."""
    from scipy.signal import lfilter

    drawn = random.normal(size=count + 300)
    return lfilter([math.sqrt(1 - correlation**2)], [1, -correlation], drawn)[300:]


def _force_course(move: str, cycles: int, random: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Force history of a recording, (rows,): the force as a fraction of the largest force. A second array (rows,) is 1
    where the force falls, else 0.

    The numbers of force levels and rows are random.
    """
    # Stairs: levels held for several rows.
    if move == "stairs":
        levels, hold = int(random.integers(4, 41)), int(np.exp(random.uniform(math.log(3), math.log(400))))
        hold = min(hold, MOST_ROWS // (2 * levels * cycles) + 3)
        up = np.linspace(0, 1, levels)
        fraction = np.concatenate([up[:1], *[np.concatenate([up[1:], up[-2::-1]])] * cycles]).repeat(hold)
        falls = np.concatenate([[0], *[np.repeat([0, 1], levels - 1)] * cycles]).repeat(hold)
        return fraction, falls
    # One cycle of the other courses: pause, loading, pause, unloading.
    rows = min(int(np.exp(random.uniform(math.log(150), math.log(3000)))), MOST_ROWS // (2 * cycles))
    up, pause = np.linspace(0, 1, rows), np.zeros(0)
    if move == "ramp":
        pause = np.zeros(int(rows * random.uniform(0.02, 0.5)))
    elif move == "mixture":
        levels = int(random.integers(3, 8))
        count = max(rows // (2 * levels), 10)
        ends = np.linspace(0, 1, levels + 1)
        moves = [np.linspace(*pair, count) for pair in zip(ends[:-1], ends[1:], strict=True)]
        up = np.concatenate([segment for move_rows in moves for segment in (np.full(count, move_rows[0]), move_rows)])
        pause = np.zeros(count // 2)
    cycle = np.concatenate([pause, up, 1 - pause, 1 - pause, up[::-1], pause])
    if move == "sine":
        cycle = 0.5 - 0.5 * np.cos(2 * np.pi * np.arange(2 * rows) / (2 * rows))
    return np.tile(cycle, cycles), np.tile(np.repeat([0, 1], len(cycle) // 2), cycles)
