"""The flat end of a round rod."""

from __future__ import annotations

import math

import numpy as np

from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.geometry.mirror import Mirror
from mitsuba_taxel.geometry.surfaces.swept import revolved
from mitsuba_taxel.mechanics.contact.indenter_shape import ALONG, TINY, Gap, IndenterShape

EDGE = 0.1
"""Default radius of the edge, relative to that of the punch."""
EDGE_FINENESS = 0.25
"""Length over which the high pressure at the edge changes, relative to the radius of the punch."""


class Punch(IndenterShape, name="punch", rank=1):
    """A rod with a flat end and a rounded edge: a thinner rod with a sharp edge, offset outwards by the radius of the
    edge."""

    meaning = "the flat end of a round rod, with a rounded edge"
    uses = ("radius", "angle", "tilt", "edge_radius")
    unbounded = False
    contact_grows = False
    finer_when_shallow = False

    def check(self) -> None:
        edge, radius = self.indenter.edge_radius, self.indenter.radius
        if edge is not None and edge > radius:
            raise InputError(
                f"indenter_edge_radius = {edge:g} is not allowed: at most indenter_radius = {radius:g} is needed."
            )

    @property
    def edge(self) -> float:
        """Radius of the rounded edge of the punch, in mm."""
        return EDGE * self.indenter.radius if self.indenter.edge_radius is None else self.indenter.edge_radius

    def own_gap(self, points: np.ndarray) -> Gap:
        edge = self.edge
        across = np.maximum(np.hypot(points[:, 0], points[:, 1]), TINY)
        outwards = points * [1.0, 1.0, 0.0] / across[:, None]
        azimuthal = outwards @ [[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 0.0]]
        beyond, below = across - (self.indenter.radius - edge), edge - points[:, 2]
        sideways, downwards = np.maximum(beyond, 0.0), np.maximum(below, 0.0)
        distance = np.hypot(sideways, downwards)
        inside = distance == 0  # the core, where the nearer of end and side counts
        distance = np.where(inside, np.maximum(beyond, below), distance)
        sideways = np.where(inside, beyond > below, sideways / np.where(inside, 1.0, distance))
        downwards = np.where(inside, beyond <= below, downwards / np.where(inside, 1.0, distance))
        down = np.array([0.0, 0.0, -1.0])
        normal = sideways[:, None] * outwards + downwards[:, None] * down
        meridional = downwards[:, None] * outwards - sideways[:, None] * down
        rounded = (sideways > 0) & (downwards > 0)
        curvatures = np.where(rounded, 1 / np.where(rounded, distance, 1.0), 0.0), sideways / across
        curvature = sum(
            principal[:, None, None] * tangent[:, :, None] * tangent[:, None, :]
            for principal, tangent in zip(curvatures, (meridional, azimuthal), strict=True)
        )
        return Gap(distance - edge, normal, curvature)

    def keeps(self, mirror: Mirror) -> bool:
        return self._keeps_axis(mirror) and self._keeps_tip(mirror)

    def contact_radius(self, depth: float) -> float:
        return float(self.indenter.radius)

    def pressure_length(self, depth: float) -> float:
        return EDGE_FINENESS * self.contact_radius(depth)

    def own_distance_to_steepest_pressure(self, points: np.ndarray, depth: float) -> np.ndarray:
        """Distances from the edge of the flat end, where the gradient of the contact pressure is largest."""
        return np.hypot(np.hypot(points[:, 0], points[:, 1]) - self.indenter.radius, points[:, 2])

    @property
    def thickness(self) -> float:
        return math.inf

    @property
    def size_text(self) -> str:
        return f"indenter_radius = {self.indenter.radius:g}"

    @property
    def lift(self) -> float:
        tilt = math.radians(abs(self.indenter.tilt))
        return (self.indenter.radius - self.edge) * math.sin(tilt) + self.edge * (1 - math.cos(tilt))

    def own_surface(self, reach: float) -> tuple[np.ndarray, np.ndarray]:
        radius, edge = self.indenter.radius, min(self.edge, reach)
        angles = np.linspace(0, math.pi / 2, ALONG)
        rounded = np.stack([radius - edge + edge * np.sin(angles), edge - edge * np.cos(angles)], axis=1)
        return revolved(np.minimum([[0, 0], *rounded, [radius, reach], [0, reach]], [reach, max(reach / 2, edge)]))
