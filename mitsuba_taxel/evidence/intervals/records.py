"""Made-up bench recordings whose figures of merit are known: how the force moves, and what noise they have."""

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
"""Force in N."""
STEP = 3.3 / 4096
"""Of the converter, in V."""
MOST_ROWS = 20_000


def record_cases() -> dict[str, Callable[[int], dict[str, float]]]:
    """By name: for a seed, the error of each figure of a recording over the stated one."""
    kinds = [(move, noise, 2) for move in MOVES for noise in NOISES] + [("ramp", "white", cycles) for cycles in (3, 10)]
    return {
        f"record: {move}, noise {noise}, {cycles} cycles": partial(_deviations, move, noise, cycles)
        for move, noise, cycles in kinds
    }


def _deviations(move: str, noise: str, cycles: int, seed: int) -> dict[str, float]:
    """Error of each figure of the first loading over the stated one; of repeatability that of the second."""
    experiment = recorded_experiment(made_up_record(move, noise, cycles, seed))
    table, right = (
        characteristics([one]).groupby("figure").first() for one in (experiment, _without_noise(experiment))
    )
    error = table.error.where(table.error > 0)
    return ((table.value - right.value) / error).to_dict()


def made_up_record(move: str, noise: str, cycles: int, seed: int) -> Measurement:
    """A recording: 0.3 V at 10 N on a parabola, with a loop of 5 %; noise of the voltage and of the force."""
    random = np.random.default_rng(seed)
    share, falls = _moves(move, cycles, random)
    volts = 10 ** random.uniform(-4, -2.5)
    scatter = random.normal(size=share.size)
    if noise.startswith("correlated by "):
        scatter = _correlated(float(noise.removeprefix("correlated by ")), share.size, random)
    stepped = noise in ("hidden by steps", "as large as steps")
    if stepped:
        volts = STEP / 40 if noise == "hidden by steps" else STEP * random.uniform(0.2, 1.5)
    voltage = _right(share, falls) + volts * scatter
    if stepped:
        voltage = (np.floor(voltage / STEP) + 0.5) * STEP
    newtons = LARGEST * 10 ** random.uniform(-4.5, -2.5) * (random.random() > 0.2)  # none in one of five
    force = LARGEST * share + newtons * random.normal(size=share.size)
    time = np.arange(share.size) / 50
    return Measurement(time, force[:, None], ("fz",), voltage[:, None], np.array([1]), "made up")


def _right(share: np.ndarray, falls: np.ndarray | float) -> np.ndarray:
    """Voltage in V at a share of the largest force, that falls or grows."""
    bend = share * (1 - share)
    return 1.2 + 0.3 * (share - 0.3 * bend + 0.2 * bend * falls)


def _without_noise(experiment: Experiment) -> Experiment:
    """The true curve at the forces of an experiment's points."""
    runs = []
    for run in experiment.runs:
        falls = float(abs(run.force[-1]) < abs(run.force[0]))
        runs.append(Branch(run.force, _right(run.force / LARGEST, falls)[:, None, None]))
    force, values = (np.concatenate([getattr(run, name) for run in runs]) for name in ("force", "samples"))
    mine = np.concatenate([run.value for run in experiment.runs])
    # The point whose change is zero is the one at rest.
    rest = values[int(np.abs(mine).sum(axis=1).argmin())]
    return replace(experiment, runs=since(rest, runs), rest=rest)


def _correlated(correlation: float, count: int, random: np.random.Generator) -> np.ndarray:
    from scipy.signal import lfilter

    drawn = random.normal(size=count + 300)
    return lfilter([math.sqrt(1 - correlation**2)], [1, -correlation], drawn)[300:]


def _moves(move: str, cycles: int, random: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Shares of the largest force, row by row, and whether it falls; of random numbers of levels and rows."""
    if move == "stairs":
        levels, hold = int(random.integers(4, 41)), int(np.exp(random.uniform(math.log(3), math.log(400))))
        hold = min(hold, MOST_ROWS // (2 * levels * cycles) + 3)
        up = np.linspace(0, 1, levels)
        share = np.concatenate([up[:1], *[np.concatenate([up[1:], up[-2::-1]])] * cycles]).repeat(hold)
        falls = np.concatenate([[0], *[np.repeat([0, 1], levels - 1)] * cycles]).repeat(hold)
        return share, falls
    rows = min(int(np.exp(random.uniform(math.log(150), math.log(3000)))), MOST_ROWS // (2 * cycles))
    up, pause = np.linspace(0, 1, rows), np.zeros(0)
    if move == "ramp":
        pause = np.zeros(int(rows * random.uniform(0.02, 0.5)))
    elif move == "mixture":
        levels = int(random.integers(3, 8))
        count = max(rows // (2 * levels), 10)
        ends = np.linspace(0, 1, levels + 1)
        moves = [np.linspace(*pair, count) for pair in zip(ends[:-1], ends[1:], strict=True)]
        up = np.concatenate([part for each in moves for part in (np.full(count, each[0]), each)])
        pause = np.zeros(count // 2)
    cycle = np.concatenate([pause, up, 1 - pause, 1 - pause, up[::-1], pause])
    if move == "sine":
        cycle = 0.5 - 0.5 * np.cos(2 * np.pi * np.arange(2 * rows) / (2 * rows))
    return np.tile(cycle, cycles), np.tile(np.repeat([0, 1], len(cycle) // 2), cycles)
