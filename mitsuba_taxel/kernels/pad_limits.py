"""Limits of the subdivision of a pad's surface."""

from __future__ import annotations

import mitsuba as mi

from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.kernels.protocols import is_region
from mitsuba_taxel.pads import REGIONS, Pad, PadFile

MOST_TRIANGLES = 20_000_000
LEAST_FACES = 15
"""Least number of finite elements on the surface of a cell."""
LEAST_OF_MIRRORS = 3
"""Least number of triangles along an element of a round mirror wall. With fewer they turn by more than 20 degrees, and
their reflection at grazing angles errs by more than chords indicate: by up to some percent."""


def check_triangles(subdivision: int, faces: int) -> None:
    """Refuse a subdivision of the faces of cells into too many triangles.

    Parameters
    ----------
    subdivision : int
        Of the edges of elements.
    faces : int
        Faces of elements on the cells' walls.

    Raises
    ------
    InputError
        if there would be more than `MOST_TRIANGLES`.
    """
    triangles = faces * subdivision**2
    if triangles > MOST_TRIANGLES:
        raise InputError(
            f"subdivision = {subdivision} is not allowed: the surface of the cells would have {triangles:.1e} "
            f"triangles, more than {MOST_TRIANGLES:.0e}; choose less, or name the cells that are read."
        )


def mirrors(bsdf: mi.BSDF) -> list[int]:
    """Codes of the regions whose wall is partly specular or glossy.

    Parameters
    ----------
    bsdf : mi.BSDF
        A `region` or the wall of all regions.

    Returns
    -------
    list[int]
        As in `REGIONS`.
    """
    return regions_with(bsdf, mi.BSDFFlags.Delta | mi.BSDFFlags.Glossy)


def regions_with(bsdf: mi.BSDF, flags: mi.BSDFFlags) -> list[int]:
    """Codes of the regions whose wall has one of these flags."""
    walls = bsdf.walls if is_region(bsdf) else dict.fromkeys(REGIONS, bsdf)
    return [REGIONS[name] for name, wall in walls.items() if name in REGIONS and wall.flags() & flags]


def check_mirrors(pad: Pad | PadFile, codes: list[int], subdivision: int) -> None:
    """Refuse too few triangles for round walls that are mirrors.

    A surface file has flat walls; those of a solid may all be round.

    Parameters
    ----------
    pad : Pad or PadFile
        With the walls.
    codes : list[int]
        Of regions whose walls are mirrors.
    subdivision : int
        Of the edges of elements.

    Raises
    ------
    InputError
        if it is too small for a round wall.
    """
    if isinstance(pad, Pad):
        round_walls = list(pad.shape.round_regions)
    else:
        round_walls = list(REGIONS) if pad.is_drawn else []
    names = [name for name in round_walls if REGIONS[name] in codes]
    if names and subdivision < LEAST_OF_MIRRORS:
        raise InputError(
            f"subdivision = {subdivision} is not allowed: the {names[0]} is a mirror and may be round, which takes "
            f"{LEAST_OF_MIRRORS} or more."
        )
