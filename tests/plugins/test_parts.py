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
    assert (package.emitter.x, package.detector.x) == (-0.45, 0.3)
    assert np.allclose(package.body, (1.46, 1.06, 0.5))


def test_dies_beside_the_middle_line(llvm_mono, tmp_path):
    """Under a plate that is large, a reading depends on where they lie relative to each other."""
    from mitsuba_taxel.parts.part import _catalogue

    text, powers = (_catalogue() / "njl5908ar.toml").read_text(), []
    for emitter, detector in ((0, 0), (0.2, 0.2), (-0.15, 0.15), (0, 0.3)):
        lines = text.replace("x = -0.45", f"x = -0.45\ny = {emitter}\nwindow_y = 0")
        (tmp_path / "mine.toml").write_text(lines.replace("x = 0.25", f"x = 0.25\ny = {detector}\nwindow_y = 0"))
        powers.append(reading(type="photo_reflector", part=str(tmp_path / "mine.toml")))
    assert powers[1] == pytest.approx(powers[0], rel=2e-3) and powers[3] == pytest.approx(powers[2], rel=2e-3)
    assert powers[2] < 0.95 * powers[0]


@pytest.mark.parametrize(
    ("before", "after", "words"),
    [
        ("die_length = 0.35", "die_length = 0.3", "emitter's die must be a square"),
        ("x = -0.595", "x = -0.595\nwindow_x = -0.2", "windows must lie side by side along x"),
        ("x = -0.595", "x = -0.835\nwindow_x = -0.835", "obround window reaches the edge"),
    ],
)
def test_parts_that_are_no_packages(tmp_path, before, after, words):
    from mitsuba_taxel.parts.part import _catalogue

    (tmp_path / "mine.toml").write_text((_catalogue() / "vcnt2020.toml").read_text().replace(before, after, 1))
    with pytest.raises(InputError, match=words) as refused:
        PhotoReflector(part=str(tmp_path / "mine.toml"))
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"part": "none"}, "is not known"),
        ({"part": "njl5908ar", "spacing": 0.8}, "spacing and part exclude each other"),
        ({"part": "njl5908ar", "led": AnnularLed()}, "led and part exclude each other"),
    ],
)
def test_refusals(given, words):
    with pytest.raises(InputError, match=words):
        PhotoReflector(**given)
