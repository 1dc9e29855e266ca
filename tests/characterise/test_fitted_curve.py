"""Smooth curves through noisy readings: slopes, and how often their stated errors hold."""

from __future__ import annotations

import numpy as np
import pytest

from mitsuba_taxel.characterise.experiment import Branch
from mitsuba_taxel.characterise.fitted_curve import fitted_slopes
from mitsuba_taxel.characterise.slopes import slopes

REPLICATES = 32


def chebyshev(count):
    return -10 * (1 - np.cos(np.pi * np.arange(count) / (count - 1)))


def noisy(curve, force, noise, rng):
    """(N, R, 1) readings with noise that is common, that tilts and bends the curve, and that is of each alone."""
    u = force / force.min()
    common, tilt, bend = rng.normal(size=(3, REPLICATES, 1))
    field = 2 * common + tilt * u + 0.7 * bend * np.cos(2 * np.pi * u) + 0.5 * rng.normal(size=(REPLICATES, len(u)))
    return (curve(force)[:, None] + noise * np.sqrt(REPLICATES) * field.T)[:, :, None]


def random_curve(rng):
    """A decaying, oscillating or cubic curve with a range of about 1, and its derivative."""
    a, b, c = rng.normal(size=3)
    rate, frequency = rng.uniform(0.05, 0.3), rng.uniform(0.05, 0.2)
    cubic = np.polynomial.Polynomial([a, 1, 0.5 * b, 0.2 * c], domain=[-20, 0])
    return [
        (lambda f: np.exp(rate * f), lambda f: rate * np.exp(rate * f)),
        (lambda f: np.sin(frequency * f + a), lambda f: frequency * np.cos(frequency * f + a)),
        (cubic, cubic.deriv()),
    ][rng.integers(3)]


def test_polynomials_without_noise_have_their_slopes():
    force = chebyshev(9)
    cubic = np.polynomial.Polynomial([1, 0.3, -0.02, 1e-3])
    samples = np.repeat(cubic(force)[:, None, None], REPLICATES, axis=1)
    fit = fitted_slopes(force, samples, np.array([-20.0, -7.0, 0.0]))
    np.testing.assert_allclose(fit.slope[:, 0], cubic.deriv()([-20, -7, 0]), rtol=1e-3)
    np.testing.assert_allclose(fit.values.mean(axis=1)[:, 0], cubic([-20, -7, 0]), rtol=1e-4)
    assert (fit.noise == 0).all() and (fit.error[:, 0] < 2e-3 * np.abs(fit.slope[:, 0]).max()).all()


@pytest.mark.parametrize(("count", "noise"), [(7, 3e-3), (9, 1e-3)])
def test_stated_errors_of_slopes_hold(count, noise):
    """200 curves with correlated noise. Of errors that are stated right, 68.3 and 95.4 % lie within once and twice:
    fewer than 58 and 90.9 % have a probability of 1e-3 each. Four slopes of two cases: false alarms 1.6 %."""
    rng, force = np.random.default_rng(5), chebyshev(count)
    ratios = []
    for _ in range(200):
        curve, rate = random_curve(rng)
        samples = noisy(curve, force, noise, rng)
        fit = fitted_slopes(force, samples, np.array([-20.0, -9.0]))
        run = slopes(Branch(force, samples, is_fitted=True))
        everywhere = rate(np.linspace(-20, 0, 401))
        largest = everywhere[np.abs(everywhere).argmax()]
        mean = (curve(-20.0) - curve(0.0)) / -20
        ratios.append(
            [
                *((fit.slope[:, 0] - rate(np.array([-20.0, -9.0]))) / fit.error[:, 0]),
                (run.max_slope[0] - largest) / run.max_slope_error[0],
                (run.mean_slope[0] - mean) / run.mean_slope_error[0],
            ]
        )
    within_once, within_twice = ((np.abs(ratios) < bound).mean(axis=0) for bound in (1, 2))
    assert (within_once > 0.58).all() and (within_twice > 0.909).all()


def test_a_bend_between_the_forces_shows_as_an_error_of_the_fit():
    """A step between five forces: the fit's error exceeds what noise does to the polynomial through all of them."""
    force, rng = chebyshev(5), np.random.default_rng(1)
    bent, straight = (noisy(curve, force, 1e-4, rng) for curve in (lambda f: np.tanh(f + 6), lambda f: 0.05 * f))
    for samples, is_bent in ((bent, True), (straight, False)):
        fit = fitted_slopes(force, samples, np.array([-20.0]))
        assert (fit.fit_error[0, 0] > fit.interpolation_noise[0, 0]) == is_bent


def test_zero_is_reached_by_curves_that_end_near_it():
    rng = np.random.default_rng(2)
    for low, high, is_near in ((-8.0, 0.0, True), (-8.0, -4.0, False)):
        force = np.linspace(high, low, 6)
        run = slopes(Branch(force, noisy(lambda f: 0.1 * f, force, 1e-5, rng), is_fitted=True))
        assert np.isfinite(run.zero_slope[0]) == is_near
        assert run.mean_slope[0] == pytest.approx(0.1, abs=5 * run.mean_slope_error[0])
