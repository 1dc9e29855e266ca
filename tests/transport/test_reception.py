"""What a phototransistor accepts from equally bright walls, against closed forms."""

from __future__ import annotations

import math
import tracemalloc
from dataclasses import replace

import numpy as np
import pytest
from patch_cells import LAMBERTIAN, dome, led, phototransistor, plate

from mitsuba_taxel.transport import reception
from mitsuba_taxel.transport.cell import Cell, Mesh, ScatteringWalls
from mitsuba_taxel.transport.exchange import Starts
from mitsuba_taxel.transport.laws.ends import CosineFactor, End
from mitsuba_taxel.transport.laws.tabulated_law import TabulatedLaw
from mitsuba_taxel.transport.reception import CHECKED, Reception, accepted


def responding(exponent):
    """A phototransistor whose response to a parallel beam is that power of the cosine."""
    return replace(phototransistor(0.9), law=CosineFactor(1.0, exponent - 1))


@pytest.mark.parametrize("exponent", [10, 100, 1e4])
def test_a_roof_fills_a_narrow_response(exponent):
    end = responding(exponent)
    _, by_outline = accepted(end, plate(3.7, 1.3, 6), 2)
    area = end.weights[CHECKED // 2 :: CHECKED].sum()
    inside = pytest.approx(2 * math.pi / (exponent + 1) * area, rel=1e-6 if exponent > 50 else 5e-3)
    assert by_outline.sum() == inside


def test_a_table_accepts_what_its_formula_does():
    cosines = np.cos(np.linspace(math.pi / 2, 0, 20001))
    table = replace(phototransistor(0.9), law=TabulatedLaw(cosines, cosines**4))
    places = dome(1.275, 0.05, 2)
    for one, other in zip(accepted(table, places, 2), accepted(responding(5), places, 2), strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-4)


def reading(exponent, cuts):
    places = plate(3.7, 1.3, cuts) + (0.11, 0.07, 0.0)
    walls = ScatteringWalls(places, places, np.zeros(len(places)), np.ones(len(places)))
    return Cell(Mesh(places), walls, led(0.9, LAMBERTIAN), responding(exponent))


@pytest.mark.parametrize("exponent", [1, 30, 300])
def test_patches_that_are_too_large_for_a_response_have_a_large_error(monkeypatch, exponent):
    """Against patches of a third of the size, none of which are cut."""
    monkeypatch.setattr(End, "resolved", lambda self, middle, size: np.full(len(middle), np.inf))
    coarse, fine = reading(exponent, 4), reading(exponent, 12)
    assert abs(coarse.reading - fine.reading) < 2 * coarse.reception_error
    assert fine.reception_error < 0.1 * coarse.reception_error or exponent == 300
    if exponent == 1:
        assert coarse.reception_error < 1e-4 * coarse.reading
    if exponent == 300:
        assert coarse.reception_error > 0.02 * coarse.reading


def closed_form(exponent, height):
    """Reading of :func:`reading` by Gauss' rule on the plate."""
    points, weights = np.polynomial.legendre.leggauss(300)
    x, y = (1.85 * points + shift for shift in (0.11, 0.07))
    x, y, weight = x[:, None], y, 1.85**2 * weights[:, None] * weights

    def squared(end):
        return [(x - at[0]) ** 2 + (y - at[1]) ** 2 + height**2 for at in end.points]

    source, sensor = led(0.9, LAMBERTIAN), phototransistor(0.9)
    lit = sum(share * height**2 / (np.pi * r**2) for share, r in zip(source.weights, squared(source), strict=True))
    seen = sum(
        area * height * (height / np.sqrt(r)) ** exponent / (np.pi * np.sqrt(r) ** 3)
        for area, r in zip(sensor.weights, squared(sensor), strict=True)
    )
    return float((weight * lit * seen).sum())


@pytest.mark.parametrize("exponent", [1, 5, 10, 40, 400])
def test_narrow_responses_to_a_wide_beam_read_as_the_integral_over_the_plate(exponent):
    """A few hundredths of a percent were missing from 5 on, and a percent or more from 40 on."""
    upwards, step = np.zeros((32, 15, 3)), 1e-3
    upwards[..., 2] = 1.0
    found = reading(exponent, 4)
    assert found.reading == pytest.approx(closed_form(exponent, 1.3), rel=1e-4)
    assert found.reception_error < 2e-4 * found.reading
    slope = (closed_form(exponent, 1.3 + step) - closed_form(exponent, 1.3 - step)) / (2 * step)
    assert (found.gradient() * upwards).sum() == pytest.approx(slope, rel=3e-4)
    assert found.conservation_slope_error(upwards) < 2e-3 * abs(slope)


def received(count):
    """Response to points of a plate of 2 x 2 mm, 1 mm above a phototransistor, with values and gradient."""
    rng = np.random.default_rng(1)
    at = np.column_stack([rng.uniform(-1, 1, (count, 2)), np.ones(count)])
    below = np.tile([0.0, 0.0, -1.0], (count, 1))
    seen = Reception(responding(30), Starts(at, below, np.full(count, 0.3), np.full(count, 0.7)))
    return seen.value, *seen.gradient(np.linspace(1, 2, count))


def test_memory_does_not_grow_with_the_points_of_walls(monkeypatch):
    """Blocks of pairs give the same; all pairs at once took 120 bytes each of Python's memory alone."""
    pairs, count = 1 << 12, 2000
    at_once = received(count)
    monkeypatch.setattr(reception, "PAIRS_AT_ONCE", pairs)
    tracemalloc.start()
    try:
        in_blocks = received(count)
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    for one, other in zip(in_blocks, at_once, strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-12, atol=1e-15)
    assert peak < 40 * 64 * count
