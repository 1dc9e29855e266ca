"""Values in other units are found, and what is just right is left in peace."""

from __future__ import annotations

import re

import pytest
from flawed_scene import IN_LED, IN_PAD, IN_REFLECTOR, IN_SENSOR, PAD, change, check, parameter

from mitsuba_taxel import Pad

pytestmark = [pytest.mark.usefixtures("static"), pytest.mark.quick]

UNITS = {
    "pad in m": (PAD, IN_PAD, "cell_height", 0.00155, 0.06, "warning", r"unusual: .* if it is in m, write 1.55"),
    "height in µm": (PAD, IN_PAD, "height", 4550, 150, "warning", "if it is in µm, write 4.55"),
    "mesh size in m": (PAD, IN_PAD, "mesh_size", 0.00125, 0.5, "warning", "mesh_size .* in m, write 1.25"),
    "LED in m": (PAD, IN_LED, "size", 0.00025, 0.2, "error", "hole = 0.1 is not allowed"),
    "modulus in Pa": (PAD, ('"4.16"', '"{}"'), None, 4.16e6, 9.9, "warning", "in Pa, write 4.16"),
    "modulus in kPa": (PAD, ('"4.16"', '"{}"'), None, 4160, 99, "warning", "in kPa, write 4.16"),
    "modulus in GPa": (PAD, ('"4.16"', '"{}"'), None, 0.00416, 0.006, "warning", "in GPa, write 4.16"),
    "wavelength in µm": (PAD, IN_LED, "wavelength", 0.925, 250, "warning", "in µm, write 925"),
    "wavelength in m": (PAD, IN_LED, "wavelength", 9.25e-7, 1550, "warning", "in m, write 925"),
    "cone in radians": (PAD, IN_LED, "cone_angle", 1.05, 1.6, "warning", "in radians, write 60.16"),
    "force in mN": (PAD, ('"-5"', '"{}"'), None, -5000, -1000, "warning", "if it is in mN, write it in N"),
    "force in kN": (PAD, ('"-5"', '"{}"'), None, -0.005, -0.02, "warning", "if it is in kN, write it in N"),
    "a pull": (PAD, ('"-5"', '"{}"'), None, 5, 0, "warning", "pulls at the pad: compression is negative"),
}  # fmt: skip


@pytest.mark.parametrize("text, place, name, wrong, right, severity, message", UNITS.values(), ids=UNITS.keys())
def test_units(tmp_path, text, place, name, wrong, right, severity, message):
    def said_of(value):
        return check(tmp_path, change(text, place, value if name is None else parameter(name, value)))

    (finding,) = (found for found in said_of(wrong) if re.search(message, found.message))
    assert finding.severity == severity and finding.line > 1
    assert not [found for found in said_of(right) if "odd" in found.message or re.search(message, found.message)]


def test_a_force_whose_square_is_no_number(tmp_path):
    (finding,) = check(tmp_path, PAD, fz=-1e200)
    assert "times Young's modulus on its top" in finding.message


def test_a_load_is_not_judged_by_an_odd_modulus(tmp_path):
    (finding,) = check(tmp_path, PAD.replace("4.16", "4.16e6"))
    assert "youngs_modulus" in finding.message


@pytest.mark.parametrize(
    "load, message",
    [
        (("plate_displacement", "vector", "displacement", "0, 0, 0.5"), "pulls at the pad"),
        (("plate_displacement", "vector", "displacement", "0, 0, -500"), "more than the height of the pad, 4.55 mm"),
        (("pressure", "float", "pressure", "-0.1"), "suction"),
        (("pressure", "float", "pressure", "20000"), "if it is in Pa or kPa"),
        (("plate_displacement", "vector", "displacement", "0, 0, -0.5"), None),
        (("pressure", "float", "pressure", "0.1"), None),
    ],
)
def test_other_loads(tmp_path, load, message):
    name, tag, quantity, value = load
    text = PAD.replace('<vector name="force" value="0, 0, $fz"/>', parameter("load", name, "string"))
    text = change(text, IN_PAD, parameter(quantity, value, tag)).replace('<default name="fz" value="-5"/>', "")
    found = check(tmp_path, text)
    assert [finding.severity for finding in found] == ["warning"] * (message is not None)
    assert message is None or message in found[0].message


@pytest.mark.parametrize(("history", "noted"), [("", True), ("1 0 0 -6", False)])
def test_a_first_loading_with_mullins_effect(tmp_path, history, noted):
    effect = parameter("mullins", "2 0.02", "string") + parameter("history", history, "string")
    found = check(tmp_path, change(PAD, IN_PAD, effect))
    assert [finding.severity for finding in found] == ["note"] * noted
    assert not noted or "hardly changes a first loading: history" in found[0].message


@pytest.mark.parametrize(("x", "y", "beside"), [(20.0, 0.0, True), (0.0, -6.0, True), (1.0, 2.0, False)])
def test_a_force_beside_a_tilting_plate(tmp_path, x, y, beside):
    kind = parameter("load", "plate_wrench", "string") + parameter("load_x", x) + parameter("load_y", y)
    found = check(tmp_path, change(PAD, IN_PAD, kind + parameter("moment", "0, 1e-9, 0", "vector")))
    assert [finding.severity for finding in found] == ["warning"] * beside
    assert not beside or f"load_x, load_y = {x:g}, {y:g} mm, outside of the plate" in found[0].message


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_a_moment_that_no_pad_bears(tmp_path, axis):
    """The largest stress on a square top is 6 M / side^3: three times Young's modulus are too much."""
    extent = Pad().extent
    assert extent[0] == extent[1]
    largest = 3 * 4.16 * extent[0] ** 3 / 6
    kind = parameter("load", "plate_wrench", "string")
    for factor, warned in ((0.99, False), (1.01, True), (1e200, True)):
        values = [0.0, 0.0, 0.0]
        values[axis] = -factor * largest
        moment = parameter("moment", ", ".join(map(str, values)), "vector")
        found = check(tmp_path, change(PAD, IN_PAD, kind + moment))
        assert [finding.severity for finding in found] == ["warning"] * warned
        assert not warned or re.search(r"moment = .* N mm .* times Young's modulus at the edge", found[0].message)


def test_a_photo_reflector_in_metres(tmp_path):
    """Each length is odd, and says what it would be in mm."""
    lengths = parameter("body", "0.00146, 0.00106, 0.0005", "vector") + parameter("spacing", 0.0009)
    text = change(PAD, IN_LED, parameter("size", 0.00025) + parameter("hole", 0.0001))
    text = change(
        change(text, IN_SENSOR, parameter("width", 0.00052) + parameter("depth", 0.0003)), IN_REFLECTOR, lengths
    )
    meant = re.findall(
        r"if it is in m, write ([\d.]+)\.", " ".join(finding.message for finding in check(tmp_path, text))
    )
    assert meant == ["1.46", "0.9", "0.25", "0.52", "0.3"]
