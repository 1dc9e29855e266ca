"""Finite elements of a mesh: what they are at rest."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from mitsuba_taxel import ComputationError, Pad
from mitsuba_taxel.mechanics import NeoHookean
from mitsuba_taxel.mechanics.elements.elements import QUADRATURE_POINTS, Elements

pytestmark = pytest.mark.quick

MATERIAL = NeoHookean(4.16, 0.49)


@pytest.fixture(scope="module")
def mesh():
    return Pad("hemispheric", 1, 1).mesh(1.6)


def test_gradients_are_those_of_a_linear_field(mesh):
    elements = Elements(mesh, MATERIAL)
    linear = np.array([0.3, -0.7, 0.2])
    found = np.einsum("mqai,ma->mqi", elements.gradients, mesh.points[elements.nodes] @ linear)
    np.testing.assert_allclose(found, np.broadcast_to(linear, found.shape), atol=1e-12)
    assert elements.gradients.shape[1] == len(QUADRATURE_POINTS)


def test_volumes_add_up_to_that_of_the_silicone():
    pad = Pad("parallelepiped", 1, 1)
    x, y, z = pad.extent
    elements = Elements(pad.mesh(1.6), MATERIAL)
    assert elements.weight.sum() == pytest.approx(x * y * z - pad.cell_size**2 * pad.top_of_cell, rel=1e-12)


@pytest.mark.filterwarnings("error")
def test_a_flat_element_is_refused(mesh):
    points = mesh.points.copy()
    points[mesh.tets[0]] = points[mesh.tets[0, 0]]
    with pytest.raises(ComputationError, match="a finite element of the pad at rest is flat: another mesh_size"):
        Elements(replace(mesh, points=points), MATERIAL)
