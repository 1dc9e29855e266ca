"""Studies as NetCDF files."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest
import xarray as xr

from mitsuba_taxel.studies.store.netcdf import write_netcdf


@pytest.fixture
def study():
    power = ("step", "taxel"), np.arange(6.0).reshape(3, 2), {"units": "W"}
    return xr.Dataset({"power": power}, {"fz": ("step", [0.0, -1.0, -2.0])}, {"notes": "one, \u00b5W"})


def test_the_file_is_that_of_xarray(study, tmp_path):
    write_netcdf(study, tmp_path / "ours.nc")
    study.to_netcdf(tmp_path / "theirs.nc", engine="scipy")
    assert (tmp_path / "ours.nc").read_bytes() == (tmp_path / "theirs.nc").read_bytes()
    xr.testing.assert_identical(xr.load_dataset(tmp_path / "ours.nc"), study)


def test_a_folder_that_is_not_there_is_an_error(study, tmp_path):
    with pytest.raises(OSError):
        write_netcdf(study, tmp_path / "nowhere" / "ours.nc")


def test_dasks_scheduler_is_not_imported(tmp_path):
    code = (
        "import sys, pathlib, xarray\n"
        "from mitsuba_taxel.studies.store.netcdf import write_netcdf\n"
        "write_netcdf(xarray.Dataset({'power': ('taxel', [1.0])}), pathlib.Path('ours.nc'))\n"
        "assert 'distributed' not in sys.modules\n"
    )
    subprocess.run([sys.executable, "-c", code], cwd=tmp_path, check=True)
