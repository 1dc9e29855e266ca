"""Bounds on the power of phototransistors that no light path has reached."""

from __future__ import annotations

import mitsuba as mi
import numpy as np

from mitsuba_taxel.kernels.paths.emission_guiding import LARGEST_WEIGHT
from mitsuba_taxel.kernels.paths.taxel_integrators import guides_emission, traces_taxels
from mitsuba_taxel.kernels.taxel_pair import TaxelPair
from mitsuba_taxel.kernels.walls import absorbs, has_mirrors, walls_of
from mitsuba_taxel.sensing.scene.taxels import taxels_of
from mitsuba_taxel.specification.analog_tracer import AnalogTracer
from mitsuba_taxel.specification.taxel_tracer import TaxelTracer

_UPPER_LIMIT = 1.841
"""Expected number of events for which no event is observed with a probability of 15.9 %. This is the probability of a
value more than one standard deviation below the mean (N. Gehrels, Confidence Limits for Small Numbers of Events in
Astrophysical Data, 1986)."""

_WITH_HITS = ("all", "unidirectional_hits")
"""Strategies of a `taxel_tracer` that count paths which hit the phototransistor."""


def dark_errors(scene: mi.Scene, integrator: mi.Integrator, paths: int, taxels: int) -> np.ndarray:
    """Stated error in W of each taxel whose phototransistor none of ``paths`` light paths reached: one standard
    deviation.

    Let P be the power of the LED, and w P the largest power that a single path can contribute. If the reading is p,
    each path contributes light with a probability of at least p / (w P). The weight w is 1 without emission guiding,
    and larger with it.

    Returns
    -------
    (T,) ndarray
        Error of each of the T taxels. It is 0 where no light can arrive, because the LED has no power or because all
        walls absorb and there is no direct light. It is NaN if the power of the integrator's paths has no bound.
    """
    if not traces_taxels(integrator):
        return np.full(taxels, np.nan)
    return np.concatenate([_of_pair(scene, integrator, pair, paths) for pair in taxels_of(scene)])


def may_be_lit(scene: mi.Scene, integrator: mi.Integrator) -> bool:
    """Whether light could reach a taxel whose reading is 0 so far, if more paths were traced."""
    return bool(np.any(dark_errors(scene, integrator, 1, 1) > 0))


def _of_pair(scene: mi.Scene, integrator: mi.Integrator, pair: TaxelPair, paths: int) -> np.ndarray:
    power = float(np.ravel(pair.led.power)[0])
    if power == 0 or pair.coplanar and all(absorbs(wall) for wall in walls_of(scene)):
        return np.zeros(pair.count)
    if not _releases_as_leds_shine(integrator):
        return np.full(pair.count, np.nan)
    weight = LARGEST_WEIGHT if guides_emission(integrator) and has_mirrors(scene) else 1.0
    return np.full(pair.count, _UPPER_LIMIT * weight * power / paths)


def _releases_as_leds_shine(integrator: mi.Integrator) -> bool:
    """Whether light paths start at the LED with the distribution of its light, and are counted only where they hit the
    phototransistor."""
    made = integrator.specification
    return isinstance(made, AnalogTracer) or isinstance(made, TaxelTracer) and made.strategy in _WITH_HITS
