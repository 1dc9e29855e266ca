"""Studies as NetCDF files."""

from __future__ import annotations

from collections.abc import Mapping
from importlib.util import find_spec
from pathlib import Path

import xarray as xr
from xarray.backends import ScipyDataStore


def has_hdf5() -> bool:
    """Whether HDF5 files can be read and written: h5netcdf needs h5py, which it does not install.

    Returns
    -------
    bool
        True if both packages are installed.
    """
    return all(find_spec(name) is not None for name in ("h5netcdf", "h5py"))


def write_netcdf(study: xr.Dataset, file: Path) -> None:
    """Write a study to a NetCDF file as ``study.to_netcdf`` does: NetCDF 4 if h5netcdf is installed, else NetCDF 3.

    If Dask is installed, ``to_netcdf`` imports its scheduler, which takes nearly a second. NetCDF 4 is HDF5, which
    ``h5py`` can read, too; NetCDF 3 needs only SciPy.

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
    if has_hdf5():
        file.write_bytes(hdf5_image({"/": study}))
        return
    with ScipyDataStore(str(file), mode="w", lock=False) as store:
        study.dump_to_store(store)


def hdf5_image(groups: Mapping[str, xr.Dataset]) -> bytes:
    """An HDF5 file in memory, which NetCDF 4 tools can read.

    HDF5 itself must not write to the disk: if the disk is full, the library ends the process by a segmentation fault.

    Parameters
    ----------
    groups : mapping of str to xr.Dataset
        Datasets by group; ``/`` is the root.

    Returns
    -------
    bytes
        Contents of the file.
    """
    import h5netcdf
    import h5py
    from xarray.backends import H5NetCDFStore

    with h5py.File("memory", "w", driver="core", backing_store=False, track_order=True) as file:
        with h5netcdf.File(file, "w") as netcdf:
            for name, dataset in groups.items():
                group = netcdf if name == "/" else netcdf.create_group(name)
                dataset.dump_to_store(H5NetCDFStore(group, mode="a", lock=False))
        file.flush()
        return file.id.get_file_image()


def read_netcdf(file: Path) -> xr.Dataset:
    """Read a study that :func:`write_netcdf` wrote, with or without h5netcdf.

    Parameters
    ----------
    file : Path
        NetCDF file.

    Returns
    -------
    xr.Dataset
        The study, in memory.

    Raises
    ------
    OSError
        if the file cannot be read, or is NetCDF 4 and h5netcdf is not installed.
    """
    with open(file, "rb") as opened:
        is_hdf5 = opened.read(4) == b"\x89HDF"
    if is_hdf5 and not has_hdf5():
        raise OSError(f"{file} is NetCDF 4, which needs h5netcdf: pip install h5netcdf h5py")
    return xr.load_dataset(file, engine="h5netcdf" if is_hdf5 else "scipy")
