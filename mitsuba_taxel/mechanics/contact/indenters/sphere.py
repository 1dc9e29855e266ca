"""A ball."""

from __future__ import annotations

import numpy as np

from mitsuba_taxel.geometry.mirror import Mirror
from mitsuba_taxel.geometry.surfaces.swept import revolved
from mitsuba_taxel.mechanics.contact.indenter_shape import RoundBody, round_outline


class Sphere(RoundBody, name="sphere", rank=0):
    """A ball."""

    meaning = "a ball"
    uses = ("radius",)
    across = np.eye(3)
    deepest = 0.25

    def keeps(self, mirror: Mirror) -> bool:
        return self._keeps_tip(mirror)

    def own_surface(self, reach: float) -> tuple[np.ndarray, np.ndarray]:
        outline = round_outline(self.indenter.radius, reach)
        return revolved(np.append(outline, [[0, outline[-1, 1]]], axis=0))
