"""The quadrant x, y >= 0 of a pad as an OpenCascade solid with named faces."""

from __future__ import annotations

from typing import Any

from mitsuba_taxel.pads.pad import Pad

SYMMETRY = "symmetry"
"""Name of the faces along which the quadrant was cut from the pad."""


def quadrant_solid(pad: Pad) -> Any:
    """The part of a pad in x >= 0, y >= 0 as a ``netgen.occ`` shape; its faces bear the names of their regions."""
    from netgen.occ import Box, Pnt

    width, depth, height = pad.extent
    solid = Box(Pnt(0, 0, 0), Pnt(0.5 * width, 0.5 * depth, height))
    for face in solid.faces:
        face.name = _name_of_box_face(face.center, pad)
    for x, y in pad.cell_centres:
        if min(x, y) > -0.5 * pad.cell_size:
            solid = solid - _cell_solid(pad, x, y)
    return solid


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
