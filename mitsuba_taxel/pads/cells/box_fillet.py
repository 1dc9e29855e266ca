"""Rounded edges of cuboid cells."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from mitsuba_taxel.pads.cells.fillet import ARC_POINTS, LEAST, MOST, Fillet, refused


@dataclass(frozen=True)
class BoxFillet(Fillet):
    """The rounded edges of a cuboid cell: those around the roof, and the upright ones.

    The rounded cell consists of all points within ``radius`` of a smaller cuboid (the Minkowski sum of this cuboid and
    a ball).

    Attributes
    ----------
    half, height : float
        Half the width of the cell, and its height, mm.
    radius : float
        Radius of the ball, mm.
    """

    half: float
    height: float
    radius: float

    def onto_wall(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        nearest, away = self._from_core(points)
        length = np.sqrt(away[:, 0] ** 2 + away[:, 1] ** 2 + away[:, 2] ** 2)[:, None]
        normal = away / length
        # The core's nearest point follows the point along axes within its limits; the normal turns with the others.
        within = (away == 0)[:, :, None] * np.eye(3)
        across = np.eye(3) - normal[:, :, None] * normal[:, None, :]
        gradient = within + (self.radius / length)[:, :, None] * across @ (np.eye(3) - within)
        return nearest + self.radius * normal, gradient

    def holds(self, points: np.ndarray, slack: float) -> np.ndarray:
        return np.linalg.norm(self._from_core(points)[1], axis=-1) < self.radius - slack

    def outline(self) -> np.ndarray:
        centre = np.array([self.half - self.radius, self.height - self.radius])
        angles = np.linspace(0.5 * np.pi, 0.0, ARC_POINTS)
        arc = centre + self.radius * np.column_stack([np.cos(angles), np.sin(angles)])
        return np.concatenate([[[0.0, self.height]], arc, [[self.half, 0.0]]])

    def solid(self, x: float, y: float, below: float) -> Any:
        from netgen.occ import Box, Pnt, Z

        box = Box(Pnt(x - self.half, y - self.half, below), Pnt(x + self.half, y + self.half, self.height))
        middle = 0.5 * (below + self.height)
        box = box.MakeFillet([edge for edge in box.edges if edge.bounding_box[1].z > middle], self.radius)
        for face in box.faces:
            low, high = face.bounding_box
            is_plane = min(high.x - low.x, high.y - low.y, high.z - low.z) < 0.01 * self.radius
            face.name = "side" if is_plane else "fillet"
        box.faces.Max(Z).name = "roof"
        return box

    def _from_core(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Nearest points of the smaller cuboid, and vectors from these to the points."""
        across, top = self.half - self.radius, self.height - self.radius
        nearest = np.clip(points, [-across, -across, -np.inf], [across, across, top])
        return nearest, points - nearest


def box_fillet(half: float, height: float, radius: float) -> BoxFillet:
    """The rounded edges (fillets) of a cuboid cell.

    Parameters
    ----------
    half, height : float
        Half the width of the cell, and its height, mm.
    radius : float
        Radius of the fillets, mm.

    Returns
    -------
    BoxFillet
        Fillets, with lengths in mm.

    Raises
    ------
    InputError
        if the fillets are too small or do not fit.
    """
    largest = MOST * min(half, height)
    if not LEAST * 2 * half <= radius <= largest:
        raise refused(radius, 2 * half, largest)
    return BoxFillet(half, height, radius)
