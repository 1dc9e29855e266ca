"""Cylindrical cells with a spherical cap."""

from __future__ import annotations

import math
from abc import abstractmethod
from typing import Any

import numpy as np

from mitsuba_taxel.pads.cells.cell_shape import Difference
from mitsuba_taxel.pads.cells.meridian import least_radii, of_quadric
from mitsuba_taxel.pads.cells.shaft import RoundShaft, at_distance
from mitsuba_taxel.pads.cells.silicone_shifts import Rays, region_planes, shifts_along_rays


class Cap(RoundShaft):
    """A cell in the shape of a cylinder with a spherical cap above its rim."""

    round_regions = ("roof", "side")

    @property
    @abstractmethod
    def roof_radius(self) -> float: ...

    @property
    def side_height(self) -> float:
        return self.top - (self.roof_radius - math.sqrt(self.roof_radius**2 - self.radius**2))

    @property
    def centre(self) -> float:
        """Height in mm of the centre of the cap's sphere above the board. It is negative for a flat cap."""
        return self.top - self.roof_radius

    def roof_height(self, across: np.ndarray) -> np.ndarray:
        return self.top + (np.sqrt(np.maximum(self.roof_radius**2 - across**2, 0)) - self.roof_radius)

    def onto_wall(
        self, region: str, points: np.ndarray, axis: np.ndarray, beside: np.ndarray | None
    ) -> tuple[np.ndarray, np.ndarray]:
        from mitsuba_taxel.geometry.surfaces.radial import put_radially

        if region == "side":
            return super().onto_wall(region, points, axis, beside)
        return put_radially(points, axis + [0.0, 0.0, self.centre], self.roof_radius, np.eye(3))

    def rounded(self, points: np.ndarray, axis: np.ndarray, on: Any) -> np.ndarray:
        points, roof = points.copy(), on["roof"]
        points[roof] = at_distance(points[roof], axis[roof] + [0.0, 0.0, self.centre], self.roof_radius)
        return super().rounded(points, axis, on)

    def solid(self, x: float, y: float) -> Any:
        from netgen.occ import Box, Pnt, Sphere

        ball = Sphere(Pnt(x, y, self.centre), self.roof_radius)
        ball.faces.name = "roof"
        reach = 2 * self.roof_radius
        above = Box(Pnt(x - reach, y - reach, self.side_height), Pnt(x + reach, y + reach, self.side_height + reach))
        return super().solid(x, y) + ball * above

    def shifts(self, target: Any, points: np.ndarray, difference: Difference) -> np.ndarray:
        # Rays start at the height of points beside the cylinder, and in the middle of the rim for points above it.
        above = points[:, 2] > self.side_height
        growth = (target.pad.cell_size - self.pad.cell_size) / self.pad.cell_size

        def at_wall(rays: Rays) -> tuple[np.ndarray, np.ndarray]:
            drop = (self.side_height - self.centre) * above * rays.direction[:, 2]
            wall = np.sqrt(drop**2 + self.radius**2) - drop  # of the sphere through the rim
            position = rays.at(np.minimum(rays.length, wall))
            shift = growth * (position - rays.origin)
            rise = target.centre - self.centre + growth * (position[:, 2] - self.centre)
            shift[:, 2] = np.where(above, rise, rays.outside[:, 2])
            return wall, shift

        planes = region_planes(self.pad, self.levels), region_planes(target.pad, target.levels)
        base = np.where(above, self.side_height, points[:, 2])
        return shifts_along_rays(self.pad, target.pad, planes, points, base, at_wall)

    def as_profile(self, points: int) -> np.ndarray:
        cap = self.top - self.side_height
        return of_quadric(self.side_height / self.top, 2 * self.roof_radius * cap / self.radius**2, points)

    def bend_radii(self) -> np.ndarray:
        """Radius of the cap's sphere in mm; for a leaning cap, which is an ellipsoid, the smallest radius of curvature.
        """
        slope = math.hypot(*self.pad.slope)
        if not slope:
            return np.array([self.roof_radius])
        return least_radii(self.roof, slope, self.pad.cell_size).min(keepdims=True)
