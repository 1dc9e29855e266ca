"""Where a circuit saturates: the light, the force along a line of load, and the change of a parameter."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from mitsuba_taxel.electronics.circuit import Circuit
from mitsuba_taxel.electronics.response import lit, power_at, respond


def saturating_power(circuit: Circuit) -> float:
    """Optical power in W from which the output is at the circuit's limit; infinite if no power reaches it.

    Parameters
    ----------
    circuit : Circuit
        Phototransistor, load, buffer and converter.

    Returns
    -------
    float
        In W.
    """
    found = float(power_at(circuit, np.nextafter(circuit.limit, 0.0)))
    return math.inf if math.isnan(found) else found


def saturated_words(circuit: Circuit, power: Any) -> str:
    """How many readings bring the output to the circuit's limit, in words.

    Parameters
    ----------
    circuit : Circuit
        Phototransistor, load, buffer and converter.
    power : (..., T) array_like
        Readings of T taxels, W.

    Returns
    -------
    str
        Empty if none does.
    """
    power = np.asarray(power, dtype=float)
    saturated = respond(circuit, lit(power)).saturated & np.isfinite(power)
    if not saturated.any():
        return ""
    most = int(saturated.reshape(-1, saturated.shape[-1]).sum(axis=0).argmax())
    return (
        f"the output is saturated (at {circuit.limit:.4g} V or more) in {saturated.sum()} of "
        f"{np.isfinite(power).sum()} readings, most often of taxel {most + 1}: these tell little of the force, or "
        "nothing from the full scale on"
    )


def saturation_force(circuit: Circuit, force: Any, power: Any) -> np.ndarray:
    """Force of least magnitude at which the light brings the output to the circuit's limit.

    Parameters
    ----------
    circuit : Circuit
        Phototransistor, load, buffer and converter.
    force : (K,) array_like
        In N, in any order.
    power : (..., K, T) array_like
        Readings in W at these forces, between which the light is linear.

    Returns
    -------
    (..., T) ndarray
        In N; NaN where the output stays below its limit.
    """
    force, power = np.asarray(force, dtype=float), np.asarray(power, dtype=float)
    order = np.argsort(force)
    force, beyond = force[order], np.moveaxis(power - saturating_power(circuit), -2, 0)[order]
    low, high = beyond[:-1], beyond[1:]
    crossed = (low >= 0) != (high >= 0)
    share = np.zeros_like(low)
    share[crossed] = low[crossed] / (low[crossed] - high[crossed])
    at = (-1, *[1] * (beyond.ndim - 1))
    start, length = force[:-1].reshape(at), np.diff(force).reshape(at)
    # Zero lies between two forces, at both of which the output is at its limit.
    inside = (low >= 0) & (high >= 0) & (start * (start + length) < 0)
    found = [
        np.where(beyond >= 0, force.reshape(at), np.inf),
        np.where(crossed, start + share * length, np.inf),
        np.where(inside, 0.0, np.inf),
    ]
    every = np.concatenate(found)
    least = np.take_along_axis(every, np.abs(every).argmin(axis=0)[None], axis=0)[0]
    return np.where(np.isfinite(least), least, np.nan)


def change_to_saturation(circuit: Circuit, power: Any, slopes: Any) -> np.ndarray:
    """(T, P) changes of parameters that bring the output to the circuit's limit if the light follows its slopes.

    Parameters
    ----------
    power : (T,) array_like
        Readings in W.
    slopes : (T, P) array_like
        Their derivatives by the parameters.

    Returns
    -------
    (T, P) ndarray
        0 where the output is at its limit, infinite where the light does not depend on the parameter.
    """
    slopes = np.asarray(slopes, dtype=float)
    missing = np.maximum(saturating_power(circuit) - np.asarray(power, dtype=float), 0.0)[:, None]
    found = np.divide(missing, slopes, out=np.full(slopes.shape, np.inf), where=slopes != 0)
    return np.where(missing > 0, found, 0.0)
