"""Figures of a sensor for tolerance studies: reading at rest, sensitivity, noise as a force, saturation, cross-talk."""

from __future__ import annotations

import numpy as np

from mitsuba_taxel.electronics import Circuit, respond, saturation_force, total_noise
from mitsuba_taxel.electronics.response import lit


def figures(
    power: np.ndarray, force: np.ndarray, loaded: int | None = None, circuit: Circuit | None = None
) -> dict[str, np.ndarray]:
    """Figures of merit of a sensor for tolerance studies, from its readings against force.

    Parameters
    ----------
    power : (..., forces, taxels) ndarray
        Readings in W.
    force : (forces,) ndarray
        Forces in N.
    loaded : int, optional
        Index of the loaded taxel.
    circuit : Circuit, optional
        Read-out circuit; figures are then in V instead of W.

    Returns
    -------
    dict[str, ndarray]
        Values (..., taxels) by figure. ``rest``: reading at the least force. ``sensitivity``: mean slope from the least
        to the largest force. With a circuit, ``noise_force``: noise at the least force divided by the slope, infinite
        where the converter is at full scale; and ``saturation_force``: least force at which the output reaches the
        circuit's limit, with power linear between the forces, NaN if the output does not reach the limit. With several
        taxels, ``crosstalk``: relative change of the reading from the least to the largest force, divided by the
        relative change of the loaded taxel; NaN for the loaded taxel.
    """
    readings = shown_readings(power, circuit)
    first, last = np.abs(force).argmin(), np.abs(force).argmax()
    rest = readings[..., first, :]
    values = {"rest": rest}
    if force[first] != force[last]:
        change = readings[..., last, :] - rest
        values["sensitivity"] = slope = change / (force[last] - force[first]) + 0.0  # no zero with a minus sign
        if circuit is not None:
            with np.errstate(divide="ignore", invalid="ignore"):
                at_rest = lit(power[..., first, :])
                hidden = total_noise(circuit, at_rest) / np.abs(slope)
                values["noise_force"] = np.where(respond(circuit, at_rest).rate > 0, hidden, np.inf)
            values["saturation_force"] = saturation_force(circuit, force, power)
        if readings.shape[-1] > 1 and loaded is not None:
            with np.errstate(divide="ignore", invalid="ignore"):
                relative = change / rest
                crosstalk = relative / relative[..., loaded, None]
            crosstalk[..., loaded] = np.nan
            values["crosstalk"] = crosstalk
    return values


def shown_readings(power: np.ndarray, circuit: Circuit | None) -> np.ndarray:
    """Readings of any shape in W, converted to V if there is a circuit; NaN (missing) stays NaN."""
    return power if circuit is None else np.where(np.isnan(power), np.nan, respond(circuit, lit(power)).voltage)


def loaded_taxel(readings: np.ndarray, force: np.ndarray) -> int:
    """Index of the taxel with the largest relative change of its reading (forces, taxels)."""
    first, last = np.abs(force).argmin(), np.abs(force).argmax()
    with np.errstate(divide="ignore", invalid="ignore"):
        change = np.abs(readings[last] / readings[first] - 1)
    return int(np.nan_to_num(change, posinf=0.0).argmax())


def figure_rates(
    power: np.ndarray, rates: np.ndarray, force: np.ndarray, loaded: int | None, circuit: Circuit | None = None
) -> dict[str, np.ndarray]:
    """Derivatives of the figures of merit with respect to parameters, from those of the readings.

    The chain rule is applied by central differences of :func:`figures`.

    Parameters
    ----------
    power : (forces, taxels) ndarray
        Readings in W.
    rates : (forces, taxels, parameters) ndarray
        Derivatives of the readings with respect to the parameters.
    force, loaded, circuit
        See :func:`figures`.

    Returns
    -------
    dict[str, (taxels, parameters) ndarray]
        Derivatives by figure.
    """
    largest = np.nanmax(np.abs(rates), initial=0.0)
    step = 1e-4 * np.abs(power).max() / (largest if largest > 0 else 1.0)
    both = (power + sign * step * np.moveaxis(rates, -1, 0) for sign in (1.0, -1.0))
    ends = [figures(readings, force, loaded, circuit) for readings in both]
    with np.errstate(invalid="ignore"):  # noise as a force is infinite beyond the full scale
        return {name: (ends[0][name] - ends[1][name]).T / (2 * step) for name in ends[0]}
