"""Indenters in pictures: where they are, closed, and the colours of what they press with."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from mitsuba_taxel import Pad, PadSensor
from mitsuba_taxel.backend import default_variant
from mitsuba_taxel.geometry.surfaces.cutaway import is_closed
from mitsuba_taxel.geometry.surfaces.triangles import volume
from mitsuba_taxel.mechanics import Indenter, IndenterDisplacement
from mitsuba_taxel.report.picture.drawing import most_pressure, render_parts, with_scale
from mitsuba_taxel.report.picture.indenters import indenter_surface
from mitsuba_taxel.report.picture.sensor_parts import shown_parts

pytestmark = pytest.mark.usefixtures("mechanics_error_unknown")

BODIES = [
    Indenter("sphere", radius=2.0, at=(1.0, -0.5)),
    Indenter("sphere", radius=6.0),
    Indenter("sphere", radius=500.0),
    Indenter("cylinder", radius=1.5, angle=30.0),
    Indenter("cylinder", radius=50.0),
    Indenter("punch", radius=1.0),
    Indenter("punch", radius=100.0),
    Indenter("plane"),
    Indenter("punch", radius=1.0, angle=30.0, tilt=-20.0),
    Indenter("plane", tilt=10.0),
]


@pytest.mark.parametrize("body", BODIES, ids=lambda body: f"{body.shape} {body.radius} {body.tilt}")
def test_surfaces_are_those_that_press(body):
    """Or lie within, where a body is cut off at ten times the height of the tallest pad here."""
    top, moved = 4.0, np.array([0.0, 0.2, -0.7])
    state = SimpleNamespace(mesh=SimpleNamespace(points=np.array([[-4, 0, 0], [4, 3, top]])), indenter_moved=moved)
    pad = SimpleNamespace(load=IndenterDisplacement(body), state=state, to_world=np.eye(4))
    vertices, triangles = indenter_surface(pad)
    start = [0, 0, top + 4 * np.tan(np.radians(body.tilt))] if body.shape == "plane" else [*body.at, top]
    gap = body.body.gap(vertices - start - moved).size
    assert is_closed(triangles) and volume(vertices, triangles) > 0
    assert gap.max() < 1e-9 and np.mean(gap > -1e-9) > 0.02
    assert body.shape == "plane" or vertices[:, 2].min() == pytest.approx(top - 0.7, abs=1e-3)
    assert np.ptp(vertices, axis=0).max() <= 2 * 8 + 1e-9


def test_a_pressed_pad_has_the_colours_of_what_it_is_pressed_with():
    import mitsuba as mi

    mi.set_variant(default_variant())
    ball = IndenterDisplacement(Indenter("sphere", radius=2.5, at=(0.3, 0.0)))
    live = PadSensor(pad=Pad("hemispheric", rows=1, columns=1), load=ball, force=(0, 0, -0.3)).scene().load()
    whole, opened = (shown_parts(live, cut)[0] for cut in ("none", "middle"))
    for parts in (whole, opened):
        _, pad, body, _ = parts
        assert set(body.material) == {"indenter"}
        assert body.range(2)[0] == pytest.approx(4.25, abs=5e-3)
        pressed = pad.pressure.max(axis=1) > 0
        assert set(pad.material[pressed]) == {"top"}
        places = pad.vertices[pad.triangles[pressed]].reshape(-1, 3)
        assert np.abs(places[:, 0] - 0.3).max() < 1.3  # of a contact about 0.85 mm wide to each side
    assert most_pressure(opened) == pytest.approx(most_pressure(whole), rel=0.1)
    pixels = render_parts(opened, width=96, samples=16)
    assert (pixels[..., 1] - pixels[..., 2]).max() > 0.15  # yellow, as nothing else is
    assert np.abs(with_scale(pixels, 1.0) - pixels).max() > 0.1
