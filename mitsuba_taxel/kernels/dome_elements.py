"""Default size of the finite elements of loaded domes, which follows what the light needs."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import mitsuba as mi

from mitsuba_taxel.kernels.pad_limits import mirrors, regions_with
from mitsuba_taxel.pads import Pad, PadFile
from mitsuba_taxel.pads.pad import PROFILE

if TYPE_CHECKING:
    from mitsuba_taxel.mechanics.elements.loads import Load

DIFFUSE = {"hemispheric": 0.6, "spherical": 0.5, PROFILE: 0.5}
MIRRORS = {"hemispheric": 0.5, "spherical": 0.6, PROFILE: 0.5}
"""Relative to the pad's default: diffuse walls are within 0.03 % then, mirrors and rough mirrors within 0.3 %
(`taxel bench domes`). Light leaves a spherical cell after few reflections, of which each counts."""
MIRRORS_SIDE_BY_SIDE = {"hemispheric": 0.55}
"""Those that may be larger in pads of several cells: readings there are as accurate (the same command)."""
MOST_CELLS = 16
"""Pads of more cells keep the pad's default: their elements would take too long and too much memory."""


def size_for_light(pad: Pad | PadFile, load: Load, walls: list[mi.BSDF]) -> float | None:
    """In mm, for built-in domes that return light; None for other pads, and under an indenter."""
    from mitsuba_taxel.mechanics import IndenterDisplacement, IndenterForce

    indented = isinstance(load, IndenterDisplacement | IndenterForce)
    if not isinstance(pad, Pad) or pad.rows * pad.columns > MOST_CELLS or indented:
        return None
    if any(map(mirrors, walls)):
        side_by_side = MIRRORS_SIDE_BY_SIDE if pad.rows * pad.columns > 1 else {}
        share = (MIRRORS | side_by_side).get(pad.cell)
    elif any(regions_with(wall, mi.BSDFFlags.Diffuse) for wall in walls):
        share = DIFFUSE.get(pad.cell)
    else:
        return None
    return None if share is None else share * pad.default_mesh_size


def fewer_triangles(subdivision: int, share: float) -> int:
    """Triangles along the edges of elements of a ``share`` of the default size, for those on domes to be no larger.

    Elements there become smaller in proportion to its square, as shares are at least `FINER_DOMES`.
    """
    return math.ceil(share**2 * subdivision)
