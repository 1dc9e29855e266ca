"""Whether elements are small enough for the contact with an indenter."""

from __future__ import annotations

import numpy as np
import pytest

from mitsuba_taxel.base.errors import ComputationError
from mitsuba_taxel.mechanics import Indenter, IndenterDisplacement, NeoHookean
from mitsuba_taxel.mechanics.contact.resolution import resolution
from mitsuba_taxel.mechanics.continuation.pad_path import pad_path
from mitsuba_taxel.mechanics.local_mesh import Refinement
from mitsuba_taxel.pads import Pad

BLOCK, LAW = Pad("parallelepiped", 1, 1, cell_size=0.4, cell_height=0.4, height=2.0, wall=1.3), NeoHookean()
MODULUS = LAW.youngs_modulus / (1 - LAW.poisson_ratio**2)


def pressed(radius, depth, relative_size, x=0.0):
    """Force of a ball on a block, relative to that on a half-space by Hertz, and how it is resolved."""
    load, moved = IndenterDisplacement(Indenter(radius=radius, at=(x, 0.0))), np.array([0, 0, -depth])
    path = pad_path(BLOCK, LAW, load, 0.8, refinement=Refinement(relative_size))
    displacement, pressure, _ = path.canonical(moved, [], None)
    force = path.force(moved, displacement, pressure)
    hertz = 4 / 3 * MODULUS * np.sqrt(radius) * depth**1.5
    return force[2] / hertz, resolution(path.mesh, load.indenter, displacement, moved), (path, moved, displacement)


@pytest.mark.parametrize(
    ("radius", "depth", "x"), [(1.0, 0.02, 0.0), (1.0, 0.005, 0.0), (1.0, 0.005, 0.37), (0.3, 0.01, 0.0)]
)
def test_a_contact_that_is_resolved_has_the_force_of_hertz(radius, depth, x):
    """And what has not is not resolved: on elements of each size, some are and some are not."""
    for relative_size in (1.0, 2.0, 4.0):
        force, found, _ = pressed(radius, depth, relative_size, x)
        if found.suffices:
            assert force == pytest.approx(1.0, abs=0.08)
        assert found.suffices == (relative_size < 1.5 or (relative_size == 2.0 and depth == 0.02))
        if not found.suffices:
            assert found.size > 2


def test_a_ball_that_is_not_felt_is_inside_by_all_of_its_depth():
    force, found, (path, moved, displacement) = pressed(1.0, 0.005, 4.0)
    assert abs(force) < 1e-9 and found.depth == pytest.approx(1.0)
    said = (
        r"the finite elements are too large for an indenter 0.005 mm deep at \(0, 0\) mm: their faces are 10 "
        r"times half the width of its contact. A mesh_size of 0.098 mm, or a deeper or larger indenter is needed."
    )
    with pytest.raises(ComputationError, match=said):
        path.refuse_unresolved(moved, displacement)


def test_a_body_that_does_not_touch_and_a_plate_are_resolved():
    mesh = BLOCK.mesh(0.8)
    at_rest = np.zeros_like(mesh.points)
    for body, moved in (
        (Indenter(radius=0.3), (0, 0, 0.1)),
        (Indenter(radius=0.3, at=(5.0, 0.0)), (0, 0, -0.1)),
        (Indenter("plane"), (0, 0, -0.1)),
    ):
        assert resolution(mesh, body, at_rest, np.array(moved))[:2] == (0.0, 0.0)
    found = resolution(mesh, Indenter(radius=0.3), at_rest, np.array([0.7, 0.1, -0.1]))
    assert found.depth == 1.0 and found.size > 2
