"""Studies as NetCDF files: of version 4 with h5netcdf, of version 3 without, both read back alike."""

from __future__ import annotations

import subprocess
import sys
from importlib.util import find_spec

import numpy as np
import pytest
import xarray as xr

from mitsuba_taxel.studies.store import netcdf
from mitsuba_taxel.studies.store.netcdf import read_netcdf, write_netcdf


@pytest.fixture
def study():
    power = ("step", "taxel"), np.arange(6.0).reshape(3, 2), {"units": "W"}
    words = ("step", np.array(["a", "", "\u00b5 b"]))
    forces = {"fz": ("step", [0.0, -1.0, -2.0])}
    return xr.Dataset({"power": power, "touched": words}, forces, {"notes": "one, \u00b5W", "long": 200_000 * "x"})


@pytest.fixture
def without_h5netcdf(monkeypatch):
    monkeypatch.setattr(netcdf, "find_spec", lambda name: None)


def test_version_3_is_that_of_xarray_to_the_byte(study, tmp_path, without_h5netcdf):
    write_netcdf(study, tmp_path / "ours.nc")
    study.to_netcdf(tmp_path / "theirs.nc", engine="scipy")
    assert (tmp_path / "ours.nc").read_bytes() == (tmp_path / "theirs.nc").read_bytes()
    read = read_netcdf(tmp_path / "ours.nc")
    xr.testing.assert_identical(read.drop_vars("touched"), study.drop_vars("touched"))
    assert read.touched.values.tolist() == study.touched.values.tolist()


def test_version_4_is_read_by_h5py_xarray_and_us(study, tmp_path):
    h5py = pytest.importorskip("h5py")
    pytest.importorskip("h5netcdf")
    write_netcdf(study, tmp_path / "ours.nc")
    with h5py.File(tmp_path / "ours.nc") as file:
        np.testing.assert_array_equal(file["power"][:], study.power)
        assert file["power"].attrs["units"] == "W" and file.attrs["notes"] == "one, \u00b5W"
        assert file["touched"].asstr()[:].tolist() == ["a", "", "\u00b5 b"]
    for read in (xr.load_dataset(tmp_path / "ours.nc"), read_netcdf(tmp_path / "ours.nc")):
        xr.testing.assert_equal(read, study)
        assert read.attrs == study.attrs and read.power.attrs == study.power.attrs
    write_netcdf(study, tmp_path / "again.nc")
    assert (tmp_path / "ours.nc").read_bytes() == (tmp_path / "again.nc").read_bytes()


def test_files_of_before_stay_readable(study, tmp_path):
    """Version 3, with h5netcdf installed or not."""
    study.to_netcdf(tmp_path / "old.nc", engine="scipy")
    read = read_netcdf(tmp_path / "old.nc")
    xr.testing.assert_identical(read.power, study.power)


def test_version_4_without_h5netcdf_says_what_to_install(study, tmp_path, monkeypatch):
    pytest.importorskip("h5netcdf")
    write_netcdf(study, tmp_path / "ours.nc")
    monkeypatch.setattr(netcdf, "find_spec", lambda name: None)
    with pytest.raises(OSError, match="is NetCDF 4, which needs h5netcdf: pip install h5netcdf h5py"):
        read_netcdf(tmp_path / "ours.nc")


@pytest.mark.parametrize("installed", [True, False])
def test_a_folder_that_is_not_there_is_an_error(study, tmp_path, monkeypatch, installed):
    if not installed:
        monkeypatch.setattr(netcdf, "find_spec", lambda name: None)
    elif find_spec("h5netcdf") is None:
        pytest.skip("h5netcdf is not installed")
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


def test_h5netcdf_without_h5py_writes_version_3(study, tmp_path, monkeypatch):
    """h5netcdf does not install h5py, without which it can neither read nor write."""
    monkeypatch.setattr(netcdf, "find_spec", lambda name: None if name == "h5py" else object())
    netcdf.write_netcdf(study, tmp_path / "a.nc")
    assert (tmp_path / "a.nc").read_bytes().startswith(b"CDF")
