"""Default size of the finite elements of loaded cells, chosen for the accuracy of the light.

A reading depends on the curvature of domes, and of flat mirrors that a load bends. On elements of the default size of a
pad, the curvature of a bent roof is wrong by a third.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import mitsuba as mi

from mitsuba_taxel.kernels.pad_limits import mirrors, regions_with
from mitsuba_taxel.pads import AnyPad, Pad

if TYPE_CHECKING:
    from mitsuba_taxel.mechanics.elements.loads import Load

MOST_CELLS = 16
"""Largest number of cells of a pad with smaller elements; with more cells, smaller elements need too much time and
memory."""


def size_for_light(pad: AnyPad, load: Load, walls: list[mi.BSDF]) -> float | None:
    """Size of the finite elements of a pad whose light needs smaller ones than the default: pads with domed cells, and
    with mirrors on their walls.

    Parameters
    ----------
    pad : AnyPad
        Any pad.
    load : Load
        Load on the pad.
    walls : list[mi.BSDF]
        BSDFs of the pad.

    Returns
    -------
    float or None
        Element size in mm; None for other pads and under an indenter, where the default of the pad applies.
    """
    if not isinstance(pad, Pad) or pad.rows * pad.columns > MOST_CELLS or load.indenter is not None:
        return None
    sizes, relative = pad.shape.light_sizes, None
    if sizes is None:
        return None
    if any(map(mirrors, walls)):
        relative = sizes.mirrors_side_by_side if pad.rows * pad.columns > 1 else sizes.mirrors
    elif any(regions_with(wall, mi.BSDFFlags.Diffuse) for wall in walls):
        relative = sizes.diffuse
    else:
        relative = None
    return None if relative is None else relative * pad.default_mesh_size


def fewer_triangles(subdivision: int, pad: Pad, mesh_size: float) -> int:
    """Number of triangles along each edge of smaller elements, chosen so that triangles are as small as on default
    elements.

    Parameters
    ----------
    subdivision : int
        Triangles along the edges of elements of the default size.
    pad : Pad
        The pad.
    mesh_size : float
        Size of its elements, mm.

    Returns
    -------
    int
        Number of triangles, at least 1.
    """
    return math.ceil(edge_ratio(pad, mesh_size) * subdivision)


def edge_ratio(pad: AnyPad, mesh_size: float) -> float:
    """Length of the edges of elements on roofs, relative to the default.

    On domes with elements smaller than the default, the length is proportional to the square of the mesh size, down to
    a relative mesh size of `FINER_DOMES`; otherwise it is proportional to the mesh size.

    Parameters
    ----------
    pad : AnyPad
        The pad.
    mesh_size : float
        Size of its elements, mm.

    Returns
    -------
    float
        Relative length, without unit.
    """
    from mitsuba_taxel.pads.parametric.meshing import FINER_DOMES  # imports scipy, which a scene without a pad omits

    ratio = mesh_size / pad.default_mesh_size
    is_domed = isinstance(pad, Pad) and "roof" in pad.shape.round_regions
    return ratio * min(max(ratio, FINER_DOMES), 1.0) if is_domed else ratio
