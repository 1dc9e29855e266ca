"""Synthetic experiments whose figures of merit are known."""

from __future__ import annotations

import numpy as np
import pytest

from mitsuba_taxel.characterise import Branch, Measurement


@pytest.fixture
def branch():
    """Branch of a curve: function of force, forces, and per replicate and channel noise of a given size."""

    def make(curve, force, noise=0.0, replicates=32, channels=1, seed=0):
        force = np.asarray(force, dtype=float)
        scatter = np.random.default_rng(seed).normal(size=(len(force), replicates, channels))
        return Branch(force, curve(force)[:, None, None] + noise * scatter)

    return make


@pytest.fixture
def covered():
    """A check that 95 % of many intervals hold the truth, or at least a lower share; false-alarm rate 1e-4."""
    from scipy import stats

    def check(value, error, truth, replicates, at_least=None):
        z = (np.ravel(value) - truth) / np.ravel(error)
        inside = int((np.abs(z) < stats.t.isf(0.025, df=replicates - 1)).sum())
        share = at_least or 0.95
        assert inside >= stats.binom.ppf(0.5e-4, z.size, share), f"{inside} of {z.size} intervals hold the truth"
        if at_least is None:
            assert inside <= stats.binom.isf(0.5e-4, z.size, share), f"{inside} of {z.size} intervals hold the truth"

    return check


@pytest.fixture
def record():
    """A bench's record of cycles 0 -> 10 -> 0 N, with known figures of merit, pauses and noise.

    The voltage is 0.3 V at 10 N, on a parabola that deviates from its end-point line by 7.5 %; it is larger by up to
    5 % (at 5 N) when the force falls, and lower by up to ``drift`` (at 10 N) in every cycle after the first.
    """

    def make(seed=0, volts=1e-3, newtons=0.01, drift=0.0, rows=2500, pause=150, taxels=2, cycles=2):
        rng = np.random.default_rng(seed)
        up, low, high = np.linspace(0, 1, rows), np.zeros(pause), np.ones(pause)
        share = np.concatenate([low, *[np.concatenate([up, high, up[::-1], low]) for _ in range(cycles)]])
        falls = np.concatenate([low, *[np.repeat([0.0, 0.5, 1, 0], [rows, pause, rows, pause])] * cycles])
        cycle = np.concatenate([low, *[np.full(2 * rows + 2 * pause, float(n > 0)) for n in range(cycles)]])
        bend = share * (1 - share)
        clean = 1.2 + 0.3 * (share - 0.3 * bend + 0.2 * bend * falls - drift * cycle * share)
        voltage = clean[:, None] + volts * rng.normal(size=(len(share), taxels))
        force = 10 * share + newtons * rng.normal(size=len(share))
        return Measurement(
            np.arange(len(share)) / 50, force[:, None], ("fz",), voltage, np.arange(1, taxels + 1), "bench.csv"
        )

    return make
