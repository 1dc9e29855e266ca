"""Friction by the tangential compliance against finite elements with friction: forces, moments and readings."""

from __future__ import annotations

import numpy as np
import pytest

from mitsuba_taxel import PadSensor
from mitsuba_taxel.mechanics import Indenter, IndenterDisplacement, NeoHookean, load_path, reactions
from mitsuba_taxel.pads import Pad
from mitsuba_taxel.sensing.derivatives.wall_gradient import WallGradient
from mitsuba_taxel.sensing.diffuse.diffuse_cells import DiffuseCells
from mitsuba_taxel.surrogates import FrictionPads, contact_model

PAD, SILICONE = Pad("parallelepiped", rows=1, columns=1), NeoHookean(0.3, 0.49)
SENSOR = PadSensor(pad=PAD, material=SILICONE)


@pytest.fixture(scope="module")
def model():
    return contact_model(SENSOR.scene(), 0.25, spacing=0.455, mesh_size=0.7, friction=True)


@pytest.mark.parametrize(
    ("radius", "place", "depth", "friction", "slides"),
    [
        (2.0, (0.0, 0.0), 0.2, 0.4, [(0.03, 0.0), (0.15, 0.0), (0.05, 0.0)]),
        (5.0, (0.3, -0.2), 0.2, 0.25, [(0.0, 0.1), (-0.2, 0.15)]),
    ],
)
def test_a_ball_that_slides_is_as_in_the_full_solution(model, radius, place, depth, friction, slides):
    """The bounds are those of few patches, four to fourteen of which are in contact, and of large strains."""
    cells, pads, last = DiffuseCells(SENSOR.scene().load()), FrictionPads(model, 1, friction), np.zeros(2)
    load = IndenterDisplacement(Indenter(radius=radius, at=place, friction=friction))
    values = [(*slide, -depth) for slide in [(0.0, 0.0), *slides]]
    for value, state in zip(values, load_path(PAD, SILICONE, values, load=load, mesh_size=1.5), strict=True):
        now = np.array(value[:2])
        across = model.points[..., :2] - place - now
        squares = (across**2).sum(axis=-1)
        maps = depth - radius + np.sqrt(np.maximum(radius**2 - squares, 0.0))
        found = pads.step(np.where(squares < radius**2, maps, -1.0)[None], (now - last)[None]).readings
        last, full = now, reactions(state)
        scale = friction * abs(full.applied_force[2])
        assert found.force[0, 2] == pytest.approx(full.applied_force[2], rel=0.05)
        np.testing.assert_allclose(found.force[0, :2], full.applied_force[:2], rtol=0, atol=0.08 * scale)
        np.testing.assert_allclose(found.moment[0], full.applied_moment, rtol=0, atol=0.08 * scale * PAD.height)
        change = WallGradient(cells, state).power - model.rest
        np.testing.assert_allclose(found.power[0] - model.rest, change, rtol=0.08)  # the rest is of second order
