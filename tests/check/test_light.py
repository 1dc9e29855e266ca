"""Scenes without light, or that an integrator does not serve, are found at their place."""

from __future__ import annotations

import re

import pytest
from flawed_scene import AT_END, IN_LED, PACKAGE, PAD, PLATE, change, check, parameter

pytestmark = pytest.mark.usefixtures("static")

NO_ROOF = ('<bsdf name="roof" type="wall">', '<bsdf name="{}" type="wall">')


LIGHT = {
    "roof absorbs": (PAD, NO_ROOF, "side", "roof", "warning", 4, "roof of deformable_pad absorbs, and only its sides"),
    "nothing comes back": (PAD, ('"0.9"', '"{}"'), "0", "0.01", "warning", 4, "absorbs, and so do its sides"),
    "region of a package": (PAD, NO_ROOF, "led", "roof", "warning", 9, "led is not a region of deformable_pad"),
    "no LED": (PLATE, ('<emitter type="annular_led"/>', "{}"), "", '<emitter type="annular_led"/>', "error", 0,
               "holds 0 LEDs and 1 phototransistors"),
    "another emitter": (PLATE, ('"annular_led"', '"{}"'), "area", "annular_led", "error", 6,
                        "every emitter must be an annular_led"),
    "no power": (PAD, IN_LED, parameter("power", 0), parameter("power", 1e-3), "warning", 15, "power = 0"),
    "detector first": (PAD, ('"taxel_tracer"/>', "{}"), '"taxel_path"/>', '"analog_tracer"/>', "", 0, ""),
    "no wall": (PLATE, ('<bsdf type="wall">\n    <string name="scattering" value="mirror"/>\n  </bsdf>', "{}"), "",
                '<bsdf type="wall"/>', "warning", 16, "rectangle has no bsdf"),
    "a region on a rectangle": (PLATE, ('<bsdf type="wall">\n    <string name="scattering" value="mirror"/>', "{}"),
                                '<bsdf type="region"> <bsdf name="roof" type="wall"/>', '<bsdf type="wall">',
                                "warning", 18, "rectangle has no regions"),
    "a sampler of Mitsuba": (PLATE, ("owen_sobol", "{}"), "independent", "owen_sobol", "error", 13,
                             "its sampler must be owen_sobol, not independent"),
}  # fmt: skip


@pytest.mark.parametrize("text, place, wrong, right, severity, line, message", LIGHT.values(), ids=LIGHT.keys())
def test_light(tmp_path, text, place, wrong, right, severity, line, message):
    found = check(tmp_path, change(text, place, wrong))
    if severity:
        assert any(
            (finding.severity, finding.line) == (severity, line) and re.search(message, finding.message)
            for finding in found
        ), found
    else:
        assert found == []
    assert check(tmp_path, change(text, place, right)) == []


@pytest.mark.parametrize(
    "integrator, scattering, law, severity",
    [
        ("taxel_tracer", "isotropic", "lambertian", None),
        ("analog_tracer", "isotropic", "lambertian", None),
        ("taxel_path", "isotropic", "lambertian", "error"),
        ("taxel_path", "lambertian", "lambertian", None),
        ("taxel_path", "lambertian", "uniform_polar_angle", "error"),
        ("path", "isotropic", "lambertian", "warning"),
        ("path", "lambertian", "lambertian", None),
        ("ptracer", "isotropic", "lambertian", None),
    ],
)
def test_paths_from_the_phototransistor(tmp_path, integrator, scattering, law, severity):
    text = change(PAD, ("taxel_tracer", "{}"), integrator)
    text = text.replace('<float name="reflectance" value="0.9"/>', parameter("scattering", scattering, "string"))
    found = check(tmp_path, change(text, IN_LED, parameter("law", law, "string")))
    assert [finding.severity for finding in found] == ([] if severity is None else [severity])
    said = "taxel_path: " if severity == "error" else "use taxel_tracer"
    assert all(said in finding.message and finding.line == 3 for finding in found)


def test_a_table_must_reach_the_wavelength(tmp_path):
    (tmp_path / "paint.csv").write_text("400, 0.5\n1000, 0.9\n")
    text = PAD.replace('<float name="reflectance" value="0.9"/>', parameter("reflectance_table", "paint.csv", "string"))
    assert check(tmp_path, text) == []
    (finding,) = check(tmp_path, change(text, IN_LED, parameter("wavelength", 1550)))
    assert (finding.severity, finding.line) == ("error", 9) and "1550" in finding.message
    other = PACKAGE.format(0.0).replace('"annular_led"/>', f'"annular_led">{parameter("wavelength", 850)}</emitter>')
    both = change(change(text, ('name="rows" value="3"', 'name="rows" value="{}"'), 1), AT_END, other)
    both = both.replace('name="columns" value="3"', 'name="columns" value="1"').replace(
        '<translate x="0.0"/>', '<translate x="3.55"/>'
    )
    assert check(tmp_path, both) == []
    (finding,) = check(tmp_path, both.replace("taxel_tracer", "ptracer"))
    assert finding.severity == "error" and "850, 925 nm" in finding.message


def test_mitsubas_own_integrators_need_the_origin(tmp_path):
    away = PLATE.replace("</transform>", '<translate y="100"/> </transform>')
    assert check(tmp_path, away) == []
    (finding,) = check(tmp_path, away.replace("taxel_tracer", "path"))
    assert finding.severity == "error" and "use taxel_tracer" in finding.message
