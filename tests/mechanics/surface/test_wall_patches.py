"""Patches on the walls of a cell that are those of an equal one."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from mitsuba_taxel.mechanics.surface.wall_patches import WallPatches
from mitsuba_taxel.pads import Pad
from mitsuba_taxel.pads.parametric.velocities import mesh_velocity
from mitsuba_taxel.pads.regions import REGIONS
from mitsuba_taxel.transport.patches import LATTICE

ROW = {"rows": 1, "columns": 3}
DRAWN, MEANT = 2, 3
PADS = [Pad("parallelepiped", **ROW), Pad("spherical", **ROW), Pad("cylindrical", **ROW, top_x=0.3)]


def patches(pad, mesh, drawn, meant):
    chosen = np.isin(mesh.face_region, [REGIONS["roof"], REGIONS["side"]]) & (mesh.face_cell == drawn)
    return WallPatches(mesh, mesh, pad, np.flatnonzero(chosen), meant, LATTICE)


@pytest.mark.parametrize("pad", PADS, ids=lambda pad: pad.cell)
def test_they_lie_in_the_cell_that_is_meant(pad):
    mesh = pad.mesh(2.0)
    own, other, there = (patches(pad, mesh, *cells).rest for cells in ((MEANT, MEANT), (DRAWN, MEANT), (DRAWN, DRAWN)))
    for end in (np.min, np.max):
        assert np.allclose(end(own, axis=(0, 1)), end(other, axis=(0, 1)), atol=1e-6)
    assert np.allclose(other - there, (pad.pitch, 0, 0), atol=1e-12)
    assert np.array_equal(patches(pad, mesh, DRAWN, MEANT).pattern, there)


@pytest.mark.parametrize("parameter", ["pitch", "cell_size", "wall"])
@pytest.mark.parametrize("pad", PADS, ids=lambda pad: pad.cell)
def test_they_move_with_a_dimension_as_the_walls_of_a_changed_pad(pad, parameter):
    mesh, step = pad.mesh(2.0), 1e-4
    velocity = mesh_velocity(replace(pad), mesh, parameter)

    def rest(by):
        changed = replace(pad).changed(**{parameter: pad.dimensions[parameter] + by})
        return patches(changed, replace(mesh, points=mesh.points + by * velocity), DRAWN, MEANT).rest

    moved = patches(pad, mesh, DRAWN, MEANT).moved(parameter, np.zeros_like(mesh.points))
    assert np.allclose(moved, (rest(step) - rest(-step)) / (2 * step), atol=1e-6)
