"""Second-order tetrahedral mesh of a block without cells, from a grid of bricks, graded towards its glued edges."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import permutations
from typing import Protocol

import numpy as np

from mitsuba_taxel.base.errors import ComputationError, InputError
from mitsuba_taxel.geometry.element_maps import worst_element
from mitsuba_taxel.geometry.mirror import ACROSS_DIAGONAL, ACROSS_X, ACROSS_Y, mirrored
from mitsuba_taxel.geometry.second_order import positive, second_order
from mitsuba_taxel.geometry.volume_mesh import VolumeMesh
from mitsuba_taxel.pads.parametric.grading import cut_towards
from mitsuba_taxel.pads.parametric.meshing import CUT, LEAST_QUALITY, MOST_ELEMENTS
from mitsuba_taxel.pads.regions import REGIONS

LEAST_LAYERS = 2
"""Least number of bricks over the height."""
OF_BRICK = 24
"""Number of tetrahedra of a brick and of its mirror images together."""


class Meshed(Protocol):
    """Interface: the properties of a block without cells that meshing uses; see `Block`."""

    @property
    def extent(self) -> tuple[float, float, float]: ...
    @property
    def default_mesh_size(self) -> float: ...
    def top_at(self, x: np.ndarray, y: np.ndarray) -> np.ndarray: ...


def mesh_block(block: Meshed, mesh_size: float) -> VolumeMesh:
    """Mesh a block with elements of about ``mesh_size`` mm.

    A quarter of the block, or an eighth of a square one, is divided into bricks of six tetrahedra (H. W. Kuhn, IBM J.
    Res. Dev. 4, 1960), and mirrored: the mesh has exactly the symmetry of the block. Elements at the glued edges, where
    the stress is singular, are divided. Nodes are then moved vertically in proportion to the height of the top.

    Parameters
    ----------
    block : Block
        The block, with lengths in mm.
    mesh_size : float
        Length of the edges of bricks, mm.

    Returns
    -------
    VolumeMesh
        Undeformed quadratic tetrahedra with tagged faces.

    Raises
    ------
    InputError
        if ``mesh_size`` is not a finite length above 0, or needs more than `MOST_ELEMENTS`.
    ComputationError
        if an element is too distorted, below a strongly domed top.
    """
    check_block_size(block, mesh_size)
    width, depth, height = block.extent
    half = 0.5 * width, 0.5 * depth, height
    bricks = _bricks_along(block, mesh_size)

    # The meshed part: 0 <= y <= x of a square block, x, y >= 0 of another block.
    is_square = width == depth
    points, tets = _bricks([np.linspace(0, side, count + 1) for side, count in zip(half, bricks, strict=True)])
    if is_square:
        middle = points[tets].mean(axis=1)
        tets = tets[middle[:, 0] > middle[:, 1]]
    nodes, tets, faces = second_order(*positive(points, tets))
    mesh = _tagged(nodes, tets, faces, half)
    mesh = cut_towards(mesh, _on(mesh, "bottom") & _on(mesh, "outer"), CUT)
    points = mesh.points.copy()
    if is_square:
        on_diagonal = np.abs(points[:, 0] - points[:, 1]) < 1e-9 * width
        points[on_diagonal, 1] = points[on_diagonal, 0]
    points[:, 2] *= block.top_at(points[:, 0], points[:, 1]) / height
    mesh = replace(mesh, points=points)

    for mirror in (*([ACROSS_DIAGONAL] if is_square else []), ACROSS_X, ACROSS_Y):
        mesh = mirrored(mesh, mirror)
    quality, where = worst_element(mesh)
    if quality < LEAST_QUALITY:
        x, y, z = where
        raise ComputationError(
            f"the mesh has a distorted element near ({x:.3g}, {y:.3g}, {z:.3g}) mm: choose a larger top_radius, or "
            f"another mesh_size than {mesh_size:g}."
        )
    # Corners come before other nodes.
    corners, middles = np.unique(mesh.tets[:, :4]), np.unique(mesh.tets[:, 4:])
    order = np.concatenate([corners, middles])
    number = np.argsort(order)
    return replace(mesh, points=mesh.points[order], tets=number[mesh.tets], faces=number[mesh.faces])


def check_block_size(block: Meshed, mesh_size: float) -> None:
    """Refuse an invalid mesh size, or a mesh with more elements than fit in memory.

    Parameters
    ----------
    block : Block
        The block, with lengths in mm.
    mesh_size : float
        Length of the edges of bricks, mm.

    Raises
    ------
    InputError
        if the size is not allowed for this block.
    """
    if not (math.isfinite(mesh_size) and mesh_size > 0):
        raise InputError(f"mesh_size = {mesh_size:g} is not allowed: a finite number above 0 is needed.")
    if OF_BRICK * math.prod(_bricks_along(block, mesh_size)) <= MOST_ELEMENTS:
        return
    least = (OF_BRICK * math.prod(block.extent) / 4 / MOST_ELEMENTS) ** (1 / 3)
    if mesh_size >= 0.5 * block.default_mesh_size:  # the size is the default
        size = " x ".join(f"{side:.3g}" for side in block.extent)
        raise InputError(
            f"a block of {size} mm is not allowed: its thinnest side needs elements of {mesh_size:.2g} mm, but in a "
            f"block of this size, the smallest possible elements are {least:.2g} mm. A less slender block is needed "
            "(lengths are in mm)."
        )
    raise InputError(f"mesh_size = {mesh_size:g} is not allowed: at least {least:.2g} is needed for this block.")


def _bricks_along(block: Meshed, mesh_size: float) -> list[int]:
    """Number of bricks along half the width, half the depth, and the height."""
    width, depth, height = block.extent
    sides = 0.5 * width, 0.5 * depth, height
    least = 1, 1, LEAST_LAYERS
    return [max(n, math.ceil(min(side / mesh_size * (1 - 1e-9), 1e9))) for n, side in zip(least, sides, strict=True)]


def _bricks(sides: list[np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """Points (N, 3) of a grid of bricks, and the corners (M, 4) of M tetrahedra, six in each brick.

    The corners of each tetrahedron are a path along the edges of the brick, from its lowest to its highest corner.
    Tetrahedra of neighbouring bricks therefore match, and exchanging two axes maps tetrahedra to tetrahedra."""
    shape = tuple(len(side) for side in sides)
    points = np.stack(np.meshgrid(*sides, indexing="ij"), axis=-1).reshape(-1, 3)
    lowest = np.stack(np.meshgrid(*(np.arange(n - 1) for n in shape), indexing="ij"), axis=-1).reshape(-1, 3)
    steps = np.eye(3, dtype=int)[list(permutations(range(3)))]
    paths = np.insert(np.cumsum(steps, axis=1), 0, 0, axis=1)
    corners = lowest[:, None, None] + paths
    return points, np.ravel_multi_index(tuple(np.moveaxis(corners, -1, 0)), shape).reshape(-1, 4)


def _tagged(points: np.ndarray, tets: np.ndarray, faces: np.ndarray, half: tuple[float, float, float]) -> VolumeMesh:
    """Assemble the mesh: each boundary face gets its region, and the faces on planes of symmetry are left out."""
    middle, near = points[faces[:, :3]].mean(axis=1), 1e-9 * np.array(half)
    region = np.zeros(len(faces), dtype=int)
    region[(middle[:, :2] > (np.array(half) - near)[:2]).any(axis=1)] = REGIONS["outer"]
    region[middle[:, 2] < near[2]] = REGIONS["bottom"]
    region[middle[:, 2] > half[2] - near[2]] = REGIONS["top"]
    outside = region > 0
    return VolumeMesh(points, tets, faces[outside], region[outside], np.zeros(np.count_nonzero(outside), dtype=int))


def _on(mesh: VolumeMesh, region: str) -> np.ndarray:
    """Mask (N,) of the mesh's N nodes that lie on a region of the surface."""
    on = np.zeros(len(mesh.points), dtype=bool)
    on[mesh.faces[mesh.face_region == REGIONS[region]]] = True
    return on
