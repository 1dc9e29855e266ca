"""Polynomials through samples of polynomials, and Sobol' indices that are known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

from mitsuba_taxel.bench.intervals import ALLOWED, TWICE, interval_cases
from mitsuba_taxel.tolerances import law_of
from mitsuba_taxel.tolerances.shares import ENOUGH, fitted, indices

NORMAL = [law_of(name, {"law": "normal", "mean": 5.0, "sd": 2.0}) for name in "abc"]


def outputs(z):
    """Linear, with a product, and one that does not vary."""
    return np.stack([z[:, 0] + 2 * z[:, 1], z[:, 0] + z[:, 0] * z[:, 1] + 3, np.zeros(len(z))], axis=1)


def test_indices_of_what_is_known():
    """Variances of the parts: 1 and 4; 1 and, of the product, 1; and none."""
    z = np.random.default_rng(1).normal(size=(40, 3))
    polynomial = fitted(z, outputs(z))
    np.testing.assert_allclose(polynomial.explained, 1, atol=1e-12)
    first, total, *_ = indices(polynomial, NORMAL, seed=2)
    np.testing.assert_allclose(first[:2], [[0.2, 0.8, 0], [0.5, 0, 0]], atol=0.02)
    np.testing.assert_allclose(total[:2], [[0.2, 0.8, 0], [1.0, 0.5, 0]], atol=0.02)
    assert np.isnan(first[2]).all() and np.isnan(total[2]).all()


def test_uniform_laws():
    """A square of a uniform variable varies by 4 / 45, the variable itself by 1 / 3."""
    laws = [law_of(name, {"law": "uniform", "low": -1.0, "high": 1.0}) for name in "ab"]
    x = np.random.default_rng(1).uniform(-1, 1, size=(30, 2))
    z = x / laws[0].deviation
    first, total, *_ = indices(fitted(z, (x[:, [0]] + x[:, [1]] ** 2)), laws, seed=0)
    share = (1 / 3) / (1 / 3 + 4 / 45)
    np.testing.assert_allclose(first[0], [share, 1 - share], atol=0.02)
    np.testing.assert_allclose(total[0], [share, 1 - share], atol=0.02)


@pytest.mark.parametrize(("count", "terms"), [(5, None), (6, 4), (10, None), (16, 10)])
def test_the_degree_follows_the_samples(count, terms):
    z = np.random.default_rng(3).normal(size=(count, 3))
    polynomial = fitted(z, z[:, [0]] * z[:, [1]] if terms == 10 else z[:, [0]] + 1)
    if count == 5:
        assert polynomial is None
    elif terms:
        assert len(polynomial.powers) == terms and polynomial.explained[0] > 0.999


def test_what_is_not_explained_is_told():
    random = np.random.default_rng(4)
    z = random.normal(size=(200, 2))
    polynomial = fitted(z, z[:, [0]] + 0.5 * random.normal(size=(200, 1)))
    assert polynomial.explained[0] == pytest.approx(0.8, abs=0.08)


def ishigami(x):
    return np.sin(x[:, 0]) + 7 * np.sin(x[:, 1]) ** 2 + 0.1 * x[:, 2] ** 4 * np.sin(x[:, 0])


@pytest.mark.parametrize("kind", ["Ishigami", "product", "noise"])
def test_indices_of_what_a_polynomial_does_not_explain_are_not_known(kind):
    """They were told as 0.85, 0.12, 0.05 of Ishigami's function (0.56, 0.44, 0.24), and 0.99, 0.01, 0.00 of a product
    of three (1, 0.8, 0.8)."""
    random = np.random.default_rng(2)
    laws = [law_of(name, {"law": "uniform", "low": -np.pi, "high": np.pi}) for name in "abc"]
    x = random.uniform(-np.pi, np.pi, size=(256, 3))
    of = {"Ishigami": ishigami(x), "product": (1 + x[:, 0]) * x[:, 1] * x[:, 2], "noise": random.normal(size=256)}
    polynomial = fitted(x / laws[0].deviation, of[kind][:, None])
    assert polynomial.explained[0] < ENOUGH and np.isnan(indices(polynomial, laws, seed=0)).all()


@pytest.mark.parametrize("case", ["tolerance: sum,", "tolerance: sum and"])
def test_stated_errors_of_tolerances_hold(case):
    """Of mean, spread, quantile and indices of known functions: as many as 3 points less than normal errors do."""
    (one,) = interval_cases(case)
    for row in replace(one, count=60).measured():
        least = stats.binom.ppf(1e-5, row.made, TWICE - ALLOWED)
        assert row.within * row.made >= least and row.ratio > 0.4, row
