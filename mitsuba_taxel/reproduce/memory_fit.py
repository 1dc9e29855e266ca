"""A Prony series fitted to the voltage after release, and its predictions of holds and slow cycles."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.optimize import nnls

from mitsuba_taxel.mechanics import NeoHookean, PlateDisplacement, Viscoelastic, load_path, reactions
from mitsuba_taxel.pads import Pad
from mitsuba_taxel.reproduce import measured

TIMES = (0.05, 0.5, 5.0)
"""Relaxation times in s, one per decade of the record; their shares are fitted."""
TRAVEL, STEPS = 0.6, 10
"""Travel in mm of a plate on one cell, a sixth of the height, and number of steps."""


class Loop(NamedTuple):
    """Width of a cycle at equal travel, in percent of the largest force, and energy lost, in percent."""

    width: float
    energy: float


def fitted_terms() -> tuple[tuple[float, float], ...]:
    """Shares of the three terms by least squares of the relative error of the tail.

    A pad released after a long hold keeps about the sum of g exp(-t / tau) of its strain.
    """
    left = np.array(measured.TAIL_VOLTS) / (measured.HELD_SHARE * measured.PRESSES[measured.PRESSED].at_rest)
    decays = np.exp(-np.array(measured.TAIL_TIMES)[:, None] / TIMES)
    shares, _ = nnls(decays / left[:, None], np.ones(len(left)))
    return tuple((float(share), time) for share, time in zip(shares, TIMES, strict=True))


def tail(terms: tuple[tuple[float, float], ...]) -> np.ndarray:
    """Remaining strain after release, relative to the hold, at the times of the record."""
    shares, times = np.array(terms).T
    return np.exp(-np.array(measured.TAIL_TIMES)[:, None] / times) @ shares


def hold(terms: tuple[tuple[float, float], ...]) -> np.ndarray:
    """Force in the windows of the hold, relative to the last."""
    silicone = Viscoelastic(NeoHookean(), terms)
    forces = [silicone.relaxation(np.linspace(*window, 1000)).mean() for window in measured.HOLD_WINDOWS]
    return np.array(forces) / forces[-1]


def slow_loop(terms: tuple[tuple[float, float], ...]) -> Loop:
    """A cycle of a plate on one cell, with the duration of the measurement."""
    way = np.concatenate([np.linspace(0, TRAVEL, STEPS + 1)[1:], np.linspace(TRAVEL, 0, STEPS + 1)[1:]])
    times = measured.CYCLE_SECONDS * np.arange(1, 2 * STEPS + 1) / (2 * STEPS)
    values = [(0.0, 0.0, -travel) for travel in way]
    silicone, pad = Viscoelastic(NeoHookean(), terms), Pad(rows=1, columns=1)
    states = load_path(pad, silicone, values, times=times, load=PlateDisplacement())
    force = np.array([0.0, *(-reactions(state).applied_force[2] for state in states)])
    loading, unloading = force[: STEPS + 1], force[STEPS:][::-1]
    gap = loading - unloading
    return Loop(100 * gap.max() / force.max(), 100 * np.sum(gap[1:] + gap[:-1]) / np.sum(loading[1:] + loading[:-1]))
