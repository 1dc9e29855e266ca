"""Sections of the page with text, tables and plots; ``key`` distinguishes the sections of several scenes."""

from __future__ import annotations

import json
from collections.abc import Mapping
from functools import partial

import numpy as np
import xarray as xr

from mitsuba_taxel.base.left_out import LEFT_OUT
from mitsuba_taxel.base.units import prefixed
from mitsuba_taxel.characterise import characteristics, simulated_experiments, symmetric_pairs, volts_notes, volts_table
from mitsuba_taxel.characterise.characteristics import DEVIATIONS
from mitsuba_taxel.characterise.wording import merit_tables, pair_rows, remarks_explained, with_error
from mitsuba_taxel.electronics.volts import circuit_of_study, in_volts
from mitsuba_taxel.plots.characteristics import (
    parameters_of,
    plot_against,
    plot_deviations,
    plot_sensitivity,
    plot_tangential_maps,
)
from mitsuba_taxel.plots.curves import has_taxels_to_compare, plot_curves, plot_taxels
from mitsuba_taxel.plots.maps import plane_of, plane_of_steps, plot_map
from mitsuba_taxel.plots.pad_maps import has_pad_map, plot_pad_map
from mitsuba_taxel.report.page.markup import bullets, folded, paragraph, plot, section, table
from mitsuba_taxel.sensing.reading.wording import budget_rows, light_of_study
from mitsuba_taxel.studies import stage_totals, study_error_budget

MOST_ROWS = 2000
"""Largest number of rows of a table."""


def about(study: xr.Dataset, title: str, key: str) -> str:
    """Section of the page with the scene, its parameters, settings and versions."""
    readings = int(study.power.notnull().sum())
    varied = [
        f"{name}: {span(study[name].values, study[name].attrs.get('units', ''))}"
        for name in study.coords
        if study[name].dims and study[name].dims[0] not in ("taxel", "stage", "replicate") and name != "step"
    ]
    lines = [
        f"Scene {study.attrs['scene']}; {count(study.sizes['taxel'], 'taxel')}; {count(readings, 'reading')}.",
        f"Varied: {'; '.join(varied)}.",
        f"Each reading: {light_of_study(study)}, seed {study.attrs['seed']}.",
        *study.attrs["notes"].splitlines(),
    ]
    failures = study.attrs["failures"].splitlines()
    failed = f'<div class="failed">{paragraph("Failed:")}{bullets(failures)}</div>' if failures else ""
    return section(f"about{key}", title, bullets(lines), failed, *provenance(study))


def count(number: int, what: str) -> str:
    """A number of things in words, such as "2 taxels"."""
    return f"{number} {what}" if number == 1 else f"{number} {what}s"


def span(values: np.ndarray, unit: str) -> str:
    """Values of a varied parameter in words: number, first and last one."""
    if values.dtype.kind not in "fi":
        return ", ".join(map(str, dict.fromkeys(values)))
    if len(values) == 1:
        return f"{values[0]:.6g} {unit}".strip()
    return " ".join(f"{len(values)} values from {values[0]:.6g} to {values[-1]:.6g} {unit}".split())


def provenance(study: xr.Dataset) -> list[str]:
    """HTML of tables, shown when clicked, of the parameters that were not varied and of versions."""
    tables = {"Parameters that were not varied": "parameters", "Versions": "versions"}
    read: dict[str, Mapping[str, str]] = {title: json.loads(study.attrs[name]) for title, name in tables.items()}
    return [folded(title, table(title, ("name", "value"), list(rows.items()))) for title, rows in read.items() if rows]


def power(study: xr.Dataset, key: str) -> str:
    """Section of the page with plot and table of the readings' power against the varied parameters."""
    curve = study.attrs["curve"]
    values = study.power.values[np.isfinite(study.power.values)]
    words = (
        f"Optical power of {study.sizes['taxel']} taxels against {curve}: between {values.min():.4g} and "
        f"{values.max():.4g} W. The table below has the numbers."
    )
    caption = "Bands: total error, of light and mechanics. Bars: one standard error of the light."
    plots = [plot(partial(plot_curves, study), words, caption)]
    circuit = circuit_of_study(study)
    if circuit is not None:
        words = f"Output voltages of {study.sizes['taxel']} taxels against {curve}."
        plots.append(plot(partial(plot_curves, in_volts(study, circuit)), words, f"Output of the circuit. {caption}"))
    if has_taxels_to_compare(study):
        words = "Change of each taxel's reading, one panel for each combination of parameters, with the same axes."
        plots.append(plot(partial(plot_taxels, study), words, "Each taxel's change. Bars: light."))
    plane = plane_of(study) or plane_of_steps(study)
    if plane:
        words = f"Optical power of each taxel as a colour over {plane[0]} and {plane[1]}; all taxels have one scale."
        plots.append(plot(partial(plot_map, study), words, f"Readings over {plane[0]} and {plane[1]}."))
    if has_pad_map(study):
        words = "Optical power of each taxel as the colour of a square at its position; all panels have one scale."
        plots.append(plot(partial(plot_pad_map, study), words, "Readings over the sensor; a cross is the contact."))
    return section(f"power{key}", "Power", *plots, folded("Readings", _readings(study)))


def _readings(study: xr.Dataset) -> str:
    shown = [("power", "total_error", "W"), ("voltage", "voltage_error", "V")]
    shown = [columns for columns in shown if columns[0] in study]
    counts = ["counts"] if "counts" in study else []
    numbers = [*(name for columns in shown for name in columns[:2]), *counts, *(["saturated"] if counts else [])]
    frame = study[numbers].to_dataframe().reset_index()
    keys = [name for name in frame.columns if name not in numbers]
    units = [f" [{study[name].attrs['units']}]" if "units" in study[name].attrs else "" for name in keys]
    scales = [prefixed(float(frame[name].abs().max()), unit) for name, _, unit in shown]
    rows = [
        [
            *(word(record[name]) for name in keys),
            *(
                with_error(record[name] / factor, record[error] / factor)
                for (name, error, _), (factor, _) in zip(shown, scales, strict=True)
            ),
            *(word(record[name]) + (" saturated" if record["saturated"] == 1 else "") for name in counts),
        ]
        for record in frame.head(MOST_ROWS).to_dict("records")
    ]
    headings = [name + unit for name, unit in zip(keys, units, strict=True)]
    headings += [f"{name} [{unit}]" for (name, *_), (_, unit) in zip(shown, scales, strict=True)]
    omitted = left_out(len(frame), "readings.csv holds")
    return table(f"Readings with their total error{omitted}", [*headings, *counts], rows)


def left_out(rows: int, elsewhere: str) -> str:
    """Words for the rows that a table omits; empty text if it has all."""
    return f" (the first {MOST_ROWS} of {rows}: {elsewhere} all)" if rows > MOST_ROWS else ""


def word(value: object) -> str:
    """A value of a table as text."""
    return f"{value:.6g}" if isinstance(value, float) else str(value)


def merit(study: xr.Dataset, key: str) -> str:
    """Section of the page with figures of merit: sensitivity, linearity and tangential maps, in volts too if the study
    has a circuit.

    Empty if no force is varied.
    """
    circuit = circuit_of_study(study)
    simulated = simulated_experiments(study, circuit)
    if not simulated.experiments:
        return ""
    figures, pairs = characteristics(simulated.experiments, simulated.off), symmetric_pairs(simulated.maps)
    volts = None if circuit is None else volts_table(study, circuit)
    limits = [] if volts is None else volts_notes(volts, circuit)
    blocks = []
    for title, (headings, rows) in merit_tables(figures, volts).items():
        if rows:
            omitted = left_out(len(rows), "taxel characterise lists")
            blocks.append(table(f"{title}{omitted}", headings, rows[:MOST_ROWS]))
    blocks += [paragraph(line, "quiet") for line in (*remarks_explained(figures, pairs), *limits)]
    words = "Change of readings against force, and its slope below, also relative to rest; the tables have the numbers."
    caption = "Change since rest, and slope; on the right in percent of the reading at rest. Bars: light."
    blocks.append(plot(partial(plot_sensitivity, simulated.experiments), words, caption))
    if parameters_of(simulated.experiments):
        words = "Mean slope against each varied parameter; the tables have the numbers."
        caption = "Mean slope against the parameter; on the right in percent of the reading at rest. Bars: light."
        blocks.append(plot(partial(plot_against, simulated.experiments), words, caption))
    if len(figures[figures.figure.isin(DEVIATIONS)]):
        words = "Deviation of each taxel's reading from the straight line between its end points, in percent."
        blocks.append(plot(partial(plot_deviations, simulated.experiments), words, "Deviation from the line."))
    if simulated.maps:
        blocks.append(_tangential(simulated.maps, pairs))
    return section(f"merit{key}", "Sensitivity and linearity", *blocks, paragraph(simulated.notes[0], "quiet"))


def _tangential(maps, pairs) -> str:
    words = "Map of the taxels' changes under each tangential load; arrows show the direction of the force."
    caption = "Change of each taxel under a tangential load, with one standard error; x to the right, y upwards."
    headings, rows = pair_rows(pairs)
    numbers = [table("Symmetric pairs under a tangential load", headings, rows)] if rows else []
    return "".join(["<h3>Tangential loads</h3>", plot(partial(plot_tangential_maps, maps), words, caption), *numbers])


def cost(study: xr.Dataset, key: str) -> str:
    """Section of the page with the error budget, and the computing time by stage."""
    errors = budget_rows(study_error_budget(study))
    seconds = stage_totals(study)
    total = sum(seconds.values())
    times = [(stage, f"{value:.2f}", f"{value / total:.0%}") for stage, value in seconds.items() if total > 0]
    times.append(("total", f"{total:.2f}", ""))
    return section(
        f"cost{key}",
        "Error and time",
        table("Error of the worst reading, relative", ("source", "error"), errors),
        paragraph(LEFT_OUT["report"], "quiet"),
        table("Time by stage, summed over processes", ("stage", "seconds", "share"), times),
    )
