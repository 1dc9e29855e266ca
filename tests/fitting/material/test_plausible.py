"""Tests that no law follows: strains in percent without a unit, and kinds of tests that contradict each other."""

from __future__ import annotations

import numpy as np
import pytest

from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.fitting.material.material_fit import fit_material
from mitsuba_taxel.mechanics.materials.silicones import SILICONES

PLAIN = "strain,stress [MPa]"


@pytest.mark.parametrize("largest", [0.008, 0.028])
@pytest.mark.parametrize("noise", [0.0, 0.005])
def test_small_strains_in_percent_without_a_unit_are_refused_with_the_row(largest, noise, stress_of, write_csv, taxel):
    """Strains up to 0.8 and 2.8 %, which would be allowed as fractions."""
    strain = np.linspace(0, largest, 26)[1:]
    stress = stress_of("neo_hookean", (0.16,), "uniaxial", strain)
    stress = stress * (1 + noise * np.random.default_rng(0).normal(size=25))
    words = rf"^test 'a.csv', line 26: a strain of {100 * largest:g} seems to be in percent: .*'strain \[%\]' is needed"
    file = write_csv("a.csv", PLAIN, 100 * strain, stress)
    with pytest.raises(InputError, match=words):
        fit_material([file])
    said = taxel("material", str(file), "-o", str(file.with_suffix(".toml")))
    assert said.returncode == 2 and said.stderr.count("\n") == 1 and "line 26" in said.stderr

    percent = fit_material([write_csv("b.csv", "strain [%],stress [MPa]", 100 * strain, stress)])
    assert percent.best.material.youngs_modulus == pytest.approx(0.16 * 2 * 1.49, rel=0.03)
    assert fit_material([write_csv("c.csv", "strain [1],stress [MPa]", 100 * strain, stress)]).warnings


@pytest.mark.parametrize("label", ["neo_hookean", "yeoh, 2 terms", "ogden, 1 term"])
@pytest.mark.parametrize("noise", [0.0, 0.03])
def test_fractions_without_a_unit_are_no_percent(label, noise, stress_of, write_csv):
    constants = {"neo_hookean": (0.1,), "yeoh, 2 terms": (0.05, 0.01), "ogden, 1 term": (0.1, 2.5)}[label]
    for largest in (0.1, 0.5, 2.0):
        strain = np.linspace(0, largest, 31)[1:]
        stress = stress_of(label, constants, "uniaxial", strain)
        stress = stress * (1 + noise * np.random.default_rng(1).normal(size=30))
        fit = fit_material([write_csv("a.csv", PLAIN, strain, stress)])
        assert not any("percent" in line for line in fit.warnings)


def test_a_wavy_curve_is_no_percent_either(stress_of, write_csv):
    strain = np.linspace(0, 1, 31)[1:]
    stress = stress_of("neo_hookean", (0.1,), "uniaxial", strain) * (1 + 0.05 * np.sin(9 * strain))
    fit = fit_material([write_csv("a.csv", PLAIN, strain, stress)])
    assert not any("percent" in line for line in fit.warnings)


def test_a_noisy_curve_softer_than_all_named_silicones_is_warned_of(stress_of, write_csv):
    softest = min(entry.material.youngs_modulus for entry in SILICONES.values())
    strain, rng = np.linspace(0, 0.02, 31)[1:], np.random.default_rng(4)
    stress = stress_of("neo_hookean", (0.1,), "uniaxial", strain) * (1 + 0.05 * rng.normal(size=30))
    fit = fit_material([write_csv("a.csv", PLAIN, 100 * strain, stress)])
    assert fit.best.material.youngs_modulus < softest
    assert any("line 31" in line and "a strain of 2 without a unit may be in percent" in line for line in fit.warnings)
    with_unit = fit_material([write_csv("b.csv", "strain [1],stress [MPa]", 100 * strain, stress)])
    assert not any("percent" in line for line in with_unit.warnings)


@pytest.mark.parametrize("factor", [0.5, 2.5])
@pytest.mark.parametrize("kind", ["compression", "equibiaxial"])
def test_kinds_of_tests_that_contradict_each_other_are_refused_with_the_row(factor, kind, stress_of, write_csv):
    rng, strain = np.random.default_rng(3), np.linspace(0, 0.5, 26)[1:]
    tension = stress_of("neo_hookean", (0.1,), "uniaxial", strain) * (1 + 0.01 * rng.normal(size=25))
    sign, mode = (-1, "uniaxial") if kind == "compression" else (1, kind)
    other = factor * sign * stress_of("neo_hookean", (0.1,), mode, sign * strain) * (1 + 0.01 * rng.normal(size=25))
    files = write_csv("a.csv", PLAIN, strain, tension), write_csv("b.csv", PLAIN, strain, other)
    words = r"^test '[ab].csv', line \d+: .* MPa at a strain of .*, where the law that is nearest .*with '[ab].csv'"
    with pytest.raises(InputError, match=words) as caught:
        fit_material(files[:1], **{kind: files[1:]})
    assert "\n" not in str(caught.value)
    agreeing = write_csv("c.csv", PLAIN, strain, other / factor)
    assert fit_material(files[:1], **{kind: [agreeing]}).best.misfit < 2


@pytest.mark.parametrize(("kind", "largest"), [("compression", 0.4), ("equibiaxial", 0.25)])
def test_kinds_that_an_unstable_law_follows_do_not_contradict_each_other(kind, largest, stress_of, write_csv):
    """The law is refused, and the others miss a test by a fifth or more: this is warned of."""
    rng, strain, smaller = np.random.default_rng(3), np.linspace(0, 1, 31)[1:], np.linspace(0, largest, 31)[1:]
    label, constants = "mooney_rivlin", (0.06, -0.02)
    tension = stress_of(label, constants, "uniaxial", strain) * (1 + 0.003 * rng.normal(size=30))
    sign, mode = (-1, "uniaxial") if kind == "compression" else (1, kind)
    other = sign * stress_of(label, constants, mode, sign * smaller) * (1 + 0.003 * rng.normal(size=30))
    files = write_csv("a.csv", PLAIN, strain, tension), write_csv("b.csv", PLAIN, smaller, other)
    fit = fit_material(files[:1], **{kind: files[1:]})
    (unstable,) = (each for each in fit.fits if each.candidate.label == label)
    assert unstable.refusal and unstable.misfit < 1.5
    assert any("no law follows the tests within their noise" in line for line in fit.warnings)
