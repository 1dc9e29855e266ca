"""What a mould asks of a pad, in closed form."""

from __future__ import annotations

import math

import numpy as np
import pytest

from mitsuba_taxel.pads import Pad
from mitsuba_taxel.pads.cells.meridian import FLAT
from mitsuba_taxel.pads.mould import bend_radii, draft_angles, thicknesses, view_angles

pytestmark = pytest.mark.quick


def test_thicknesses():
    np.testing.assert_allclose(thicknesses(Pad(height=3.0, wall=0.9)), [0.9, 1.45, 1.0])
    np.testing.assert_allclose(thicknesses(Pad("profile", 1, 1, profile="1 1; .5 .9; 0 .8", height=3.0)), [1.0, 1.45])


@pytest.mark.parametrize(("cell", "radius"), [("spherical", 2.55), ("hemispheric", 1.275)])
def test_domes_as_profiles_bend_as_their_spheres(cell, radius):
    pad = Pad(cell)
    assert bend_radii(pad) == pytest.approx([radius])
    np.testing.assert_allclose(bend_radii(pad.as_profile(5)), radius, rtol=(radius / 2.55 / FLAT) ** 2)
    assert draft_angles(pad) == 0.0
    angles = draft_angles(pad.as_profile())  # the side's, and from the crown down to the rim
    rim = 0.0 if cell == "hemispheric" else 60.0
    np.testing.assert_allclose(angles[[0, 1, -1]], [0.0, 90.0, rim], atol=1e-6)
    assert np.all(np.diff(angles[1:]) < 0)


def test_flat_roofs_do_not_bend():
    assert bend_radii(Pad()).size == bend_radii(Pad("cylindrical")).size == 0
    np.testing.assert_allclose(bend_radii(Pad("cylindrical").as_profile()), FLAT * 2.55)


def test_a_cone_leans_and_a_neck_hangs_over():
    cone = Pad("profile", profile="0.8 0.5; 0.5 1; 0 1")
    assert draft_angles(cone)[0] == pytest.approx(math.degrees(math.atan2(0.2 * 1.275, 0.5 * 1.55)))
    assert draft_angles(cone).min() == draft_angles(cone)[0]
    assert draft_angles(Pad("profile", profile="0.8 0.3; 0.9 0.6; 0.5 1; 0 1")).min() < -5


def test_roofs_are_seen_at_the_angle_of_their_rays():
    """A flat one at the elevation of the ray, a dome about the middle of the opening at right angles."""
    pad = Pad("cylindrical").as_profile(3)
    rim = math.degrees(math.atan2(1.55, 1.275))
    assert view_angles(pad)[-1] == pytest.approx(rim) and view_angles(pad).min() == view_angles(pad)[-1]
    dome = Pad("profile", cell_height=1.275, profile=[(0.8, 0.6), (math.sqrt(0.4), 0.8), (0, 1)])
    np.testing.assert_allclose(view_angles(dome), 90.0, atol=1e-4)
    assert view_angles(Pad("spherical")).size == 0


def test_leaning_cells():
    """A side of them hangs over, and domes become ellipsoids, of which the axes tell the least radius."""
    box = Pad(top_x=0.31, top_y=-0.2)
    np.testing.assert_allclose(thicknesses(box), [1 - 0.31, 3.0, 1.0])
    assert draft_angles(box) == pytest.approx([-math.degrees(math.atan(0.2))])
    assert draft_angles(Pad("cylindrical", top_x=0.31, top_y=0.31)) == pytest.approx(
        [-math.degrees(math.atan(0.2 * math.sqrt(2)))]
    )
    cone = Pad("profile", profile="0.8 0.5; 0.5 1; 0 1", top_x=0.155)
    assert draft_angles(cone)[0] == pytest.approx(math.degrees(math.atan2(0.2 * 1.275 - 0.1 * 0.775, 0.775)))
    dome = Pad("hemispheric", wall=1.5, top_x=0.71)  # a slope of 0.4
    values = np.linalg.svd([[1, 0.4], [0, 1]], compute_uv=False)
    assert bend_radii(dome) == pytest.approx([1.275 * values[1] ** 2 / values[0]], rel=3e-3)
    assert bend_radii(Pad("cylindrical", top_x=0.3)).size == 0
    assert bend_radii(dome.as_profile()).size == bend_radii(Pad("hemispheric").as_profile()).size
