"""Figures of a sensor for tolerance studies: reading at rest, sensitivity, noise as a force, saturation, cross-talk."""

from __future__ import annotations

import numpy as np

from mitsuba_taxel.electronics import Circuit, respond, saturation_force, total_noise
from mitsuba_taxel.electronics.response import lit


def figures(
    power: np.ndarray, force: np.ndarray, loaded: int | None = None, circuit: Circuit | None = None
) -> dict[str, np.ndarray]:
    """Figures of readings in W (..., forces, taxels), each (..., taxels); in V behind a circuit.

    ``rest``: at the least force. ``sensitivity``: mean slope from there to the largest force. With a circuit,
    ``noise_force``: the noise at the least force over that slope, infinite where the converter is at its full scale;
    ``saturation_force``: the least force at which the output reaches the circuit's limit, with power linear between the
    forces, NaN if it does not. ``crosstalk``: the change in between, relative to the reading at rest, over that of the
    taxel ``loaded`` (an index), for which it is NaN; only for several taxels.
    """
    readings = shown_readings(power, circuit)
    first, last = np.abs(force).argmin(), np.abs(force).argmax()
    rest = readings[..., first, :]
    found = {"rest": rest}
    if force[first] != force[last]:
        change = readings[..., last, :] - rest
        found["sensitivity"] = slope = change / (force[last] - force[first])
        if circuit is not None:
            with np.errstate(divide="ignore", invalid="ignore"):
                at_rest = lit(power[..., first, :])
                hidden = total_noise(circuit, at_rest) / np.abs(slope)
                found["noise_force"] = np.where(respond(circuit, at_rest).rate > 0, hidden, np.inf)
            found["saturation_force"] = saturation_force(circuit, force, power)
        if readings.shape[-1] > 1 and loaded is not None:
            with np.errstate(divide="ignore", invalid="ignore"):
                share = change / rest
                crosstalk = share / share[..., loaded, None]
            crosstalk[..., loaded] = np.nan
            found["crosstalk"] = crosstalk
    return found


def shown_readings(power: np.ndarray, circuit: Circuit | None) -> np.ndarray:
    """Readings in W, of any shape, as they are or in V behind a circuit; NaN where they are."""
    return power if circuit is None else np.where(np.isnan(power), np.nan, respond(circuit, lit(power)).voltage)


def loaded_taxel(readings: np.ndarray, force: np.ndarray) -> int:
    """Index of the taxel whose reading (forces, taxels) changes most, relative to that at rest."""
    first, last = np.abs(force).argmin(), np.abs(force).argmax()
    with np.errstate(divide="ignore", invalid="ignore"):
        change = np.abs(readings[last] / readings[first] - 1)
    return int(np.nan_to_num(change, posinf=0.0).argmax())


def figure_rates(
    power: np.ndarray, rates: np.ndarray, force: np.ndarray, loaded: int | None, circuit: Circuit | None = None
) -> dict[str, np.ndarray]:
    """Derivatives (taxels, parameters) of the figures, from readings in W (forces, taxels) and their derivatives
    (forces, taxels, parameters)."""
    largest = np.nanmax(np.abs(rates), initial=0.0)
    step = 1e-4 * np.abs(power).max() / (largest if largest > 0 else 1.0)
    both = (power + sign * step * np.moveaxis(rates, -1, 0) for sign in (1.0, -1.0))
    moved = [figures(one, force, loaded, circuit) for one in both]
    return {name: (moved[0][name] - moved[1][name]).T / (2 * step) for name in moved[0]}
