"""Distributions have the moments that their words say, and refuse what is none."""

from __future__ import annotations

import math
import re

import numpy as np
import pytest

from mitsuba_taxel import InputError
from mitsuba_taxel.tolerances import law_of

pytestmark = pytest.mark.quick


@pytest.mark.parametrize(
    ("table", "mean", "deviation", "ends"),
    [
        ({"law": "normal", "mean": 2, "sd": 0.5}, 2, 0.5, (-math.inf, math.inf)),
        ({"law": "uniform", "low": 1, "high": 3}, 2, 1 / math.sqrt(3), (1, 3)),
        ({"law": "triangular", "low": 0, "peak": 1, "high": 2}, 1, 1 / math.sqrt(6), (0, 2)),
        ({"law": "truncated_normal", "mean": 5, "sd": 2.0, "low": 3, "high": 7}, 5, 2 * 0.53956, (3, 7)),
        ({"law": "lognorm", "s": 0.1, "scale": 4.0}, 4 * math.exp(0.005), 0.40303, (0, math.inf)),
    ],
    ids=lambda given: given["law"] if isinstance(given, dict) else "",
)
def test_moments(table, mean, deviation, ends):
    law = law_of("x", table)
    assert law.mean == pytest.approx(mean) and law.deviation == pytest.approx(deviation, rel=1e-4)
    assert law.distribution.support() == pytest.approx(ends) and law.words.startswith(f"{table['law']}(")
    z = law.standardised((np.arange(20_000) + 0.5) / 20_000)
    assert z.mean() == pytest.approx(0, abs=1e-3) and z.std() == pytest.approx(1, rel=2e-3)
    assert np.all(np.isfinite(law.values(np.array([0.0, 1.0]))))


@pytest.mark.parametrize(
    ("table", "said"),
    [
        (5, "tolerance of x = 5"),
        ({"mean": 1, "sd": 1}, "tolerance of x = {'mean': 1, 'sd': 1}"),
        ({"law": "normal", "mean": 1}, "normal(mean=1) is not allowed: mean, sd are needed"),
        ({"law": "normal", "mean": 1, "sd": "a"}, "sd = 'a'"),
        ({"law": "normal", "mean": 1, "sd": math.inf}, "sd = inf"),
        ({"law": "normal", "mean": 1, "sd": 0}, "a spread above 0"),
        ({"law": "normal", "mean": 1, "sd": -1}, "a spread above 0"),
        ({"law": "uniform", "low": 2, "high": 1}, "a spread above 0"),
        ({"law": "truncated_normal", "mean": 1, "sd": 0, "low": 0, "high": 2}, "division by zero"),
        ({"law": "triangular", "low": 1, "peak": 5, "high": 2}, "a spread above 0"),
        ({"law": "guess", "mean": 1}, "law = 'guess' is not known"),
        ({"law": "poisson", "mu": 1}, "law = 'poisson' is not known"),
        ({"law": "beta", "c": 1}, "beta(c=1) is not allowed"),
        ({"law": "cauchy", "scale": 1}, "a finite mean"),
    ],
)
def test_what_is_no_distribution_is_refused(table, said):
    with pytest.raises(InputError, match=re.escape(said)):
        law_of("x", table)
