"""Stepped surface of a mould printed in layers: treads and risers."""

from __future__ import annotations

import numpy as np

from mitsuba_taxel.geometry.surfaces.slices import Slices, sliced
from mitsuba_taxel.geometry.surfaces.slivers import without_slivers
from mitsuba_taxel.mechanics.surface.relief import Relief, SmoothSurface
from mitsuba_taxel.pads.regions import REGIONS

ALONG = 1e-6
"""Angle in radians from the print direction, below which sides count as parallel to it."""


def stepped(smooth: SmoothSurface, layer_height: float, layer_offset: float, direction: np.ndarray) -> Relief:
    """The stepped walls of the cells of a mould printed in layers.

    Walls are cut half-way between levels, and each piece moves along the direction to the nearest level; risers join
    pieces on different levels. In a vertical print, sides that are vertical, or have no steps, are not cut but
    stretched, to meet the edge of the roof at its level. Other walls keep their edges, and a riser joins an edge to the
    first piece.

    Parameters
    ----------
    smooth : SmoothSurface
        The undeformed surface.
    layer_height : float
        Distance between levels in mm.
    layer_offset : float
        Position of a level along the direction in mm.
    direction : (3,) ndarray
        Unit vector along which the mould was printed.

    Returns
    -------
    Relief
        Treads and risers.
    """
    height = smooth.vertices @ direction / layer_height
    first = layer_offset / layer_height
    stretched = is_vertical(direction) and (smooth.vertical_sides or "side" not in smooth.walls)
    chosen = smooth.rough & ((smooth.region == REGIONS["roof"]) | (not stretched))
    if not chosen.any():
        return Relief.of_vertices(smooth, np.zeros_like(smooth.vertices))

    # Layer of each corner of each piece, and the movement in layers of vertices of walls that are not cut.
    cut = sliced(height - first - 0.5, smooth.triangles, chosen)
    fixed = int(np.floor(cut.height.min())) - 1  # marks vertices that are in no layer
    layer = np.where(chosen[cut.parents], cut.band, fixed)[:, None].repeat(3, axis=1)
    move = np.zeros(len(height))
    if stretched:
        side = smooth.triangles[smooth.region == REGIONS["side"]]
        eaves = np.intersect1d(smooth.triangles[chosen], side)
        at_eaves = np.isin(cut.triangles, eaves) & (smooth.region[cut.parents] == REGIONS["side"])[:, None]
        layer[at_eaves] = np.floor(cut.height[cut.triangles[at_eaves]]).astype(np.int64)
        level = np.floor(cut.height[eaves[0]]) + 1 + first
        on_side = np.unique(side)
        move[on_side] = height[on_side] * (level / height[eaves[0]] - 1)
    return _assembled(smooth, cut, layer, fixed, move, layer_height * direction, first)


def is_vertical(direction: np.ndarray) -> bool:
    """Whether a unit vector is vertical."""
    return bool(np.hypot(direction[0], direction[1]) < ALONG)


def _assembled(
    smooth: SmoothSurface, cut: Slices, layer: np.ndarray, fixed: int, move: np.ndarray, step: np.ndarray, first: float
) -> Relief:
    """Assemble a stepped surface: pieces of walls move along the vector ``step`` of one layer, and risers are added
    between them.

    Parameters
    ----------
    layer : (T, 3) ndarray
        Layer of each corner of each piece, or ``fixed``.
    move : (V',) ndarray
        Movement in layers of the vertices of the smooth surface that are in no layer.
    first : float
        Position of a level, in layers.
    """
    lowest = int(layer.min())
    layers = int(layer.max()) - lowest + 1
    copies, number = np.unique(cut.triangles * layers + (layer - lowest), return_inverse=True)
    pieces = number.reshape(-1, 3)
    vertex, layer_of = np.divmod(copies, layers)
    layer_of += lowest
    low, high, fraction = (field[vertex] for field in (cut.low, cut.high, cut.fraction))
    points = smooth.vertices[low] + fraction[:, None] * (smooth.vertices[high] - smooth.vertices[low])
    is_fixed = layer_of == fixed
    smooth_move = move[low] + fraction * (move[high] - move[low])
    level = layer_of + 1 + first
    if is_vertical(step / np.linalg.norm(step)):  # no tread lies below the board
        level = np.maximum(level * np.sign(step[2]), 0) * np.sign(step[2])
    offset = np.where(is_fixed, smooth_move, level - points @ step / (step @ step))[:, None] * step

    risers, neighbour = _risers(vertex, pieces, smooth.rough[cut.parents])
    triangles = np.concatenate([pieces, risers])
    parents = np.concatenate([cut.parents, cut.parents[neighbour]])
    gaps, of_vertex = _gaps(vertex, triangles)
    triangles, parents = np.concatenate([triangles, gaps]), np.concatenate([parents, parents[of_vertex]])
    triangles, kept = without_slivers(points + offset, triangles)
    used, triangles = np.unique(triangles, return_inverse=True)
    return Relief(low[used], high[used], fraction[used], offset[used], triangles.reshape(-1, 3), parents[kept])


def _risers(vertex: np.ndarray, pieces: np.ndarray, moved: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Triangles of the risers, which connect the two copies of each edge between pieces on different levels. Also
    returns the number of a neighbouring triangle for each.
    """
    start, end = pieces.ravel(), np.roll(pieces, -1, axis=1).ravel()
    size = int(vertex.max()) + 1
    low, high = np.minimum(vertex[start], vertex[end]), np.maximum(vertex[start], vertex[end])
    order = np.argsort(low * size + high, kind="stable").reshape(-1, 2)
    first, second = order[:, 0], order[:, 1]
    swap = moved[second // 3] & ~moved[first // 3]  # region and cell are those of the rough neighbour
    first, second = np.where(swap, second, first), np.where(swap, first, second)
    separated = (start[first] != end[second]) | (end[first] != start[second])
    first, second = first[separated], second[separated]
    a, b, second_a, second_b = start[first], end[first], end[second], start[second]
    risers = np.concatenate([np.stack([b, a, second_a], axis=1), np.stack([b, second_a, second_b], axis=1)])
    proper = (risers != np.roll(risers, 1, axis=1)).all(axis=1)
    return risers[proper], np.tile(first // 3, 2)[proper]


def _gaps(vertex: np.ndarray, triangles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Triangles that close the gaps where risers meet an edge that has not moved. Each connects three copies of a
    vertex. Also returns the number of a neighbouring triangle for each.
    """
    start, end = triangles.ravel(), np.roll(triangles, -1, axis=1).ravel()
    riser = np.flatnonzero(vertex[start] == vertex[end])
    start, end = start[riser].astype(np.int64), end[riser].astype(np.int64)
    is_open = ~np.isin(end * len(vertex) + start, start * len(vertex) + end)
    start, end, riser = start[is_open], end[is_open], riser[is_open]
    order = np.argsort(vertex[start], kind="stable").reshape(-1, 3)
    first, second = order[:, 0], order[:, 1]
    third = np.where(end[first] == start[second], end[second], start[second])
    return np.stack([end[first], start[first], third], axis=1), riser[first] // 3
