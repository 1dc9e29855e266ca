"""Expected difference between the measured map and the computed map due to the spread of sensitivities: in the computed
map, all taxels have the same sensitivity. The spread follows from the taxels that were pressed themselves."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from mitsuba_taxel.evidence.measured import measured
from mitsuba_taxel.evidence.measured.pad_comparison import PadComparison, TaxelComparison

ROUNDING = 1 / math.sqrt(12)
"""Rounding error of the measured map in points, as one standard deviation."""


class TaxelBand(NamedTuple):
    """Expected difference between the measured and the computed map, because taxels differ in sensitivity.

    Attributes
    ----------
    own : dict[int, float]
        For the number of each pressed taxel, the ratio of its measured to its computed sensitivity, from
        :func:`own_sensitivity`.
    spread : float
        Standard deviation of the logarithms of these ratios.
    moved : (5, 5) ndarray
        The computed map: changes of all taxels, in percent of the change of the pressed taxel.
    deviation : (5, 5) ndarray
        Standard deviation of each number of the map, in percentage points; 0 for the middle taxel.
    """

    own: dict[int, float]
    spread: float
    moved: np.ndarray
    deviation: np.ndarray

    def chance(self, times: float | np.ndarray) -> float | np.ndarray:
        """Probability that the sensitivity of a taxel deviates by ``times`` standard deviations or more, by Student's
        distribution."""
        from scipy.stats import t

        return 2 * t.sf(times, len(self.own) - 1)

    def expected_beyond(self, target: float) -> float:
        """Expected number of taxels that deviate by more than ``target`` percentage points."""
        with np.errstate(divide="ignore"):
            return float(np.sum(self.chance(target / self.deviation)))

    def chance_of_none_beyond(self, target: float) -> float:
        """Probability that no taxel deviates by more than ``target`` percentage points.

        Two unknowns are common to all taxels: the deviation of the pressed taxel, and the standard deviation, which is
        estimated from few taxels. For given values of both, the taxels are independent. The probability is averaged
        over equally likely values of both."""
        from scipy.stats import chi2, norm

        degrees, quantiles = len(self.own) - 1, (np.arange(400) + 0.5) / 400
        spread = self.spread * np.sqrt(degrees / chi2.ppf(quantiles, degrees))[:, None, None]
        pressed = norm.ppf(quantiles)[:, None]
        map_values = self.moved[self.deviation > 0]
        sd = np.hypot(spread * map_values, ROUNDING)
        within = norm.cdf((target + spread * pressed * map_values) / sd) - norm.cdf(
            (-target + spread * pressed * map_values) / sd
        )
        return float(np.prod(within, axis=-1).mean())


def band(results: PadComparison) -> TaxelBand:
    """Uncertainty of the computed map due to the spread of sensitivities. Each number of the map is a ratio of the
    changes of two taxels, and both have unknown deviations of their sensitivity."""
    sensitivities = {taxel: own_sensitivity(compared) for taxel, compared in results.taxels.items()}
    deviation = map_deviation(sensitivities, results.moved, measured.PRESSED)
    return TaxelBand(sensitivities, spread_of(sensitivities), results.moved, deviation)


def spread_of(own: Mapping[int, float]) -> float:
    """Standard deviation of the logarithms of the sensitivities ``own`` of pressed taxels."""
    return float(np.std(np.log(list(own.values())), ddof=1))


def map_deviation(own: Mapping[int, float], computed: np.ndarray, taxel: int) -> np.ndarray:
    """Standard deviation (5, 5) in points of the numbers of a map, due to the spread of the sensitivities ``own`` of
    pressed taxels; 0 for the held taxel."""
    deviation = np.hypot(math.sqrt(2) * spread_of(own) * computed, ROUNDING)
    deviation[np.unravel_index(taxel - 1, deviation.shape)] = 0.0
    return deviation


def own_sensitivity(compared: TaxelComparison) -> float:
    """Measured divided by computed sensitivity of a pressed taxel, from changes at equal force, by least squares."""
    borne = np.isfinite(compared.change_at_force)
    computed, observed = compared.change_at_force[borne], compared.measured.change[borne]
    return float(computed @ observed / (computed @ computed))
