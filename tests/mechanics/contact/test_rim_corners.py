"""Corners where the outside of a pad meets its bottom and top."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from mitsuba_taxel.mechanics.contact.barriers.rim_corners import has_right_angled_top, rim_corners
from mitsuba_taxel.pads import Pad


@pytest.fixture(scope="module")
def mesh():
    return Pad(rows=1, columns=2).mesh(2.5)


@pytest.mark.parametrize("region", ["bottom", "top"])
def test_a_box_has_four(mesh, region):
    x, y, height = mesh.points.max(axis=0)
    found = mesh.points[rim_corners(mesh, region, 85.0)]
    at = height if region == "top" else 0.0
    np.testing.assert_allclose(np.unique(found, axis=0), [(i * x, j * y, at) for i in (-1, 1) for j in (-1, 1)])
    assert not len(rim_corners(mesh, region, 95.0))


def test_a_top_whose_sides_lean_or_meet_in_a_blunt_angle_has_none_that_is_right_angled(mesh):
    assert has_right_angled_top(mesh)
    x, y, z = mesh.points.T
    leaning = np.stack([x * (1 - 0.2 * z / z.max()), y * (1 - 0.2 * z / z.max()), z], axis=1)
    sheared = np.stack([x + 0.5 * y, y, z], axis=1)  # two corners of 63 and two of 117 degrees
    moved = [replace(mesh, points=points) for points in (leaning, sheared)]
    assert [has_right_angled_top(one) for one in moved] == [False, True]
    assert len(rim_corners(moved[1], "top", 85.0)) == 2
