"""Store of a rerun's studies on disk: a NetCDF file for each study, which is computed once."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import xarray as xr

from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.base.files.atomic import replacing
from mitsuba_taxel.studies.plan.files import make_folder
from mitsuba_taxel.studies.store.dataset import stage_totals
from mitsuba_taxel.studies.store.netcdf import read_netcdf, write_netcdf


class MissingStudy(LookupError):
    """Error: a study is missing, and the store is read-only."""


class PaperStudies:
    """Store of studies in the folder of a rerun, by names such as ``nominal/hemispheric_fz``.

    Parameters
    ----------
    folder : Path
        Folder of the rerun, which is created if it does not exist.
    announce : Callable[[str], None], optional
        Called with the name of a study before it is computed. Without it, the store is read-only: no study is computed.

    Attributes
    ----------
    seconds : dict[str, float]
        Computing time in s of the studies computed so far, by stage, summed over processes.
    """

    def __init__(self, folder: Path, announce: Callable[[str], None] | None = None) -> None:
        make_folder(folder)
        self.folder, self.announce = folder, announce
        self.seconds: dict[str, float] = {}

    def study(self, name: str, request: Mapping[str, Any], compute: Callable[[], xr.Dataset]) -> xr.Dataset:
        """Read a study from its file, or compute it and store it atomically.

        Parameters
        ----------
        request : Mapping[str, Any]
            Settings of the study, as JSON values. They are stored as an attribute, together with the time
            ``wall_seconds``.

        Raises
        ------
        InputError
            if the file is of a study with other settings.
        MissingStudy
            if there is no file and the store is read-only.
        """
        file, request_text = self.folder / f"{name}.nc", json.dumps(request, sort_keys=True)
        if file.is_file():
            stored = read_netcdf(file)
            if stored.attrs["request"] != request_text:
                raise InputError(f"{file} is of a study with other settings: use a new folder, or delete the file.")
            return stored
        if self.announce is None:
            raise MissingStudy(name)
        self.announce(name)
        start = time.perf_counter()
        study = compute()
        study.attrs.update(request=request_text, wall_seconds=time.perf_counter() - start)
        if "stage" in study.dims:
            add_seconds(self.seconds, stage_totals(study))
        make_folder(file.parent)
        with replacing(file) as temporary:
            write_netcdf(study, temporary)
        return study


def add_seconds(totals: dict[str, float], more: Mapping[str, float]) -> None:
    """Add the seconds of each stage in ``more`` to ``totals``."""
    for stage, seconds in more.items():
        totals[stage] = totals.get(stage, 0.0) + seconds
