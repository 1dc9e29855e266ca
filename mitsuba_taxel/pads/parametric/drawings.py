"""A pad and its mould as solids, for CAD programs and printers."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from mitsuba_taxel.base.files.atomic import replacing
from mitsuba_taxel.pads.meshers import require_netgen
from mitsuba_taxel.pads.parametric.lean import leans
from mitsuba_taxel.pads.parametric.pad import Pad

MOULD = 3.0
"""Thickness of the mould around the pad, mm."""
CURVATURE = 4
"""Number of triangle edges of an STL file per radius of curvature of a round wall."""
SURFACES = 4
"""Number of Netgen's meshing steps that precede the volume."""


def solids(pad: Pad) -> dict[str, Any]:
    """The pad, and the mould in which it is cast: a base with the cells as pegs, and a frame around it, open at the
    top.

    The results are ``netgen.occ`` shapes in mm, by name, in their assembled positions: the pad upright, the frame on
    the base at z = 0. Raises `InputError` if Netgen is not installed."""
    require_netgen("a drawing")
    from netgen.occ import Box, Pnt

    width, depth, height = pad.extent
    x, y = width / 2, depth / 2
    block = Box(Pnt(-x, -y, 0), Pnt(x, y, height)) if pad.outside is None else pad.outside.solid()
    below = Box(Pnt(-x - MOULD, -y - MOULD, -MOULD - pad.cell_size), Pnt(x + MOULD, y + MOULD, 0))
    silicone, base = block, Box(Pnt(-x - MOULD, -y - MOULD, -MOULD), Pnt(x + MOULD, y + MOULD, 0))
    for centre in pad.cell_centres:
        upright = pad.shape.solid(*centre) if pad.edges is None else pad.edges.solid(*centre, -pad.cell_size)
        if pad.mouth is not None:
            upright = upright + pad.mouth.solid(*centre, -pad.cell_size)
        cell = _leaning(upright, pad)
        silicone, base = silicone - cell, base + (cell - below)
    frame = Box(Pnt(-x - MOULD, -y - MOULD, 0), Pnt(x + MOULD, y + MOULD, height)) - block
    return {"pad": silicone, "mould_base": base, "mould_frame": frame}


def _leaning(cell: Any, pad: Pad) -> Any:
    from netgen.occ import gp_GTrsf

    x, y = pad.slope
    return gp_GTrsf([1, 0, x, 0, 1, y, 0, 0, 1])(cell) if leans(pad) else cell


def write_drawings(pad: Pad, folder: Path) -> None:
    """Write the solids of a pad as STEP and STL files, under their names.

    Parameters
    ----------
    pad : Pad
        The pad, with lengths in mm.
    folder : Path
        Existing folder.

    Raises
    ------
    WriteError
        if a file cannot be written.
    """
    import trimesh

    drawn = solids(pad)
    from netgen.occ import OCCGeometry

    for name, solid in drawn.items():
        with replacing(folder / f"{name}.step") as file:
            solid.WriteStep(str(file))
        mesh = OCCGeometry(solid).GenerateMesh(maxh=pad.cell_size, curvaturesafety=CURVATURE, perfstepsend=SURFACES)
        corners = mesh.Elements2D().NumPy()["nodes"][:, :3] - 1
        with replacing(folder / f"{name}.stl") as file:
            trimesh.Trimesh(mesh.Coordinates(), corners, process=False).export(file, file_type="stl")
