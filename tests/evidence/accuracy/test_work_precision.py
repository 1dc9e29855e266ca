"""Curves of error against work: their slopes, and what cannot be claimed of them."""

from __future__ import annotations

import math

import numpy as np
import pytest
from power_law_curve import line
from scipy import stats

from mitsuba_taxel.evidence.rows.work_precision import TruthEstimate, relative_rms, slope


@pytest.mark.parametrize("exponent", [-0.5, -1.0, -1.5])
def test_the_slope_of_a_power_law_is_its_exponent(exponent):
    assert slope(line(exponent)).value == pytest.approx(exponent, abs=1e-12)
    # As the shortest run did some work as well, what is taken off for launching is a little too much.
    assert slope(line(exponent, launch=1.0, count=12, launched=True)).value == pytest.approx(exponent, rel=0.01)
    assert slope(line(exponent, launch=1.0, count=12)).value < 1.2 * exponent


def test_points_near_the_floor_and_curves_too_short_give_no_slope():
    bent = line(-1.0, floor=0.002, count=12)
    assert bent.points[-1].error < 1.2 * 0.002 and slope(bent).value == pytest.approx(-1.0, abs=0.05)
    for curve in (line(-1.0, count=2), line(-1.0, count=0), line(-1.0, floor=1.0), line(-1.0, launch=1.0, count=4)):
        assert math.isnan(slope(curve).value) and math.isnan(slope(curve).standard_error)


@pytest.mark.parametrize("scatter", [1.0, 3.0])
def test_the_slopes_standard_error_is_its_scatter(scatter):
    rng, readings = np.random.default_rng(1), 16
    found = [
        slope(line(-0.5, noise=scatter * rng.normal(0, (2 * readings) ** -0.5, 8), readings=readings))
        for _ in range(400)
    ]
    values, errors = (np.array(column) for column in zip(*found, strict=True))
    z = values.mean() + 0.5
    assert abs(z) < stats.norm.isf(5e-5) * values.std() / 20
    assert np.sqrt(np.mean(errors**2)) == pytest.approx(values.std(), rel=0.25)


def test_errors_are_relative_and_leave_dark_taxels_out():
    truth = TruthEstimate(np.array([2.0, 0.0, 4.0]), np.array([0.02, 0.0, 0.0]), "")
    assert truth.floor == pytest.approx(0.01 / math.sqrt(2))
    assert relative_rms(np.array([[0.2, 9.0, 0.4], [0.0, 9.0, 0.0]]), truth.power) == pytest.approx(0.1 / math.sqrt(2))
    assert math.isnan(relative_rms(np.ones(2), np.zeros(2)))
