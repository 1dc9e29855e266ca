"""What the facets of curved walls do to readings: the light is traced once more, past triangles that are their chords.

The triangles that readings are taken with have the mean of the walls. What that leaves is of the same order in their
size as what it mends, and a small part of it.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import mitsuba as mi

from mitsuba_taxel.base import stages
from mitsuba_taxel.sensing.mechanics_error import moved


def curved_pads(scene: mi.Scene) -> list[Any]:
    """The `deformable_pad`s of a scene whose triangles are off their walls by more than nothing."""
    return [shape for shape in scene.shapes() if getattr(shape, "is_curved", False)]


@contextmanager
def past_chords(scene: mi.Scene) -> Iterator[None]:
    """Have the triangles of curved walls be their chords for a while."""
    pads = curved_pads(scene)
    with stages.stage("load"):
        chords = [pad.chords() for pad in pads]
    with moved(scene, pads, chords):
        yield
