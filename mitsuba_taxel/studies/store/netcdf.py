"""Studies as NetCDF files."""

from __future__ import annotations

from pathlib import Path

import xarray as xr
from xarray.backends import ScipyDataStore


def write_netcdf(study: xr.Dataset, file: Path) -> None:
    """Write what ``study.to_netcdf`` writes, which imports all of Dask's scheduler where that is installed."""
    with ScipyDataStore(str(file), mode="w", lock=False) as store:
        study.dump_to_store(store)
