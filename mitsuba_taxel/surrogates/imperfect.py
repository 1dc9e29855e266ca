"""Imperfections that real pads have, added to the readings of a model: memory, spread, dead taxels, latency, noise and
counts.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from mitsuba_taxel.base.arguments import (
    array_of,
    check_flags,
    check_seed,
    is_number,
    is_whole,
    path_of,
    refusal,
    require,
)
from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.electronics.circuit import Circuit
from mitsuba_taxel.electronics.noise import noise_parts
from mitsuba_taxel.electronics.response import counts_of, lit, respond
from mitsuba_taxel.mechanics.materials.viscoelastic import Terms
from mitsuba_taxel.surrogates.memory import PadMemory, checked_step

UNKNOWN_COUNTS = -1
"""Counts of a pad whose reading is not known."""
LEAST_NOMINAL = 1.0
"""Least nominal value of a taxel, relative to its standard deviation, for which factors of it have a meaning."""
FILTERED = ("shot", "thermal")
"""Sources of white noise before the low pass; those after it are independent from sample to sample."""


class PadSpread(NamedTuple):
    """Readings of the sensors of a tolerance study, relative to those of the nominal sensor.

    Attributes
    ----------
    rest : (N, T) ndarray
        Readings at rest of N sensors with T taxels.
    change : (N, T) ndarray
        Sensitivities of these sensors.
    """

    rest: np.ndarray
    change: np.ndarray


def read_spread(folder: str | Path) -> PadSpread:
    """Read the sensors of a tolerance study.

    Parameters
    ----------
    folder : str or Path
        Folder of a tolerance study (`taxel tolerance`) without a circuit, and with more than one force.

    Returns
    -------
    PadSpread
        Readings at rest and sensitivities of the exact samples, relative to those with all parameters at their mean.

    Raises
    ------
    InputError
        if the folder is no such study.
    """
    import pandas

    folder = path_of("folder", folder)
    ratios = []
    try:
        spread, samples = (pandas.read_csv(folder / f"{name}.csv") for name in ("spread", "samples"))
        if "exact" in samples:
            samples = samples[samples.exact]
        for figure, unit in (("rest", "W"), ("sensitivity", "W/N")):
            rows = spread[spread.figure == figure].sort_values("taxel")
            if not len(rows) or set(rows.unit) != {unit}:
                raise InputError(
                    f"the study in {folder} has no {figure} in {unit}: a study over force, without a circuit, is "
                    "needed."
                )
            values = np.stack([samples[f"{figure}_{taxel}"] for taxel in rows.taxel], axis=1)
            ratios.append(values / rows.nominal.to_numpy())
            unlike = np.abs(rows.nominal.to_numpy()) < LEAST_NOMINAL * np.nanstd(values, axis=0)
            if unlike.any():
                taxels = ", ".join(map(str, rows.taxel[unlike]))
                raise InputError(
                    f"the nominal {figure} of taxel {taxels} in {folder} is smaller than its spread, which no factor "
                    "describes."
                )
    except InputError:
        raise
    except FileNotFoundError as error:
        raise InputError(f"{folder} is no tolerance study: {Path(error.filename).name} is missing.") from None
    except (OSError, ValueError, KeyError, AttributeError, TypeError) as error:
        raise InputError(f"{folder} is no tolerance study: spread.csv or samples.csv cannot be read.") from error
    read = np.isfinite(ratios).all(axis=(0, 2))
    if not read.any():
        raise InputError(f"the study in {folder} has no exact sample with all readings: at least one is needed.")
    return PadSpread(*(ratio[read] for ratio in ratios))


class ImperfectReadings(NamedTuple):
    """Readings of B pads with T taxels at one time, with the imperfections of `ImperfectPads`.

    Attributes
    ----------
    power : (B, T) ndarray
        Optical powers in W with memory, spread and dead taxels; NaN where the powers that were given are NaN.
    voltage : (B, T) ndarray or None
        Voltage before the converter in V, with latency and noise; None without a circuit.
    counts : (B, T) ndarray of int or None
        Counts of the converter; -1 where the voltage is not known.
    """

    power: np.ndarray
    voltage: np.ndarray | None
    counts: np.ndarray | None


class ImperfectPads:
    """Converts readings of a model of the perfect pad to readings of B imperfect pads over time.

    All imperfections are off by default. They are applied in the order in which they occur in a sensor: memory of the
    silicone, spread from sensor to sensor, dead taxels, response of the circuit, latency of its low pass, noise,
    converter.

    Parameters
    ----------
    rest : (T,) array_like
        Readings at rest in W.
    pads : int
        Number B of pads.
    prony : str or sequence of (float, float), optional
        Prony series of the silicone: readings of a model over forces creep (:class:`PadMemory`). Readings under given
        depths have no memory; leave it out for them.
    spread : PadSpread, optional
        Sensors of a tolerance study, of which one is drawn for each pad.
    dead : float
        Probability that a taxel is dead, from 0 to 1. Dead taxels have no light.
    circuit : Circuit, optional
        Circuit that reads all taxels: voltages and counts.
    latency : bool
        With a circuit: whether its low pass delays the voltage.
    noise : bool
        With a circuit: whether the voltage has its noise. Shot and thermal noise pass the low pass, so that quick
        samples are correlated (Ornstein-Uhlenbeck). Flicker and other noise are drawn anew for each sample.
    seed : int
        Seed of all random numbers.

    Attributes
    ----------
    dead : (B, T) ndarray of bool
        Which taxels are dead.

    Raises
    ------
    InputError
        if a value is not allowed.
    """

    def __init__(
        self,
        rest: np.ndarray,
        pads: int,
        *,
        prony: str | Terms = (),
        spread: PadSpread | None = None,
        dead: float = 0.0,
        circuit: Circuit | None = None,
        latency: bool = True,
        noise: bool = True,
        seed: int = 0,
    ) -> None:
        taxels = np.size(rest)
        self._rest = array_of("rest", rest, (taxels,))
        if not (is_whole(pads) and pads > 0):
            raise refusal("pads", pads, "a whole number above 0 is needed")
        if not (is_number(dead) and 0 <= dead <= 1):
            raise refusal("dead", dead, "a probability from 0 to 1 is needed")
        if spread is not None:
            require("spread", spread, PadSpread, "a PadSpread")
            spread = PadSpread(*map(np.asarray, spread))
            shape = spread.rest.shape
            if len(shape) != 2 or 0 in shape or shape[1] != taxels or spread.change.shape != shape:
                raise InputError(
                    f"spread with arrays {shape} and {spread.change.shape} is not allowed: both need a row for each "
                    f"sensor and {taxels} columns."
                )
        if circuit is not None:
            require("circuit", circuit, Circuit, "a Circuit")
        check_flags(latency=latency, noise=noise)
        check_seed(seed)
        self._circuit, self._latency, self._noise = circuit, latency, noise
        self._memory = PadMemory(prony, "force", pads, taxels) if len(prony) else None
        self._random = np.random.default_rng(seed)
        drawn = 0 if spread is None else self._random.integers(len(spread.rest), size=pads)
        ones = PadSpread(np.ones((1, taxels)), np.ones((1, taxels)))
        self._factors = [np.broadcast_to(of[drawn], (pads, taxels)) for of in (spread or ones)]
        self.dead = self._random.random((pads, taxels)) < dead
        if circuit is not None:
            self._at_rest, self._noise_at_rest, _ = self._electrical(self._power(np.zeros((pads, taxels))))
            self._output, self._passed = self._at_rest.copy(), self._at_rest.copy()
            self._fluctuation = self._noise_at_rest * self._random.standard_normal((pads, taxels))

    def _power(self, change: np.ndarray) -> np.ndarray:
        """Powers of the imperfect pads in W, from the changes of the readings of the perfect pad."""
        return np.where(self.dead, 0.0, self._rest * self._factors[0] + change * self._factors[1])

    def _electrical(self, power: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Electrical signal of the pads, three arrays (B, T) in V: voltage before the low pass, standard deviation of
        the noise that passes the low pass, and standard deviation of all other noise.
        """
        assert self._circuit is not None
        parts = noise_parts(self._circuit, lit(power))
        filtered = np.sqrt(sum(parts[name] ** 2 for name in FILTERED))
        others = np.sqrt(sum(parts[name] ** 2 for name in ("flicker", "other")))
        return respond(self._circuit, lit(power)).output, filtered, others

    def step(self, power: np.ndarray, duration: float) -> ImperfectReadings:
        """Readings of the imperfect pads at the end of a time step.

        Parameters
        ----------
        power : (B, T) ndarray
            Readings of the perfect pads in W at the end of the step. Within it they change linearly. A pad with a NaN
            is left as it was.
        duration : float
            Duration of the step in s; 0 for a jump.

        Returns
        -------
        ImperfectReadings
            Readings of the imperfect pads.

        Raises
        ------
        InputError
            if a value is not allowed.
        """
        power, known = checked_step("power", power, self.dead.shape, duration)
        change = power - self._rest
        if self._memory is not None:
            change = self._memory.step(change, duration)
        imperfect = np.where(known, self._power(change), np.nan)
        if self._circuit is None:
            return ImperfectReadings(imperfect, None, None)

        # Low pass of a voltage that changes linearly within the step: exact.
        output, filtered, others = self._electrical(imperfect)
        x = 2 * math.pi * self._circuit.bandwidth * float(duration)
        mean_decay = -math.expm1(-x) / x if x > 0 else 1.0
        lag = (self._passed - self._output) * math.exp(-x) - (output - self._output) * mean_decay
        self._passed = np.where(known, output + lag, self._passed)
        self._output = np.where(known, output, self._output)
        voltage = self._passed if self._latency else self._output

        # Noise of a stationary process behind the low pass, and independent noise.
        if self._noise:
            fresh = filtered * self._random.standard_normal(output.shape)
            moved = math.exp(-x) * self._fluctuation + math.sqrt(-math.expm1(-2 * x)) * fresh
            self._fluctuation = np.where(known, moved, self._fluctuation)
            voltage = voltage + self._fluctuation + others * self._random.standard_normal(output.shape)
        counts = np.where(known, counts_of(self._circuit, voltage), UNKNOWN_COUNTS)
        return ImperfectReadings(imperfect, np.where(known, voltage, np.nan), counts)

    def reset(self, pads: Any = slice(None)) -> None:
        """Set pads to the state at rest, for example at the start of an episode. Spread and dead taxels do not change.

        Parameters
        ----------
        pads : int, slice or array_like, optional
            Indices of the pads, or a mask; by default all.
        """
        pads = pads if isinstance(pads, slice) else np.asarray(pads)  # a tuple would be a place in the arrays
        if self._memory is not None:
            self._memory.reset(pads)
        if self._circuit is not None:
            fresh = self._noise_at_rest * self._random.standard_normal(self.dead.shape)
            self._output[pads] = self._passed[pads] = self._at_rest[pads]
            self._fluctuation[pads] = fresh[pads]
