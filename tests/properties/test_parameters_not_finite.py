"""Every number that a plugin reads is refused where it is none, or beyond all bounds."""

from __future__ import annotations

import math

import pytest

from mitsuba_taxel import InputError, Scene
from mitsuba_taxel.specification import specifications

pytestmark = pytest.mark.quick

NUMBERS = {
    "float": [math.nan, math.inf, -math.inf, 1e308],
    "int": [10**12, -(10**12)],
    "vector": [[0.0, 0.0, math.nan], [math.inf, 1.0, 1.0]],
}
NEEDED = {
    ("wall", "specular"): {"scattering": "mixed"},
    ("wall", "lambertian"): {"scattering": "mixed"},
    ("wall", "isotropic"): {"scattering": "mixed"},
    ("wall", "rms_slope"): {"scattering": "rough_mirror"},
    ("annular_led", "exponent"): {"law": "cosine_power"},
    ("phototransistor", "exponent"): {"response": "cosine_power"},
    **{("deformable_pad", name): {"material": "yeoh", "c10": 1.0} for name in ("c20", "c30")},
    **{("deformable_pad", name): {"material": "mooney_rivlin", "c10": 1.0, "c01": 1.0} for name in ("c10", "c01")},
    **{
        ("deformable_pad", name): {"load": "patch_force", "patch_width": 1.0, "patch_depth": 1.0}
        for name in ("patch_width", "patch_depth", "patch_x", "patch_y")
    },
    ("deformable_pad", "displacement"): {"load": "plate_displacement"},
    ("deformable_pad", "pressure"): {"load": "pressure"},
    **{
        ("deformable_pad", name): {"finish": "layer_steps", "layer_height": 0.1}
        for name in ("layer_height", "print_direction", "layer_offset", "finish_refinement")
    },
    **{
        ("deformable_pad", name): {"finish": "grooves", "groove_pitch": 0.1, "groove_depth": 0.01}
        for name in ("groove_pitch", "groove_depth", "groove_direction")
    },
    **{
        ("deformable_pad", name): {"finish": "random", "rms_height": 0.01, "correlation_length": 0.1}
        for name in ("rms_height", "correlation_length", "roughness_seed")
    },
}
"""What a parameter is read with."""


def numeric_parameters() -> list[tuple[str, str, str]]:
    """Plugin, parameter and type of all that is a number, or three."""
    return [
        (plugin, name, parameter.type)
        for plugin, specification in sorted(specifications().items())
        for name, parameter in specification.values().items()
        if parameter.type in NUMBERS
    ]


def scene_with(plugin: str, parameters: dict) -> Scene:
    part = {"type": plugin, **parameters}
    led, sensor = {"type": "annular_led"}, {"type": "phototransistor"}
    content = {
        "wall": {"type": "rectangle", "bsdf": part},
        "annular_led": {"type": "rectangle", "led": part},
        "phototransistor": {"type": "rectangle", "sensor": part},
        "owen_sobol": {"type": "rectangle", "sensor": {**sensor, "sampler": part}},
        "photo_reflector": {**part, "led": led, "sensor": sensor},
    }
    return Scene({"type": "scene", "part": content.get(plugin, part)})


def test_numbers_are_found():
    found = numeric_parameters()
    assert len(found) > 50 and NEEDED.keys() <= {(plugin, name) for plugin, name, _ in found}


@pytest.mark.parametrize("plugin, name, kind", numeric_parameters())
def test_numbers_that_are_none_are_refused_by_name(llvm_mono, plugin, name, kind):
    for value in NUMBERS[kind]:
        given = llvm_mono.ScalarVector3f(value) if kind == "vector" else value
        scene = scene_with(plugin, {**NEEDED.get((plugin, name), {}), name: given})
        with pytest.raises(InputError, match=name) as caught:
            scene.load()
        assert "\n" not in str(caught.value)
