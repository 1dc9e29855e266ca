import math

import numpy as np
import pytest

from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.pads import Pad

PADS = {
    "cylindrical": Pad("cylindrical", fillet=0.2),
    "spherical": Pad("spherical", fillet=0.2),
    "frustum": Pad("frustum", fillet=0.2),
    "profile": Pad("profile", profile="0.95 0.7; 0.5 0.75; 0 0.8", fillet=0.1),
}


@pytest.mark.parametrize("pad", PADS.values(), ids=PADS)
def test_the_arc_touches_roof_and_side(pad):
    rim = pad.edges
    for curve, angle in ((rim.side, rim.arc.ends[0]), (rim.roof, rim.arc.ends[1])):
        point, along, _ = (values[0] for values in rim.arc.at(np.array([angle])))
        u, _ = curve.nearest(point[None])
        position, tangent, _ = (values[0] for values in curve.at(u))
        np.testing.assert_allclose(position, point, atol=1e-12)
        sine = along[0] * tangent[1] - along[1] * tangent[0]
        assert abs(sine) < 1e-10 * np.linalg.norm(along) * np.linalg.norm(tangent)


@pytest.mark.parametrize("pad", PADS.values(), ids=PADS)
def test_points_return_from_the_rounded_to_the_sharp_wall(pad):
    rim, angle = pad.edges, np.linspace(0, 2 * np.pi, 7)
    walls = np.concatenate([rim.roof.at(np.linspace(0.5, 1, 40))[0], rim.side.at(np.linspace(0, 0.5, 40))[0]])
    r, z = np.repeat(walls, 7, axis=0).T
    around = np.tile(angle, len(walls))
    sharp = np.column_stack([r * np.cos(around), r * np.sin(around), z])
    rounded = rim.onto_wall(sharp)[0]
    assert np.abs(rounded - sharp).max() > 0.02
    np.testing.assert_allclose(rim.onto_sharp_wall(rounded), sharp, atol=1e-10)
    np.testing.assert_allclose(rim.onto_wall(rounded)[0], rounded, atol=1e-10)


def test_the_fillet_of_a_cylinder_is_a_torus():
    rim = PADS["cylindrical"].edges
    np.testing.assert_allclose(rim.arc.centre, [1.275 - 0.2, 1.55 - 0.2], atol=1e-12)
    np.testing.assert_allclose(rim.arc.ends, [0.0, 0.5 * math.pi], atol=1e-12)
    assert rim.width == pytest.approx(0.2)
    corner = np.array([[[1.275 - 0.2 + 0.2 / math.sqrt(2), 0.0, 1.35 + 0.2 / math.sqrt(2)]]])
    assert rim.holds(0.999 * corner, 0.0).all()
    assert not rim.holds(1.001 * corner, 0.0).any()


@pytest.mark.parametrize(
    ("cell", "radius", "allowed"),
    [
        ("cylindrical", 1.03, "0.0255 to 1.02 mm"),
        ("cylindrical", 1e-6, "0.0255 to 1.02 mm"),
        ("spherical", 0.02, "0.0255 to"),
        ("frustum", 1.0, "0.0255 to"),
        ("hemispheric", 0.1, "joins the side smoothly"),
    ],
)
def test_what_does_not_fit_is_refused_in_one_line(cell, radius, allowed):
    with pytest.raises(InputError, match=rf"fillet = {radius:g} is not allowed: .*{allowed}"):
        Pad(cell, fillet=radius)


def test_the_ridges_of_a_square_profile_cannot_be_rounded():
    with pytest.raises(InputError, match="profile cells cannot be rounded, 0 is needed"):
        Pad("profile", profile="1 0.28; 1 0.64; 0 1", section="square", fillet=0.1)
