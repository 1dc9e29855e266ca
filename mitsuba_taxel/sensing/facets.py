"""What the facets of curved walls do to readings: the light is traced once more, past triangles that are their chords.

The triangles that readings are taken with have the mean of the walls. What that leaves is of the same order in their
size as what it mends, and a small part of it.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import mitsuba as mi
import numpy as np

from mitsuba_taxel.base import stages
from mitsuba_taxel.sensing.mechanics_error import moved


def curved_pads(scene: mi.Scene) -> list[Any]:
    """The `deformable_pad`s of a scene whose triangles are off their walls by more than nothing."""
    return [shape for shape in scene.shapes() if getattr(shape, "is_curved", False)]


def change_by_chords(scene: mi.Scene, powers: Callable[[], np.ndarray], before: np.ndarray) -> np.ndarray:
    """(T,) W, by how much powers change where triangles are chords of the curved walls.

    Parameters
    ----------
    powers : traces the scene as it is, always with the same random numbers; (R, T) W
    before : (R, T) W, what it has given

    Pads are as before when this returns.
    """
    pads = curved_pads(scene)
    with stages.stage("load"):
        chords = [pad.chords() for pad in pads]
    with moved(scene, pads, chords):
        return (powers() - before).mean(axis=0)
