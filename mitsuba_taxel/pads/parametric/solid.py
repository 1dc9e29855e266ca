"""The symmetric part of a pad as an OpenCascade solid with named faces, and its singular edges."""

from __future__ import annotations

from functools import lru_cache
from itertools import pairwise
from typing import Any

import numpy as np

from mitsuba_taxel.geometry.volume_mesh import VolumeMesh
from mitsuba_taxel.pads.pad import PROFILE, REGIONS, Pad
from mitsuba_taxel.pads.profile import from_axis, onto_meridian, outline, roof_of, side_of

SPLINE_POINTS = 49
"""Points of the interpolated roof of a profile."""
BELOW = 1.5
"""How far the side of a profile goes on below the board, over its height."""
SYMMETRY = "symmetry"
"""Name of the faces along which the part was cut from the pad."""


def is_square(pad: Pad) -> bool:
    """Whether the pad has as many rows as columns."""
    return pad.rows == pad.columns


def symmetric_part(pad: Pad) -> Any:
    """The part of a pad in 0 <= y <= x if it is square, else in x, y >= 0, as a ``netgen.occ`` shape.

    Its faces have the names of their regions.
    """
    from netgen.occ import Box, Pnt

    width, depth, height = pad.extent
    solid = Box(Pnt(0, 0, 0), Pnt(0.5 * width, 0.5 * depth, height))
    for face in solid.faces:
        face.name = _name_of_box_face(face.center, pad)
    if is_square(pad):
        solid = solid - _beyond_diagonal(pad)
    for x, y in pad.cell_centres:
        if min(x, y) > -0.5 * pad.cell_size and not (is_square(pad) and y - x > pad.cell_size):
            solid = solid - cell_solid(pad, x, y)
    return solid


def _beyond_diagonal(pad: Pad) -> Any:
    """A box over y > x, larger than the pad."""
    from netgen.occ import Axis, Box, Pnt, Z

    reach = 2 * sum(pad.extent)
    box = Box(Pnt(-reach, 0, -reach), Pnt(reach, reach, reach)).Rotate(Axis(Pnt(0, 0, 0), Z), 45)
    box.faces.name = SYMMETRY
    return box


def _name_of_box_face(centre: Any, pad: Pad) -> str:
    tolerance = 1e-9 * pad.height
    if min(centre.x, centre.y) < tolerance:
        return SYMMETRY
    if centre.z < tolerance:
        return "bottom"
    return "top" if centre.z > pad.height - tolerance else "outer"


def cell_solid(pad: Pad, x: float, y: float) -> Any:
    """One cell; it reaches below the board, so that cutting it leaves a clean rim."""
    from netgen.occ import Box, Cylinder, Pnt, Sphere, Vec, Z

    if pad.cell == PROFILE:
        return _of_profile(pad).Move(Vec(x, y, 0))
    below, radius = -pad.cell_size, 0.5 * pad.cell_size
    if pad.cell == "parallelepiped":
        shaft = Box(Pnt(x - radius, y - radius, below), Pnt(x + radius, y + radius, pad.side_height))
    else:
        shaft = Cylinder(Pnt(x, y, below), Z, radius, pad.side_height - below)
    shaft.faces.name = "side"
    shaft.faces.Max(Z).name = "roof"
    if not pad.dome_radius:
        return shaft
    ball = Sphere(Pnt(x, y, pad.top_of_cell - pad.dome_radius), pad.dome_radius)
    ball.faces.name = "roof"
    reach = 2 * pad.dome_radius
    above = Box(Pnt(x - reach, y - reach, pad.side_height), Pnt(x + reach, y + reach, pad.side_height + reach))
    return shaft + ball * above


@lru_cache(maxsize=1)  # all cells of a pad are alike
def _of_profile(pad: Pad) -> Any:
    """A cell with a profile about the axis z; its roof is interpolated, to some 1e-7 of its size."""
    from netgen.occ import Axis, Face, Pnt, Segment, SplineInterpolation, Wire, Z

    def at(r: float, z: float) -> Any:
        return Pnt(r, 0, z)

    roof = roof_of(pad).at(np.linspace(0.0, 1.0, SPLINE_POINTS))[0]
    roof[0, 0] = 0.0
    crown, rim, below = (0.0, roof[0, 1]), roof[-1], side_of(pad).at(np.array([BELOW]))[0][0]
    corners = [at(*rim), at(*below), at(0.0, below[1]), at(*crown)]
    sides = [Segment(start, end) for start, end in pairwise(corners)]
    half, axis = (
        Face(Wire([SplineInterpolation([at(*place) for place in roof.tolist()]), *sides])),
        Axis(Pnt(0, 0, 0), Z),
    )
    solid = _of_quarters(half, axis, float(below[0])) if pad.is_square else half.Revolve(axis, 360)
    for face in solid.faces:
        face.name = "roof" if face.bounding_box[0].z > 0 else "side"
    return solid


def _of_quarters(half: Any, axis: Any, widest: float) -> Any:
    """The solid of a square section whose walls have the outline of a planar face on one side of the axis."""
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


def singular_edges(solid: Any, pad: Pad) -> list[Any]:
    """The edges of the symmetric part, at any scale, where the stress is singular: glued to the board, or re-entrant.

    Edges due to the cut along a plane of symmetry do not count, nor do smooth rims, as round a hemisphere.
    """
    cut, side, roof = (
        {edge for face in solid.faces if face.name == name for edge in face.edges}
        for name in (SYMMETRY, "side", "roof")
    )
    height = solid.bounding_box[1].z
    glued = {edge for edge in solid.edges if edge.bounding_box[1].z < 1e-6 * height}
    singular = glued | (side & roof if pad.has_sharp_rim else set())
    if pad.is_square:
        singular |= side | (roof - side if _has_ridges(pad) else set())
    return [edge for edge in solid.edges if edge in singular and edge not in cut]


def _has_ridges(pad: Pad) -> bool:
    """Whether walls of a roof meet at edges."""
    return pad.cell == PROFILE and pad.is_square and float(np.ptp(outline(pad)[:-1, 1])) > 0


def singular_nodes(mesh: VolumeMesh, pad: Pad) -> np.ndarray:
    """(N,) which nodes of the symmetric part's mesh lie on the edges of :func:`singular_edges`."""
    roof, side, bottom, outer = (_on_region(mesh, name) for name in ("roof", "side", "bottom", "outer"))
    singular = bottom & (side | outer)
    if pad.has_sharp_rim:
        singular |= roof & side
    if pad.is_square:
        x, y = np.abs(mesh.points[:, :2] - _nearest_axis(mesh.points, pad)).T
        singular |= (side | roof & _has_ridges(pad)) & (np.abs(x - y) < 1e-7 * pad.cell_size)
    return singular


def rounded(mesh: VolumeMesh, pad: Pad) -> np.ndarray:
    """(N, 3) the mesh's nodes, those on round walls and roofs moved exactly onto them."""
    points, axis = mesh.points.copy(), _nearest_axis(mesh.points, pad)
    if pad.cell == PROFILE:
        return _on_profile(mesh, pad, np.column_stack([axis, np.zeros(len(axis))]))
    if pad.dome_radius:
        roof = _on_region(mesh, "roof")
        centre = np.column_stack([axis, np.full(len(axis), pad.top_of_cell - pad.dome_radius)])
        points[roof] = _at_distance(points[roof], centre[roof], pad.dome_radius)
    if pad.cell != "parallelepiped":
        side = _on_region(mesh, "side")
        points[side, :2] = _at_distance(points[side, :2], axis[side], 0.5 * pad.cell_size)
    return points


def _on_profile(mesh: VolumeMesh, pad: Pad, axis: np.ndarray) -> np.ndarray:
    points, walls = mesh.points.copy(), [_on_region(mesh, name) for name in ("roof", "side")]
    for curve, on in zip((roof_of(pad), side_of(pad)), walls, strict=True):
        points[on] = axis[on] + onto_meridian(curve, points[on] - axis[on], pad.is_square)[0]
    rim, bottom = walls[0] & walls[1], walls[1] & _on_region(mesh, "bottom")
    for on, place in ((rim, side_of(pad).at(np.zeros(1))[0][0]), (bottom, (0.5 * pad.cell_size, 0.0))):
        across = points[on, :2] - axis[on, :2]
        points[on, :2] = axis[on, :2] + place[0] * across / from_axis(pad.is_square, across)[0][:, None]
        points[on, 2] = place[1]
    return points


def _at_distance(points: np.ndarray, centre: np.ndarray, distance: float) -> np.ndarray:
    from_centre = points - centre
    return centre + distance * from_centre / np.linalg.norm(from_centre, axis=1, keepdims=True)


def _nearest_axis(points: np.ndarray, pad: Pad) -> np.ndarray:
    """(N, 2) x and y of the axis of the cell nearest to each of points (N, 3)."""
    centres = np.array(pad.cell_centres)
    return centres[np.linalg.norm(points[:, None, :2] - centres, axis=2).argmin(axis=1)]


def _on_region(mesh: VolumeMesh, region: str) -> np.ndarray:
    """(N,) which nodes lie on a region of the surface."""
    on = np.zeros(len(mesh.points), dtype=bool)
    on[mesh.faces[mesh.face_region == REGIONS[region]]] = True
    return on
