"""Error of readings by the facets of curved walls: light is traced once more with triangles that are chords.

The triangles used for readings match the walls on average. The remaining error is of the same order in their size as
the correction, and a small part of it.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import mitsuba as mi

from mitsuba_taxel.base import stages
from mitsuba_taxel.kernels.protocols import PadShape
from mitsuba_taxel.sensing.mechanics_error import moved
from mitsuba_taxel.sensing.scene_pads import deformed_pads


def curved_pads(scene: mi.Scene) -> list[PadShape]:
    """The `deformable_pad`s of a scene whose triangles deviate from their walls."""
    return [pad for pad in deformed_pads(scene) if pad.is_curved]


@contextmanager
def with_chords(scene: mi.Scene) -> Iterator[None]:
    """Temporarily replace the triangles of curved walls by chords."""
    pads = curved_pads(scene)
    with stages.stage("load"):
        chords = [pad.chords() for pad in pads]
    with moved(scene, pads, chords):
        yield
