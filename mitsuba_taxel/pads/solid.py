"""The part of a pad that its mirror images complete, as an OpenCascade solid with named faces."""

from __future__ import annotations

from typing import Any

from mitsuba_taxel.pads.pad import Pad

SYMMETRY = "symmetry"
"""Name of the faces along which the part was cut from the pad."""


def is_square(pad: Pad) -> bool:
    """Whether the pad is the same along x and y."""
    return pad.rows == pad.columns


def symmetric_part(pad: Pad) -> Any:
    """The part of a pad in 0 <= y <= x if it is square, else in x, y >= 0, as a ``netgen.occ`` shape.

    Its faces bear the names of their regions.
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
            solid = solid - _cell_solid(pad, x, y)
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


def _cell_solid(pad: Pad, x: float, y: float) -> Any:
    """One cell; it reaches below the board, so that cutting it leaves a clean rim."""
    from netgen.occ import Box, Cylinder, Pnt, Sphere, Z

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
