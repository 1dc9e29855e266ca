"""Figures of a study behind a circuit: volts and counts at rest and per newton, noise-equivalent force, saturation."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from mitsuba_taxel.characterise.experiment import Branch
from mitsuba_taxel.characterise.load_lines import loading_lines, runs
from mitsuba_taxel.characterise.roles import with_forces_named
from mitsuba_taxel.characterise.shape_error import changed_by_shape, with_shape
from mitsuba_taxel.characterise.slopes import slopes
from mitsuba_taxel.electronics import Circuit, in_volts, respond, saturation_force, total_noise
from mitsuba_taxel.electronics.noise import FEW_COUNTS, resolution_notes, unused_range

if TYPE_CHECKING:
    import pandas

MOST_NAMED = 5
"""Largest number of saturated taxels that are named individually."""


def volts_table(study: xr.Dataset | xr.DataTree, circuit: Circuit, up_to: float = math.inf) -> pandas.DataFrame:
    """Table of the voltage, counts, noise and saturation of each taxel along each line of load of a study.

    Parameters
    ----------
    study : xr.Dataset or xr.DataTree
        Results with readings in W.
    circuit : Circuit
        Phototransistor, load, buffer and converter.
    up_to : float
        Largest force that is used, N.

    Returns
    -------
    pandas.DataFrame
        One row per line of load and taxel; no row if no force is varied. Columns: ``force``; the other varied
        parameters; ``taxel``; ``rest_V``, ``rest_counts`` and ``noise_V`` (1 sigma) at the least force;
        ``mean_slope_V_per_N`` and its ``_error``, between the ends of the line, and ``mean_slope_counts_per_N``;
        ``signal_counts``, the counts between the least and the largest force; ``noise_force_N``, the noise as a force
        at the first step, and ``least_noise_force_N``, the least over all steps, both infinite where the output exceeds
        the full scale of the converter; ``saturation_N``, the least force at which the output reaches the limit of the
        circuit, with power linear between the forces, NaN if the output does not reach the limit.
    """
    import pandas

    leaves = (
        [("", study)] if isinstance(study, xr.Dataset) else [(node.name, node.to_dataset()) for node in study.leaves]
    )
    return pandas.DataFrame(
        [
            {"force": row.pop("force"), **({"scene": name} if name else {}), **row}
            for name, leaf in leaves
            for row in _rows(leaf, circuit, up_to)
        ]
    )


def volts_notes(table: pandas.DataFrame, circuit: Circuit | None) -> list[str]:
    """Notes on the limits of the figures of a :func:`volts_table`: saturated taxels, an unused range of the converter,
    few counts of signal, and noise below the step of the converter.

    Parameters
    ----------
    table : pandas.DataFrame
        Result of :func:`volts_table`.
    circuit : Circuit or None
        Circuit of the study.

    Returns
    -------
    list[str]
        Notes; empty without a circuit.
    """
    if circuit is None or not len(table):
        return []
    notes = []
    saturated = table[table.saturation_N.notna()]
    if len(saturated):
        at_rest = (saturated.saturation_N == 0) | (saturated.rest_counts == 2**circuit.adc_bits - 1)
        # Columns before that of the taxel are varied; those that distinguish rows are named.
        varied = [name for name in table.columns[: table.columns.get_loc("taxel")] if table[name].nunique() > 1]
        taxels = [
            f"taxel {row['taxel']}{_where(row, varied)} "
            + ("at rest" if rest else f"from {row['saturation_N']:.4g} N on")
            for row, rest in zip(saturated.to_dict("records"), at_rest, strict=True)
        ]
        remainder = f" and {len(taxels) - MOST_NAMED} more" if len(taxels) > MOST_NAMED else ""
        notes.append(
            f"Saturated (output of {circuit.limit:.4g} V or more; full scale {circuit.full_scale:.4g} V): "
            f"{', '.join(taxels[:MOST_NAMED])}{remainder}. "
            "Slopes and noise-equivalent forces are valid up to that force only."
        )
    notes += unused_range(circuit, int(np.maximum(table.rest_counts, table.rest_counts + table.signal_counts).max()))
    signal = int(table.signal_counts.abs().max())
    if signal < FEW_COUNTS and not len(saturated):
        notes.append(f"Counts of signal, from the least force to the largest: {signal} at most.")
    return [*notes, *resolution_notes(circuit.step, table.noise_V.to_numpy())]


def _where(row: dict[Any, Any], varied: list[str]) -> str:
    """Text with the values of varied parameters, such as `` of spacing = 0.8``; empty if there are none."""
    words = [f"{value:g}" if isinstance(value, float) else value for value in (row[name] for name in varied)]
    values = ", ".join(f"{name} = {word}" for name, word in zip(varied, words, strict=True))
    return f" of {values}" if values else ""


def _rows(study: xr.Dataset, circuit: Circuit, up_to: float) -> Iterator[dict[str, Any]]:
    """Table rows of a scene behind a circuit: one for each line of load, combination of the other parameters, and
    taxel."""
    # Readings in watts, in volts, and in volts changed by each mode of the errors of the shape.
    study = with_forces_named(study)
    changed_studies = changed_by_shape(study)
    watts = (study, *(changed for pair in changed_studies.values() for changed in pair))
    studies = (study, *(in_volts(readings, circuit) for readings in watts))

    for line in loading_lines(study):
        for (where, power), *voltages in zip(*(runs(readings, line) for readings in studies), strict=True):
            within = np.abs(power.force) <= up_to
            if within.sum() < 2:
                continue
            derived = voltages[0][1].tangents is not None
            unchanged, *changed_slopes = (slopes(voltage.part(within)) for _, voltage in voltages)
            means = [changed.mean_slope for changed in changed_slopes]
            pairs = {mode: means[2 * index : 2 * index + 2] for index, mode in enumerate(changed_studies)}
            error = with_shape(unchanged.mean_slope_error, unchanged.mean_slope, pairs, derived)
            figures = _figures(circuit, power.part(within), unchanged.mean_slope, error)
            for index, taxel in enumerate(study.taxel.values.tolist()):
                row = {name: values[index].item() for name, values in figures.items()}
                yield {"force": line.name, **where, **line.constant, "taxel": taxel, **row}


def _figures(circuit: Circuit, power: Branch, slope: np.ndarray, error: np.ndarray) -> dict[str, np.ndarray]:
    """Figures (channels,) of a run behind a circuit, such as the voltage at rest and the noise. The first step of the
    run goes from the least force towards the largest.
    """
    order = np.argsort(power.force)
    force, light = power.force[order], np.maximum(power.value[order], 0.0)
    shown, noise = respond(circuit, light), total_noise(circuit, light)

    # Noise over slope at each step: the force that the noise hides. Where the output is saturated, nothing is read.
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
