"""Maps of all taxels while one of them is held, measured and computed with the pad that was fitted to taxel 13.

The place of the indenter is not known. It is fitted to the measured map under the assumption that the change of a
taxel is proportional to a function of its distance from the indenter, which is read off the map computed for an
indenter above the middle of the held taxel. Then the map is computed for this place by finite elements.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import xarray as xr
from scipy.interpolate import CubicSpline
from scipy.optimize import least_squares

from mitsuba_taxel.evidence.measured import bench_pad, measured
from mitsuba_taxel.evidence.measured.bench_pad import IndenterPress, PadAssumptions
from mitsuba_taxel.evidence.measured.pad_fit import FittedPad
from mitsuba_taxel.evidence.paper.paper_studies import PaperStudies

NEAR = 2.3
"""Largest distance from the held taxel, in pitches, of the taxels to which a place is fitted."""
LEAST = 4.0
"""Smallest computed change, in percent of that of the held taxel, from which ratios of changes are formed."""
FREE_WALLS = PadAssumptions("free_walls", collar=0.0)


class ComputedMap(NamedTuple):
    """Computed force in N while a taxel is held, and changes (25,) of all taxels relative to rest."""

    force: float
    changes: np.ndarray

    def relative_to(self, taxel: int) -> np.ndarray:
        """Map (5, 5) in percent of the change of a taxel."""
        return 100 * (self.changes / self.changes[taxel - 1]).reshape(bench_pad.SIDE, bench_pad.SIDE)


class HeldMapComparison(NamedTuple):
    """Measured and computed maps while a taxel is held.

    Attributes
    ----------
    taxel : int
        Number of the held taxel.
    place : (2,) ndarray
        Fitted position of the indenter relative to the middle of the taxel, mm.
    centred, moved, free : ComputedMap
        Computed for an indenter above the middle; for one at the fitted place; and there without collars that hold the
        walls.
    """

    taxel: int
    place: np.ndarray
    centred: ComputedMap
    moved: ComputedMap
    free: ComputedMap

    @property
    def measured(self) -> np.ndarray:
        """The measured map (5, 5), in percent of the change of the held taxel."""
        return np.array(measured.HELD_PRESSES[self.taxel].changes, dtype=float)

    def difference(self, computed: ComputedMap) -> np.ndarray:
        """Computed minus measured map (5, 5), percentage points."""
        return computed.relative_to(self.taxel) - self.measured

    def ratio(self, computed: ComputedMap) -> np.ndarray:
        """Measured divided by computed change (5, 5), each relative to rest; NaN where little is computed."""
        share = measured.HELD_PRESSES[self.taxel].change
        changes = computed.changes.reshape(bench_pad.SIDE, bench_pad.SIDE)
        return np.where(computed.relative_to(self.taxel) < LEAST, np.nan, share * self.measured / 100 / changes)


def rms(difference: np.ndarray) -> float:
    """Root mean square of the differences of the 24 taxels that are not held; that of the held one is 0."""
    return float(np.sqrt(np.square(difference).sum() / (difference.size - 1)))


def held_map(
    store: PaperStudies, press: IndenterPress, found: FittedPad, taxel: int, path: xr.Dataset
) -> HeldMapComparison:
    """Compare the map of a held taxel; missing load paths are computed.

    Parameters
    ----------
    store : PaperStudies
        Store of results.
    press : IndenterPress
        The fitted pad and indenter.
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
    travel, middle = found.travel(record.travel), np.array(bench_pad.centre_of(taxel))
    centred = _at(path, travel, found.modulus)
    place = place_of(centred.relative_to(taxel), np.array(record.changes), taxel)
    moved = press.moved(*np.round(middle + place, 2).tolist())
    there, free = (
        _at(bench_pad.path(store, moved, (travel,), assumed=assumed), travel, found.modulus)
        for assumed in (bench_pad.AS_FITTED, FREE_WALLS)
    )
    return HeldMapComparison(taxel, place, centred, there, free)


def _at(path: xr.Dataset, travel: float, modulus: float) -> ComputedMap:
    """Force and changes at a travel, by splines over the travels of a load path that start at rest."""
    if len(path.travel) == 1:
        return ComputedMap(modulus * float(path.force[0]), path.change.values[0])
    knots = np.insert(path.travel.values, 0, 0.0)
    values = np.vstack([np.zeros(bench_pad.SIDE**2 + 1), np.column_stack([path.force, path.change])])
    force, *changes = CubicSpline(knots, values, bc_type="natural")(travel)
    return ComputedMap(modulus * float(force), np.array(changes))


def place_of(centred: np.ndarray, measured_map: np.ndarray, taxel: int) -> np.ndarray:
    """Position (x, y) of an indenter relative to the middle of the held taxel in mm, from the measured map.

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

    def logarithm(place: np.ndarray) -> np.ndarray:
        distance = np.square(away - place).sum(axis=1) / measured.PITCH**2
        return np.stack([distance, distance**2], axis=1) @ falls

    def residuals(place: np.ndarray) -> np.ndarray:
        growth = logarithm(place) - logarithm(np.zeros(2))
        return (centred.ravel() * np.exp(growth - growth[taxel - 1]) - measured_map.ravel())[near]

    return np.round(least_squares(residuals, np.zeros(2), x_scale=0.1).x, 2)
