"""Polynomials through samples of polynomials, and Sobol' indices that are known."""

from __future__ import annotations

import numpy as np
import pytest

from mitsuba_taxel.tolerances import law_of
from mitsuba_taxel.tolerances.shares import fitted, indices

NORMAL = [law_of(name, {"law": "normal", "mean": 5.0, "sd": 2.0}) for name in "abc"]


def outputs(z):
    """Linear, with a product, and one that does not vary."""
    return np.stack([z[:, 0] + 2 * z[:, 1], z[:, 0] + z[:, 0] * z[:, 1] + 3, np.zeros(len(z))], axis=1)


def test_indices_of_what_is_known():
    """Variances of the parts: 1 and 4; 1 and, of the product, 1; and none."""
    z = np.random.default_rng(1).normal(size=(40, 3))
    polynomial = fitted(z, outputs(z))
    np.testing.assert_allclose(polynomial.explained, 1, atol=1e-12)
    first, total = indices(polynomial, NORMAL, seed=2)
    np.testing.assert_allclose(first[:2], [[0.2, 0.8, 0], [0.5, 0, 0]], atol=0.02)
    np.testing.assert_allclose(total[:2], [[0.2, 0.8, 0], [1.0, 0.5, 0]], atol=0.02)
    assert np.isnan(first[2]).all() and np.isnan(total[2]).all()


def test_uniform_laws():
    """A square of a uniform variable varies by 4 / 45, the variable itself by 1 / 3."""
    laws = [law_of(name, {"law": "uniform", "low": -1.0, "high": 1.0}) for name in "ab"]
    x = np.random.default_rng(1).uniform(-1, 1, size=(30, 2))
    z = x / laws[0].deviation
    first, total = indices(fitted(z, (x[:, [0]] + x[:, [1]] ** 2)), laws, seed=0)
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
