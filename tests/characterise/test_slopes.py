"""Slopes of curves whose slopes are known, their errors, and what noise does to the largest."""

from __future__ import annotations

import numpy as np
import pytest

from mitsuba_taxel.characterise import Branch, slopes
from mitsuba_taxel.characterise.experiment import Tangents

pytestmark = pytest.mark.quick

STEPS = np.linspace(0, -20, 41)
CURVES = {
    "line": lambda f: -2e-5 * f,
    "cubic": lambda f: 4e-4 * (-f / 20) + 1e-4 * (f / 20) ** 2 + 2e-4 * (-f / 20) ** 3,
    "s-shaped": lambda f: 2e-4 / (1 + np.exp((f + 10) / 2)),
}


@pytest.mark.parametrize("force", [[0, 1, 2], [0, -0.5, -2, -7], [-3, -1, 0, 4], [-1, 2, 5], [0.3, 1, 2]])
def test_slope_at_zero_is_exact_for_a_parabola_on_uneven_forces(branch, force):
    found = slopes(branch(lambda f: 3e-4 + 2e-5 * f - 7e-6 * f**2, sorted(force), replicates=2))
    assert found.zero_slope[0] == pytest.approx(2e-5, rel=1e-9)


@pytest.mark.parametrize("grid", [np.array([0, 1, 2.5]), np.array([-1, 0, 2.0])])
def test_slope_at_zero_is_of_second_order(branch, grid):
    """Its error is v'''/6 times the distances of the two other points: 4 times less on half the steps."""
    for scale in (1.0, 0.5):
        error = slopes(branch(lambda f: 5 * f + 2 * f**3, scale * grid, replicates=2)).zero_slope[0] - 5
        others = scale * grid[grid != 0]
        assert error == pytest.approx(-2 * others.prod(), rel=1e-9)


def test_slope_at_zero_needs_points_near_it(branch):
    assert np.isnan(slopes(branch(np.square, [8, 9, 10, 12])).zero_slope[0])
    assert slopes(branch(lambda f: 4 * f, [0, -2])).zero_slope[0] == pytest.approx(4)
    assert np.isnan(slopes(branch(np.square, [1.0])).max_slope[0])


def test_slopes_of_two_straight_pieces(branch):
    """2 W/N up to 3 N and 0.5 W/N beyond."""
    found = slopes(branch(lambda f: np.minimum(2 * f, 6 + 0.5 * (f - 3)), np.linspace(0, 10, 21), replicates=4))
    assert found.max_slope[0] == pytest.approx(2) and 0 < found.max_slope_at[0] < 3
    assert found.mean_slope[0] == pytest.approx(0.95) and found.zero_slope[0] == pytest.approx(2)


@pytest.mark.parametrize("replicates", [8, 32])
@pytest.mark.parametrize("name", ["mean_slope", "zero_slope"])
def test_intervals_hold_the_truth(branch, covered, name, replicates):
    curve = CURVES["cubic"]
    found = slopes(branch(curve, STEPS, 1e-5, replicates, channels=600, seed=1))._asdict()
    clean = slopes(branch(curve, STEPS))._asdict()
    covered(found[name], found[f"{name}_error"], clean[name], replicates)


@pytest.mark.parametrize("noise", [1e-6, 1e-5, 1e-4])
@pytest.mark.parametrize("curve", CURVES.values(), ids=CURVES.keys())
def test_the_largest_slope_is_not_too_large(branch, covered, curve, noise):
    """Its bias is below a quarter of its error, and below half that of the steepest mean reading where noise is large.

    Only where a curve's own steepest part is hidden by noise, it may be half an error low.
    """
    run = branch(curve, STEPS, noise, channels=800, seed=2)
    found, truth = slopes(run), slopes(branch(curve, STEPS)).max_slope[0]
    bias = np.mean((found.max_slope - truth) / truth) * abs(truth) / found.max_slope_error.mean()
    hidden = curve is CURVES["s-shaped"] and noise == 1e-4
    assert -(0.5 if hidden else 0.25) < bias < 5 / np.sqrt(800)
    covered(found.max_slope, found.max_slope_error, truth, 32, at_least=0.93)
    naive = np.abs(np.diff(run.value, axis=0) / np.diff(run.force)[:, None]).max(axis=0).mean()
    if noise == 1e-4:
        assert naive - abs(truth) > 2 * abs(found.max_slope.mean() - truth)


RISING = {
    "saturating": lambda f: 1e-3 * np.expm1(0.1 * f),
    "parabola": lambda f: -2e-5 * f + 1e-6 * f**2,
    **CURVES,
}


@pytest.mark.parametrize("noise", [1e-7, 1e-6, 3e-6, 1e-5, 1e-4])
@pytest.mark.parametrize("curve", RISING.values(), ids=RISING.keys())
def test_errors_of_the_largest_slope_cover_at_one_and_two_sigma(branch, curve, noise):
    """With noise far below, at and far above the differences of neighbouring slopes: 68 % and 95 %, or a little more.

    The binomial scatter of 400 is 2.3 and 1.1 %; 60 and 91 % are missed by chance once in 3000.
    """
    truth = slopes(branch(curve, STEPS)).max_slope[0]
    found = slopes(branch(curve, STEPS, noise, channels=400, seed=3))
    z = np.abs(found.max_slope - truth) / found.max_slope_error
    assert 0.60 < np.mean(z < 1) < 0.92 and np.mean(z < 2) > 0.91
    assert found.max_slope_error.mean() < 2 * np.sqrt(2 / 32) * noise / 0.5  # noise of one step's slope


@pytest.mark.parametrize("noise", [1e-6, 1e-5])
def test_steps_of_both_signs_do_not_cancel(branch, noise):
    """A wave that rises and falls by 2e-5 W/N: halves may choose a rise and a fall, which are as steep."""
    wave = 2e-5 / np.pi
    truth = abs(slopes(branch(lambda f: wave * np.sin(np.pi * f), STEPS)).max_slope[0])
    found = slopes(branch(lambda f: wave * np.sin(np.pi * f), STEPS, noise, channels=400, seed=4))
    assert set(np.sign(found.max_slope)) == {-1, 1}
    z = (np.abs(found.max_slope) - truth) / found.max_slope_error
    assert np.mean(np.abs(z) < 1) > 0.6 and np.mean(np.abs(z) < 2) > 0.91
    assert abs(np.mean(np.abs(found.max_slope)) / truth - 1) < 0.05


def test_results_with_few_replicates(branch):
    """One gives no error, two and three that of their scatter."""
    curve = CURVES["cubic"]
    assert np.isnan(slopes(branch(curve, STEPS, 1e-6, replicates=1)).max_slope_error[0])
    for count in (2, 3, 4):
        assert slopes(branch(curve, STEPS, 1e-6, replicates=count)).max_slope_error[0] > 0


def tangents(curve, rate, force, error=1e-7):
    """A branch whose readings are noise, and whose slopes are known."""
    force = np.asarray(force, dtype=float)
    value, slope = curve(force)[:, None], rate(force)[:, None]
    noise = np.random.default_rng(0).normal(size=(len(force), 8, 1))
    return Branch(force, noise, Tangents(value, slope, error * (1 + np.abs(force))[:, None]))


@pytest.mark.parametrize("force", [[0, -3, -4, -9], [-9, -4, 0], [-6, -2, 1, 3]])
def test_slopes_of_tangents_are_exact_for_a_cubic(force):
    """v = 2 f - 0.3 f^2 - 0.05 f^3: its slope has its extremum, 2.6, at -2, and grows without bound beyond."""
    found = slopes(tangents(lambda f: 2 * f - 0.3 * f**2 - 0.05 * f**3, lambda f: 2 - 0.6 * f - 0.15 * f**2, force))
    rates = np.append(2 - 0.6 * np.array([force[0], force[-1]]) - 0.15 * np.square([force[0], force[-1]]), 2.6)
    assert found.max_slope[0] == pytest.approx(rates[np.abs(rates).argmax()], rel=1e-6)
    assert found.zero_slope[0] == pytest.approx(2) and 1e-7 <= found.zero_slope_error[0] < 2.4e-7
    ends = np.polyval([-0.05, -0.3, 2, 0], [force[0], force[-1]])
    assert found.mean_slope[0] == pytest.approx(np.diff(ends)[0] / (force[-1] - force[0]))


def test_the_error_of_a_slope_is_that_of_the_tangents_there():
    found = slopes(tangents(np.square, lambda f: 2 * f, [0, -2, -4]))
    assert found.max_slope_at[0] == -4 and found.max_slope_error[0] == pytest.approx(5e-7)
    assert found.mean_slope_error[0] == pytest.approx(3e-7)  # of one sign: errors of neighbours are not independent


def test_slope_at_zero_of_tangents_needs_points_near_it():
    assert slopes(tangents(np.square, lambda f: 2 * f, [-1, -2, -4])).zero_slope[0] == pytest.approx(0, abs=1e-9)
    assert np.isnan(slopes(tangents(np.square, lambda f: 2 * f, [-3, -4, -5])).zero_slope[0])
