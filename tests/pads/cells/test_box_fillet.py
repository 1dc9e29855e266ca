import numpy as np
import pytest

from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.pads import Pad
from mitsuba_taxel.pads.cells.box_fillet import BoxFillet, box_fillet

FILLET = BoxFillet(1.2, 1.5, 0.3)


def test_points_project_onto_planes_cylinders_and_a_ball():
    core = np.array([0.9, 0.9, 1.2])
    sharp = np.array([[0.2, -0.3, 1.5], [1.2, 0.5, 1.4], [1.2, -1.2, 0.4], [1.2, 1.2, 1.5]])
    normals = np.array([[0, 0, 1], [np.hypot(0.3, 0.2), 0, 0], [1, -1, 0], [1, 1, 1]], dtype=float)
    normals[1] = np.array([0.3, 0.0, 0.2])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    nearest = np.clip(sharp, [-0.9, -0.9, -9.0], core)
    np.testing.assert_allclose(FILLET.onto_wall(sharp)[0], nearest + 0.3 * normals, atol=1e-14)


def test_the_gradient_is_that_of_the_projection():
    points = np.array([[0.2, -0.3, 1.6], [1.25, 0.5, 1.4], [1.1, -1.2, 0.4], [1.1, 1.25, 1.4]])
    gradient, step = FILLET.onto_wall(points)[1], 1e-6
    for axis in range(3):
        move = step * np.eye(3)[axis]
        difference = (FILLET.onto_wall(points + move)[0] - FILLET.onto_wall(points - move)[0]) / (2 * step)
        np.testing.assert_allclose(gradient[:, :, axis], difference, atol=1e-8)


def test_a_body_fits_where_the_ball_reaches():
    diagonal = (1.2 - 0.3) + 0.3 / np.sqrt(3)
    inside, outside = ([(diagonal + sign * 1e-3) * np.ones(3) + [0, 0, 0.3]] for sign in (-1, 1))
    assert FILLET.holds(np.array([inside]), 0.0).all()
    assert not FILLET.holds(np.array([outside]), 0.0).any()


@pytest.mark.parametrize("radius", [-0.1, 1e-6, 0.02, 1.1, np.nan, np.inf])
def test_other_radii_are_refused(radius):
    with pytest.raises(InputError, match=r"fillet = .* is not allowed: .*needed"):
        Pad(fillet=radius)


def test_the_stated_limits_are_allowed():
    for radius in (0.0255, 1.02):
        assert box_fillet(1.275, 1.55, radius).radius == radius
        assert Pad(fillet=radius).edges is not None
