"""Error of readings by the facets of curved walls: light is traced once more with triangles that are chords.

The triangles used for readings match the walls on average. The remaining error is of the same order in their size as
the correction, and a small part of it.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import mitsuba as mi

from mitsuba_taxel.base import stages
from mitsuba_taxel.sensing.mechanics_error import moved


def curved_pads(scene: mi.Scene) -> list[Any]:
    """The `deformable_pad`s of a scene whose triangles deviate from their walls."""
    return [shape for shape in scene.shapes() if getattr(shape, "is_curved", False)]


@contextmanager
def with_chords(scene: mi.Scene) -> Iterator[None]:
    """Temporarily replace the triangles of curved walls by chords."""
    pads = curved_pads(scene)
    with stages.stage("load"):
        chords = [pad.chords() for pad in pads]
    with moved(scene, pads, chords):
        yield
