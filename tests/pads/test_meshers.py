"""Pads where a mesher is not installed: one line that says which and how to install it, before work."""

from __future__ import annotations

import importlib.util
import sys

import numpy as np
import pytest

from mitsuba_taxel import InputError, Pad
from mitsuba_taxel.base.errors import ComputationError
from mitsuba_taxel.geometry.surfaces.triangles import volume
from mitsuba_taxel.pads import meshers
from mitsuba_taxel.pads.block import Block
from mitsuba_taxel.pads.imported import surface_meshing, tetwild
from mitsuba_taxel.pads.pad_file import PadFile, mesh_pad_file
from mitsuba_taxel.pads.parametric.drawings import write_drawings
from mitsuba_taxel.pads.parametric.meshing import mesh_pad


@pytest.fixture
def without(monkeypatch):
    """A function that lets packages not be found."""
    find = importlib.util.find_spec

    def hide(*names: str) -> None:
        found = lambda name, *args: None if name in names else find(name, *args)  # noqa: E731
        monkeypatch.setattr(importlib.util, "find_spec", found)

    return hide


def test_a_drawn_pad_needs_netgen(without, tmp_path):
    without("netgen")
    for work in (lambda: mesh_pad(Pad(rows=1, columns=1), 1.0), lambda: write_drawings(Pad(), tmp_path)):
        with pytest.raises(InputError, match="^(meshing a pad|a drawing) needs .*: pip install netgen") as refused:
            work()
        assert "\n" not in str(refused.value)
    assert list(tmp_path.iterdir()) == []


def test_a_pad_without_cells_needs_neither(without, monkeypatch):
    without("netgen", "pytetwild")
    for name in ("netgen", "pytetwild"):
        monkeypatch.setitem(sys.modules, name, None)
    mesh = Block(4.0, 3.0, 2.0).mesh(1.0)
    np.testing.assert_allclose(volume(mesh.points, mesh.faces[:, :3]), 24.0)


def test_a_step_file_needs_netgen(without, tmp_path):
    without("netgen")
    (tmp_path / "pad.step").write_text("")
    with pytest.raises(InputError, match="^a pad from a STEP file needs the package netgen-mesher"):
        mesh_pad_file(PadFile(tmp_path / "pad.step"), 1.0)


def test_a_surface_needs_either(without, write_stl, box, tmp_path):
    file = PadFile(write_stl(tmp_path / "box.stl", box()))
    without("netgen", "pytetwild")
    with pytest.raises(InputError, match="^meshing a pad needs the package netgen-mesher"):
        mesh_pad_file(file, 1.0)


def test_without_netgen_a_surface_is_meshed_by_ftetwild(without, write_stl, box, tmp_path, monkeypatch):
    file = PadFile(write_stl(tmp_path / "box.stl", box()))
    without("netgen")
    monkeypatch.setattr(tetwild, "run_isolated", lambda task, arrays: (_ for _ in ()).throw(ComputationError(task)))
    monkeypatch.setattr(surface_meshing, "run_isolated", lambda *_: pytest.fail("Netgen is not there"))
    with pytest.raises(ComputationError, match="^tetrahedralise$"):
        mesh_pad_file(file, 1.0)


def test_a_surface_that_netgen_cannot_fill_needs_ftetwild(without, write_stl, box, tmp_path, monkeypatch):
    file = PadFile(write_stl(tmp_path / "box.stl", box()))
    without("pytetwild")
    monkeypatch.setattr(surface_meshing, "_meshed", lambda *_: None)
    with pytest.raises(ComputationError, match="pytetwild, .*: pip install pytetwild"):
        mesh_pad_file(file, 1.0)


def test_meshes_of_other_meshers_are_other_solutions(write_stl, box, tmp_path, monkeypatch):
    file = PadFile(write_stl(tmp_path / "box.stl", box()))
    before = file.identity
    monkeypatch.setattr("mitsuba_taxel.pads.pad_file._version", lambda mesher: "not installed")
    assert file.identity != before and "not installed" in str(file.identity)


def test_both_are_found_here():
    assert meshers.has_netgen() and meshers.has_ftetwild()
