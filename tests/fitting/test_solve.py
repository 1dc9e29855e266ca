"""Least squares of models whose answer is known: intervals hold the truth, and what cannot be told is told."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy import stats

from mitsuba_taxel.fitting.plan import Unknown
from mitsuba_taxel.fitting.solve import lack_of_fit_warnings, misfit_warnings, solve

pytestmark = pytest.mark.quick

X = np.linspace(0, 2, 12)
TRUTH = np.array([3.0, 0.7])


def decay(unknowns):
    """a exp(-b x), and its derivatives."""
    a, b = unknowns
    value = a * np.exp(-b * X)
    return value, np.stack([value / a, -X * value], axis=1)


def unknown(name, start, low=-math.inf, high=math.inf):
    return Unknown(name, start, low, high)


DECAY = [unknown("a", 1.0), unknown("b", 0.1)]


@pytest.mark.parametrize("known", [True, False], ids=["errors known", "errors from residuals"])
def test_intervals_hold_the_truth(known):
    """95 % of them; false-alarm rate 1e-4."""
    random, sigma, count = np.random.default_rng(5), 0.02 * (1 + X), 300
    sigma = sigma if known else np.full_like(X, 0.05)
    inside = np.zeros(2)
    for _ in range(count):
        data = decay(TRUTH)[0] + sigma * random.normal(size=len(X))
        found = solve(decay, data, sigma if known else None, DECAY)
        inside += np.abs(found.values - TRUTH) < found.half_width
    low, high = stats.binom.ppf(0.25e-4, count, 0.95), stats.binom.isf(0.25e-4, count, 0.95)
    assert np.all((inside >= low) & (inside <= high))


def test_exact_data():
    found = solve(decay, decay(TRUTH)[0], np.full_like(X, 0.01), DECAY)
    np.testing.assert_allclose(found.values, TRUTH, rtol=1e-5)
    assert found.misfit < 1e-6 and found.degrees_of_freedom == 10 and not found.warnings
    _, jacobian = decay(TRUTH)
    covariance = np.linalg.inv(jacobian.T @ jacobian) * 1e-4
    np.testing.assert_allclose(found.errors, np.sqrt(np.diag(covariance)), rtol=1e-3)
    assert found.correlation[0, 1] == pytest.approx(covariance[0, 1] / np.prod(found.errors), rel=1e-3)
    assert found.half_width[0] == pytest.approx(1.959964 * found.errors[0])


def test_the_misfit_of_wrong_errors():
    random = np.random.default_rng(6)
    data = decay(TRUTH)[0] + 0.03 * random.normal(size=len(X))
    found = solve(decay, data, np.full_like(X, 0.01), DECAY)
    assert 3 < found.misfit < 30 and not found.warnings
    residual, unknown_error = data - found.model, np.full_like(X, np.nan)
    (warning,) = misfit_warnings(residual, np.full_like(X, 0.01), unknown_error, 10)
    assert f"residuals are {np.sqrt(found.misfit):.2g} times as large as the errors" in warning
    assert warning.endswith("intervals are too narrow")
    (warning,) = misfit_warnings(residual, np.full_like(X, 0.01), np.full_like(X, 0.03), 10)
    assert warning.endswith("the error of the model, which the intervals include, explains the residuals")
    assert not misfit_warnings(residual, np.full_like(X, 0.03), unknown_error, 10)
    without = solve(decay, data, None, DECAY)
    assert math.sqrt(without.misfit) == pytest.approx(0.03, rel=0.5) and not without.warnings


def test_a_mean_square_of_1_45_with_98_degrees_of_freedom_is_warned_of():
    """More is found by chance in 0.24 % of fits."""
    residual = np.full(100, math.sqrt(1.45 * 98 / 100))
    (warning,) = misfit_warnings(residual, np.ones(100), np.zeros(100), 98)
    assert "1.2 times as large" in warning and "(probability 0.002)" in warning


def test_right_errors_are_warned_of_once_in_a_hundred():
    """Of 400 data, at most 13: more with probability 1e-4."""
    random, sigma = np.random.default_rng(7), 0.02 * (1 + X)
    data = decay(TRUTH)[0] + sigma * random.normal(size=(400, len(X)))
    found = [misfit_warnings(one - solve(decay, one, sigma, DECAY).model, sigma, 0 * X, 10) for one in data]
    assert sum(map(len, found)) <= stats.binom.isf(1e-4, 400, 0.01)


def test_unknowns_move_with_readings_as_stated():
    """The derivative of the solution, against fits to data of which one is changed."""
    sigma, data = 0.02 * (1 + X), decay(TRUTH)[0]
    by_reading = solve(decay, data, sigma, DECAY).by_reading
    for number in (0, 5, 11):
        ends = [solve(decay, data + step * (np.arange(12) == number), sigma, DECAY).values for step in (1e-3, -1e-3)]
        np.testing.assert_allclose(by_reading[:, number], (ends[0] - ends[1]) / 2e-3, rtol=1e-2)


def test_two_factors_cannot_be_told_apart():
    def product(unknowns):
        a, b, c = unknowns
        value = a * b * X + c
        return value, np.stack([b * X, a * X, np.ones_like(X)], axis=1)

    found = solve(product, 6 * X + 1, None, [unknown("a", 1.0), unknown("b", 1.0), unknown("c", 0.0)])
    assert found.warnings == ["these data do not distinguish a and b"]
    assert np.isinf(found.errors[:2]).all() and found.errors[2] < 1e-3 and found.values[2] == pytest.approx(1)


def test_alike_at_a_bound_and_without_effect():
    def model(unknowns):
        a, b, c = unknowns
        return a * X + b * (X + 1e-2 * X**2), np.stack([X, X + 1e-2 * X**2, 0 * X], axis=1) + 0 * c

    found = solve(
        model, 5 * X, np.full_like(X, 0.1), [unknown("a", 1.0), unknown("b", 1.0, 0.5, 9.0), unknown("c", 1.0)]
    )
    assert any(line.startswith("these data hardly distinguish a and b") for line in found.warnings)
    assert "these data do not determine c" in found.warnings and np.isinf(found.errors[2])
    low = solve(decay, decay(TRUTH)[0], None, [unknown("a", 1.0), unknown("b", 1.0, 0.8, 2.0)])
    assert low.warnings == ["b = 0.8 is at the bound 0.8 of its range; its interval ignores the bound"]


def test_a_curve_beside_the_scatter_of_repeated_readings_is_warned_of():
    """Of 400 right models, at most 13 are: more with probability 1e-4. A bend of four errors always is, unless the
    model's own error is as large. Two taxels, of which each setting is read three times; a line was fitted to each."""
    random, x = np.random.default_rng(8), np.tile(np.linspace(-1, 1, 9), 3)
    settings, unknown_error = {"fz": [f"{value:g}" for value in x]}, np.full((27, 2), np.nan)

    def warnings(bend, of_model=unknown_error):
        data = bend * (x**2 - 0.4)[:, None] + random.normal(size=(27, 2))
        line = np.polynomial.polynomial.polyvander(x, 1)
        return lack_of_fit_warnings(data - line @ np.linalg.lstsq(line, data)[0], settings, of_model, 50)

    assert 0 < sum(map(len, (warnings(0) for _ in range(400)))) <= 13
    (warning,) = warnings(4)
    assert "times as large as the scatter of repeated readings" in warning and "the model is wrong" in warning
    (warning,) = warnings(4, np.full((27, 2), 2.0))
    assert warning.endswith("the error of the model, which the intervals include, explains the residuals")
    alone = {"fz": [f"{number}" for number in range(27)]}  # nothing is repeated
    assert not lack_of_fit_warnings(unknown_error * 0 + 1, alone, unknown_error, 50)
