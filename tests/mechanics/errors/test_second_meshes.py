"""Second meshes of other sizes, where the usual ones cost too much or do not fit."""

from __future__ import annotations

import numpy as np
import pytest

from mitsuba_taxel.base.processes.activities import announced_to
from mitsuba_taxel.mechanics import Indenter, IndenterDisplacement, NeoHookean, load_path, reactions
from mitsuba_taxel.mechanics.continuation.pad_path import pad_path
from mitsuba_taxel.mechanics.elements.loads import SPREAD_FORCE
from mitsuba_taxel.mechanics.errors import second_meshes
from mitsuba_taxel.mechanics.errors.roof_error import RoofComparison, size_ratio
from mitsuba_taxel.mechanics.errors.second_meshes import LEAST_RATIO, SecondMeshes
from mitsuba_taxel.pads import Pad

LAW, UNDER = NeoHookean(), np.array([0.0, 0.0, -1.0])


def change(path, other, value):
    """Root mean square of the change of the roofs' displacement from one mesh to the other, mm, without an estimate."""
    comparison = RoofComparison(path.mesh, other.mesh)
    here, there = (on.canonical(value, [], None)[0] for on in (path, other))
    moved = (weights @ field for weights, field in ((comparison._here, here), (comparison._there, there)))
    difference = np.subtract(*moved).reshape(3, -1, 3)[0]
    return float(np.sqrt(comparison._weight @ (difference**2).sum(axis=1)))


@pytest.mark.parametrize(("cell", "cell_size", "mesh_size"), [("cylindrical", 0.6, 1.5), ("hemispheric", 0.5, 1.5)])
def test_a_tiny_cell_in_a_large_pad_is_compared_with_elements_of_a_size_in_between(cell, cell_size, mesh_size, fresh):
    """The true error, by elements of the default size, is within that stated."""
    pad = Pad(cell, rows=1, columns=1, cell_size=cell_size, height=2.5, wall=2.5)
    path, default = (pad_path(pad, LAW, SPREAD_FORCE, size) for size in (mesh_size, pad.default_mesh_size))
    assert len(default.mesh.tets) > 8 * len(path.mesh.tets)
    second, _ = next(iter(SecondMeshes(path)))
    assert len(second.mesh.tets) < 0.6 * len(default.mesh.tets)
    assert 1 / size_ratio(path.mesh, second.mesh) > LEAST_RATIO
    said = []
    (state,) = load_path(pad, LAW, [UNDER], mesh_size=mesh_size)
    with announced_to(said.append):
        stated = state.error.displacement
    assert f"solving a second mesh, elements of {second.mesh_size:.3g} mm" in said
    assert 0.2 * stated < change(path, default, UNDER) < stated


@pytest.mark.parametrize(("cell", "cells", "most"), [("parallelepiped", 1, 3.0), ("hemispheric", 2, 8.0)])
def test_where_finer_elements_are_too_many_coarser_ones_tell(cell, cells, most, fresh, monkeypatch):
    """The error that is stated is above that by far smaller elements, and not many times as much."""
    monkeypatch.setattr(second_meshes, "MOST_ELEMENTS_COMPARED", 0)
    pad, value = Pad(cell, rows=1, columns=cells), cells * UNDER
    (state,) = load_path(pad, LAW, [value])
    path, fine = (pad_path(pad, LAW, SPREAD_FORCE, size * pad.default_mesh_size) for size in (1.0, 0.6))
    assert change(path, fine, value) < state.error.displacement < most * change(path, fine, value)


def test_an_indenter_on_too_large_elements_is_compared_with_little_larger_ones(fresh, monkeypatch):
    """The error of the force is stated although elements of twice the size do not resolve the contact and finer ones
    are too many; smaller elements confirm it."""
    pad, value, load = Pad(rows=1, columns=1), (0, 0, -0.02), IndenterDisplacement(Indenter("sphere", radius=3.0))
    (finer,) = load_path(pad, LAW, [value], load=load, mesh_size=0.7 * pad.default_mesh_size)
    monkeypatch.setattr(second_meshes, "MOST_ELEMENTS_COMPARED", 0)
    (state,) = load_path(pad, LAW, [value], load=load)
    change = abs(reactions(state).applied_force[2] - reactions(finer).applied_force[2])
    assert change < state.force_error < 0.2 * abs(reactions(state).applied_force[2])
