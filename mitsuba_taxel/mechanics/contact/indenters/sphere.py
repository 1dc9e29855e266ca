"""A ball."""

from __future__ import annotations

import math

import numpy as np

from mitsuba_taxel.geometry.mirror import Mirror
from mitsuba_taxel.geometry.swept import revolved
from mitsuba_taxel.mechanics.contact.indenter_shape import Gap, IndenterShape, round_gap, round_outline

DEEPEST = 0.25
"""Largest depth, relative to the radius, for which elements are as small as the contact needs."""


class Sphere(IndenterShape, name="sphere", rank=0):
    """A ball."""

    meaning = "a ball"
    uses = ("radius",)
    unbounded = False
    contact_grows = True
    finer_when_shallow = True

    def own_gap(self, points: np.ndarray) -> Gap:
        return round_gap(points, self.indenter.radius, np.eye(3))

    def keeps(self, mirror: Mirror) -> bool:
        return self._keeps_tip(mirror)

    def contact_radius(self, depth: float) -> float:
        """By Hertz."""
        radius = self.indenter.radius
        return math.sqrt(radius * min(depth, DEEPEST * radius))

    def own_distance_to_steepest_pressure(self, points: np.ndarray, depth: float) -> np.ndarray:
        return np.linalg.norm(points, axis=1)

    @property
    def thickness(self) -> float:
        return 2 * self.indenter.radius

    @property
    def size_text(self) -> str:
        return f"indenter_radius = {self.indenter.radius:g}"

    def own_surface(self, reach: float) -> tuple[np.ndarray, np.ndarray]:
        outline = round_outline(self.indenter.radius, reach)
        return revolved(np.append(outline, [[0, outline[-1, 1]]], axis=0))
