"""A study on disk: NetCDF, CSV, summary and plot, each file written whole or not at all."""

from __future__ import annotations

from pathlib import Path

import xarray as xr

from mitsuba_taxel.characterise import sensitivity_table
from mitsuba_taxel.report.curves import plot_curves
from mitsuba_taxel.studies.files import replacing


def write_study(study: xr.Dataset, folder: Path) -> None:
    """Write ``readings.nc``, ``readings.csv``, ``power.png`` and, if a force is varied, ``summary.csv``."""
    with replacing(folder / "readings.nc") as file:
        study.to_netcdf(file, engine="scipy")
    with replacing(folder / "readings.csv") as file:
        file.write_text(_readings_csv(study), encoding="utf-8")
    with replacing(folder / "power.png") as file:
        plot_curves(study, file)
    table = sensitivity_table(study)
    if len(table):
        with replacing(folder / "summary.csv") as file:
            table.to_csv(file, index=False)


def _readings_csv(study: xr.Dataset) -> str:
    """One row per scene and taxel, after lines that start with # and tell where the numbers come from."""
    head = [f"# {name}: {study.attrs[name]}" for name in ("scene", "parameters", "seed", "points", "versions")]
    head += [f"# {note}" for note in study.attrs["notes"].splitlines()]
    units = {name: variable.attrs.get("units") for name, variable in study.variables.items()}
    names = ["power", "standard_error", *(["mesh"] if "mesh" in study else [])]
    table = study[names].to_dataframe().reset_index()
    table = table[[*(name for name in study.power.dims), *names]]
    table.columns = [f"{name}_{units[name]}" if units[name] not in (None, "1") else name for name in table.columns]
    return "\n".join(head) + "\n" + table.to_csv(index=False)
