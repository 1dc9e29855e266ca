"""Maps of all taxels while one of them is held, measured and computed with the pad that was fitted to taxel 13.

The place of the indenter is not known. It is fitted to the measured map under the assumption that the change of a
taxel is proportional to a function of its distance from the indenter, which is read off the map computed for an
indenter above the middle of the held taxel.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import xarray as xr
from scipy.interpolate import CubicSpline
from scipy.optimize import least_squares

from mitsuba_taxel.evidence.measured import bench_pad, measured
from mitsuba_taxel.evidence.measured.pad_fit import FittedPad

NEAR = 2.3
"""Largest distance from the held taxel, in pitches, of the taxels to which a place is fitted."""
LEAST = 4.0
"""Smallest computed change, in percent of that of the held taxel, for fits and for ratios of changes."""


class ComputedMap(NamedTuple):
    """Computed force in N while a taxel is held, and changes (25,) of all taxels relative to rest."""

    force: float
    changes: np.ndarray

    def relative_to(self, taxel: int) -> np.ndarray:
        """Map (5, 5) in percent of the change of a taxel."""
        return 100 * (self.changes / self.changes[taxel - 1]).reshape(bench_pad.SIDE, bench_pad.SIDE)


class HeldMapComparison(NamedTuple):
    """Measured and computed maps (5, 5) while a taxel is held, in percent of the change of this taxel.

    Attributes
    ----------
    taxel : int
        Number of the held taxel.
    place : (2,) ndarray
        Fitted position of the indenter relative to the middle of the taxel, mm.
    computed : ComputedMap
        Force and changes for an indenter above the middle.
    measured, centred, shifted : (5, 5) ndarray
        The measured map; the one computed for an indenter above the middle; and this map shifted to the fitted place.
    """

    taxel: int
    place: np.ndarray
    computed: ComputedMap
    measured: np.ndarray
    centred: np.ndarray
    shifted: np.ndarray

    @property
    def ratio(self) -> np.ndarray:
        """Measured divided by computed change (5, 5), each relative to rest; NaN where little is computed."""
        computed = np.where(self.shifted < LEAST, np.nan, self.computed.changes[self.taxel - 1] * self.shifted)
        return measured.HELD_PRESSES[self.taxel].change * self.measured / computed


def rms(difference: np.ndarray) -> float:
    """Root mean square of the differences of the 24 taxels that are not held; that of the held one is 0."""
    return float(np.sqrt(np.square(difference).sum() / (difference.size - 1)))


def held_map(found: FittedPad, taxel: int, path: xr.Dataset) -> HeldMapComparison:
    """Compare the map of a held taxel.

    Parameters
    ----------
    found : FittedPad
        The fit to taxel 13: its modulus and start of the record are used.
    taxel : int
        Number of the held taxel, one of `measured.HELD_PRESSES`.
    path : xr.Dataset
        Load path for an indenter above the middle of the taxel.

    Returns
    -------
    HeldMapComparison
        Measured and computed maps.
    """
    record = measured.HELD_PRESSES[taxel]
    measured_map = np.array(record.changes, dtype=float)
    computed = _at(path, found.travel(record.travel), found.modulus)
    centred = computed.relative_to(taxel)
    place, shifted = place_of(centred, measured_map, taxel)
    return HeldMapComparison(taxel, place, computed, measured_map, centred, shifted)


def _at(path: xr.Dataset, travel: float, modulus: float) -> ComputedMap:
    """Force and changes at a travel, by splines over the travels of a load path that start at rest."""
    knots = np.insert(path.travel.values, 0, 0.0)
    values = np.vstack([np.zeros(bench_pad.SIDE**2 + 1), np.column_stack([path.force, path.change])])
    force, *changes = CubicSpline(knots, values)(travel)
    return ComputedMap(modulus * float(force), np.array(changes))


def place_of(centred: np.ndarray, measured_map: np.ndarray, taxel: int) -> tuple[np.ndarray, np.ndarray]:
    """Position (x, y) of an indenter relative to the middle of the held taxel in mm, from the measured map, and the map
    ``centred`` shifted to it.

    The change of a taxel at the distance r from the indenter is taken as proportional to exp(a r^2 + b r^4), with a and
    b from the computed map ``centred`` of an indenter above the middle. The differences between taxels of that map that
    do not depend on the distance alone are kept.
    """
    sites = np.array([bench_pad.centre_of(number) for number in range(1, measured_map.size + 1)])
    away = sites - sites[taxel - 1]
    squared = np.square(away).sum(axis=1) / measured.PITCH**2
    near = (squared > 0) & (squared < NEAR**2) & (centred.ravel() > LEAST)
    powers = np.stack([squared, squared**2], axis=1)
    falls = np.linalg.lstsq(powers[near], np.log(centred.ravel()[near] / 100), rcond=None)[0]

    def shifted(place: np.ndarray) -> np.ndarray:
        # The quartic holds within NEAR; beyond, changes are small, and keep those of the centred map.
        distance = np.square(away - place).sum(axis=1) / measured.PITCH**2
        growth = (np.stack([distance, distance**2], axis=1) - powers) @ falls
        factor = np.where(squared < NEAR**2, np.exp(growth), np.exp(growth[taxel - 1]))
        return centred.ravel() * factor / factor[taxel - 1]

    def residuals(place: np.ndarray) -> np.ndarray:
        return (shifted(place) - measured_map.ravel())[near]

    place = np.round(least_squares(residuals, np.zeros(2), x_scale=0.1).x, 2)
    return place, shifted(place).reshape(centred.shape)
