"""Texts on readings and their errors, common to terminal, notebook and web page."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING

from mitsuba_taxel.base.text_table import text_table
from mitsuba_taxel.base.units import in_percent

if TYPE_CHECKING:
    import xarray as xr

    from mitsuba_taxel.sensing.audit import EnergyAudit
    from mitsuba_taxel.sensing.derivative_values import Derivatives
    from mitsuba_taxel.sensing.readings import Crosstalk, Readings


def readings_text(readings: Readings, width: int | None = None) -> str:
    """Power, error and photocurrent per taxel, explanations, the error budget, the time by stage, and derivatives.

    ``width`` is that of a line in characters, as for `text_table`; this holds for the other texts, too.
    """
    columns = readings_columns(readings)
    lines = [
        text_table(list(columns), zip(*columns.values(), strict=True), width),
        light_error_line(readings),
        *readings.notes,
        budget_line(readings.error_budget),
        stage_line(readings.seconds),
    ]
    if readings.derivatives is not None:
        lines += ["", derivatives_text(readings.derivatives, width)]
    return "\n".join(lines)


def derivatives_text(derivatives: Derivatives, width: int | None = None) -> str:
    """Derivatives of each taxel's reading, each with its standard error."""
    columns = derivative_columns(derivatives)
    table = text_table(list(columns), zip(*columns.values(), strict=True), width)
    return f"Derivatives of the readings ({derivatives.method}), +- standard error\n{table}"


def crosstalk_text(crosstalk: Crosstalk, width: int | None = None) -> str:
    """The power that each LED brings to each phototransistor, each with its standard error."""
    taxels = [str(taxel) for taxel in range(1, len(crosstalk.power) + 1)]
    rows = (
        (led, *(f"{power:.3e} +- {error:.0e}" if error else f"{power:g}" for power, error in zip(*of, strict=True)))
        for led, *of in zip(taxels, crosstalk.power, crosstalk.standard_error, strict=True)
    )
    title = "Crosstalk: power [W] from each LED (row) on each phototransistor (column), +- standard error"
    return f"{title}\n{text_table(('LED', *taxels), rows, width)}"


def audit_text(audit: EnergyAudit, width: int | None = None) -> str:
    """Shares of the emitted light by the place where it ends, with their standard errors."""
    rows = [
        *zip(audit.places, audit.share, audit.standard_error, strict=True),
        ("total", audit.total, audit.total_error),
    ]
    cells = ((place, f"{share:.6f}", f"{error:.1e}") for place, share, error in rows)
    table = text_table(("place", "share", "standard error"), cells, width)
    return f"Energy audit: share of the power that all LEDs emit\n{table}"


def readings_columns(readings: Readings) -> dict[str, list[str]]:
    """Columns of a table by heading, a row for each taxel: power, its errors and, if it is known, the photocurrent."""
    columns = {
        "taxel": [str(taxel) for taxel in readings.taxel],
        "power [W]": [f"{power:.6e}" for power in readings.power],
    }
    if readings.points:
        columns["light error [W]"] = [f"{error:.1e}" for error in readings.standard_error]
    if readings.deviation is not None:
        columns["mechanics error [W]"] = [f"{error:.1e}" for error in readings.mechanics_error]
    if readings.geometry_error.any():
        columns["geometry error [W]"] = [f"{error:.1e}" for error in readings.geometry_error]
    pairs = zip(readings.power, readings.total_error, strict=True)
    columns["total"] = [f"{error / power:.2%}" if power > 0 else "-" for power, error in pairs]
    if readings.photocurrent is not None:
        columns["photocurrent [A]"] = [f"{current:.6e}" for current in readings.photocurrent]
    return columns


def derivative_columns(derivatives: Derivatives) -> dict[str, list[str]]:
    """Columns of a table by heading, a row for each taxel: the derivative with respect to each parameter, and its
    error."""
    columns = {"taxel": [str(taxel) for taxel in derivatives.taxel]}
    of_parameters = zip(
        derivatives.parameters, derivatives.units, derivatives.values.T, derivatives.standard_errors.T, strict=True
    )
    for name, unit, values, errors in of_parameters:
        pairs = zip(values, errors, strict=True)
        columns[f"{name} [{unit}]"] = [
            f"{value:.4e} +- {'unknown' if math.isnan(error) else f'{error:.0e}'}" for value, error in pairs
        ]
    return columns


def light_error_line(readings: Readings) -> str:
    """The meaning and origin of the light error."""
    if not readings.points:
        return "Light: without random numbers, as all walls are diffuse; its error is part of the geometry's."
    runs = f"{len(readings.replicates)} randomisations of {readings.points} points per taxel"
    return f"Light error: 1 sigma, from {runs}, seed {readings.seed}."


def light_of_study(study: xr.Dataset) -> str:
    """How the light of the readings of a study was computed."""
    if points := study.attrs["points"]:
        return f"from {study.sizes['replicate']} randomisations of {points} points"
    random = int((study.standard_error > 0).sum())
    return f"without random numbers{f', but {random} that need random paths' if random else ''}"


def budget_line(budget: Mapping[str, float]) -> str:
    """``Error of the worst reading: light 0.20%, mechanics 0.30%, geometry 0.01%, total 0.36%``."""
    return f"Error of the worst reading: {', '.join(f'{source} {share}' for source, share in budget_rows(budget))}"


def budget_rows(budget: Mapping[str, float]) -> list[tuple[str, str]]:
    """Each source of error with its share of a reading."""
    return [(source, in_percent(share)) for source, share in budget.items()]


def stage_line(seconds: Mapping[str, float]) -> str:
    """``Seconds: mechanics 3.2, optics 0.4, total 3.6``."""
    stages = [f"{stage} {value:.2f}" for stage, value in seconds.items()]
    return f"Seconds: {', '.join(stages)}, total {sum(seconds.values()):.2f}"
