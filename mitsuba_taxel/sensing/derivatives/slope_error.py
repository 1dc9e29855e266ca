"""Errors of derivatives due to the finite elements, from the same derivatives on a second mesh."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from mitsuba_taxel.mechanics.errors.second_state import SecondState

INDEPENDENT_WEIGHT = 0.25
"""Weight of the root of the sum of squares of the changes by single patches, which is added to the sum of these
changes. With this weight, the true errors of 98 % of single cells are less than twice the stated errors; without it, 88
%."""


class Comparison(NamedTuple):
    """Differences of one cell's reading and of its P derivatives between two finite-element meshes, per W of the LED.

    Attributes
    ----------
    changes : (1 + P,) ndarray
        Change of the reading, then of each derivative.
    independent : (P,) ndarray
        Root of the sum of squares of the changes that single patches contribute to each derivative.
    kinks : (P,) ndarray
        Changes of derivatives due to the kinks between elements, which affect both the shape and the velocities of a
        mesh.
    displaced : (P,) ndarray
        Derivatives through the displacement of the pad alone.
    """

    changes: np.ndarray
    independent: np.ndarray
    kinks: np.ndarray
    displaced: np.ndarray


def unknown(count: int) -> Comparison:
    """The comparison of two meshes for ``count`` parameters if there is no second mesh: all values are NaN."""
    return Comparison(np.full(1 + count, np.nan), *np.full((3, count), np.nan))


def mechanics_errors(
    comparisons: list[Comparison], reading: np.ndarray, second: SecondState | None
) -> tuple[np.ndarray, np.ndarray]:
    """Estimate the errors of derivatives and readings due to the finite elements.

    The change due to kinks is an error of each taxel. In the rest of the change, two meshes may agree by chance. It is
    therefore averaged over all cells that receive light, and a fraction of the changes by single patches is added as if
    they were independent.

    Parameters
    ----------
    comparisons : list[Comparison]
        Comparison of two meshes for each taxel.
    reading : (T, 1) ndarray
        Readings of T taxels, per W of the LED.
    second : SecondState or None
        The state on the second mesh. Its mesh size determines which fraction of the difference is stated as the error.

    Returns
    -------
    of_derivatives : (T, P) ndarray
        Errors of the derivatives per W of the LED and unit of the parameter, for P parameters; NaN without a second
        mesh.
    of_readings : (T, 1) ndarray
        Errors of the readings per W of the LED.
    """
    lit = reading[:, 0] > 0
    changes, independent, kinks, displaced = (np.array(values) for values in zip(*comparisons, strict=True))
    if second is None or not lit.any():
        return np.full(displaced.shape, np.nan), np.full_like(reading, np.nan)
    without_kinks = changes[lit, 1:] - (1 - 2 * second.share_of_sum) * kinks[lit]
    difference = np.hypot(_root_mean_square(without_kinks), INDEPENDENT_WEIGHT * _root_mean_square(independent[lit]))
    averaged = np.maximum(second.share * difference, second.least * _root_mean_square(displaced[lit]))
    of_readings = second.share * _root_mean_square(changes[lit, :1] / reading[lit]) * reading
    return np.hypot(averaged, second.share_of_sum * kinks), of_readings


def _root_mean_square(values: np.ndarray) -> np.ndarray:
    """Root mean square over the first axis."""
    return np.sqrt((values**2).mean(axis=0))
