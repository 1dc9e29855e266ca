"""What a white card sends back: closed forms, and the renderer."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest
from taxel_program import run_program

from mitsuba_taxel import InputError, Scene, measure
from mitsuba_taxel.parts import card_curve, distance_model, mirror_curve, read_part

VCNT = read_part("vcnt2020")
CARD = """<scene version="3.9.0">
    <default name="h" value="1"/> <default name="part" value=""/>
    <integrator type="taxel_tracer"/>
    <shape type="photo_reflector"><string name="part" value="$part"/></shape>
    <shape type="rectangle"><transform name="to_world"><scale value="60"/><rotate x="1" angle="180"/>
        <translate z="0.8"/><translate z="$h"/></transform>
      <bsdf type="wall"><string name="scattering" value="lambertian"/><float name="reflectance" value="1"/></bsdf>
    </shape>
</scene>"""


@pytest.mark.parametrize("height", [1.0, 4.0])
def test_small_dies_side_by_side_have_a_closed_form(height):
    """Both at the origin, without resin: the integral of h^4 / r^8 / pi^2 over the plane, A / (3 pi h^2)."""
    bare = {"x": 0.0, "y": 0.0, "window_y": None, "window_shape": "rectangle", "die_depth": 0.0}
    bare |= {"window_width": 2.0, "window_length": 2.0, "die_width": 0.02, "die_length": 0.02}
    sides = {name: replace(getattr(VCNT, name), **bare) for name in ("emitter", "detector")}
    part = replace(VCNT, resin_index=1.0, **sides)
    assert card_curve(part, height) == pytest.approx(0.02**2 / (3 * np.pi * height**2), rel=5e-3)
    law = replace(part, emitter=replace(sides["emitter"], law="cosine_power", exponent=3.0))
    # The intensity 2 cos^3 / pi in place of cos / pi: the integral of 2 h^6 / r^10 / pi^2, A / (2 pi h^2)
    assert card_curve(law, height) == pytest.approx(0.02**2 / (2 * np.pi * height**2), rel=5e-3)


def test_dies_below_windows_are_what_the_renderer_gives(tmp_path, agree):
    (tmp_path / "card.xml").write_text(CARD)
    heights = np.array([0.3, 1.0, 3.0])
    for height, power in zip(heights, card_curve(VCNT, heights), strict=True):
        readings = measure(Scene.from_file(tmp_path / "card.xml", h=height, part="vcnt2020"), points=4096, seed=1)
        agree(readings.power, readings.standard_error, power, 5e-3 * power)


def test_the_part_says_under_what_its_curve_was_measured(tmp_path):
    assert run_program(tmp_path, "new", "part").returncode == 0
    text = (tmp_path / "part.toml").read_text().replace("# distance_curve", "distance_curve")
    (tmp_path / "part.toml").write_text(text.replace('= "mirror"', '= "white card"'))
    part = read_part(tmp_path / "part.toml")
    heights = np.array([0.5, 1.0, 2.0])
    assert np.array_equal(distance_model(part, heights), card_curve(part, heights))
    assert not np.allclose(card_curve(part, heights), mirror_curve(part, heights), rtol=0.2)
    shown = run_program(tmp_path, "parts", "part.toml").stdout
    assert "Current under a white card, relative to the largest" in shown
    under_card = card_curve(part, heights) / card_curve(part, heights).max()
    curve = ", ".join(f"[{z}, {power:.4f}]" for z, power in zip(heights, under_card, strict=True))
    (tmp_path / "curve.toml").write_text(re.sub(r"distance_curve = .*", f"distance_curve = [{curve}]", text))
    shown = run_program(tmp_path, "parts", "curve.toml").stdout
    said = r"With distance_reflector = 'white card', for a curve under a white card, the difference is (\d.\d)%."
    assert float(re.search(said, shown)[1]) < 5  # the largest lies between these heights
    (tmp_path / "part.toml").write_text(text.replace('= "mirror"', '= "paper"'))
    with pytest.raises(InputError, match="distance_reflector = 'paper' is not allowed: 'mirror' or 'white card'"):
        read_part(tmp_path / "part.toml")
