"""Pads that do not fit into memory are refused before they are meshed, with a size that fits."""

from __future__ import annotations

import re

import numpy as np
import pytest

from mitsuba_taxel.base.errors import ComputationError
from mitsuba_taxel.mechanics import (
    Indenter,
    IndenterDisplacement,
    NeoHookean,
    SpreadForce,
    load_path,
    load_paths,
    memory_of_pads,
    state_at_rest,
)
from mitsuba_taxel.mechanics.continuation.pad_path import pad_path
from mitsuba_taxel.mechanics.memory_of_pads import refuse_too_large, symmetric_parts
from mitsuba_taxel.mechanics.meshes import pad_mesh
from mitsuba_taxel.pads import Pad

NORMAL, GB = [(0.0, 0.0, -1.0)], 1e9


@pytest.fixture
def free(fresh, monkeypatch):
    """Sets the free memory, in GB; no pad has been meshed."""
    return lambda size: monkeypatch.setattr(memory_of_pads, "free_memory", lambda: size * GB)


@pytest.mark.parametrize(
    ("load", "value"),
    [
        (SpreadForce(), (0.0, 0.0, -1.0)),
        (SpreadForce(), (0.3, 0.0, -1.0)),
        (SpreadForce(), (0.3, 0.3, -1.0)),
        (SpreadForce(), (0.3, 0.2, -1.0)),
        (IndenterDisplacement(Indenter("sphere", radius=2.5)), (0.0, 0.0, -0.1)),
        (IndenterDisplacement(Indenter("sphere", radius=2.5, at=(0.5, 0.0))), (0.0, 0.0, -0.1)),
        (IndenterDisplacement(Indenter("sphere", radius=2.5, at=(0.5, 0.2))), (0.0, 0.0, -0.1)),
    ],
)
@pytest.mark.parametrize("columns", [1, 2])
def test_symmetries_are_those_that_the_mesh_has(load, value, columns):
    pad = Pad("hemispheric", rows=1, columns=columns)
    path = pad_path(pad, NeoHookean(), load, 2.5)
    end = np.array(value)
    origin = end * (0, 0, 1) if end[:2].any() else np.zeros(3)
    part = path.segments.pad_for(origin, (end - origin) / np.linalg.norm(end - origin)).part
    assert symmetric_parts(pad, load, value) >= part.copies
    if columns == 1 or not end[:2].all():
        assert symmetric_parts(pad, load, value) == part.copies


@pytest.mark.parametrize(
    ("cell", "size", "rows", "columns"),
    [("parallelepiped", 1.25, 5, 5), ("hemispheric", 1.25, 4, 7), ("spherical", 2.0, 2, 9)],
)
def test_unknowns_are_told_from_few_cells(cell, size, rows, columns, free):
    """Those of pads that are meshed here, within 15 %; memory is stated in their proportion."""
    pad = Pad(cell, rows=rows, columns=columns)
    free(1e-3)
    with pytest.raises(ComputationError, match=f"enough memory for {rows} x {columns} cells") as refused:
        refuse_too_large(pad, size, SpreadForce(), [(0.3, 0.2, -1.0)])
    path = pad_path(pad, NeoHookean(), SpreadForce(), size)
    unknowns = path.segments.pad_for(np.zeros(3), np.array([0.6, 0.8, 0.0])).unknowns
    needed = float(re.search(r"some ([\d.]+) GB", str(refused.value))[1]) * GB
    assert needed / memory_of_pads.BYTES == pytest.approx(unknowns, rel=0.15)


@pytest.mark.parametrize("solve", [load_path, state_at_rest])
def test_a_pad_that_does_not_fit_is_not_meshed(solve, monkeypatch, free):
    """Nor at rest, where a scene begins."""
    meshed = []
    monkeypatch.setattr(load_paths, "pad_path", lambda *arguments, **more: meshed.append(arguments))
    free(0.5)
    with pytest.raises(ComputationError, match=r"enough memory for 30 x 30 cells .* would fit\.$") as refused:
        solve(Pad(rows=30, columns=30), NeoHookean(), NORMAL)
    assert not meshed and "\n" not in str(refused.value)
    rows, columns = map(int, re.search(r"rows = (\d+), columns = (\d+)", str(refused.value)).groups())
    assert 4 < rows == columns < 30
    refuse_too_large(Pad(rows=rows, columns=columns), 1.25, SpreadForce(), NORMAL)


def test_the_size_that_is_named_fits(free):
    pad = Pad("hemispheric", rows=1, columns=1)
    free(0.05)
    with pytest.raises(ComputationError, match="mesh_size = ") as refused:
        refuse_too_large(pad, 0.2, SpreadForce(), NORMAL)
    named = float(re.search(r"mesh_size = ([\d.]+)", str(refused.value))[1])
    refuse_too_large(pad, named, SpreadForce(), NORMAL)
    free(50)
    refuse_too_large(pad, 0.2, SpreadForce(), NORMAL)


def test_a_pad_at_rest_or_meshed_before_is_not_judged(free):
    """At rest nothing is solved, and what is meshed may be solved already."""
    free(1e-3)
    pad = Pad("spherical", rows=1, columns=6)
    refuse_too_large(pad, 3.0, SpreadForce(), [(0.0, 0.0, 0.0)])
    with pytest.raises(ComputationError, match="enough memory"):
        refuse_too_large(pad, 3.0, SpreadForce(), [(0.0, 0.0, 0.0), *NORMAL])
    pad_mesh(pad, 3.0)
    refuse_too_large(pad, 3.0, SpreadForce(), NORMAL)
