"""What else the model of the measured pad might have assumed, one thing at a time, and what that changes.

Height and end of the indenter stay those of the fit; the modulus and where the record begins are found anew.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from mitsuba_taxel.reproduce import bench_pad, measured
from mitsuba_taxel.reproduce.bench_pad import Assumed
from mitsuba_taxel.reproduce.pad_comparison import (
    MAP_TRAVEL,
    PREDICTED_TRAVELS,
    Compared,
    Results,
    compare,
    curve_of,
    held_map,
    measured_curve,
)
from mitsuba_taxel.reproduce.pad_fit import lateness, modulus, residuals
from mitsuba_taxel.reproduce.paper_studies import PaperStudies

PREDICTED = 17
"""The taxel whose change is missed most."""
OFF = "the indenter off the middle of both taxels, as the map tells"
OTHERS = {
    OFF: Assumed("off"),
    "silicone that hardly changes its volume, nu = 0.4999": Assumed("stiff_volume", poisson_ratio=0.4999),
    "an indenter with a coefficient of friction of 0.3": Assumed("rubbed", friction=0.3),
    "walls of the cells that reflect 20 %": Assumed("grey_walls", walls=0.2),
    "collars that hold nothing: walls are free down to the dies": Assumed("free_walls", collar=0.0),
}
"""Assumptions by what they are."""


class Tried(NamedTuple):
    """What an assumption leads to.

    Attributes
    ----------
    fitted, predicted : Compared
        The fitted taxel, and :data:`PREDICTED`.
    held : (5, 5) ndarray
        Map of the changes of all taxels, in percent of the fitted one's.
    """

    fitted: Compared
    predicted: Compared
    held: np.ndarray

    @property
    def ratio(self) -> float:
        """Change of the predicted taxel by that of the fitted one at the largest force of both records; NaN if it is
        not reached."""
        return _ratio(self.predicted, self.fitted)


def ratio(found: Results) -> tuple[float, float]:
    """Of :class:`Tried`, measured and with what the fit assumes."""
    one, other = (found.taxels[taxel] for taxel in (PREDICTED, measured.PRESSED))
    at = one.measured.force.max()
    there = (float(np.interp(at, taxel.measured.force, taxel.measured.change)) for taxel in (one, other))
    return float(np.divide(*there)), _ratio(one, other)


def _ratio(one: Compared, other: Compared) -> float:
    at = one.measured.force.max()
    changes = (np.interp(at, taxel.along.force, taxel.along.change, right=np.nan) for taxel in (one, other))
    return float(np.divide(*changes))


def tried(store: PaperStudies, found: Results) -> dict[str, Tried]:
    """What each of :data:`OTHERS` leads to; missing paths are computed."""
    return {words: _tried(store, found, words) for words in OTHERS}


def _tried(store: PaperStudies, found: Results, words: str) -> Tried:
    assumed, offset = OTHERS[words], found.offset.tolist()
    x, y = offset if words == OFF else (0.0, 0.0)
    there, ahead = measured_curve(measured.PRESSED), bench_pad.centre_of(PREDICTED)
    middle = bench_pad.path(store, found.fitted.moved(x, y), assumed=assumed)
    curve = curve_of(middle, measured.PRESSED)
    late = lateness(curve, there)
    misfit = float(np.sqrt(np.mean(residuals(curve, there, late) ** 2)))
    again = found.found._replace(modulus=modulus(curve, there, late), late=late, misfit=misfit)
    beside = bench_pad.path(store, found.fitted.moved(x + ahead[0], y + ahead[1]), PREDICTED_TRAVELS, assumed=assumed)
    if words == OFF:
        held = found.moved
    else:
        held = held_map(
            bench_pad.path(store, found.fitted.moved(*offset), (again.travel(MAP_TRAVEL),), assumed=assumed)
        )
    return Tried(
        compare(middle, measured.PRESSED, again, there),
        compare(beside, PREDICTED, again, measured_curve(PREDICTED)),
        held,
    )


def expected_at(found: Results) -> tuple[float, float, float]:
    """Of :data:`PREDICTED` in the map: measured, computed, and computed if it is as sensitive as when pressed itself.

    That is by the ratio of its measured to its computed changes, by least squares.
    """
    one = found.taxels[PREDICTED]
    borne = np.isfinite(one.change_at_force)
    here, there = one.change_at_force[borne], one.measured.change[borne]
    share = float(here @ there / (here @ here))
    place = np.unravel_index(PREDICTED - 1, found.moved.shape)
    computed = float(found.moved[place])
    return float(np.array(measured.HELD_MAP)[place]), computed, share * computed
