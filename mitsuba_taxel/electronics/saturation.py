"""Saturation of a circuit: the power, the force on a line of load, and the parameter change at which it occurs."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from mitsuba_taxel.electronics.circuit import Circuit
from mitsuba_taxel.electronics.response import lit, power_at, respond


def saturating_power(circuit: Circuit) -> float:
    """Least optical power at which the output is at the circuit's limit.

    Parameters
    ----------
    circuit : Circuit
        Phototransistor, load, buffer and converter.

    Returns
    -------
    float
        Power in W; infinite if no power reaches the limit.
    """
    power = float(power_at(circuit, np.nextafter(circuit.limit, 0.0)))
    return math.inf if math.isnan(power) else power


def saturated_words(circuit: Circuit, power: Any) -> str:
    """A note that names the readings at which the output is at the circuit's limit.

    Parameters
    ----------
    circuit : Circuit
        Phototransistor, load, buffer and converter.
    power : (..., T) array_like
        Readings of T taxels, W.

    Returns
    -------
    str
        The note; empty if there is no such reading.
    """
    power = np.asarray(power, dtype=float)
    saturated = respond(circuit, lit(power)).saturated & np.isfinite(power)
    if not saturated.any():
        return ""
    index = int(saturated.reshape(-1, saturated.shape[-1]).sum(axis=0).argmax())
    return (
        f"the output is saturated (at {circuit.limit:.4g} V or more) in {saturated.sum()} of "
        f"{np.isfinite(power).sum()} readings, most often of taxel {index + 1}: such readings depend little on the "
        "force, and not at all at the full scale"
    )


def saturation_force(circuit: Circuit, force: Any, power: Any) -> np.ndarray:
    """Force of least magnitude at which the output of each taxel reaches the circuit's limit.

    Parameters
    ----------
    circuit : Circuit
        Phototransistor, load, buffer and converter.
    force : (K,) array_like
        K forces in N, in any order.
    power : (..., K, T) array_like
        Readings in W of T taxels at these forces; they are interpolated linearly.

    Returns
    -------
    (..., T) ndarray
        Force in N; NaN where the output stays below its limit.
    """
    force, power = np.asarray(force, dtype=float), np.asarray(power, dtype=float)

    # Between which forces the power crosses the saturating power, and where.
    order = np.argsort(force)
    force, excess = force[order], np.moveaxis(power - saturating_power(circuit), -2, 0)[order]
    low, high = excess[:-1], excess[1:]
    crossed = (low >= 0) != (high >= 0)
    fraction = np.zeros_like(low)
    fraction[crossed] = low[crossed] / (low[crossed] - high[crossed])
    shape = (-1, *[1] * (excess.ndim - 1))
    start, length = force[:-1].reshape(shape), np.diff(force).reshape(shape)

    # Candidates: forces at the limit, crossings, and zero if it lies between two forces at the limit.
    inside = (low >= 0) & (high >= 0) & (start * (start + length) < 0)
    candidates = [
        np.where(excess >= 0, force.reshape(shape), np.inf),
        np.where(crossed, start + fraction * length, np.inf),
        np.where(inside, 0.0, np.inf),
    ]
    forces = np.concatenate(candidates)
    least = np.take_along_axis(forces, np.abs(forces).argmin(axis=0)[None], axis=0)[0]
    return np.where(np.isfinite(least), least, np.nan)


def change_to_saturation(circuit: Circuit, power: Any, slopes: Any) -> np.ndarray:
    """Change of each parameter at which the output reaches the circuit's limit, with a power linear in the parameter.

    Parameters
    ----------
    circuit : Circuit
        Phototransistor, load, buffer and converter.
    power : (T,) array_like
        Readings in W.
    slopes : (T, P) array_like
        Derivatives of the readings with respect to P parameters.

    Returns
    -------
    (T, P) ndarray
        Changes in the units of the parameters; 0 where the output is at its limit already, infinite where the power
        does not depend on the parameter.
    """
    slopes = np.asarray(slopes, dtype=float)
    missing = np.maximum(saturating_power(circuit) - np.asarray(power, dtype=float), 0.0)[:, None]
    change = np.divide(missing, slopes, out=np.full(slopes.shape, np.inf), where=slopes != 0)
    return np.where(missing > 0, change, 0.0)
