"""Effects of the assumptions in the model of the measured pad, which are changed one at a time. The height of the pad
and the radius of the indenter are those of the fit; the modulus and the start of the record are fitted again."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from mitsuba_taxel.evidence.measured import bench_pad, measured
from mitsuba_taxel.evidence.measured.bench_pad import PadAssumptions
from mitsuba_taxel.evidence.measured.pad_comparison import (
    PadComparison,
    TaxelComparison,
    compare,
    curve_of,
    held_map,
    measured_curve,
)
from mitsuba_taxel.evidence.measured.pad_fit import lateness, modulus, residuals
from mitsuba_taxel.evidence.measured.taxel_spread import own_sensitivity
from mitsuba_taxel.evidence.paper.paper_studies import PaperStudies

PREDICTED = 17
"""Number of the taxel whose predicted change has the largest error."""
OTHERS = {
    "silicone that hardly changes its volume, nu = 0.4999": PadAssumptions("stiff_volume", poisson_ratio=0.4999),
    "an indenter with a coefficient of friction of 0.3": PadAssumptions("rubbed", friction=0.3),
    "walls of the cells that reflect 20 %": PadAssumptions("grey_walls", walls=0.2),
    "collars that hold nothing: walls are free down to the dies": PadAssumptions("free_walls", collar=0.0),
}
"""Assumptions by their description on the page."""


class AssumptionResult(NamedTuple):
    """Results under one changed assumption.

    Attributes
    ----------
    fitted : TaxelComparison
        Comparison of the taxel to which the model was fitted.
    rings : (5,) ndarray
        Mean changes at each of five distances from the middle, from :func:`rings`, at the travel of the hold.
    """

    fitted: TaxelComparison
    rings: np.ndarray


def tried(store: PaperStudies, results: PadComparison) -> dict[str, AssumptionResult]:
    """Compute the results under each assumption in :data:`OTHERS`; missing load paths are computed."""
    return {name: _tried(store, results, assumed) for name, assumed in OTHERS.items()}


def _tried(store: PaperStudies, results: PadComparison, assumed: PadAssumptions) -> AssumptionResult:
    measured_taxel, study = measured_curve(measured.PRESSED), bench_pad.path(store, results.fitted, assumed=assumed)
    curve = curve_of(study, measured.PRESSED)
    late = lateness(curve, measured_taxel)
    misfit = float(np.sqrt(np.mean(residuals(curve, measured_taxel, late) ** 2)))
    refitted = results.found._replace(modulus=modulus(curve, measured_taxel, late), late=late, misfit=misfit)
    hold_map = held_map(study.sel(travel=[measured.HELD_AT]))
    return AssumptionResult(compare(study, measured.PRESSED, refitted, measured_taxel), rings(hold_map))


def rings(values: np.ndarray) -> np.ndarray:
    """Mean of a map (5, 5) over the taxels at each of the five distances from the middle.

    To first order, a small offset of the indenter from the middle does not change these means."""
    row, column = np.indices(values.shape) - bench_pad.SIDE // 2
    distance = np.hypot(row, column).round(6)
    return np.array([values[distance == radius].mean() for radius in np.unique(distance)[1:]])


def expected_at(results: PadComparison) -> tuple[float, float, float]:
    """Change of the reading of the taxel :data:`PREDICTED` while the middle taxel is pressed: measured; computed; and
    computed times the ratio of measured to computed change when this taxel is pressed itself."""
    position = np.unravel_index(PREDICTED - 1, results.moved.shape)
    computed = float(results.moved[position])
    return float(np.array(measured.HELD_MAP)[position]), computed, own_sensitivity(results.taxels[PREDICTED]) * computed
