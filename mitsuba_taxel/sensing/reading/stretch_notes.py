"""Notes on pads that are stretched beyond the tests of their silicone, or beyond the stability of its law."""

from __future__ import annotations

import re
from collections.abc import Iterable
from typing import TYPE_CHECKING

import numpy as np

from mitsuba_taxel.sensing.scene.scene_pads import deformed_pads

if TYPE_CHECKING:
    import mitsuba as mi

_STRETCHED = re.compile(r"the silicone is stretched to (?P<stretch>\d+\.\d+) (?P<rest>.*)")


def stretch_notes(scene: mi.Scene) -> list[str]:
    """Notes on pads whose largest strain exceeds what is known of their material.

    Parameters
    ----------
    scene : mi.Scene
        A loaded scene.

    Returns
    -------
    list[str]
        A sentence for each limit that is exceeded.
    """
    loaded = [pad for pad in deformed_pads(scene) if pad.state.displacement.any()]
    if not loaded:  # and nothing of the mechanics is imported
        return []
    from mitsuba_taxel.mechanics.materials.drucker import stable_stretch
    from mitsuba_taxel.mechanics.results.largest_strain import largest_strain

    notes = []
    for pad in loaded:
        tested, stable = pad.specification.tested_stretch or np.inf, stable_stretch(pad.material)
        if not np.isfinite(min(tested, stable)):
            continue
        stretch = 1 + largest_strain(pad.state).value
        reached = f"the silicone is stretched to {stretch:.2f} in its most strained 1%"
        if stretch > tested:
            notes.append(f"{reached}, its tests reach {tested:.3g}: beyond that, its law is an extrapolation")
        if stretch > stable:
            notes.append(f"{reached}, its law is stable up to {stable:.3g}: beyond that, its stress may fall")
    return notes


def worst_stretches(notes: Iterable[str]) -> list[str]:
    """Distinct notes of many readings, with the largest stretch alone.

    Parameters
    ----------
    notes : iterable of str
        Notes of all readings.

    Returns
    -------
    list[str]
        Notes in their original order.
    """
    worst: dict[str, str] = {}
    for note in notes:
        match = _STRETCHED.fullmatch(note)
        key = match["rest"] if match else note
        known = _STRETCHED.fullmatch(worst.get(key, ""))
        if not (match and known and float(known["stretch"]) >= float(match["stretch"])):
            worst[key] = note
    return list(worst.values())
