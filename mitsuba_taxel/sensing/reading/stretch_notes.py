"""Notes on pads whose silicone is stretched beyond its material tests, or beyond the range in which its law is
stable."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING

import numpy as np

from mitsuba_taxel.sensing.scene.scene_pads import deformed_pads

if TYPE_CHECKING:
    import mitsuba as mi


def exceeded_limits(scene: mi.Scene) -> dict[str, float]:
    """Limits of a silicone that the pads of a scene exceed, each with the largest stretch in the pads.

    Parameters
    ----------
    scene : mi.Scene
        A loaded scene.

    Returns
    -------
    dict[str, float]
        Largest stretch, by the description of each exceeded limit in words.
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
    """Merge exceeded limits of many pads or readings: the largest stretch for each limit.

    Parameters
    ----------
    readings : iterable of Mapping[str, float]
        Results of `exceeded_limits`.

    Returns
    -------
    dict[str, float]
        Largest stretch by limit, in the order of first occurrence.
    """
    largest: dict[str, float] = {}
    for limits in readings:
        for limit, stretch in limits.items():
            largest[limit] = max(stretch, largest.get(limit, stretch))
    return largest


def stretch_notes(limits: Mapping[str, float]) -> list[str]:
    """Describe each exceeded limit in a sentence.

    Parameters
    ----------
    limits : Mapping[str, float]
        Result of `exceeded_limits` or `largest_stretches`.

    Returns
    -------
    list[str]
        A note for each limit, in the order of ``limits``.
    """
    reached = "the silicone is stretched to {:.2f} in its most strained 1%, {}"
    return [reached.format(stretch, limit) for limit, stretch in limits.items()]
