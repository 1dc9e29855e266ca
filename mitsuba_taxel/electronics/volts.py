"""Studies in volts: readings behind a circuit."""

from __future__ import annotations

import json

import numpy as np
import xarray as xr

from mitsuba_taxel.electronics.circuit import Circuit, circuit_of
from mitsuba_taxel.electronics.noise import total_noise
from mitsuba_taxel.electronics.response import lit, respond

VOLTS = ("voltage", "voltage_error", "counts", "noise", "saturated")
"""Variables that a circuit adds to a study."""


def with_volts(study: xr.Dataset, circuit: Circuit | None) -> xr.Dataset:
    """Add voltages and counts at the output of a circuit to a study.

    The result has the variables ``voltage``, ``voltage_error`` (due to the total error of the power), ``counts``,
    ``noise`` and ``saturated`` (1 where the output is at the circuit's limit), and the attribute ``circuit``.

    Parameters
    ----------
    study : xr.Dataset
        Results with readings in W.
    circuit : Circuit or None
        Phototransistor, load, buffer and converter.

    Returns
    -------
    xr.Dataset
        The study itself if ``circuit`` is None.
    """
    if circuit is None:
        return study
    power = study.power.values
    finite = np.isfinite(power)
    lit_power = lit(power)
    response = respond(circuit, lit_power)
    dims = study.power.dims

    def column(values: np.ndarray, unit: str, name: str) -> tuple:
        return dims, np.where(finite, values, np.nan), {"units": unit, "long_name": name}

    return study.assign(
        voltage=column(response.voltage, "V", "voltage at the converter"),
        voltage_error=column(response.rate * study.total_error.values, "V", "error of voltage by that of power"),
        counts=column(response.counts, "1", "counts of the converter"),
        noise=column(total_noise(circuit, lit_power), "V", "1 sigma of voltage by the electronics"),
        saturated=column(response.saturated, "1", "whether the output is at the circuit's limit"),
    ).assign_attrs(circuit=json.dumps(circuit.as_table()))


def circuit_of_study(study: xr.Dataset | xr.DataTree) -> Circuit | None:
    """The circuit with which a study was computed; all its scenes have the same circuit.

    Parameters
    ----------
    study : xr.Dataset or xr.DataTree
        Result of ``open_study``.

    Returns
    -------
    Circuit or None
        The circuit; None if the study has only optical powers.
    """
    attributes = study.leaves[0].attrs if isinstance(study, xr.DataTree) else study.attrs
    return circuit_of(json.loads(attributes["circuit"])) if "circuit" in attributes else None


def in_volts(study: xr.Dataset, circuit: Circuit) -> xr.Dataset:
    """Convert readings, their errors and their derivatives to volts, for figures of merit and plots.

    Voltages of the mean powers are exact; deviations of the replicates are linearised.

    Parameters
    ----------
    study : xr.Dataset
        Results with readings in W.
    circuit : Circuit
        Phototransistor, load, buffer and converter.

    Returns
    -------
    xr.Dataset
        The study with the same variables in V.
    """
    # Readings: the voltage of the mean, and linearised deviations of the replicates.
    mean = study.replicate_power.mean("replicate")
    response = respond(circuit, lit(mean.values))
    voltage = mean.copy(data=np.where(np.isfinite(mean), response.voltage, np.nan))
    rate = mean.copy(data=response.rate)
    converted = {"replicate_power": voltage + rate * (study.replicate_power - mean)}
    if "total_error" in study:
        converted["total_error"] = rate * study.total_error

    # Readings without random numbers, and derivatives by the chain rule.
    if "smooth_power" in study:
        response = respond(circuit, lit(study.smooth_power.values))
        rate = study.smooth_power.copy(data=response.rate)
        finite = np.isfinite(study.smooth_power.values)
        converted["smooth_power"] = study.smooth_power.copy(data=np.where(finite, response.voltage, np.nan))
        slopes = ("smooth_power_error", "derivative", "derivative_error")
        converted |= {name: study[name] * rate for name in slopes if name in study}
    for name, values in converted.items():
        converted[name] = values.transpose(*study[name].dims).assign_attrs(units="V")
    return study.assign(converted)
