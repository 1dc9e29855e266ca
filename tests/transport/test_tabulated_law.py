"""Laws of tables in cells, as formulas and kernels have them."""

from __future__ import annotations

import math

import numpy as np
import pytest

from mitsuba_taxel.transport.laws.ends import POWER, CosineFactor
from mitsuba_taxel.transport.laws.tabulated_law import TabulatedLaw

ANGLES = np.radians(np.linspace(90, 0, 20001))


@pytest.mark.parametrize("exponent", [0.0, 1.0, 7.5, 40.0])
def test_a_fine_table_of_a_formula_is_the_formula(exponent):
    formula = CosineFactor(0.3, exponent)
    law = TabulatedLaw(np.cos(ANGLES), formula(np.cos(ANGLES))[0])
    cosines = np.linspace(0.05, 0.999, 77)
    for got, expected in zip(law(cosines), formula(cosines), strict=True):
        np.testing.assert_allclose(got, expected, rtol=5e-3, atol=1e-4)
    assert POWER * law.width(cosines) == pytest.approx(formula.width(cosines), rel=0.15 if exponent >= 7 else 0.7)
    assert law.cutoff == pytest.approx(0, abs=1e-15) and law.has_kinks and not formula.has_kinks


def test_a_table_may_end_above_zero():
    law = TabulatedLaw(np.cos(np.radians([60, 30, 0])), np.array([0.5, 0.8, 1.0]))
    assert law.cutoff == pytest.approx(0.5)
    assert law(np.array([0.5]))[0] == pytest.approx(0.5)
    slope = 0.3 / (math.sqrt(0.75) - 0.5)
    assert law(np.array([0.49])) == (pytest.approx(0.5 - 0.01 * slope), pytest.approx(slope))  # on, just outside


def test_laws_are_equal_if_their_tables_are():
    one, same = (TabulatedLaw(np.cos(ANGLES), np.cos(ANGLES)) for _ in range(2))
    assert one == same and one != TabulatedLaw(np.cos(ANGLES), 2 * np.cos(ANGLES)) and one != CosineFactor(1.0, 1.0)
