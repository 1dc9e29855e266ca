"""Maps of all taxels while one of them is held, measured and computed with the pad that was fitted to taxel 13.

The place of the indenter is not known. It is fitted to the measured map under the assumption that the change of a
taxel is proportional to a function of its distance from the indenter, which is read off a computed map: first that for
an indenter above the middle of the held taxel, then that for the place that was found. The map compared with the
measured one is computed by finite elements for the last place.
"""

from __future__ import annotations

from collections.abc import Callable
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
SETTLED = 0.06
"""Distance in mm between two successive places of the indenter below which the search ends."""
MOST_PLACES = 2
"""Number of places for which finite elements are computed at most."""


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
        Force and changes for an indenter at this place.
    measured, centred : (5, 5) ndarray
        The measured map, and the one computed for an indenter above the middle.
    """

    taxel: int
    place: np.ndarray
    computed: ComputedMap
    measured: np.ndarray
    centred: np.ndarray

    @property
    def placed(self) -> np.ndarray:
        """The map (5, 5) computed for the fitted place."""
        return self.computed.relative_to(self.taxel)

    @property
    def ratio(self) -> np.ndarray:
        """Measured divided by computed change (5, 5), each relative to rest; NaN where little is computed."""
        computed = np.where(self.placed < LEAST, np.nan, self.computed.changes[self.taxel - 1] * self.placed)
        return measured.HELD_PRESSES[self.taxel].change * self.measured / computed


def rms(difference: np.ndarray) -> float:
    """Root mean square of the differences of the 24 taxels that are not held; that of the held one is 0."""
    return float(np.sqrt(np.square(difference).sum() / (difference.size - 1)))


def held_map(
    found: FittedPad, taxel: int, path: xr.Dataset, pressed_at: Callable[[np.ndarray, float], xr.Dataset]
) -> HeldMapComparison:
    """Compare measured and computed changes of all taxels while the indenter presses on one taxel and is held there.

    Parameters
    ----------
    found : FittedPad
        The fit to taxel 13: its modulus and start of the record are used.
    taxel : int
        Number of the held taxel, one of `measured.HELD_PRESSES`.
    path : xr.Dataset
        Load path for an indenter above the middle of the taxel.
    pressed_at : Callable[[ndarray, float], xr.Dataset]
        Computes the load path for an indenter at a place (x, y) relative to the middle of the taxel, in mm, at one
        travel in mm.

    Returns
    -------
    HeldMapComparison
        Measured and computed maps, for the place whose map agrees best with the measured one; it may be the middle.
    """
    record = measured.HELD_PRESSES[taxel]
    travel = found.travel(record.travel)
    measured_map = np.array(record.changes, dtype=float)
    above = _at(path, travel, found.modulus)
    centred = above.relative_to(taxel)
    tried = [HeldMapComparison(taxel, np.zeros(2), above, measured_map, centred)]
    place, start = place_of(centred, measured_map, taxel), np.zeros(2)
    while len(tried) <= MOST_PLACES and np.linalg.norm(place - start) > SETTLED:
        study = pressed_at(place, travel)
        computed = ComputedMap(found.modulus * float(study.force[-1]), study.change.values[-1])
        tried.append(HeldMapComparison(taxel, place, computed, measured_map, centred))
        start, place = place, place_of(computed.relative_to(taxel), measured_map, taxel, place)
    return min(tried, key=lambda compared: rms(compared.placed - measured_map))


def _at(path: xr.Dataset, travel: float, modulus: float) -> ComputedMap:
    """Force and changes at a travel, by splines over the travels of a load path that start at rest."""
    knots = np.insert(path.travel.values, 0, 0.0)
    values = np.vstack([np.zeros(bench_pad.SIDE**2 + 1), np.column_stack([path.force, path.change])])
    force, *changes = CubicSpline(knots, values)(travel)
    return ComputedMap(modulus * float(force), np.array(changes))


def place_of(
    computed: np.ndarray, measured_map: np.ndarray, taxel: int, place: np.ndarray | None = None
) -> np.ndarray:
    """Position (x, y) of an indenter relative to the middle of the held taxel in mm, from the measured map.

    The change of a taxel at the distance r from the indenter is taken as proportional to exp(a r^2 + b r^4), with a and
    b from the map ``computed`` of an indenter at ``place``, by default above the middle. The differences between taxels
    of that map that do not depend on the distance alone are kept.
    """
    place = np.zeros(2) if place is None else place
    sites = np.array([bench_pad.centre_of(number) for number in range(1, measured_map.size + 1)])
    away = sites - sites[taxel - 1]

    def powers(at: np.ndarray) -> np.ndarray:
        """Second and fourth powers (25, 2) of the distances from an indenter in pitches, less those of the held taxel.
        """
        distance = np.square(away - at).sum(axis=1) / measured.PITCH**2
        both = np.stack([distance, distance**2], axis=1)
        return both - both[taxel - 1]

    squared = np.square(away).sum(axis=1) / measured.PITCH**2
    near = (squared > 0) & (squared < NEAR**2) & (computed.ravel() > LEAST)
    falls = np.linalg.lstsq(powers(place)[near], np.log(computed.ravel()[near] / 100), rcond=None)[0]

    def residuals(at: np.ndarray) -> np.ndarray:
        moved = computed.ravel() * np.exp((powers(at) - powers(place)) @ falls)
        return (moved - measured_map.ravel())[near]

    return np.round(least_squares(residuals, place, x_scale=0.1).x, 2)
