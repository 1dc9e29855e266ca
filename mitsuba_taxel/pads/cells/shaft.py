"""Cells with a vertical side: the common base of cells with a flat roof and cells with a cap."""

from __future__ import annotations

import math
from abc import abstractmethod
from typing import Any, ClassVar

import numpy as np

from mitsuba_taxel.pads.cells.cell_shape import FLAT_ROOF, ON_ROUND_WALLS, CellShape, Difference, LightSizes
from mitsuba_taxel.pads.cells.meridian import SAMPLES, Meridian, as_text, of_quadric, roof_meridian, side_meridian
from mitsuba_taxel.pads.cells.rim_fillet import RimFillet, rim_fillet
from mitsuba_taxel.pads.cells.silicone_shifts import Rays, region_planes, shifts_along_rays


class Shaft(CellShape):
    """A cell with a vertical side and a flat roof; subclasses may have another roof."""

    default_height_words = "1.55"
    has_curved_rim = False
    has_sharp_rim = True
    has_ridges = False
    light_sizes: ClassVar[LightSizes | None] = FLAT_ROOF

    @property
    def default_height(self) -> float:
        return 1.55

    @property
    def side_height(self) -> float:
        return self.top

    @property
    def roof_radius(self) -> float:
        return math.inf

    @property
    def levels(self) -> list[float]:
        """Heights in mm at which displacements of the silicone beside the cells are known; between them they are
        interpolated linearly.
        """
        return [0.0, self.side_height, self.pad.height]

    @abstractmethod
    def across(self, points: np.ndarray) -> np.ndarray:
        """Distance of points from the cell's axis, measured so that all points of the side wall have the same distance
        (for a square section, the larger of ``|x|`` and ``|y|``).

        Parameters
        ----------
        points : (N, M, 3) ndarray
            Points relative to the middle of the mouth, mm.

        Returns
        -------
        (N, M) ndarray
            Distances in mm; for a square section the larger of the distances along x and y.
        """

    def roof_height(self, across: np.ndarray) -> np.ndarray:
        """Height of the roof at distances from the axis.

        Parameters
        ----------
        across : (N, M) ndarray
            Distances as :meth:`across` gives them, mm.

        Returns
        -------
        (N, M) ndarray
            Heights above the board, mm.
        """
        return np.full(across.shape, self.top)

    def holds(self, points: np.ndarray, slack: float) -> np.ndarray:
        across = self.across(points)
        return (across < self.radius - slack) & (points[..., 2] < self.roof_height(across) - slack)

    @abstractmethod
    def shaft(self, x: float, y: float, below: float) -> Any:
        """Solid of the lower part of the cell, up to the height of its side.

        Parameters
        ----------
        x, y : float
            Position of the axis of the cell on the board, mm.
        below : float
            Lowest z of the solid, mm.

        Returns
        -------
        netgen.occ.TopoDS_Shape
            The solid.
        """

    def solid(self, x: float, y: float) -> Any:
        from netgen.occ import Z

        shaft = self.shaft(x, y, -self.pad.cell_size)
        shaft.faces.name = "side"
        shaft.faces.Max(Z).name = "roof"
        return shaft

    def as_profile(self, points: int) -> np.ndarray:
        return of_quadric(1.0, 1.0, points)

    @property
    def roof(self) -> Meridian:
        """The meridian of the roof, from the crown to the rim."""
        return roof_meridian(as_text(self.as_profile(4)), self.radius, self.cell_height)

    def outline(self) -> np.ndarray:
        return np.concatenate([self.roof.at(np.linspace(0, 1, SAMPLES))[0], [[self.radius, 0.0]]])

    def wall_tangents(self) -> np.ndarray:
        return np.array([[0.0, -1.0]])

    def bend_radii(self) -> np.ndarray:
        return np.zeros(0)

    def view_angles(self) -> np.ndarray:
        return np.zeros(0)


class RoundShaft(Shaft):
    """A cell in the shape of a cylinder with a flat roof; subclasses may have another roof."""

    is_square = False
    round_regions: tuple[str, ...] = ("side",)
    face_refinement: ClassVar[float] = ON_ROUND_WALLS
    least_elements = 400

    def across(self, points: np.ndarray) -> np.ndarray:
        return np.hypot(points[..., 0], points[..., 1])

    def onto_wall(
        self, region: str, points: np.ndarray, axis: np.ndarray, beside: np.ndarray | None
    ) -> tuple[np.ndarray, np.ndarray]:
        from mitsuba_taxel.geometry.surfaces.radial import put_radially  # a scene without a pad imports no scipy

        return put_radially(points, axis, self.radius, np.diag([1.0, 1.0, 0.0]))

    def rounded(self, points: np.ndarray, axis: np.ndarray, on: Any) -> np.ndarray:
        points, side = points.copy(), on["side"]
        points[side, :2] = at_distance(points[side, :2], axis[side, :2], self.radius)
        return points

    def filleted(self, radius: float) -> RimFillet:
        side = side_meridian(np.array([self.radius, self.side_height]), self.radius)
        return rim_fillet(self.name, self.roof, side, radius)

    def shaft(self, x: float, y: float, below: float) -> Any:
        from netgen.occ import Cylinder, Pnt, Z

        return Cylinder(Pnt(x, y, below), Z, self.radius, self.side_height - below)

    def shifts(self, target: Any, points: np.ndarray, difference: Difference) -> np.ndarray:
        growth = (target.pad.cell_size - self.pad.cell_size) / self.pad.cell_size

        def at_wall(rays: Rays) -> tuple[np.ndarray, np.ndarray]:
            wall = np.full(len(points), self.radius)
            shift = growth * (rays.at(np.minimum(rays.length, wall)) - rays.origin)
            shift[:, 2] = rays.outside[:, 2]
            return wall, shift

        planes = region_planes(self.pad, self.levels), region_planes(target.pad, target.levels)
        return shifts_along_rays(self.pad, target.pad, planes, points, points[:, 2], at_wall)


def at_distance(points: np.ndarray, centre: np.ndarray, distance: float) -> np.ndarray:
    """Points moved radially to a distance from centres.

    Parameters
    ----------
    points, centre : (N, 2 or 3) ndarray
        Positions of points and centres in mm.
    distance : float
        Distance in mm.

    Returns
    -------
    (N, 2 or 3) ndarray
        Positions in mm.
    """
    from_centre = points - centre
    return centre + distance * from_centre / np.linalg.norm(from_centre, axis=1, keepdims=True)
