"""What a phototransistor accepts from equally bright walls, against closed forms."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from patch_cells import LAMBERTIAN, dome, led, phototransistor, plate

from mitsuba_taxel.transport.cell import Cell, Mesh, ScatteringWalls
from mitsuba_taxel.transport.ends import CosineFactor
from mitsuba_taxel.transport.patches import PatchPoints
from mitsuba_taxel.transport.reception import CHECKED, acceptance
from mitsuba_taxel.transport.rules import triangle_rule
from mitsuba_taxel.transport.tabulated_law import TabulatedLaw


def responding(exponent):
    """A phototransistor whose response to a parallel beam is that power of the cosine."""
    return replace(phototransistor(0.9), law=CosineFactor(1.0, exponent - 1))


def accepted(end, places):
    rule, weights = triangle_rule(2)
    points = PatchPoints(np.repeat(np.arange(len(places)), len(rule)), np.tile(rule, (len(places), 1)))
    return acceptance(end, places, points, np.tile(weights, len(places)))


@pytest.mark.parametrize("exponent", [10, 100, 1e4])
def test_a_roof_fills_a_narrow_response(exponent):
    end = responding(exponent)
    _, by_outline = accepted(end, plate(3.7, 1.3, 6))
    area = end.weights[CHECKED // 2 :: CHECKED].sum()
    inside = pytest.approx(2 * math.pi / (exponent + 1) * area, rel=1e-6 if exponent > 50 else 5e-3)
    assert by_outline.sum() == inside


def test_a_table_accepts_what_its_formula_does():
    cosines = np.cos(np.linspace(math.pi / 2, 0, 20001))
    table = replace(phototransistor(0.9), law=TabulatedLaw(cosines, cosines**4))
    places = dome(1.275, 0.05, 2)
    for one, other in zip(accepted(table, places), accepted(responding(5), places), strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-4)


def reading(exponent, cuts):
    places = plate(3.7, 1.3, cuts) + (0.11, 0.07, 0.0)
    walls = ScatteringWalls(places, places, np.zeros(len(places)), np.ones(len(places)))
    return Cell(Mesh(places), walls, led(0.9, LAMBERTIAN), responding(exponent))


@pytest.mark.parametrize("exponent", [1, 30, 300])
def test_patches_that_are_too_large_for_a_response_have_a_large_error(exponent):
    """Against patches of a third of the size."""
    coarse, fine = reading(exponent, 4), reading(exponent, 12)
    assert abs(coarse.reading - fine.reading) < 2 * coarse.reception_error
    assert fine.reception_error < 0.1 * coarse.reception_error or exponent == 300
    if exponent == 1:
        assert coarse.reception_error < 1e-4 * coarse.reading
    if exponent == 300:
        assert coarse.reception_error > 0.02 * coarse.reading
