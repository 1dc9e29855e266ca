"""LEDs on the rectangles that carry them: where they emit, and how much."""

from __future__ import annotations

import numpy as np
import pytest
from chi_square import chi2
from kernel_arrays import floats

from mitsuba_taxel import InputError, Scene

pytestmark = pytest.mark.quick


def led_on_rectangle(mi, **parameters):
    """An LED on a 2 x 2 rectangle that is turned and displaced."""
    turn = mi.ScalarTransform4f().translate([0.3, -0.2, 0.7]).rotate([0.6, 0.8, 0], 50)
    scene = mi.load_dict(
        {
            "type": "scene",
            "r": {"type": "rectangle", "to_world": turn, "led": {"type": "annular_led", **parameters}},
        }
    )
    return scene, scene.emitters()[0]


@pytest.mark.parametrize("hole", [0.0, 0.1, 0.2])
def test_led_lights_its_annulus_uniformly(llvm_mono, hole):
    mi = llvm_mono
    from mitsuba.chi2 import PlanarDomain

    _, led = led_on_rectangle(mi, size=0.25, hole=hole)

    def offset(sample):
        ps, _ = led.sample_position(0, sample)
        return led.faces.locate(ps.p)[1]

    def density(p):
        half = floats(mi, np.maximum(np.abs(p.x.numpy()), np.abs(p.y.numpy())))
        inside = (half <= 0.125) & (half >= 0.5 * hole)
        import drjit as dr

        return dr.select(inside, 1 / (0.25**2 - hole**2), 0)

    domain = PlanarDomain(mi.ScalarBoundingBox2f([-0.125, -0.125], [0.125, 0.125]))
    chi2(domain, offset, density, resolution=50)


@pytest.mark.parametrize("law", ["uniform_solid_angle", "uniform_polar_angle", "lambertian", "cosine_power"])
@pytest.mark.parametrize("strategy, power", [("unidirectional_hits", 1.0), ("unidirectional_hits", 0.25), ("all", 1.0)])
def test_led_emits_its_power(llvm_mono, agree, law, strategy, power):
    """A phototransistor that all but covers the sky of the LED receives all of it."""
    from mitsuba_taxel import Scene, measure

    mi = llvm_mono
    down = mi.ScalarTransform4f().translate([0, 0, 0.01]).rotate([1, 0, 0], 180).scale(200)
    scene = Scene(
        {
            "type": "scene",
            "integrator": {"type": "taxel_tracer", "strategy": strategy},
            "below": {"type": "rectangle", "led": {"type": "annular_led", "power": power, "law": law}},
            "above": {
                "type": "rectangle",
                "to_world": down,
                "sensor": {"type": "phototransistor", "width": 400, "depth": 400},
            },
        }
    )
    reading = measure(scene, points=4096)
    if strategy == "unidirectional_hits":
        assert reading.power[0] == pytest.approx(power, rel=1e-6)
    else:
        agree(reading.power, reading.standard_error, power)


def test_led_must_fit_on_its_rectangle(llvm_mono):
    from mitsuba_taxel import measure

    tiny = llvm_mono.ScalarTransform4f().scale(0.05)
    scene = {
        "type": "scene",
        "integrator": {"type": "taxel_tracer"},
        "a": {"type": "rectangle", "to_world": tiny, "led": {"type": "annular_led"}},
        "b": {"type": "rectangle", "sensor": {"type": "phototransistor"}},
    }
    with pytest.raises(InputError, match=r"annular_led: 0.25 x 0.25 mm do not fit on its rectangle, 0.1 x 0.1 mm"):
        measure(Scene(scene), points=16)
