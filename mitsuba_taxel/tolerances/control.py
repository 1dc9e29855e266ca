"""Control variates: moments from few exact samples and the linear estimate of all samples."""

from __future__ import annotations

import math

import numpy as np

RESAMPLES = 200
"""Number of resamples for a standard error, which then has an uncertainty of 5 %."""
LITTLE = 0.5
"""Share of the variance below which the linear estimate is of little use."""
OF_NORMAL_QUANTILE = math.sqrt(0.05 * 0.95) / 0.10314
"""Standard error of the 5 % quantile of a normal sample of size 1: the root of p (1 - p) over the density there."""
QUANTITIES = ("mean", "sd", "low", "high")


def corrected(exact: np.ndarray, linear: np.ndarray, linear_only: np.ndarray, seed: int) -> dict[str, np.ndarray]:
    """Mean, standard deviation and quantiles (5 and 95 %) from few exact samples and many linear estimates.

    The linear estimate is a control variate: each result is the value for the scaled linear estimates of all samples,
    plus the value for the exact samples, minus the value for the scaled linear estimates of the exact samples. The
    scale is the slope of the exact samples against their linear estimates; if these explain nothing, it is 0, and the
    exact samples alone remain (S. S. Lavenberg and P. D. Welch, A perspective on the use of control variables to
    increase the efficiency of Monte Carlo simulations, Management Science 27, 1981).

    Parameters
    ----------
    exact, linear : (N, T) ndarray
        N exact samples of T taxels, and their linear estimates.
    linear_only : (M, T) ndarray
        Linear estimates of the M samples that are not exact.
    seed : int
        Seed of the resamples.

    Returns
    -------
    ``mean``, ``sd``, ``low`` and ``high``, each with its standard error such as ``mean_error``, and
    ``linear_explained``, the share of the variance of the exact samples explained by their linear estimate (NaN where
    nothing varies), each (T,). The errors are the standard deviations over resamples of the exact and of the other
    samples, with replacement, and so include those of the correction and of its coefficient; they are valid for random
    samples, and conservative for Latin hypercubes and Sobol' points.
    """
    random = np.random.default_rng(seed)
    count = len(exact)
    draws = []
    for _ in range(RESAMPLES):
        drawn = random.integers(count, size=count)
        drawn_linear = random.integers(len(linear_only), size=len(linear_only))
        draws.append(_estimates(exact[drawn], linear[drawn], linear_only[drawn_linear]))
    errors = np.std(draws, axis=0, ddof=1) * math.sqrt(count / (count - 1))
    estimates = dict(zip(QUANTITIES, _estimates(exact, linear, linear_only), strict=True))
    estimates |= {f"{name}_error": error for name, error in zip(QUANTITIES, errors, strict=True)}
    return estimates | {"linear_explained": _explained(exact, linear)}


def spreads(exact: np.ndarray, seed: int) -> dict[str, np.ndarray]:
    """Standard errors of the mean and of both quantiles if all samples are exact, by the bootstrap.

    Errors of the quantiles are at least those of normal samples, as resamples repeat the few outermost samples.

    Parameters
    ----------
    exact : (N, T) ndarray
        The samples.
    seed : int
        Seed of the resamples.

    Returns
    -------
    dict[str, (T,) ndarray]
        ``mean_error``, ``low_error`` and ``high_error``, in the unit of the samples.
    """
    random = np.random.default_rng(seed)
    count = len(exact)
    draws = [_moments(exact[random.integers(count, size=count)]) for _ in range(RESAMPLES)]
    mean, _, low, high = np.std(draws, axis=0, ddof=1) * math.sqrt(count / (count - 1))
    normal = OF_NORMAL_QUANTILE * exact.std(axis=0, ddof=1) / math.sqrt(count)
    return {"mean_error": mean, "low_error": np.maximum(low, normal), "high_error": np.maximum(high, normal)}


def _estimates(exact: np.ndarray, linear: np.ndarray, linear_only: np.ndarray) -> np.ndarray:
    """Estimate the `QUANTITIES` (mean, spread and quantiles), as an array (quantities, T), with the linear estimates as
    control variate."""
    slope = _coefficient(exact, linear)
    every = slope * np.concatenate([linear, linear_only])
    mean, variance, low, high = _moments(every) + _moments(exact) - _moments(every[: len(exact)])
    return np.stack([mean, np.sqrt(np.maximum(variance, 0.0)), low, high])  # below 0 by rounding alone


def _moments(samples: np.ndarray) -> np.ndarray:
    """Mean, variance and both quantiles (4, T) of samples (N, T)."""
    # Sorted first, as `np.sort` is so much faster than the selection of quantiles that both take half the time.
    low, high = np.quantile(np.sort(samples, axis=0), (0.05, 0.95), axis=0, overwrite_input=True)
    return np.stack([samples.mean(axis=0), samples.var(axis=0, ddof=1), low, high])


def _coefficient(exact: np.ndarray, linear: np.ndarray) -> np.ndarray:
    """Slopes (T,) of the exact samples against their linear estimate; 0 where the linear estimate does not vary."""
    deviation = linear - linear.mean(axis=0)
    together, alone = np.sum(deviation * exact, axis=0), np.sum(deviation**2, axis=0)
    return np.divide(together, alone, out=np.zeros_like(alone), where=alone > 0)


def _explained(exact: np.ndarray, linear: np.ndarray) -> np.ndarray:
    """Fraction (T,) of the variance of exact samples that their linear estimate explains; NaN if they do not vary."""
    residual = exact - _coefficient(exact, linear) * linear
    variance = exact.var(axis=0)
    varies = variance > 1e-20 * np.mean(exact**2, axis=0)
    return 1 - np.divide(residual.var(axis=0), variance, out=np.full_like(variance, math.nan), where=varies)
