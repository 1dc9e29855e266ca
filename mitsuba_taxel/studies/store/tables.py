"""Output files of a study: NetCDF, CSV, summary and plot, each written atomically."""

from __future__ import annotations

from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING

import xarray as xr

from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.base.files.atomic import replacing, write_text
from mitsuba_taxel.characterise import resolution, sensitivity_table, volts_table
from mitsuba_taxel.electronics.volts import VOLTS, circuit_of_study, in_volts
from mitsuba_taxel.plots.curves import has_taxels_to_compare, plot_curves, plot_taxels
from mitsuba_taxel.plots.figures import save_figure
from mitsuba_taxel.plots.maps import has_map, plane_of, plot_map, plot_resolution
from mitsuba_taxel.plots.pad_maps import has_pad_map, plot_pad_map
from mitsuba_taxel.sensing.reading.results import PARAMETER, RESULTS
from mitsuba_taxel.studies.store.netcdf import write_netcdf

if TYPE_CHECKING:
    import pandas


def write_readings(study: xr.Dataset, folder: Path, parquet: bool = False) -> None:
    """Write the readings of a study to ``readings.nc`` and ``readings.csv``.

    Parameters
    ----------
    study : xr.Dataset
        Results of ``sweep``.
    folder : Path
        Existing folder.
    parquet : bool
        Whether to write the table as ``readings.parquet`` too.
    """
    table = _readings(study)
    with replacing(folder / "readings.nc") as file:
        write_netcdf(study, file)
    write_text(folder / "readings.csv", "\n".join(_head(study)) + "\n" + table.to_csv(index=False))
    if parquet:
        with replacing(folder / "readings.parquet") as file:
            table.to_parquet(file, engine="pyarrow", index=False)


def write_summary(study: xr.Dataset, folder: Path) -> None:
    """Write the slopes along each force to ``summary.csv``; nothing is written if no force is varied."""
    slopes = summary_table(study)
    if len(slopes):
        with replacing(folder / "summary.csv") as file:
            slopes.to_csv(file, index=False)


def write_resolution(study: xr.Dataset, folder: Path) -> None:
    """Write the resolution of a study over the contact position: ``resolution.csv``, ``.png`` and ``.svg``.

    Nothing is written unless the study has derivatives, a circuit, and contact positions varied in x and y.
    """
    if plane_of(study) is None or "derivative" not in study or circuit_of_study(study) is None:
        return
    resolutions = resolution(study)
    with replacing(folder / "resolution.csv") as file:
        resolutions[["resolution", "resolution_error"]].to_dataframe().reset_index().to_csv(file, index=False)
    save_figure(plot_resolution(resolutions), folder, "resolution")


def draw_results(study: xr.Dataset, folder: Path) -> None:
    """Draw the readings, as ``power.png`` and ``power.svg``.

    With a circuit, ``voltage.png`` and ``voltage.svg`` are drawn too; if curves of several taxels are compared,
    ``taxels.png`` and ``taxels.svg``; if a position in x and y is varied, ``map.png`` and ``map.svg``; of more than 64
    taxels, ``pad.png`` and ``pad.svg``.
    """
    plots: dict[str, Callable] = {
        "power": plot_curves,
        **({"taxels": plot_taxels} if has_taxels_to_compare(study) else {}),
    }
    if has_map(study):
        plots["map"] = plot_map
    if has_pad_map(study):
        plots["pad"] = plot_pad_map
    for name, plot in plots.items():
        save_figure(plot(study), folder, name)
    circuit = circuit_of_study(study)
    if circuit is not None:
        save_figure(plot_curves(in_volts(study, circuit)), folder, "voltage")


def summary_table(study: xr.Dataset) -> pandas.DataFrame:
    """Slopes by each varied force, in W/N and, with a circuit, in V/N and counts/N.

    Parameters
    ----------
    study : xr.Dataset
        Study of one scene.

    Returns
    -------
    pandas.DataFrame
        A row per line of load and taxel.
    """
    table, circuit = sensitivity_table(study), circuit_of_study(study)
    volts = () if circuit is None else volts_table(study, circuit)
    return table.merge(volts, how="left") if len(volts) else table


def check_parquet() -> None:
    """Raise `InputError` if Parquet files cannot be written here."""
    if find_spec("pyarrow") is None:
        raise InputError("parquet needs pyarrow: pip install pyarrow.")


def _head(study: xr.Dataset) -> list[str]:
    """Lines for the head of a CSV file, starting with #, with the provenance of the numbers."""
    lines = [f"# {name}: {study.attrs[name]}" for name in ("scene", "parameters", "seed", "points", "versions")]
    return lines + [f"# {note}" for note in study.attrs["notes"].splitlines()]


def _readings(study: xr.Dataset) -> pandas.DataFrame:
    """Table of a study with one row for each scene and taxel: all results that belong in tables, voltages, and the
    files of pads."""
    # Results with a value for each scene and taxel.
    listed = [result for result in RESULTS if result.in_table and result.name in study]
    by_parameter = {result.name for result in listed if PARAMETER in result.per}
    names = [*(result.name for result in listed if result.name not in by_parameter), *VOLTS, "mesh"]
    names = [name for name in names if name in study]
    dims = [str(dim) for dim in study.power.dims]
    together = [str(name) for name in study.power.coords if name not in dims]
    table = study[names].to_dataframe(dim_order=dims).reset_index()[[*dims[:-1], *together, dims[-1], *names]]
    units = {name: study[name].attrs.get("units") for name in table.columns}
    table.columns = [f"{name}_{units[name]}" if units[name] not in (None, "1") else name for name in table.columns]

    # Results by parameter get a column for each parameter.
    for result in listed if by_parameter else ():
        if result.name in by_parameter:
            for number, parameter in enumerate(study[PARAMETER].values):
                values = study[result.name].isel({PARAMETER: number})
                unit = f"_{study.derivative_unit.values[number]}" if values.dtype.kind == "f" else ""
                table[f"{result.name}_{parameter}{unit}"] = (
                    values.broadcast_like(study.power).transpose(*dims).values.ravel()
                )
    return table
