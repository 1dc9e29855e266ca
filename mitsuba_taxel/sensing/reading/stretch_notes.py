"""Notes on pads that are stretched beyond the tests of their silicone, or beyond the stability of its law."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING

import numpy as np

from mitsuba_taxel.sensing.scene.scene_pads import deformed_pads

if TYPE_CHECKING:
    import mitsuba as mi


def exceeded_limits(scene: mi.Scene) -> dict[str, float]:
    """Limits of the silicone of pads that their largest stretch exceeds.

    Parameters
    ----------
    scene : mi.Scene
        A loaded scene.

    Returns
    -------
    dict[str, float]
        Largest stretch for each limit, in words, that it exceeds.
    """
    loaded = [pad for pad in deformed_pads(scene) if pad.state.displacement.any()]
    if not loaded:  # and nothing of the mechanics is imported
        return {}
    from mitsuba_taxel.mechanics.materials.drucker import stable_stretch
    from mitsuba_taxel.mechanics.results.largest_strain import largest_strain

    exceeded = []
    for pad in loaded:
        tested, stable = pad.specification.tested_stretch or np.inf, stable_stretch(pad.material)
        if not np.isfinite(min(tested, stable)):
            continue
        stretch = 1 + largest_strain(pad.state).value
        if stretch > tested:
            exceeded.append({f"its tests reach {tested:.3g}: beyond that, its law is an extrapolation": stretch})
        if stretch > stable:
            exceeded.append({f"its law is stable up to {stable:.3g}: beyond that, its stress may fall": stretch})
    return largest_stretches(exceeded)


def largest_stretches(readings: Iterable[Mapping[str, float]]) -> dict[str, float]:
    """The largest stretch for each limit, of many pads or readings.

    Parameters
    ----------
    readings : iterable of Mapping[str, float]
        Results of `exceeded_limits`.

    Returns
    -------
    dict[str, float]
        In their order.
    """
    largest: dict[str, float] = {}
    for limits in readings:
        for limit, stretch in limits.items():
            largest[limit] = max(stretch, largest.get(limit, stretch))
    return largest


def stretch_notes(limits: Mapping[str, float]) -> list[str]:
    """A sentence for each limit that is exceeded.

    Parameters
    ----------
    limits : Mapping[str, float]
        Result of `exceeded_limits` or `largest_stretches`.

    Returns
    -------
    list[str]
        Notes in their original order.
    """
    reached = "the silicone is stretched to {:.2f} in its most strained 1%, {}"
    return [reached.format(stretch, limit) for limit, stretch in limits.items()]
