"""A rod that lies on the pad."""

from __future__ import annotations

import numpy as np

from mitsuba_taxel.geometry.mirror import Mirror
from mitsuba_taxel.geometry.surfaces.swept import prism
from mitsuba_taxel.mechanics.contact.indenter_shape import RoundBody, round_outline


class Cylinder(RoundBody, name="cylinder", rank=2):
    """An endless rod along the x axis of its frame."""

    meaning = "a rod that lies across the whole pad"
    uses = ("radius", "angle")
    across = np.diag([0.0, 1.0, 1.0])
    deepest = 1.0

    def keeps(self, mirror: Mirror) -> bool:
        axis = np.round(self.turn[:, 0], 12)
        tip, image, across = np.array([*self.indenter.at, 0.0]), mirror.image(axis), np.array([-axis[1], axis[0], 0.0])
        rotates = not np.array_equal(image, axis) and not np.array_equal(image, -axis)
        return bool(not rotates and across @ mirror.image(tip) == across @ tip)

    def own_distance_to_steepest_pressure(self, points: np.ndarray, depth: float) -> np.ndarray:
        return np.hypot(points[:, 1], points[:, 2])

    def own_surface(self, reach: float) -> tuple[np.ndarray, np.ndarray]:
        outline = round_outline(self.indenter.radius, reach)
        closed = 2 * self.indenter.radius <= reach
        section = np.concatenate([outline[:0:-1] * [-1, 1], outline[: -1 if closed else None]])
        return prism(section, reach)
