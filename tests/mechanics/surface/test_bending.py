"""Errors of the curvature of walls: against closed forms, and as they scale."""

from __future__ import annotations

import numpy as np
import pytest

from mitsuba_taxel.geometry.surfaces.triangles import unit
from mitsuba_taxel.mechanics import NeoHookean, load_path, tessellate
from mitsuba_taxel.mechanics.surface.bending import bent_normals, curvature_errors, wall_numbers
from mitsuba_taxel.pads import REGIONS, Pad

PAD = Pad("parallelepiped", rows=1, columns=2)
SIZE = 2.5


@pytest.fixture(scope="module")
def state():
    return load_path(PAD, NeoHookean(4.16, 0.49), [(0.0, 0.0, 0.0)], mesh_size=SIZE)[0]


def test_a_flat_roof_becomes_a_paraboloid(state):
    """Normals of z = c r^2 / 2, with r from the middle of each roof; other walls and the first cell keep theirs."""
    surface, curvature = tessellate(state, 4, pad=PAD), np.zeros(100)
    curvature[wall_numbers(np.array([2]), np.array([REGIONS["roof"]]))] = 0.02
    bent = bent_normals(surface, curvature)
    roof = (surface.region == REGIONS["roof"]) & (surface.cell == 2)
    x, y = np.moveaxis(surface.vertices[surface.triangles[roof]][..., :2] - PAD.cell_centres[1], -1, 0)
    expected = unit(np.stack([0.02 * x, 0.02 * y, -np.ones_like(x)], axis=-1))
    assert np.abs(x).max() > 1.2
    assert bent[roof] == pytest.approx(expected, abs=1e-7)
    assert bent[~roof] == pytest.approx(surface.normals[~roof], abs=1e-12)


def test_errors_follow_the_strain_and_the_elements_of_each_cell(state):
    """Of a pad stretched along z: the roofs move by their height times the strain."""
    strain = 0.01 * np.where(state.mesh.points[:, :1] > 0, 1.0, 0.0) * state.mesh.points * [0.0, 0.0, 1.0]
    walls = wall_numbers(np.array([1, 2]), np.full(2, REGIONS["roof"]))
    pressed, both, finer = (
        curvature_errors(state.mesh, factor * strain, ratio, 1.25)[walls]
        for factor, ratio in ((1, 1.0), (2, 1.0), (1, 0.5))
    )
    assert pressed[0] == 0 and pressed[1] == pytest.approx(0.01 / 1.25 * PAD.cell_height / PAD.height)
    assert both == pytest.approx(2 * pressed) and finer == pytest.approx(pressed / 8)
