"""Tables of tests: units, modes, branches, and what is refused, with its line."""

from __future__ import annotations

import numpy as np
import pytest

from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.fitting.material.curves import read_curve
from mitsuba_taxel.fitting.material.material_fit import fit_material
from mitsuba_taxel.fitting.material.noise import curve_noise, refuse_contradictions

STRAIN = np.linspace(0, 0.6, 25)
YEOH = ("yeoh, 2 terms", (0.05, 0.01))


@pytest.fixture
def stress(stress_of):
    return stress_of(*YEOH, "uniaxial", STRAIN)


@pytest.mark.parametrize(
    ("heading", "of_strain", "of_stress", "options"),
    [
        ("strain,stress [MPa]", lambda e: e, lambda s, e: s, {}),
        ("strain [%],stress [kPa]", lambda e: 100 * e, lambda s, e: 1e3 * s, {}),
        ("Strain (%),Stress (psi)", lambda e: 100 * e, lambda s, e: s / 6.894757293168361e-3, {}),
        ("stretch,stress_MPa", lambda e: 1 + e, lambda s, e: s, {}),
        ("extension [mm],force [N]", lambda e: 33 * e, lambda s, e: 18 * s, {"area": 18.0, "length": 33.0}),
        ("strain [mm/mm],stress [N/mm^2]", lambda e: e, lambda s, e: s, {}),
        ("true strain,true stress [MPa]", np.log1p, lambda s, e: s * (1 + e), {}),
        ("strain,stress [MPa]", lambda e: e, lambda s, e: s * (1 + e), {"true_stress": True}),
        ("strain,stress [MPa]", lambda e: -e, lambda s, e: -s, {"compression": True}),
    ],
)
def test_units_become_nominal_strain_and_stress(heading, of_strain, of_stress, options, stress, write_csv):
    file = write_csv("a.csv", heading, of_strain(STRAIN), of_stress(stress, STRAIN))
    curve = read_curve(file, "uniaxial", **options)
    np.testing.assert_allclose(curve.strain, STRAIN, atol=1e-8)
    np.testing.assert_allclose(curve.stress, stress, rtol=1e-6, atol=1e-10)
    assert curve.lines.tolist() == list(range(2, 27)) and not curve.notes


def test_nominal_columns_are_preferred_to_true_ones(stress, write_csv):
    heading = "true strain,true stress [MPa],engineering strain,engineering stress [MPa]"
    file = write_csv("a.csv", heading, np.log1p(STRAIN), stress * (1 + STRAIN), STRAIN, stress)
    np.testing.assert_allclose(read_curve(file, "uniaxial").stress, stress, rtol=1e-6, atol=1e-10)


@pytest.mark.parametrize(
    ("mode", "strain", "largest"),
    [("uniaxial", 0.6, 1.6), ("uniaxial", -0.5, 2**0.5), ("planar", -0.5, 2.0), ("equibiaxial", -0.5, 4.0)],
)
def test_largest_principal_stretch(mode, strain, largest, stress_of, write_csv):
    strains = np.linspace(0, strain, 12)
    file = write_csv("a.csv", "strain,stress [MPa]", strains, stress_of(*YEOH, mode, strains))
    assert read_curve(file, mode).largest_stretch == pytest.approx(largest)


def test_unloading_and_reloading_are_left_out_and_said(stress, write_csv):
    there, back = np.arange(20), np.arange(19, 3, -1)
    rows = np.concatenate([there, back, back[::-1], np.arange(20, 25)])
    softer = np.concatenate([stress[there], 0.8 * stress[back], 0.8 * stress[back[::-1]], stress[20:]])
    curve = read_curve(write_csv("a.csv", "strain,stress [MPa]", STRAIN[rows], softer), "uniaxial")
    np.testing.assert_allclose(curve.strain, STRAIN, atol=1e-8)
    np.testing.assert_allclose(curve.stress, stress, rtol=1e-6, atol=1e-10)
    assert curve.notes == ["a.csv: 32 rows of unloading and reloading are left out"]


def test_noise_of_the_strain_is_no_unloading(stress, write_csv):
    noisy = STRAIN + 0.004 * np.random.default_rng(1).normal(size=25)
    assert len(read_curve(write_csv("a.csv", "strain,stress [MPa]", noisy, stress), "uniaxial").lines) == 25


@pytest.mark.parametrize("noise", [0.0, 0.05])
def test_a_noisy_curve_does_not_fall(noise, stress, write_csv):
    for seed in range(30):
        noisy = stress * (1 + noise * np.random.default_rng(seed).normal(size=25))
        read_curve(write_csv("a.csv", "strain,stress [MPa]", STRAIN, noisy), "uniaxial")


def edited(**changes):
    def edit(strain, stress):
        stress = stress.copy()
        for row, factor in changes.get("factors", {}).items():
            stress[row:] *= factor
        return changes.get("scale", 1) * strain, stress

    return edit


@pytest.mark.parametrize(
    ("heading", "edit", "words"),
    [
        ("strain,stress [MPa]", lambda e, s: (100 * e, s), "line 4: a strain of 5 may be in percent: the heading"),
        ("strain,stress [MPa]", lambda e, s: (-100 * e, -s), "line 4: a strain of -5 may be in percent"),
        ("strain,stress [MPa]", lambda e, s: (-2 * e, -s), "line 22: a strain of -1 is not allowed: above -1 is"),
        ("strain,stress [MPa]", lambda e, s: (e, -s), "line 4: a stress of -0.0.* at a strain of 0.05 has the wrong"),
        ("strain,stress [MPa]", lambda e, s: (-e, s), "line 4: .*wrong sign: .*given as compression"),
        ("strain,stress [MPa]", lambda e, s: (e[9:10], s[9:10]), "line 2 alone is not enough: at least 5 rows"),
        ("strain,stress [MPa]", lambda e, s: (e[:3], s[:3]), "3 rows are not enough: at least 5 rows"),
        ("strain,stress [MPa]", edited(factors={20: 0.3}), "line 2[12]: the stress falls from 0.1.* to 0.0"),
        ("strain,stress [MPa]", lambda e, s: (e[1:6], s[6:1:-1]), "line 2 to 6: the stress is lower in the"),
        ("strain [mil],stress [MPa]", lambda e, s: (e, s), "column strain .mil.: the unit 'mil' is not known"),
        ("strain,stress", lambda e, s: (e, s), "column stress: a unit is needed"),
        ("strain,force [N]", lambda e, s: (e, s), "the area of the specimen in mm² is needed"),
        ("extension [mm],stress [MPa]", lambda e, s: (e, s), "the length of the specimen in mm is needed"),
        ("stretch,stress [MPa]", lambda e, s: (e, s), "line 2: a stretch of 0 or less is not allowed"),
        ("time,stress [MPa]", lambda e, s: (e, s), "no column is not allowed: one column is needed whose heading"),
        ("strain,strain 2,stress [MPa]", lambda e, s: (e, e, s), "columns strain, strain 2 are not allowed"),
    ],
)
def test_what_is_no_test_is_refused_in_one_line_with_its_row(heading, edit, words, stress, write_csv):
    file = write_csv("bad.csv", heading, *edit(STRAIN, stress))
    with pytest.raises(InputError, match=words) as caught:
        read_curve(file, "uniaxial")
    assert str(caught.value).startswith("test 'bad.csv'") and "\n" not in str(caught.value)


def test_tests_that_contradict_each_other_are_refused_with_the_row(stress, write_csv):
    rng = np.random.default_rng(2)
    first, second, third = (
        write_csv(f"{name}.csv", "strain,stress [MPa]", STRAIN, factor * stress * (1 + 0.01 * rng.normal(size=25)))
        for name, factor in (("a", 1.0), ("b", 1.3), ("c", 1.06))
    )
    words = r"^test 'b.csv', line \d+: .* MPa at a strain of .*, \+[23]\d% from 'a.csv', which"
    with pytest.raises(InputError, match=words):
        fit_material([first, second])
    again = write_csv("d.csv", "strain,stress [MPa]", STRAIN, stress * (1 + 0.01 * rng.normal(size=25)))
    curves = [read_curve(file, "uniaxial") for file in (first, third, again)]
    noises = [curve_noise(curve) for curve in curves]
    warnings = refuse_contradictions(curves, noises)
    assert len(warnings) == 2 and all("'c.csv'" in line and "more than their noise" in line for line in warnings)
    assert not refuse_contradictions([curves[0], curves[2]], [noises[0], noises[2]])


def test_without_a_test_or_with_a_bad_limit_there_is_no_fit(stress, write_csv):
    file = write_csv("a.csv", "strain,stress [MPa]", STRAIN, stress)
    with pytest.raises(InputError, match="no test is given"):
        fit_material()
    with pytest.raises(InputError, match="up_to = -1 is not allowed"):
        fit_material([file], up_to=-1)
    with pytest.raises(InputError, match="area = 0 is not allowed"):
        fit_material([file], area=0)
    with pytest.raises(InputError, match=r"3 rows up to a strain of 0.06 are not enough"):
        fit_material([file], up_to=0.06)


@pytest.mark.parametrize(("heading", "factor", "noted"), [
    ("strain", 2.5, True), ("strain", 0.9, False), ("strain [1]", 2.5, False), ("strain [%]", 250, False),
])  # fmt: skip
def test_large_strains_without_a_unit_are_noted(heading, factor, noted, stress, write_csv):
    """They may be in percent: 2.5 % is written as 2.5."""
    rising = np.linspace(0, 1, len(stress))
    curve = read_curve(write_csv("a.csv", f"{heading},stress [MPa]", factor * rising, rising), "uniaxial")
    assert any("taken as a fraction" in note for note in curve.notes) == noted
