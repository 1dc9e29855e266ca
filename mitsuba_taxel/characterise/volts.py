"""A study behind a circuit: volts and counts at rest and per newton, noise-equivalent force, saturation."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from mitsuba_taxel.characterise.experiment import Branch
from mitsuba_taxel.characterise.load_lines import loading_lines, runs
from mitsuba_taxel.characterise.roles import with_forces_named
from mitsuba_taxel.characterise.shape_error import off_by_shape, with_shape
from mitsuba_taxel.characterise.slopes import slopes
from mitsuba_taxel.electronics import Circuit, in_volts, respond, saturation_force, total_noise
from mitsuba_taxel.electronics.noise import FEW_COUNTS, resolution_notes, unused_range

if TYPE_CHECKING:
    import pandas

MOST_NAMED = 5
"""Saturated taxels that are named individually."""


def volts_table(study: xr.Dataset | xr.DataTree, circuit: Circuit, up_to: float = math.inf) -> pandas.DataFrame:
    """One row per line of load and taxel of a study behind a circuit; none if no force is varied.

    Parameters
    ----------
    study : xr.Dataset or xr.DataTree
        With readings in W.
    circuit : Circuit
        Phototransistor, load, buffer and converter.
    up_to : float
        Largest force that counts, N.

    Returns
    -------
    pandas.DataFrame
        Columns: ``force``; the other varied parameters; ``taxel``; ``rest_V``, ``rest_counts`` and ``noise_V`` (1
        sigma) at the least force; ``mean_slope_V_per_N`` and its ``_error``, between the ends of the line, and
        ``mean_slope_counts_per_N``; ``signal_counts``, from the least force to the largest; ``noise_force_N``, the
        noise as a force at the first step, and ``least_noise_force_N``, the least of all steps, both infinite beyond
        the converter's full scale, where nothing is read; ``saturation_N``, the least force where the output reaches
        the circuit's limit, by linear interpolation of the power, NaN if it does not.
    """
    import pandas

    leaves = [("", study)] if isinstance(study, xr.Dataset) else [(one.name, one.to_dataset()) for one in study.leaves]
    return pandas.DataFrame(
        [
            {"force": row.pop("force"), **({"scene": name} if name else {}), **row}
            for name, leaf in leaves
            for row in _rows(leaf, circuit, up_to)
        ]
    )


def volts_notes(table: pandas.DataFrame, circuit: Circuit | None) -> list[str]:
    """What limits the numbers of a :func:`volts_table`: saturated taxels, a range that is not used, few counts of
    signal, and noise that the converter does not see.

    Parameters
    ----------
    table : pandas.DataFrame
        Of :func:`volts_table`.
    circuit : Circuit or None
        Of the study.

    Returns
    -------
    list[str]
        Empty without a circuit.
    """
    if circuit is None or not len(table):
        return []
    notes = []
    saturated = table[table.saturation_N.notna()]
    if len(saturated):
        at_rest = (saturated.saturation_N == 0) | (saturated.rest_counts == 2**circuit.adc_bits - 1)
        places = [
            f"taxel {taxel} {'at rest' if rest else f'from {force:.4g} N on'}"
            for taxel, force, rest in zip(saturated.taxel, saturated.saturation_N, at_rest, strict=True)
        ]
        more = f" and {len(places) - MOST_NAMED} more" if len(places) > MOST_NAMED else ""
        notes.append(
            f"Saturated (output of {circuit.limit:.4g} V or more; full scale {circuit.full_scale:.4g} V): "
            f"{', '.join(places[:MOST_NAMED])}{more}. Slopes and noise as a force hold up to there only."
        )
    notes += unused_range(circuit, int(np.maximum(table.rest_counts, table.rest_counts + table.signal_counts).max()))
    signal = int(table.signal_counts.abs().max())
    if signal < FEW_COUNTS and not len(saturated):
        notes.append(f"Counts of signal, from the least force to the largest: {signal} at most.")
    return [*notes, *resolution_notes(circuit.step, table.noise_V.to_numpy())]


def _rows(study: xr.Dataset, circuit: Circuit, up_to: float) -> Iterator[dict[str, Any]]:
    study = with_forces_named(study)
    off = off_by_shape(study)
    every = (study, *(in_volts(one, circuit) for one in (study, *(one for both in off.values() for one in both))))
    for line in loading_lines(study):
        for (where, power), *shown in zip(*(runs(one, line) for one in every), strict=True):
            within = np.abs(power.force) <= up_to
            if within.sum() < 2:
                continue
            derived = shown[0][1].tangents is not None
            slope, *changed = (slopes(voltage.part(within)) for _, voltage in shown)
            means = [one.mean_slope for one in changed]
            pairs = {mode: means[2 * number : 2 * number + 2] for number, mode in enumerate(off)}
            error = with_shape(slope.mean_slope_error, slope.mean_slope, pairs, derived)
            found = _figures(circuit, power.part(within), slope.mean_slope, error)
            for number, taxel in enumerate(study.taxel.values.tolist()):
                figures = {name: values[number].item() for name, values in found.items()}
                yield {"force": line.name, **where, **line.constant, "taxel": taxel, **figures}


def _figures(circuit: Circuit, power: Branch, slope: np.ndarray, error: np.ndarray) -> dict[str, np.ndarray]:
    """Each (channels,), along a run; the first step is that from the least force towards the largest."""
    order = np.argsort(power.force)
    force, light = power.force[order], np.maximum(power.value[order], 0.0)
    shown, noise = respond(circuit, light), total_noise(circuit, light)
    steps = np.abs(np.diff(shown.voltage, axis=0) / np.diff(force)[:, None])
    with np.errstate(divide="ignore"):
        hidden = np.divide((noise[1:] + noise[:-1]) / 2, steps)
    blind = shown.rate == 0
    hidden[blind[1:] | blind[:-1]] = np.inf
    least, largest = np.abs(force).argmin(), np.abs(force).argmax()
    return {
        "rest_V": shown.voltage[least],
        "rest_counts": shown.counts[least],
        "noise_V": noise[least],
        "mean_slope_V_per_N": slope,
        "mean_slope_V_per_N_error": error,
        "mean_slope_counts_per_N": slope / circuit.step,
        "signal_counts": shown.counts[largest] - shown.counts[least],
        "noise_force_N": hidden[least - (largest < least)],
        "least_noise_force_N": hidden.min(axis=0),
        "saturation_N": saturation_force(circuit, force, light),
    }
