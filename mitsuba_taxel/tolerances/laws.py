"""Distributions of parameters."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from mitsuba_taxel.base.arguments import is_number
from mitsuba_taxel.base.errors import InputError


@dataclass(frozen=True, eq=False)
class Law:
    """Probability distribution of a parameter with a tolerance.

    Attributes
    ----------
    name : str
        The parameter.
    words : str
        The distribution in words, such as ``normal(mean=0.9, sd=0.02)``.
    distribution : Any
        Frozen distribution of ``scipy.stats``.
    """

    name: str
    words: str
    distribution: Any

    @property
    def mean(self) -> float:
        """Mean of the distribution, at which derivatives are taken."""
        return float(self.distribution.mean())

    @property
    def deviation(self) -> float:
        """Standard deviation of the distribution."""
        return float(self.distribution.std())

    def values(self, shares: np.ndarray) -> np.ndarray:
        """Quantiles of the distribution, in the unit of the parameter.

        Parameters
        ----------
        shares : ndarray
            Probabilities from 0 to 1, limited to 1e-12 from either end.

        Returns
        -------
        ndarray
            Values in the unit of the parameter, of the same shape.
        """
        return self.distribution.ppf(np.clip(shares, 1e-12, 1 - 1e-12))

    def standardised(self, shares: np.ndarray) -> np.ndarray:
        """Quantiles of the distribution minus its mean, in standard deviations."""
        return (self.values(shares) - self.mean) / self.deviation


LAWS: dict[str, tuple[Callable[..., Any], tuple[str, ...]]] = {
    "normal": (lambda stats, mean, sd: stats.norm(mean, sd), ("mean", "sd")),
    "uniform": (lambda stats, low, high: stats.uniform(low, high - low), ("low", "high")),
    "truncated_normal": (
        lambda stats, mean, sd, low, high: stats.truncnorm((low - mean) / sd, (high - mean) / sd, mean, sd),
        ("mean", "sd", "low", "high"),
    ),
    "triangular": (
        lambda stats, low, peak, high: stats.triang((peak - low) / (high - low), low, high - low),
        ("low", "peak", "high"),
    ),
}
"""Distributions with names of this package; other continuous distributions have their names in ``scipy.stats``."""


def law_of(name: str, table: object) -> Law:
    """Read the distribution of a parameter from its table in a study file.

    Parameters
    ----------
    name : str
        The parameter.
    table : object
        Table of the TOML file, such as ``{law = "normal", mean = 0.9, sd = 0.02}``.

    Returns
    -------
    Law
        Distribution in the unit of the parameter.

    Raises
    ------
    InputError
        if there is no such law, one of its numbers is missing or not allowed, or it has no spread.
    """
    if not isinstance(table, Mapping) or not isinstance(table.get("law"), str):
        example = '{law = "normal", mean = ..., sd = ...}'
        raise InputError(f"tolerance of {name} = {table!r} is not allowed: a table such as {example} is needed.")
    law, numbers = table["law"], {key: value for key, value in table.items() if key != "law"}
    for key, value in numbers.items():
        if not is_number(value):
            raise InputError(f"tolerance of {name}: {key} = {value!r} is not allowed: a finite number is needed.")
    words = f"{law}({', '.join(f'{key}={value:g}' for key, value in numbers.items())})"
    return Law(name, words, _frozen(name, law, numbers, words))


def _frozen(name: str, law: str, numbers: dict[str, float], words: str) -> Any:
    """The frozen distribution of ``scipy.stats``; raises `InputError` without a finite mean and a spread above 0."""
    from scipy import stats

    if law in LAWS:
        of_stats, needed = LAWS[law]
        make = partial(of_stats, stats)
        if set(numbers) != set(needed):
            raise InputError(f"tolerance of {name}: {words} is not allowed: {', '.join(needed)} are needed.")
    else:
        make, needed = getattr(stats, law, None), ()  # type: ignore[assignment]
        if not isinstance(make, stats.rv_continuous):
            raise InputError(
                f"tolerance of {name}: law = {law!r} is not known: {', '.join(LAWS)}, or a continuous distribution of "
                "scipy.stats, is needed."
            )
    try:
        with np.errstate(all="ignore"):
            frozen = make(**numbers)
            moments = [float(moment) for moment in (frozen.mean(), frozen.std(), frozen.ppf(0.5))]
    except (TypeError, ValueError, ArithmeticError) as error:
        raise InputError(f"tolerance of {name}: {words} is not allowed: {error}.") from error
    if not (all(map(math.isfinite, moments)) and moments[1] > 0):
        raise InputError(f"tolerance of {name}: {words} is not allowed: a finite mean and a spread above 0 are needed.")
    return frozen
