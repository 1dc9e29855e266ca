"""Where a disk is full, no writer leaves a part of a file in place of a good one, and none ends without an error.

A process may limit the size of the files that it writes, which fails as a full disk does.
"""

from __future__ import annotations

import resource
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import xarray as xr

from mitsuba_taxel import ComputationError, InputError, Pad, Scene
from mitsuba_taxel.base.files.atomic import replacing, write_text
from mitsuba_taxel.mechanics import NeoHookean
from mitsuba_taxel.pads import mesh_pad
from mitsuba_taxel.pads.parametric.drawings import write_drawings
from mitsuba_taxel.studies.store.netcdf import hdf5_image, write_netcdf


def written_map(file: Path) -> None:
    from mitsuba_taxel.sensing.reading.irradiance_file import write_irradiance

    about = {"seed": 0, "points": 1, "parameters": {}, "replicates": np.zeros((32, 1))}
    write_irradiance(SimpleNamespace(irradiance=np.ones((4, 4)), **about), file)


def written_picture(file: Path) -> None:
    from mitsuba_taxel.report.picture.drawing import write_picture

    write_picture(np.linspace(0, 1, 3072).reshape(32, 32, 3), file)


def written_mesh(file: Path) -> None:
    import mitsuba as mi

    from mitsuba_taxel.studies.run.deformation import write_mesh

    write_mesh(SimpleNamespace(closed=lambda: mi.Mesh("sheet", 40, 20)), file)


def written_state(file: Path) -> None:
    from mitsuba_taxel.mechanics.results.vtu import write_vtu

    mesh = mesh_pad(Pad(rows=1, columns=1), 3.0)
    write_vtu(file, mesh, np.zeros((len(mesh.points), 3)), np.zeros(mesh.corner_count), NeoHookean())


def written_figure(file: Path) -> None:
    from matplotlib.figure import Figure

    with replacing(file) as temporary:
        Figure().savefig(temporary, format=file.suffix[1:])


def written_readings(file: Path) -> None:
    values = {"power": (("z", "taxel"), np.ones((2, 1))), "standard_error": (("z", "taxel"), np.ones((2, 1)))}
    study = xr.Dataset(values, {"z": [1.0, 2.0], "taxel": [1]})
    with replacing(file) as temporary:
        write_netcdf(study, temporary)


def written_training_set(file: Path) -> None:
    with replacing(file) as temporary:
        groups = {"/": xr.Dataset(attrs={"scene": "a"}), "train": xr.Dataset({"fz": ("row", [1.0])})}
        temporary.write_bytes(hdf5_image(groups))


WRITERS: dict[str, Callable[[Path], None]] = {
    "map.exr": written_map,
    "picture.exr": written_picture,
    "picture.png": written_picture,
    "pad.ply": written_mesh,
    "pad.vtu": written_state,
    "pad.step": lambda file: write_drawings(Pad(rows=1, columns=1), file.parent),
    "figure.svg": written_figure,
    "readings.nc": written_readings,
    "dataset.h5": written_training_set,
    "scene.xml": lambda file: Scene("plate.xml").write_xml(file),
    "page.md": lambda file: write_text(file, "text"),
}


@contextmanager
def files_up_to(size: int) -> Iterator[None]:
    """Files of this process cannot grow beyond ``size`` bytes."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


@pytest.mark.parametrize("name", WRITERS)
def test_a_good_file_stays_where_another_cannot_be_written(name, tmp_path, llvm_mono, painted_figures):
    file = tmp_path / name
    WRITERS[name](file)
    size, others = file.stat().st_size, sorted(tmp_path.iterdir())
    file.write_text("good")
    for limit in (0, size // 2, size - 1):
        with files_up_to(limit), pytest.raises((ComputationError, InputError), match="File too large"):
            WRITERS[name](file)
        assert file.read_text() == "good" and sorted(tmp_path.iterdir()) == others
