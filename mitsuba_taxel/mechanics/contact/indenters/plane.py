"""A plate."""

from __future__ import annotations

import math

import numpy as np

from mitsuba_taxel.geometry.mirror import Mirror
from mitsuba_taxel.geometry.surfaces.swept import prism
from mitsuba_taxel.mechanics.contact.indenter_shape import Gap, IndenterShape

THICKNESS = 0.1
"""Thickness in drawings, relative to the reach of the drawing."""


class Plane(IndenterShape, name="plane", rank=3):
    """A plate that covers the pad; it starts at the height at which it touches the pad."""

    meaning = "a plate that covers the pad"
    uses = ("angle", "tilt")
    unbounded = True
    contact_grows = False
    finer_when_shallow = False

    def own_gap(self, points: np.ndarray) -> Gap:
        down = np.broadcast_to([0.0, 0.0, -1.0], points.shape)
        return Gap(-points[:, 2], down, np.zeros((len(points), 3, 3)))

    def keeps(self, mirror: Mirror) -> bool:
        return self._keeps_axis(mirror)

    def highest(self, points: np.ndarray) -> int:
        return int((points @ self.up).argmax())

    def start(self, highest: np.ndarray) -> np.ndarray:
        return np.array([0.0, 0.0, highest @ self.up / self.up[2]])

    def contact_radius(self, depth: float) -> float:
        return math.inf

    def own_distance_to_steepest_pressure(self, points: np.ndarray, depth: float) -> np.ndarray:
        return np.linalg.norm(points, axis=1)

    @property
    def thickness(self) -> float:
        return math.inf

    @property
    def size_text(self) -> str:
        return "indenter = plane"

    def own_surface(self, reach: float) -> tuple[np.ndarray, np.ndarray]:
        return prism(np.array([[-1, 0], [1, 0], [1, THICKNESS], [-1, THICKNESS]]) * reach, reach)
