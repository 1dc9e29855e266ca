"""Default size of the finite elements of loaded domes, which follows what the light needs."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import mitsuba as mi

from mitsuba_taxel.kernels.pad_limits import mirrors, regions_with
from mitsuba_taxel.pads import Pad, PadFile

if TYPE_CHECKING:
    from mitsuba_taxel.mechanics.elements.loads import Load

MOST_CELLS = 16
"""Pads of more cells keep the pad's default: their elements would take too long and too much memory."""


def size_for_light(pad: Pad | PadFile, load: Load, walls: list[mi.BSDF]) -> float | None:
    """Size of elements of built-in domes that return light.

    Parameters
    ----------
    pad : Pad or PadFile
        Of any cells.
    load : Load
        On the pad.
    walls : list[mi.BSDF]
        Of the pad.

    Returns
    -------
    float or None
        In mm; None for other pads, and under an indenter.
    """
    if not isinstance(pad, Pad) or pad.rows * pad.columns > MOST_CELLS or load.indenter is not None:
        return None
    sizes = pad.shape.light_sizes
    if sizes is None:
        return None
    if any(map(mirrors, walls)):
        relative = sizes.mirrors_side_by_side if pad.rows * pad.columns > 1 else sizes.mirrors
    elif any(regions_with(wall, mi.BSDFFlags.Diffuse) for wall in walls):
        relative = sizes.diffuse
    else:
        return None
    return relative * pad.default_mesh_size


def fewer_triangles(subdivision: int, share: float) -> int:
    """Triangles along the edges of elements on domes, so that these are no larger than on default elements.

    Elements there become smaller in proportion to the square of the fraction, as it is at least `FINER_DOMES`.

    Parameters
    ----------
    subdivision : int
        Of elements of the default size.
    share : float
        Size of the elements, relative to the default.

    Returns
    -------
    int
        From 1 on.
    """
    return math.ceil(share**2 * subdivision)
