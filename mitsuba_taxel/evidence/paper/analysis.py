"""Comparison of the rerun's studies with the numbers in the paper."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
import xarray as xr

from mitsuba_taxel.evidence.paper import paper
from mitsuba_taxel.evidence.paper.analog import EmulatedSlope, emulated
from mitsuba_taxel.evidence.paper.comparison import CommonFactorFit, common_scale
from mitsuba_taxel.evidence.paper.slopes import Sensitivity, change, curves, sensitivity

Paths = Mapping[str, xr.Dataset]
PUBLISHED = {"normal": paper.NORMAL, "tangential": paper.TANGENTIAL}
"""Table 1 by kind of force."""
PLACES = 201
"""Forces at which a curve is compared with a straight line."""


def table_one(studies: Mapping[str, Paths]) -> dict[str, dict[str, Sensitivity]]:
    """Sensitivities by load path (``fz``, ``fx``, ...) and cell shape, and in addition by ``normal`` and ``tangential``
    as in Table 1.

    The paper gives a single number for tangential forces along x and y; here it is the larger of the two slopes.
    """
    cells = list(studies)
    table = {path: {cell: sensitivity(studies[cell][path], path) for cell in cells} for path in studies[cells[0]]}
    table["normal"] = table["fz"]
    table["tangential"] = {cell: max(table["fx"][cell], table["fy"][cell], key=lambda s: s.max_slope) for cell in cells}
    return table


def expected_of_counting(nominal: Mapping[str, Paths]) -> dict[str, dict[str, EmulatedSlope]]:
    """Maximum slopes that the paper's procedure of counting rays would give with the readings of this program, by kind
    of force and cell shape.
    """
    return {
        "normal": {cell: emulated(paths["fz"], "fz") for cell, paths in nominal.items()},
        "tangential": {cell: emulated(paths["fx"], "fx") for cell, paths in nominal.items()},
    }


def readings(nominal: Mapping[str, Paths]) -> dict[str, dict[str, float]]:
    """Mean reading of the taxels in W at the start of the curves, by kind of force and cell shape: at rest for normal
    forces, at -8 N for tangential forces."""
    return {
        "normal": {cell: float(paths["fz"].power.sel(fz=0).mean()) for cell, paths in nominal.items()},
        "tangential": {cell: float(paths["fx"].power.sel(fx=0).mean()) for cell, paths in nominal.items()},
    }


def explanations(
    published: Mapping[str, float],
    slopes: Mapping[str, Sensitivity],
    counts: Mapping[str, EmulatedSlope],
    reading: Mapping[str, float],
) -> dict[str, CommonFactorFit]:
    """Fit three explanations to a column of Table 1 (a number for each cell shape), each with one free common factor.

    The published numbers are assumed to be proportional to the true slopes, with the errors of the computed slopes; or
    to the square root of the reading; or to the maximum slope with counting noise, with the scatter of one repetition.
    """
    cells = list(published)
    numbers = np.array([published[cell] for cell in cells])
    counted = np.array([counts[cell].mean for cell in cells])
    scatter = np.array([counts[cell].spread for cell in cells]) / counted
    root = np.sqrt([reading[cell] for cell in cells])
    return {
        "true maximum slope": against_slopes(numbers, [slopes[cell] for cell in cells]),
        "square root of the reading": common_scale(numbers, root, scatter),
        "maximum slope with counting noise": common_scale(numbers, counted, scatter),
    }


def against_slopes(published: np.ndarray, slopes: list[Sensitivity]) -> CommonFactorFit:
    """Fit published sensitivities as a common factor times the computed maximum slopes."""
    error = np.array([slope.max_slope_error for slope in slopes])
    value = np.array([least(slope) for slope in slopes])
    return common_scale(published, value, error / value)


def least(slope: Sensitivity) -> float:
    """The maximum slope or, if it is larger, its error: a number that is not 0, so that ratios stay finite."""
    return max(slope.max_slope, slope.max_slope_error)


def against_table_one(table: Mapping[str, Mapping[str, Sensitivity]]) -> CommonFactorFit:
    """Fit all eight numbers of Table 1 as one common factor times the computed numbers.

    All numbers have equal weight, because their deviations from the computed numbers are much larger than the errors of
    these."""
    pairs = [(PUBLISHED[kind][cell], least(slope)) for kind in PUBLISHED for cell, slope in table[kind].items()]
    published, slopes = np.array(pairs).T
    return common_scale(published, slopes, np.ones(len(slopes)))


class ReadingDifference(NamedTuple):
    """A difference of readings in W, and its error."""

    value: float
    error: float


def skewness(study: xr.Dataset) -> dict[str, ReadingDifference]:
    """Differences between the readings of taxels that mirror each other (Fig. 10), under a force along the secondary
    diagonal, minus the differences without this force.

    ``3 - 7``: corner taxels on the secondary diagonal; ``(2 + 6 - 4 - 8) / 2``: taxels at the sides; ``1, 5, 9``: the
    largest difference of these taxels, on the main diagonal, from their mean, which should be small.
    """
    taxels = np.eye(9)
    middle = (taxels[0] + taxels[4] + taxels[8]) / 3
    sums = {
        "3 - 7": [taxels[2] - taxels[6]],
        "(2 + 6 - 4 - 8) / 2": [(taxels[1] + taxels[5] - taxels[3] - taxels[7]) / 2],
        "1, 5, 9": [taxels[taxel] - middle for taxel in (0, 4, 8)],
    }
    differences = {
        name: [
            ReadingDifference(*change(study, "resultant", paper.SHOWN_TANGENTIAL_FORCE, weight)) for weight in weights
        ]
        for name, weights in sums.items()
    }
    return {name: max(weight, key=lambda difference: abs(difference.value)) for name, weight in differences.items()}


def nonlinearity_of(study: xr.Dataset) -> tuple[float, float]:
    """Nonlinearity in percent (paper, equation 7), and its error, of the taxel with the largest change up to 10 N.

    The error is the change of the nonlinearity if the slopes at both ends of the curve change by their errors, with
    opposite signs.
    """
    curve = curves(study, "fz")
    force = np.linspace(0, -paper.MEASURED_FORCE, PLACES)
    power = curve.power(force)
    values = power - power[0]
    taxel = int(np.abs(values[-1]).argmax())
    largest = np.abs(values[:, taxel]).max()
    line = values[-1, taxel] * force / force[-1]
    slope_error = np.interp(force[::-1], curve.force, curve.slope_error[:, taxel]).mean()
    power_error = slope_error * paper.MEASURED_FORCE / 4
    return float(100 * np.abs(values[:, taxel] - line).max() / largest), float(100 * power_error / largest)
