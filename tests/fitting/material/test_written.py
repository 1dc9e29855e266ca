"""`taxel material`: the file and the plot, the answer, and one line for bad input."""

from __future__ import annotations

import json

import numpy as np
import pytest

from mitsuba_taxel import Material, NeoHookean, Yeoh
from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.fitting.material.candidates import CANDIDATES
from mitsuba_taxel.fitting.material.curves import read_curve
from mitsuba_taxel.fitting.material.material_fit import rank_laws
from mitsuba_taxel.mechanics.materials.laws import ArrudaBoyce
from mitsuba_taxel.mechanics.materials.material_file import read_material


def test_tests_in_own_units_become_a_file_and_a_plot(stress_of, write_csv, tmp_path, taxel):
    rng, strain, law = np.random.default_rng(1), np.linspace(0, 0.8, 40), ("yeoh, 2 terms", (0.05, 0.015))
    tension = stress_of(*law, "uniaxial", strain) + 0.002 * rng.normal(size=40)
    write_csv("tension.csv", "strain [%],stress [psi]", 100 * strain, tension / 6.894757e-3)
    compression = -stress_of(*law, "uniaxial", -strain / 2) + 0.002 * rng.normal(size=40)
    write_csv("compression.csv", "extension [mm],force [N]", 6 * strain, 600 * compression)
    words = ("tension.csv", "--compression", "compression.csv", "--area", "600", "--length", "12")
    done = taxel("material", *words, "-o", "mine.toml")
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith("yeoh, 2 terms: c10 = 0.0") and 'material="mine.toml"' in done.stdout
    assert (tmp_path / "mine.png").exists()
    assert read_material(tmp_path / "mine.toml").law.c10 == pytest.approx(0.05, rel=0.1)

    done = taxel("material", *words, "-o", "mine.toml", "--json")
    answer = json.loads(done.stdout)
    assert answer["law"] == "yeoh, 2 terms" and len(answer["ranking"]) == 8
    for name, value in (("c10", 0.05), ("c20", 0.015)):
        assert answer["constants"][name]["low"] < value < answer["constants"][name]["high"]


def test_bad_tests_are_one_line(stress_of, write_csv, taxel):
    strain = np.linspace(0, 0.8, 40)
    write_csv("a.csv", "strain,stress [MPa]", 100 * strain, stress_of("neo_hookean", (0.1,), "uniaxial", strain))
    done = taxel("material", "a.csv")
    assert done.returncode == 2 and done.stderr.count("\n") == 1
    assert "test 'a.csv', line 4: a strain of 4.10256 may be in percent" in done.stderr


def test_a_law_is_fitted_from_python_as_by_the_command(stress_of, write_csv, tmp_path, taxel):
    rng, strain = np.random.default_rng(3), np.linspace(0.02, 0.8, 40)
    stress = stress_of("yeoh, 2 terms", (0.05, 0.015), "uniaxial", strain) * (1 + 0.02 * rng.normal(size=40))
    file = write_csv("tension.csv", "strain,stress [MPa]", strain, stress)
    fit = Material.fit([file])
    assert taxel("material", "tension.csv", "-o", "mine.toml").returncode == 0
    assert read_material(tmp_path / "mine.toml").law == fit.best.material

    one = Yeoh.fit([file])
    assert {other.candidate.label for other in one.fits} == {"yeoh, 2 terms", "yeoh, 3 terms"}
    assert (one.best.low < [0.05, 0.015]).all() and (one.best.high > [0.05, 0.015]).all()
    assert [other.candidate.law for other in NeoHookean.fit([file]).fits] == ["neo_hookean"]


def test_a_law_that_cannot_be_fitted_is_refused(write_csv):
    class Own(ArrudaBoyce):
        """A user's law, without a name in scenes."""

    file = write_csv("a.csv", "strain,stress [MPa]", [0.1, 0.2, 0.3, 0.4, 0.5], [0.02, 0.04, 0.06, 0.08, 0.1])
    with pytest.raises(InputError, match="law = 'Own' cannot be fitted: one of arruda_boyce, "):
        Own.fit([file])
    curve = read_curve(file, "uniaxial")
    three_terms = [candidate for candidate in CANDIDATES if candidate.label == "ogden, 3 terms"]
    with pytest.raises(InputError, match="5 rows of tests are not enough"):
        rank_laws([curve], candidates=three_terms)
