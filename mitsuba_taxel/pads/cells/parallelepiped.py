"""Cuboid cells."""

from __future__ import annotations

from typing import Any

import numpy as np

from mitsuba_taxel.pads.cells.box_fillet import BoxFillet, box_fillet
from mitsuba_taxel.pads.cells.cell_shape import ON_FLAT_WALLS, Difference
from mitsuba_taxel.pads.cells.shaft import Shaft
from mitsuba_taxel.pads.cells.silicone_shifts import shifts_between_planes, wall_planes


class Parallelepiped(Shaft, name="parallelepiped", rank=1):
    """A cell in the shape of a cuboid with a square section."""

    is_square = True
    round_regions = ()
    face_refinement = ON_FLAT_WALLS
    least_elements = 150

    def across(self, points: np.ndarray) -> np.ndarray:
        return np.abs(points[..., :2]).max(axis=-1)

    def onto_wall(
        self, region: str, points: np.ndarray, axis: np.ndarray, beside: np.ndarray | None
    ) -> tuple[np.ndarray, np.ndarray]:
        raise AssertionError("no wall is curved")

    def filleted(self, radius: float) -> BoxFillet:
        return box_fillet(self.radius, self.side_height, radius)

    def shaft(self, x: float, y: float, below: float) -> Any:
        from netgen.occ import Box, Pnt

        radius = self.radius
        return Box(Pnt(x - radius, y - radius, below), Pnt(x + radius, y + radius, self.side_height))

    def shifts(self, target: Any, points: np.ndarray, difference: Difference) -> np.ndarray:
        planes = wall_planes(self.pad, self.top), wall_planes(target.pad, target.top)
        return shifts_between_planes(points, *planes)
