"""Measured walls: sources, values, and what is refused."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from mitsuba_taxel import InputError, PadSensor, Wall, check_scene, measure
from mitsuba_taxel.specification.wall_materials import WALL_MATERIALS, wall_table

PAGE = Path(__file__).parents[2] / "docs" / "reference" / "walls.md"
KNOWN = [material for material in WALL_MATERIALS.values() if material.measured]


@pytest.mark.parametrize("material", WALL_MATERIALS.values(), ids=WALL_MATERIALS)
def test_every_number_has_a_source(material):
    assert material.note and bool(material.law) == bool(material.measured)
    for measured in material.measured:
        assert re.search(r"\((19|20)\d\d\)", measured.source)
        assert re.search(r"doi:10\.\d{4,}/\S+|data sheet \S+", measured.source)
        wavelengths, reflectances = np.transpose(measured.rows)
        assert (np.diff(wavelengths) > 0).all() and ((reflectances > 0) & (reflectances < 1)).all()


@pytest.mark.parametrize("material", KNOWN, ids=[material.name for material in KNOWN])
def test_value_and_spread_hold_all_sources(material):
    assert material.covers[0] < 900 and material.covers[1] > 940
    for nm in (900.0, 925.0, 940.0):
        value, spread = material.at(nm), material.spread(nm)
        for measured in material.measured:
            here = np.interp(nm, *np.transpose(measured.rows))
            assert value - 2 * spread - 1e-12 < here - measured.spread
            assert here + measured.spread < value + 2 * spread + 1e-12


def test_aluminium_by_its_optical_constants():
    """At 940 nm, from n = 1.356 and k = 7.812 of one film, and between 0.90 and 0.92 by all."""
    index = complex(1.355589911, 7.812465936)
    expected = abs((index - 1) / (index + 1)) ** 2
    films = WALL_MATERIALS["aluminium"].measured
    assert np.interp(940, *np.transpose(films[1].rows)) == pytest.approx(expected, rel=1e-12)
    assert 0.90 < WALL_MATERIALS["aluminium"].at(940) < 0.92


def test_a_material_reads_as_its_reflectance(llvm_mono):
    value = WALL_MATERIALS["aluminium"].at(925)
    named, stated = (
        measure(PadSensor(roof=Wall("lambertian", **reflectance)).scene(), points=64, seed=2, mechanics_error=False)
        for reflectance in ({"material": "aluminium"}, {"reflectance": value})
    )
    np.testing.assert_allclose(named.power, stated.power, rtol=1e-6)


def test_without_data_at_the_wavelength_it_is_refused(llvm_mono):
    sensor = PadSensor(roof=Wall("lambertian", material="black_silicone"))
    message = "material = 'black_silicone' has no data at 925 nm: its reflectance is unknown; state reflectance"
    with pytest.raises(InputError, match=message):
        measure(sensor.scene(), points=64)
    with pytest.raises(InputError, match="'aluminium' has no data at 1050 nm: its data cover 885.61 to 960 nm"):
        WALL_MATERIALS["aluminium"].at(1050)


def test_check_finds_it(llvm_mono, tmp_path):
    PadSensor(roof=Wall("lambertian", material="white_silicone")).scene().write_xml(tmp_path / "pad.xml")
    assert [
        f.message for f in check_scene(tmp_path / "pad.xml") if "white_silicone" in f.message and f.severity == "error"
    ]


@pytest.mark.parametrize(
    "values, message",
    [
        ({"material": "gold"}, "material = 'gold' is not allowed: one of aluminium"),
        ({"material": "aluminium", "reflectance": 0.9}, "reflectance and material exclude each other"),
        ({"material": "aluminium", "reflectance_table": "a.csv"}, "exclude each other"),
        ({"material": "aluminium", "scattering": "absorbing"}, "material is not allowed for scattering = 'absorbing'"),
    ],
)
def test_bad_input(values, message):
    with pytest.raises(InputError, match=message):
        Wall(**values)


def test_the_page_has_the_catalogue():
    page = PAGE.read_text()
    table = [tuple(cell.strip() for cell in line.strip("|").split("|")) for line in page.splitlines() if "|" in line]
    assert table[2:] == [(f"`{name}`", *row) for name, *row in wall_table()]
