"""Summaries of the results of many taxels: smallest, mean and largest value instead of a row for each taxel, and a
small map."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    import pandas
    import xarray as xr

    from mitsuba_taxel.sensing.reading.derivative_values import Derivatives
    from mitsuba_taxel.sensing.reading.readings import Crosstalk, Readings

MOST_ROWS = 64
"""Largest number of taxels with a row each in a terminal."""
MOST_ACROSS = 36
"""Largest number of columns, and of rows, of a map."""
HEADINGS = ("quantity", "least (taxel)", "mean", "most (taxel)")
WITH_JSON = "the same command with --json"


def full_table(count: int, source: str) -> str:
    """Text line with the name of the file that has the rows of all taxels."""
    return f"A row for each of the {count} taxels: {source}."


def summary_rows(
    taxels: Sequence[int], quantities: Mapping[str, np.ndarray], missing: str = "unknown"
) -> list[list[str]]:
    """Table rows with the smallest, mean and largest value of each quantity over all taxels.

    Parameters
    ----------
    taxels : (T,) sequence of int
        Numbers of the taxels.
    quantities : Mapping[str, (T,) ndarray]
        Values by name and unit; NaN where there is none.
    missing : str
        Meaning of NaN.

    Returns
    -------
    list[list[str]]
        A row for each quantity; NaN values are left out and counted beside the name.
    """
    rows = []
    for name, values in quantities.items():
        known = np.flatnonzero(~np.isnan(values))
        if not len(known):
            rows.append([name, missing, missing, missing])
            continue
        ends = (known[values[known].argmin()], known[values[known].argmax()])
        least, most = (f"{values[index]:.4g} ({taxels[index]})" for index in ends)
        left_out = len(values) - len(known)
        label = f"{name}, {left_out} {missing}" if left_out else name
        rows.append([label, least, f"{values[known].mean():.4g}", most])
    return rows


def reading_quantities(readings: Readings) -> dict[str, np.ndarray]:
    """Power, errors and photocurrent of each taxel by name, as input of :func:`summary_rows`."""
    power, total = readings.power, readings.total_error
    quantities = {"power [W]": power}
    if readings.points:
        quantities["light error [W]"] = readings.standard_error
    if readings.deviation is not None:
        quantities["mechanics error [W]"] = readings.mechanics_error
    if readings.geometry_error.any():
        quantities["geometry error [W]"] = readings.geometry_error
    quantities["total error [W]"] = total
    quantities["total error [%]"] = np.divide(100 * total, power, out=np.full_like(power, np.nan), where=power > 0)
    if readings.photocurrent is not None:
        quantities["photocurrent [A]"] = readings.photocurrent
    return quantities


def study_quantities(study: xr.Dataset) -> dict[str, np.ndarray]:
    """Least and largest power, its change and the worst error of each taxel, as :func:`summary_rows` takes them.

    Parameters
    ----------
    study : xr.Dataset
        Study of one scene.

    Returns
    -------
    dict[str, (T,) ndarray]
        Values over all scenes that have a reading.
    """
    taxels = study.sizes["taxel"]
    power, total = (study[name].transpose(..., "taxel").values.reshape(-1, taxels) for name in ("power", "total_error"))
    relative = np.divide(total, power, out=np.zeros_like(power), where=power > 0)  # NaN stays where it is unknown
    least, most = np.nanmin(power, axis=0), np.nanmax(power, axis=0)
    return {
        "least power [W]": least,
        "largest power [W]": most,
        "change of the power [W]": most - least,
        "worst total error [%]": 100 * relative.max(axis=0),
    }


def derivative_quantities(derivatives: Derivatives) -> dict[str, np.ndarray]:
    """Derivatives with respect to each parameter, and their standard errors, by name, as input of :func:`summary_rows`.
    """
    quantities = {}
    for number, (name, unit) in enumerate(zip(derivatives.parameters, derivatives.units, strict=True)):
        quantities[f"{name} [{unit}]"] = derivatives.values[:, number]
        quantities[f"{name}, standard error [{unit}]"] = derivatives.standard_errors[:, number]
    return quantities


def crosstalk_quantities(crosstalk: Crosstalk) -> dict[str, np.ndarray]:
    """Power on each phototransistor by its own and by the other LEDs, by name, as input of :func:`summary_rows`."""
    own = np.diag(crosstalk.power)
    others = crosstalk.power - np.diag(own)
    return {
        "own LED [W]": own,
        "all other LEDs [W]": others.sum(axis=0),
        "strongest other LED [W]": others.max(axis=0),
        "largest error of an LED's power [W]": crosstalk.total_error.max(axis=0),
    }


def slope_rows(slopes: pandas.DataFrame, figures: Sequence[str]) -> list[list[str]]:
    """Rows of a table with `HEADINGS` for figures of many taxels and their errors.

    Parameters
    ----------
    slopes : pandas.DataFrame
        Result of `slope_summary`, whose rows belong to taxels.
    figures : sequence of str
        Names of figures; names that are not in the table are ignored.

    Returns
    -------
    list[list[str]]
        Two rows for each line of load and figure.
    """
    numbers = ("figure", "taxel", "loading", "value", "error", "unit", "at_N", "from_N", "to_N", "remark")
    keys = [name for name in slopes.columns if name not in numbers]
    rows = []
    for values, line in slopes.groupby(keys, sort=False, dropna=False):
        where = ", ".join(map(str, values))
        for figure in figures:
            chosen = line[line.figure == figure]
            if len(chosen):
                name, unit = f"{figure.replace('_', ' ')}, {where}", f"[{chosen.unit.iloc[0]}]"
                columns = {f"{name} {unit}": chosen.value, f"{name}, error {unit}": chosen.error}
                taxels = chosen.taxel.tolist()
                rows += summary_rows(taxels, {key: column.to_numpy(float) for key, column in columns.items()})
    return rows


def volts_rows(volts: pandas.DataFrame) -> list[list[str]]:
    """Rows of a table with `HEADINGS` for circuit figures of many taxels.

    Parameters
    ----------
    volts : pandas.DataFrame
        Result of `volts_table`.

    Returns
    -------
    list[list[str]]
        A row for each line of load and column with a unit; NaN is a force that is not reached.
    """
    from mitsuba_taxel.characterise.wording import CIRCUIT_UNITS

    units = {**{f"{suffix}_error": unit for suffix, unit in CIRCUIT_UNITS.items()}, **CIRCUIT_UNITS}
    columns = {name: next((end for end in units if str(name).endswith(end)), None) for name in volts.columns}
    keys = [name for name, end in columns.items() if end is None and name != "taxel"]
    rows = []
    for values, line in volts.groupby(keys, sort=False, dropna=False):
        where = ", ".join(map(str, values))
        quantities = {
            f"{name.removesuffix(end).replace('_', ' ')}{', error' * end.endswith('_error')}, {where} [{units[end]}]": (
                line[name].to_numpy(float)
            )
            for name, end in columns.items()
            if end is not None
        }
        rows += summary_rows(line.taxel.tolist(), quantities, missing="not reached")
    return rows


def map_lines(values: np.ndarray, positions: np.ndarray, unit: str) -> list[str]:
    """Text map of values over the board: digits from 0 (smallest value) to 9 (largest), and a legend.

    Parameters
    ----------
    values : (T,) ndarray
        Values of the taxels.
    positions : (T, 2) ndarray
        Their positions along x and y.
    unit : str
        Unit of the values.

    Returns
    -------
    list[str]
        The legend, then rows from the largest y to the least; taxels in the same cell of the map are averaged.
    """
    from scipy.spatial import KDTree

    # Cells are as large as the distance of neighbours. Where two taxels would then share a cell, the diagonal of cells
    # is that distance.
    distances, _ = KDTree(positions).query(positions, k=2)
    distance = float(np.median(np.asarray(distances)[:, 1]))
    offsets = positions - positions.min(axis=0)
    smallest = float(offsets.max()) / (MOST_ACROSS - 1)
    for side in (distance, distance / np.sqrt(2)):
        columns, rows = np.rint(offsets / (max(side, smallest) or 1.0)).astype(int).T
        counts = np.zeros((rows.max() + 1, columns.max() + 1), dtype=int)
        np.add.at(counts, (rows, columns), 1)
        if counts.max() == 1:
            break

    # Values of cells as digits, in equal steps between the ends.
    sums = np.zeros(counts.shape)
    np.add.at(sums, (rows, columns), values)
    means = sums / np.maximum(counts, 1)
    low, high = means[counts > 0].min(), means[counts > 0].max()
    digits = np.clip(10 * (means - low) / ((high - low) or 1.0), 0, 9).astype(int)
    averaged = "" if counts.max() == 1 else f"; a digit is the mean of up to {counts.max()} taxels"
    legend = f"Map from 0 = {low:.4g} {unit} to 9 = {high:.4g} {unit}, x to the right, y upwards{averaged}:"
    lines = [
        " ".join(str(digit) if count else " " for digit, count in zip(*row, strict=True)).rstrip()
        for row in zip(digits[::-1], counts[::-1], strict=True)
    ]
    return [legend, *lines]
