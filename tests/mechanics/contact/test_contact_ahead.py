"""How much further a pad may go until it touches a box or the board: in closed form."""

from __future__ import annotations

import numpy as np
import pytest
from trimesh.creation import box

from mitsuba_taxel import Pad
from mitsuba_taxel.mechanics.contact.barriers.contact_ahead import ContactAhead

ROOF, TOP = 1.75, 0.5
"""Heights of a flat roof and of a package below it."""


@pytest.fixture(scope="module")
def mesh():
    return Pad(rows=1, columns=1, cell_height=ROOF).mesh(3.0)


@pytest.fixture(scope="module")
def height(mesh):
    """A displacement by which all heights double."""
    return mesh.points * (0, 0, 1)


@pytest.mark.parametrize("before", [0.0, 1e-5, 3e-3])
@pytest.mark.parametrize(("moved", "displaced"), [(0.0, 0.0), (0.02, 0.0), (0.0, -0.02), (-1e-4, 3e-5)])
def test_a_roof_onto_a_package(mesh, height, before, moved, displaced):
    """The pad is squeezed evenly, up to somewhat before its roof meets the package, and gets higher meanwhile."""
    package = box((1.46, 1.06, TOP)).triangles + (0, 0, TOP / 2)
    squeezed = (1 - TOP / ROOF - before) * -height
    further = ContactAhead(mesh, squeezed, -height, (0.0, 0.0, TOP)).after(moved * height, displaced * height, package)
    expected = before + moved + displaced
    assert further == pytest.approx(expected, rel=5e-4, abs=5e-8)


def test_a_roof_onto_the_board(mesh, height):
    """A roof that bends as a paraboloid, which quadratic faces are exactly, meets the board with its middle."""
    down = -height * (1 - (mesh.points[:, :2] ** 2).sum(axis=1, keepdims=True) / 1.5**2)
    ahead = ContactAhead(mesh, 0.99 * down, down, (0.0, 0.0, 0.0))
    assert ahead.after(np.zeros_like(height), np.zeros_like(height), None) == pytest.approx(0.01, rel=5e-4)
    assert ahead.after(np.zeros_like(height), 100 * height, None) == np.inf
