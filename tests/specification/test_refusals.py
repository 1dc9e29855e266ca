"""What a plugin refuses, the Python object refuses when it is made, in the same words."""

from __future__ import annotations

import re

import pytest

from mitsuba_taxel import AnnularLed, InputError, Pad, PadSensor, PhotoReflector, Phototransistor, Scene, Wall
from mitsuba_taxel.mechanics import MooneyRivlin
from mitsuba_taxel.specification.deformable_pad import DeformablePad


@pytest.mark.parametrize(
    "kind, parameters",
    [
        (AnnularLed, {"power": -1.0}),
        (AnnularLed, {"hole": 0.3}),
        (AnnularLed, {"law": "laser"}),
        (AnnularLed, {"law": "lambertian", "cone_angle": 80.0}),
        (AnnularLed, {"law": "tabulated"}),
        (Phototransistor, {"exponent": 2.0}),
        (Wall, {"scattering": "absorbing", "reflectance": 1.0}),
        (Wall, {"scattering": "mixed", "specular": 0.5}),
        (Wall, {"reflectance": 0.5, "reflectance_table": "paint.csv"}),
        (PhotoReflector, {"rows": 1001}),
        (PhotoReflector, {"spacing": 1.0}),
        (DeformablePad, {"cell": "round"}),
        (DeformablePad, {"pitch": 2.5}),
        (DeformablePad, {"material": "yeoh"}),
        (DeformablePad, {"pressure": 1.0}),
        (DeformablePad, {"read_cells": "one"}),
        (DeformablePad, {"finish": "grooves", "groove_pitch": 0.1, "groove_depth": 0.1, "groove_direction": [0, 0, 0]}),
    ],
)
def test_python_refuses_in_the_words_of_the_plugin(llvm_mono, kind, parameters):
    with pytest.raises(InputError) as here:
        kind(**parameters)
    part = {"type": kind.plugin, **parameters}
    if kind is PhotoReflector:
        part.update(led=AnnularLed().to_dict(), sensor=Phototransistor().to_dict())
    elif kind is not DeformablePad:
        part = {"type": "rectangle", "part": part}
    with pytest.raises(InputError, match=f"^{re.escape(str(here.value))}$"):
        Scene({"type": "scene", "part": part}).load()


@pytest.mark.parametrize(
    "parts, message",
    [
        ({"photo_reflector": PhotoReflector(led=AnnularLed(size=0.5))}, None),
        ({"pad": Pad(cell_size=0.2, pitch=1.0)}, "pitch = 1 is not allowed: at least 1.46 is needed"),
        ({"force": (1.0, 2.0)}, r"force = \(1.0, 2.0\) is not allowed: 3 numbers are needed"),
    ],
)
def test_a_sensor_refuses_parts_that_do_not_go_together(parts, message):
    if message is None:
        PadSensor(**parts)
        return
    with pytest.raises(InputError, match=message):
        PadSensor(**parts)


def test_constants_for_which_the_energy_falls_are_refused_with_the_reason():
    with pytest.raises(InputError, match="c01 = -1 is not allowed: .* the energy falls without bound in equibiaxial"):
        MooneyRivlin(1.0, -1.0)
