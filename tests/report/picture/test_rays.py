"""Pictures of light paths, and their VTK file read back."""

from __future__ import annotations

import numpy as np
import pytest

from mitsuba_taxel import InputError, Scene
from mitsuba_taxel.report.picture.rays import PICTURES, plot_paths, write_vtk
from mitsuba_taxel.sensing import RayPaths, sample_paths
from mitsuba_taxel.studies.plan.files import check_new_file


@pytest.mark.usefixtures("painted_figures")
@pytest.mark.parametrize("suffix, start", [(".png", b"\x89PNG"), (".svg", b"<?xml"), (".pdf", b"%PDF")])
def test_picture_by_suffix(llvm_mono, tmp_path, suffix, start):
    live = Scene.from_file("plate.xml").load()
    file = tmp_path / f"rays{suffix}"
    check_new_file(file, *PICTURES)
    plot_paths(live, sample_paths(live, 1, count=20), "plate.xml", file)
    assert file.read_bytes().startswith(start)


def test_picture_of_other_kinds_is_refused(tmp_path):
    with pytest.raises(InputError, match=r"rays\.bmp must end in"):
        check_new_file(tmp_path / "rays.bmp", *PICTURES)


def test_vtk_polylines(tmp_path):
    """Points, connectivity, and two numbers for each line."""
    vertices = [np.arange(6.0).reshape(2, 3), np.arange(9.0).reshape(3, 3) / 7]
    file = tmp_path / "rays.vtk"
    write_vtk(RayPaths(vertices, np.array([True, False]), np.array([0.25, 1e-9]), 1, 4, 1), file)
    lines = file.read_text().splitlines()
    assert lines[:4:2] == ["# vtk DataFile Version 3.0", "ASCII"] and lines[3:5] == [
        "DATASET POLYDATA",
        "POINTS 5 double",
    ]
    points = np.array([line.split() for line in lines[5:10]], dtype=float)
    assert points == pytest.approx(np.concatenate(vertices), rel=1e-8)
    assert lines[10:14] == ["LINES 2 7", "2 0 1", "3 2 3 4", "CELL_DATA 2"]
    assert lines[14:18] == ["SCALARS reached int 1", "LOOKUP_TABLE default", "1", "0"]
    assert lines[18:] == ["SCALARS power double 1", "LOOKUP_TABLE default", "0.25", "1e-09"]
