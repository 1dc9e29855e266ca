"""Cells whose roof and side are given by meridians, with a round or a square section."""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Mapping
from functools import partial
from itertools import pairwise
from typing import Any

import numpy as np

from mitsuba_taxel.base.caches import kept
from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.pads.cells.cell_shape import CellShape, Difference
from mitsuba_taxel.pads.cells.fillet import Fillet
from mitsuba_taxel.pads.cells.meridian import (
    PLACES,
    SAMPLES,
    SMOOTH_RIM,
    Meridian,
    from_axis,
    least_radii,
    onto_meridian,
    rim_angle,
    side_meridian,
)
from mitsuba_taxel.pads.cells.mouth import Mouth
from mitsuba_taxel.pads.cells.rim_fillet import rim_fillet
from mitsuba_taxel.pads.cells.silicone_shifts import Rays, region_planes, shifts_along_rays

SPLINE_POINTS = 49
"""Number of points through which the roof of a solid is interpolated."""
BELOW = 1.5
"""Parameter u to which the side of a solid is extended below the board, where u = 1."""


class MeridianCell(CellShape):
    """A cell with a straight side and a flat or smooth roof, all of which is visible from the middle of the mouth.

    A subclass gives its `roof`, and whether its section is square. The walls on the four sides of a square section are
    cylinders that follow the meridian and meet at edges."""

    round_regions: tuple[str, ...] = ("roof", "side")
    roof_radius: float | None = None

    @property
    @abstractmethod
    def roof(self) -> Meridian:
        """The outline (r, z) of the roof, from its highest point (crown), where r = 0, to the rim."""

    @property
    def side(self) -> Meridian:
        """The outline (r, z) of the side wall, from the rim to the board."""
        return side_meridian(self.rim, self.radius)

    @property
    def rim(self) -> np.ndarray:
        """Coordinates (2,) r and z of the rim, mm."""
        return self.roof.at(np.ones(1))[0][0]

    @property
    def side_height(self) -> float:
        return float(self.rim[1])

    @property
    def has_sharp_rim(self) -> bool:
        return rim_angle(self.side, self.roof) > SMOOTH_RIM

    @property
    def has_ridges(self) -> bool:
        return self.is_square and float(np.ptp(self.outline()[:-1, 1])) > 0

    def curve(self, region: str) -> Meridian:
        """The outline (r, z) of the ``roof`` or the ``side``.

        Parameters
        ----------
        region : str
            ``roof`` or ``side``.

        Returns
        -------
        Meridian
            Curve in mm, relative to the middle of the mouth.
        """
        return self.roof if region == "roof" else self.side

    def onto_wall(
        self, region: str, points: np.ndarray, axis: np.ndarray, beside: np.ndarray | None
    ) -> tuple[np.ndarray, np.ndarray]:
        relative_beside = None if beside is None else beside - axis
        projected, gradient = onto_meridian(self.curve(region), points - axis, self.is_square, relative_beside)
        return axis + projected, gradient

    def rounded(self, points: np.ndarray, axis: np.ndarray, on: Mapping[str, np.ndarray]) -> np.ndarray:
        points = points.copy()
        for name in ("roof", "side"):  # flat ones as well
            points[on[name]] = self.onto_wall(name, points[on[name]], axis[on[name]], None)[0]
        rim, bottom = on["roof"] & on["side"], on["side"] & on["bottom"]
        for selected, (r, z) in ((rim, self.rim), (bottom, (self.radius, 0.0))):
            across = points[selected, :2] - axis[selected, :2]
            points[selected, :2] = axis[selected, :2] + r * across / from_axis(self.is_square, across)[0][:, None]
            points[selected, 2] = z
        return points

    def filleted(self, radius: float) -> Fillet:
        if self.is_square:
            return super().filleted(radius)
        return rim_fillet(self.name, self.roof, self.side, radius)

    def mouth(self, radius: float, beside: float) -> Mouth:
        if self.is_square:
            raise InputError(
                f"mouth_fillet = {radius:g} is not allowed: the mouths of {self.name} cells with a square section "
                "cannot be rounded, 0 is needed."
            )
        return super().mouth(radius, beside)

    def holds(self, points: np.ndarray, slack: float) -> np.ndarray:
        across = np.hypot(points[..., 0], points[..., 1])
        if self.is_square:
            across = np.abs(points[..., :2]).max(axis=-1)
        angle = np.arctan2(across, points[..., 2])
        # Seen from the middle of the mouth, each direction meets one chord of the outline, at one distance.
        outline = self.outline()
        chord = np.clip(np.searchsorted(np.arctan2(*outline.T), angle) - 1, 0, len(outline) - 2)
        (r, z), (along_r, along_z) = outline[chord].T, np.diff(outline, axis=0)[chord].T
        wall = (r * along_z - z * along_r).T / (np.sin(angle) * along_z.T - np.cos(angle) * along_r.T)
        return np.hypot(across, points[..., 2]) < wall - slack

    def solid(self, x: float, y: float) -> Any:
        from netgen.occ import Vec

        return _upright(self).Move(Vec(x, y, 0))

    def shifts(self, target: Any, points: np.ndarray, difference: Difference) -> np.ndarray:
        def at_wall(rays: Rays) -> tuple[np.ndarray, np.ndarray]:
            ray = rays.direction
            across = from_axis(self.is_square, ray)[0]
            wall, shift = np.empty(len(ray)), np.empty_like(ray)
            rim = math.atan2(self.rim[1], self.rim[0])
            up = np.arctan2(ray[:, 2], across)
            for region, selected in (("roof", up > rim), ("side", up <= rim)):
                u = self.curve(region).along(np.column_stack([across, ray[:, 2]])[selected])
                radial = ray[selected, :2] / across[selected, None]
                r, z = self.curve(region).at(u)[0].T
                wall[selected] = np.hypot(r * np.linalg.norm(radial, axis=1), z)
                along = difference(partial(_wall_position, region, u))
                shift[selected] = np.column_stack([along[:, :1] * radial, along[:, 1]])
            return wall, shift

        planes = region_planes(self.pad, [0.0, self.pad.height]), region_planes(target.pad, [0.0, target.pad.height])
        return shifts_along_rays(self.pad, target.pad, planes, points, np.zeros(len(points)), at_wall)

    def outline(self) -> np.ndarray:
        return np.concatenate([self.roof.at(np.linspace(0, 1, SAMPLES))[0], [[self.radius, 0.0]]])

    def wall_tangents(self) -> np.ndarray:
        return np.concatenate([self.side.at(np.zeros(1))[1], self.roof.at(np.linspace(0, 1, PLACES))[1]])

    def bend_radii(self) -> np.ndarray:
        if "roof" not in self.round_regions:
            return np.zeros(0)
        return least_radii(self.roof, math.hypot(*self.pad.slope), self.pad.cell_size)

    def view_angles(self) -> np.ndarray:
        position, tangent, _ = self.roof.at(np.linspace(0, 1, PLACES)[1:])
        cross = tangent[:, 0] * position[:, 1] - tangent[:, 1] * position[:, 0]
        return np.degrees(np.arctan2(cross, np.abs((tangent * position).sum(axis=1))))


def _wall_position(region: str, u: np.ndarray, shape: MeridianCell) -> np.ndarray:
    return shape.curve(region).at(u)[0]


@kept(1)  # all cells of a pad are alike
def _upright(shape: MeridianCell) -> Any:
    """A cell around the z axis as a solid. A curved roof is interpolated, with an error of about 1e-7 of its size."""
    from netgen.occ import Axis, Face, Pnt, Segment, SplineInterpolation, Wire, Z

    def at(r: float, z: float) -> Any:
        return Pnt(r, 0, z)

    roof = shape.roof.at(np.linspace(0.0, 1.0, SPLINE_POINTS))[0]
    roof[0, 0] = 0.0
    crown, rim, below = (0.0, roof[0, 1]), roof[-1], shape.side.at(np.array([BELOW]))[0][0]
    corners = [at(*rim), at(*below), at(0.0, below[1]), at(*crown)]
    sides = [Segment(start, end) for start, end in pairwise(corners)]
    top = Segment(at(*crown), at(*rim))
    if "roof" in shape.round_regions:
        top = SplineInterpolation([at(*point) for point in roof.tolist()])
    half, axis = Face(Wire([top, *sides])), Axis(Pnt(0, 0, 0), Z)
    solid = _of_quarters(half, axis, float(below[0])) if shape.is_square else half.Revolve(axis, 360)
    for face in solid.faces:
        face.name = "roof" if face.bounding_box[0].z > 0 else "side"
    return solid


def _of_quarters(half: Any, axis: Any, widest: float) -> Any:
    """The solid with square horizontal sections, whose four walls have the outline ``half``, a plane face on one side
    of the axis."""
    from netgen.occ import Face, Pnt, Segment, Vec, Wire

    low, high = (corner.z for corner in half.bounding_box)
    reach = 2 * widest
    corners = [Pnt(0, 0, low - reach), Pnt(reach, -reach, low - reach), Pnt(reach, reach, low - reach)]
    wedge = Face(Wire([Segment(*ends) for ends in pairwise([*corners, corners[0]])])).Extrude(
        Vec(0, 0, high - low + 2 * reach)
    )
    quarter = half.Move(Vec(0, -reach, 0)).Extrude(Vec(0, 2 * reach, 0)) * wedge
    solid = quarter
    for angle in (90, 180, 270):
        solid = solid + quarter.Rotate(axis, angle)
    return solid
