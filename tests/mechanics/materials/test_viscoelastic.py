"""Prony series: what a step does to the internal variables, at any length, and what is refused."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import quad

from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.mechanics import NeoHookean, Viscoelastic
from mitsuba_taxel.mechanics.materials.viscoelastic import prony_of


@pytest.mark.parametrize("step", [1e-9, 1e-3, 0.0099, 0.0101, 0.7, 30.0])
def test_weights_are_integrals_over_a_step(step):
    weights = Viscoelastic(NeoHookean(), ((0.5, 1.0),)).over(step)
    ramp = quad(lambda s: np.exp(-step * s), 0, 1)[0]
    bend = quad(lambda s: np.expm1(-step * s) * (0.5 - s), 0, 1, epsabs=1e-30)[0]
    assert weights.decay == pytest.approx(np.exp(-step), rel=1e-14)
    assert weights.ramp == pytest.approx(ramp, rel=1e-12)
    assert weights.curvature == pytest.approx(bend, rel=1e-7, abs=1e-12)


def test_weights_at_the_extremes_are_finite_and_right():
    material = Viscoelastic(NeoHookean(), ((0.3, 1e-6), (0.3, 1.0), (0.399, 1e6)))
    for step in (0.0, 1e-9, 1.0, 1e9, 1e300):
        assert np.all(np.isfinite(material.over(step)))
    at_once, long = material.over(0.0), material.over(1e300)
    np.testing.assert_array_equal([at_once.decay, at_once.ramp, at_once.curvature], [[1] * 3, [1] * 3, [0] * 3])
    assert not long.decay.any() and np.all(long.ramp < 1e-29) and np.all(long.curvature < 1e-29)
    np.testing.assert_array_equal(material.relaxation(np.array([0.0, 1e300])), [1, 1 - material.shares.sum()])


def test_terms_of_a_scene():
    assert prony_of("0.2 1; 0.1 10;") == ((0.2, 1.0), (0.1, 10.0))
    assert prony_of(" ") == ()


@pytest.mark.parametrize(
    ("terms", "words"),
    [
        ("0.5 1; 0.5 2", "add up to 1 are not allowed"),
        ("0.5 -1", "a weight and a time above 0"),
        ("0 1", "a weight and a time above 0"),
        ("0.5", "terms 'weight time'"),
        ("much 1", "terms 'weight time'"),
        ("nan 1", "at least one pair of numbers"),
    ],
)
def test_what_is_no_memory_is_refused(terms, words):
    with pytest.raises(InputError, match=words):
        prony_of(terms)


def test_other_refusals():
    with pytest.raises(InputError, match="law"):
        Viscoelastic("rubber", ((0.5, 1.0),))
    with pytest.raises(InputError, match="prony = 0.5"):
        Viscoelastic(NeoHookean(), 0.5)
