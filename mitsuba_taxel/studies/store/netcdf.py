"""Studies as NetCDF files."""

from __future__ import annotations

from pathlib import Path

import xarray as xr
from xarray.backends import ScipyDataStore


def write_netcdf(study: xr.Dataset, file: Path) -> None:
    """Write a study to a NetCDF 3 file, byte for byte as ``study.to_netcdf`` does.

    ``to_netcdf`` imports all of Dask's scheduler where that is installed, which takes most of a second.

    Parameters
    ----------
    study : xr.Dataset
        Study of one scene.
    file : Path
        Output file, which is replaced if it exists.

    Raises
    ------
    OSError
        if the file cannot be written.
    """
    with ScipyDataStore(str(file), mode="w", lock=False) as store:
        study.dump_to_store(store)
