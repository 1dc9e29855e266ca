"""Coverage of the stated errors of spreads, quantiles and Sobol' indices, on synthetic tolerance studies."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial

import numpy as np

from mitsuba_taxel.tolerances.analysis import deviations
from mitsuba_taxel.tolerances.control import spreads
from mitsuba_taxel.tolerances.laws import law_of
from mitsuba_taxel.tolerances.shares import fitted, indices

SAMPLES = 64
QUANTILE = 1.6448536269514722
"""95 % quantile of the normal distribution."""


def tolerance_cases() -> dict[str, Callable[[int], dict[str, float]]]:
    """All cases by name. A case is a function of a seed that returns the error of each statistic of a tolerance study,
    divided by its stated error."""
    return {f"tolerance: {name}, {SAMPLES} samples": partial(_deviations, name) for name in ("sum", "sum and product")}


def _deviations(kind: str, seed: int) -> dict[str, float]:
    """Error of each statistic divided by its stated error, for a function of three normally distributed parameters.

    The function is 2 a + b + 0.5 c, plus 0.5 a b for ``sum and product``. Noise of about a tenth of the function's
    spread is added; no parameter explains it.
    """
    # Samples, and the exact variance of the function.
    random = np.random.default_rng(seed)
    z = random.normal(size=(SAMPLES, 3))
    product = 0.5 if kind == "sum and product" else 0.0
    noise = 0.2 * random.normal(size=SAMPLES)
    outputs = (z @ [2.0, 1.0, 0.5] + product * z[:, 0] * z[:, 1] + noise)[:, None]
    variance = 4 + 1 + 0.25 + product**2
    spread = math.sqrt(variance + 0.04)
    # Sobol' indices from a polynomial, spread and quantile from the samples.
    polynomial = fitted(z, outputs)
    assert polynomial is not None
    laws = [law_of(name, {"law": "normal", "mean": 0.0, "sd": 1.0}) for name in "abc"]
    first, total, first_error, total_error = (float(index[0, 0]) for index in indices(polynomial, laws))
    deviation, of_deviation = deviations(outputs)
    errors = spreads(outputs, seed)
    ratios = {
        "mean": outputs.mean() / errors["mean_error"][0],
        "spread": (deviation[0] - spread) / of_deviation[0],
        "first index": (first - 4 / variance) / first_error,
        "total index": (total - (4 + product**2) / variance) / total_error,
    }
    if not product:
        high = np.quantile(outputs, 0.95)
        ratios["95 % quantile"] = (high - QUANTILE * spread) / errors["high_error"][0]
    return {figure: float(value) for figure, value in ratios.items()}
