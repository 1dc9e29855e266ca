"""Photo-reflectors whose body and dies are those of a part."""

from __future__ import annotations

import numpy as np
import pytest

from mitsuba_taxel import InputError, measure
from mitsuba_taxel.parts import read_part
from mitsuba_taxel.sensing import Scene
from mitsuba_taxel.specification.annular_led import AnnularLed
from mitsuba_taxel.specification.photo_reflector import PhotoReflector

PLATE = {
    "type": "scene",
    "integrator": {"type": "taxel_tracer"},
    "plate": {"type": "disk", "bsdf": {"type": "wall", "scattering": "lambertian"}},
}


def reading(**reflector):
    import mitsuba as mi

    turned = mi.ScalarTransform4f().translate([0, 0, 1.2]).rotate([1, 0, 0], 180).scale(3)
    plate = {**PLATE["plate"], "to_world": turned}
    return measure(Scene({**PLATE, "plate": plate, "parts": reflector}), points=256, seed=1).power[0]


def test_a_part_is_what_its_file_says(llvm_mono):
    mi, part = llvm_mono, read_part("njl5908ar")
    apart = part.detector.x - part.emitter.x
    middle = mi.ScalarTransform4f().translate([(part.detector.x + part.emitter.x) / 2, 0, 0])
    same = {
        "type": "photo_reflector",
        "spacing": apart,
        "to_world": middle,
        "led": {"type": "annular_led", "hole": 0.0, "law": "lambertian"},
        "phototransistor": {"type": "phototransistor"},
    }
    assert reading(type="photo_reflector", part="njl5908ar") == pytest.approx(reading(**same), rel=1e-5)


def test_a_file_of_ones_own(llvm_mono, tmp_path):
    from mitsuba_taxel.parts.part import _catalogue

    text = (_catalogue() / "njl5908ar.toml").read_text().replace("x = 0.25", "x = 0.3")
    (tmp_path / "mine.toml").write_text(text)
    package = PhotoReflector(part=str(tmp_path / "mine.toml")).package
    assert (package.led_x, package.phototransistor_x) == (-0.45, 0.3)
    assert np.allclose(package.body, (1.46, 1.06, 0.5))


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"part": "vcnt2020"}, "0.1 mm below their windows"),
        ({"part": "none"}, "is not known"),
        ({"part": "njl5908ar", "spacing": 0.8}, "spacing and part exclude each other"),
        ({"part": "njl5908ar", "led": AnnularLed()}, "led and part exclude each other"),
    ],
)
def test_refusals(given, words):
    with pytest.raises(InputError, match=words):
        PhotoReflector(**given)
