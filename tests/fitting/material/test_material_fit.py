"""Fits of laws: constants within their intervals, ranking, slack, memory, and the file for scenes."""

from __future__ import annotations

import time
from dataclasses import replace

import numpy as np
import pytest

from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.fitting.material.candidates import CANDIDATES
from mitsuba_taxel.fitting.material.curves import StressCurve
from mitsuba_taxel.fitting.material.law_fit import Tests, fit_law
from mitsuba_taxel.fitting.material.material_fit import fit_material, rank_laws
from mitsuba_taxel.fitting.material.noise import curve_noise
from mitsuba_taxel.fitting.material.relaxation import fit_relaxation
from mitsuba_taxel.fitting.material.written import constant_rows, material_answer, write_material
from mitsuba_taxel.mechanics.materials.laws import Yeoh
from mitsuba_taxel.mechanics.materials.material_file import read_material
from mitsuba_taxel.mechanics.materials.silicones import SILICONES

LAWS = {candidate.label: candidate for candidate in CANDIDATES}
CONSTANTS = {
    "neo_hookean": (0.1,),
    "mooney_rivlin": (0.05, 0.02),
    "yeoh, 2 terms": (0.05, 0.01),
    "yeoh, 3 terms": (0.05, -0.002, 0.001),
    "arruda_boyce": (0.1, 1.6),
    "ogden, 1 term": (0.1, 3.5),
    "ogden, 2 terms": (0.1, 0.02, 1.3, -3.0),
    "ogden, 3 terms": (0.1, 0.02, 0.001, 1.3, -3.0, 9.0),
}
TAIL = 3.5
"""Deviations of a count from its expectation that a test allows: a false alarm in 2000 runs."""


@pytest.mark.parametrize("mode", ["uniaxial", "planar", "equibiaxial"])
@pytest.mark.parametrize("label", LAWS)
def test_closed_forms_are_the_stresses_of_the_laws(label, mode):
    """The laws of scenes, incompressible, with the pressure by which the third face is free."""
    candidate, constants = LAWS[label], np.array(CONSTANTS[label])
    law = candidate.build(dict(zip(candidate.names, constants.tolist(), strict=True)))
    for stretch in (0.6, 0.95, 1.3, 2.0):
        powers = {"uniaxial": (1, -0.5, -0.5), "planar": (1, 0, -1), "equibiaxial": (1, 1, -2)}[mode]
        stretches = stretch ** np.array(powers, dtype=float)
        isochoric = np.diag(law.stress(np.diag(stretches), np.array(1.0), np.diag(1 / stretches)))
        expected = isochoric[0] - isochoric[2] * stretches[2] / stretches[0]
        assert candidate.stress(mode, np.array([stretch]), constants)[0] == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize("label", ["neo_hookean", "mooney_rivlin", "yeoh, 2 terms", "arruda_boyce", "ogden, 1 term"])
def test_constants_of_exact_curves_are_found(label, curve_of):
    rng = np.random.default_rng(0)
    curves = [curve_of(label, CONSTANTS[label], mode, np.linspace(0.03, 1, 30), rng, 1e-7) for mode in
              ("uniaxial", "equibiaxial")]
    fit = fit_law(LAWS[label], Tests(curves, [curve_noise(curve) for curve in curves]))
    np.testing.assert_allclose(fit.constants, CONSTANTS[label], rtol=1e-4)


def test_intervals_hold_the_constants_of_the_database_in_95_of_100_tests(curve_of):
    """300 tests of 40 points and 5 % noise, of one or the other kind; all laws are fitted in less than 5 s."""
    laws = [entry.material for entry in SILICONES.values() if isinstance(entry.material, Yeoh)]
    assert len(laws) == 19
    rng, held, candidate = np.random.default_rng(1), [], LAWS["yeoh, 2 terms"]
    for number in range(300):
        law = laws[number % 19]
        constants = (law.c10, law.c20)
        strain = np.linspace(0, (0.5, 1.0, 1.5)[number % 3], 41)[1:]
        curve = curve_of("yeoh, 2 terms", constants, "uniaxial", strain, rng, grows=number % 2 == 0)
        fit = fit_law(candidate, tests := Tests([curve], [curve_noise(curve)]), constants_only=True)
        held.append((fit.low <= constants) & (constants <= fit.high))
    whole = fit_law(candidate, tests)
    assert np.all(whole.constants == fit.constants) and whole.material == Yeoh(*fit.constants) and not fit.material
    bound = 0.95 - TAIL * np.sqrt(0.95 * 0.05 / 300)
    assert np.all(np.mean(held, axis=0) > bound), np.mean(held, axis=0)

    start = time.process_time()
    ranking = rank_laws([curve]).ranking
    assert time.process_time() - start < 5
    assert len(ranking) == len(CANDIDATES)


# Constants with which laws differ by more than their noise, in tension and equibiaxial tension.
DIFFERENT = {
    "neo_hookean": lambda rng: (rng.uniform(0.02, 0.2),),
    "mooney_rivlin": lambda rng: (0.05, 0.05 * rng.uniform(0.15, 0.6)),
    "yeoh, 2 terms": lambda rng: (0.05, 0.05 * rng.uniform(0.1, 0.4)),
    "arruda_boyce": lambda rng: (0.05, rng.uniform(1.3, 1.8)),
    "ogden, 1 term": lambda rng: (0.1, rng.choice([rng.uniform(0.5, 1.3), rng.uniform(3, 5)])),
    "ogden, 2 terms": lambda rng: (0.1, 0.05, rng.uniform(1, 1.5), rng.uniform(-5, -3.5)),
}
DRAWS = 100
STRAINS = {"uniaxial": np.linspace(0, 1.2, 41)[1:], "equibiaxial": np.linspace(0, 0.6, 41)[1:]}


def test_the_right_law_is_ranked_first_in_95_of_100_draws(curve_of, monkeypatch):
    """Draws in which another law with as few constants follows the exact curves within half the noise do not count."""
    # Intervals take no part in the ranking.
    monkeypatch.setattr("mitsuba_taxel.fitting.material.material_fit._with_unknown_slacks", lambda fit, _: fit)
    rng, right, count, number = np.random.default_rng(5), 0, 0, 0
    while count < DRAWS:
        label = list(DIFFERENT)[number % len(DIFFERENT)]
        number += 1
        constants = DIFFERENT[label](rng)
        exact, noisy = (
            [curve_of(label, constants, mode, strain, rng, noise) for mode, strain in STRAINS.items()]
            for noise in (0.0, 0.05)
        )
        noises = [curve_noise(curve)._replace(deviation=0.05 * np.abs(curve.stress)) for curve in exact]
        others = [law for law in CANDIDATES if law.label != label and len(law.names) <= len(constants)]
        fits = [fit_law(law, Tests(exact, noises)) for law in others]
        if min((fit.misfit for fit in fits if not fit.refusal), default=1.0) < 0.5:
            continue
        count += 1
        right += rank_laws(noisy).best.candidate.label == label
    assert right >= 0.95 * DRAWS


@pytest.mark.parametrize("slack", [0.05, -0.04, 0.0])
def test_slack_and_preload_are_found_and_said(slack, stress_of, write_csv):
    rng, strain = np.random.default_rng(3), np.linspace(0, 0.6, 40)
    stress = stress_of("yeoh, 2 terms", (0.05, 0.015), "uniaxial", np.maximum(strain - slack, 0))
    stress = stress + 0.003 * rng.normal(size=40)
    fit = fit_material([write_csv("a.csv", "strain,stress [MPa]", strain, stress)])
    yeoh = next(other for other in fit.fits if other.candidate.label == "yeoh, 2 terms")
    np.testing.assert_array_less(yeoh.low, (0.05, 0.015))
    np.testing.assert_array_less((0.05, 0.015), yeoh.high)
    notes = [note for note in fit.notes if "does not start at the origin" in note]
    if slack:
        assert yeoh.slacks[0] == pytest.approx(slack, abs=3 * yeoh.slack_errors[0])
        assert len(notes) == 1 and ("of slack is subtracted" if slack > 0 else "of preload is added") in notes[0]
    else:
        assert not notes and not yeoh.slacks.any()
        assert any("no slack is subtracted" in note and "a slack of -0.0" in note for note in fit.notes)


def test_slack_of_a_curve_that_begins_late_is_said_to_be_unseen(curve_of):
    curve = curve_of("neo_hookean", (0.1,), "uniaxial", np.linspace(0.1, 0.6, 40), np.random.default_rng(3), 0.01)
    fit = rank_laws([curve])
    assert "uniaxial.csv: slack up to its first strain, 0.1, is unknown; intervals leave it out" in fit.notes


@pytest.mark.parametrize(("slack", "grows"), [(0.02, False), (0.04, True), (-0.015, False)])
def test_intervals_hold_the_constants_whether_slack_is_found_or_not(slack, grows, stress_of, monkeypatch):
    """100 curves of 2 % noise, under which such a slack is found in some and not excluded in the others. Only two laws
    are fitted: an interval does not depend on the other laws."""
    simple = (LAWS["neo_hookean"], LAWS["yeoh, 2 terms"])
    monkeypatch.setattr("mitsuba_taxel.fitting.material.material_fit.CANDIDATES", simple)
    rng, strain, held, constants = np.random.default_rng(8), np.linspace(0, 0.6, 41)[1:], [], (0.05, 0.015)
    exact = stress_of("yeoh, 2 terms", constants, "uniaxial", np.maximum(strain - slack, 0))
    deviation = 0.02 * (np.abs(exact) if grows else np.abs(exact).max())
    for _ in range(100):
        stress = exact + deviation * rng.normal(size=40)
        fit = rank_laws([StressCurve("a.csv", "uniaxial", np.arange(2, 42), strain, stress)], candidates=simple)
        yeoh = next(other for other in fit.fits if other.candidate.label == "yeoh, 2 terms")
        held.append((yeoh.low <= constants) & (constants <= yeoh.high))
    assert np.all(np.mean(held, axis=0) > 0.95 - TAIL * np.sqrt(0.95 * 0.05 / 100)), np.mean(held, axis=0)


def test_a_law_that_falls_within_the_tests_is_refused_and_last(curve_of):
    """Curves of Yeoh's kind, in tension alone, give Mooney-Rivlin a negative c01."""
    strain, rng = np.linspace(0, 1, 41)[1:], np.random.default_rng(4)
    curve = curve_of("yeoh, 2 terms", (0.05, 0.02), "uniaxial", strain, rng, 0.01)
    fit = rank_laws([curve])
    mooney = fit.fits[-1]
    assert mooney.candidate.label == "mooney_rivlin" and mooney.constants[1] < 0 and mooney.refusal
    assert not fit.best.refusal and fit.ranking.refusal.iloc[-1] == mooney.refusal
    assert any("only uniaxial tests" in line for line in fit.warnings)


def test_a_relaxation_gives_its_prony_series_within_its_errors(write_csv):
    rng, held = np.random.default_rng(6), []
    time = np.concatenate([[0], np.geomspace(0.05, 300, 60)])
    for _ in range(20):
        exact = 1 - 0.12 * (1 - np.exp(-time / 0.8)) - 0.08 * (1 - np.exp(-time / 40))
        force = 2.5 * exact * (1 + 0.002 * rng.normal(size=61))
        fit = fit_relaxation(write_csv("r.csv", "time [ms],force [N]", 1e3 * time, force))
        assert len(fit.prony) == 2
        for (weight, tau), g, t, dg, dt in zip(
            fit.prony, (0.12, 0.08), (0.8, 40), fit.weight_errors, fit.time_errors, strict=True
        ):
            held += [abs(weight - g) <= dg, abs(tau - t) <= dt]
    assert np.mean(held) > 0.95 - TAIL * np.sqrt(0.95 * 0.05 / 20)  # the four of a fit are not independent


@pytest.mark.parametrize(
    ("time", "force", "words"),
    [
        ([0, 1, 1, 2, 3, 4, 5, 6, 7], np.linspace(2, 1, 9), "line 4: time does not grow"),
        (np.arange(5.0), np.linspace(2, 1, 5), "at least 8"),
        (np.arange(12.0), np.full(12, 2.0), "line 2: the stress does not fall"),
    ],
)
def test_what_is_no_relaxation_is_refused(time, force, words, write_csv):
    with pytest.raises(InputError, match=words):
        fit_relaxation(write_csv("r.csv", "time [s],force [N]", time, force))


def test_the_file_is_a_material_of_scenes(curve_of, write_csv, tmp_path):
    rng, strain = np.random.default_rng(7), np.linspace(0, 0.8, 40)
    curve = curve_of("yeoh, 2 terms", (0.05, 0.015), "uniaxial", strain, rng, 0.01, grows=False)
    time = np.linspace(0, 20, 40)
    relaxation = write_csv("r.csv", "time [s],stress [MPa]", time, 1 - 0.3 * (1 - np.exp(-time / 2)))
    fit = rank_laws([curve], fit_relaxation(relaxation))
    write_material(fit, tmp_path / "mine.toml")
    material = read_material(tmp_path / "mine.toml")
    assert material.law == fit.best.material and material.largest_stretch == pytest.approx(1.8)
    ((weight, tau),) = material.prony
    assert (weight, tau) == (pytest.approx(0.3, rel=1e-3), pytest.approx(2, rel=1e-3))
    assert material.content["intervals"]["c10"] == pytest.approx([fit.best.low[0], fit.best.high[0]], rel=1e-5)
    np.testing.assert_allclose(material.content["covariance"]["rows"], fit.best.covariance, rtol=1e-6)
    assert material.content["tests"][0]["rows"] == 40 and "uniaxial.csv" in material.source
    assert material_answer(fit).startswith("yeoh, 2 terms: c10 = 0.0")


@pytest.mark.parametrize(("unit", "seconds"), [("s", 1.0), ("min", 60.0), ("h", 3600.0)])
def test_times_of_a_relaxation_have_their_unit(unit, seconds, write_csv):
    time = np.linspace(0, 30, 60)
    fit = fit_relaxation(write_csv("r.csv", f"time [{unit}],force [N]", time, 10 - 2 * (1 - np.exp(-time / 5))))
    assert fit.prony == (pytest.approx((0.2, 5 * seconds), rel=1e-4),)


def test_an_unknown_unit_of_time_is_refused(write_csv):
    time = np.linspace(0, 30, 60)
    with pytest.raises(InputError, match=r"column time \[d\]: a unit of time is needed: s, ms, min or h"):
        fit_relaxation(write_csv("r.csv", "time [d],force [N]", time, 10 - 2 * (1 - np.exp(-time / 5))))


def test_the_printed_error_is_the_larger_half_of_the_interval(stress_of):
    """Intervals that include an unknown slack are not symmetric."""
    strain = np.linspace(0, 0.8, 40)
    stress = stress_of("neo_hookean", (0.2,), "uniaxial", strain)
    curve = StressCurve("a.csv", "uniaxial", np.arange(40), strain, stress)
    fit = replace(rank_laws([curve]).best, constants=np.array([0.2]), low=np.array([0.1]), high=np.array([0.21]))
    assert constant_rows(fit)[0][1] == "0.2 ± 0.1"
