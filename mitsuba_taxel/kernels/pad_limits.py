"""Limits on the subdivision of the surface of a pad."""

from __future__ import annotations

import mitsuba as mi

from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.kernels.protocols import is_region
from mitsuba_taxel.pads import REGIONS, AnyPad, Block, Pad

MOST_TRIANGLES = 20_000_000
LEAST_FACES = 15
"""Least number of finite elements on the surface of a cell."""
LEAST_OF_MIRRORS = 3
"""Least number of triangles along an element of a curved mirror. With fewer, neighbours differ by more than 20 degrees,
and the error of reflections at grazing angles, up to some percent, exceeds that estimated from chords."""



def check_triangles(subdivision: int, faces: int) -> None:
    """Raise for a subdivision of the walls of cells into too many triangles.

    Parameters
    ----------
    subdivision : int
        Triangles along the edges of elements.
    faces : int
        Faces of elements on the walls of cells.

    Raises
    ------
    InputError
        if there are more than `MOST_TRIANGLES`.
    """
    triangles = faces * subdivision**2
    if triangles > MOST_TRIANGLES:
        raise InputError(
            f"subdivision = {subdivision} is not allowed: the surface of the cells would have {triangles:.1e} "
            f"triangles, more than {MOST_TRIANGLES:.0e}; choose a smaller value, or list cells to read in read_cells."
        )


def mirrors(bsdf: mi.BSDF) -> list[int]:
    """Codes of the regions whose wall has a specular or glossy component.

    Parameters
    ----------
    bsdf : mi.BSDF
        A `region` or the wall of all regions.

    Returns
    -------
    list[int]
        Codes of `REGIONS`.
    """
    return regions_with(bsdf, mi.BSDFFlags.Delta | mi.BSDFFlags.Glossy)


def regions_with(bsdf: mi.BSDF, flags: mi.BSDFFlags) -> list[int]:
    """Codes of the regions whose wall has at least one of the given ``flags``."""
    walls = bsdf.walls if is_region(bsdf) else dict.fromkeys(REGIONS, bsdf)
    return [REGIONS[name] for name, wall in walls.items() if name in REGIONS and wall.flags() & flags]


def clear_regions(bsdfs: list[mi.BSDF]) -> list[int]:
    """Codes of the regions of a pad that are transparent: their wall is the BSDF ``null``, through which light passes
    unchanged.

    Parameters
    ----------
    bsdfs : list[mi.BSDF]
        BSDFs of a pad.

    Returns
    -------
    list[int]
        Codes of `REGIONS`.
    """
    walls = [(name, wall) for bsdf in bsdfs if is_region(bsdf) for name, wall in bsdf.walls.items()]
    return [REGIONS[name] for name, wall in walls if name in REGIONS and wall.class_name() == "Null"]


def check_mirrors(pad: AnyPad, codes: list[int], subdivision: int) -> None:
    """Raise for too few triangles on curved mirrors.

    Pads from a surface file have flat walls; all walls of a solid, and the top of a block, may be curved.

    Parameters
    ----------
    pad : AnyPad
        The pad.
    codes : list[int]
        Codes of the regions whose walls are mirrors.
    subdivision : int
        Triangles along the edges of elements.

    Raises
    ------
    InputError
        if the subdivision is too small for a curved mirror.
    """
    if isinstance(pad, Pad):
        round_walls = list(pad.curved_regions)
    elif isinstance(pad, Block):
        round_walls = ["top"]
    else:
        round_walls = list(REGIONS) if pad.is_drawn else []
    names = [name for name in round_walls if REGIONS[name] in codes]
    if names and subdivision < LEAST_OF_MIRRORS:
        raise InputError(
            f"subdivision = {subdivision} is not allowed: the {names[0]} is a mirror and may be curved, which needs "
            f"{LEAST_OF_MIRRORS} or more."
        )
