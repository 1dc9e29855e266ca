"""The deformed surface of a pad as flat triangles, fine enough to keep the curvature of its roofs."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from mitsuba_taxel.mechanics.path import State
from mitsuba_taxel.pads.pad import REGIONS


@dataclass(frozen=True)
class Surface:
    """A closed triangle mesh.

    Attributes
    ----------
    vertices : (V, 3) mm
    triangles : (T, 3) vertex numbers, counter-clockwise seen from outside the silicone
    region : (T,) region codes
    cell : (T,) number of the cell that a roof or side belongs to, 0 elsewhere
    """

    vertices: np.ndarray
    triangles: np.ndarray
    region: np.ndarray
    cell: np.ndarray


def tessellate(state: State, subdivision: int = 12) -> Surface:
    """Cut each curved face of the deformed pad into triangles.

    The faces of cells are cut into ``subdivision`` ** 2 triangles each, the others into 4, as their mid-edge nodes
    need. Both meet only along the rims of the cells, which lie flat on the board and do not move.
    """
    mesh = state.mesh
    deformed = mesh.points + state.displacement
    in_cell = np.isin(mesh.face_region, (REGIONS["roof"], REGIONS["side"]))
    fine = _cut(deformed, mesh, np.flatnonzero(in_cell), subdivision)
    coarse = _cut(deformed, mesh, np.flatnonzero(~in_cell), 2)
    vertices = np.concatenate([fine[0], coarse[0]])
    triangles = np.concatenate([fine[1], coarse[1] + len(fine[0])])
    faces = np.concatenate([fine[2], coarse[2]])
    return Surface(vertices, triangles, mesh.face_region[faces], mesh.face_cell[faces])


def _cut(points: np.ndarray, mesh, chosen: np.ndarray, subdivision: int):
    """Vertices, triangles, and the face each triangle comes from, of the ``chosen`` faces."""
    faces = mesh.faces[chosen]
    weights, pattern, barycentric = _reference(subdivision)
    vertices = np.einsum("vk,fkj->fvj", weights, points[faces]).reshape(-1, 3)
    numbers = _shared_numbers(faces, barycentric).reshape(len(faces), -1)
    unique, first, numbers_flat = np.unique(numbers.ravel(), return_index=True, return_inverse=True)
    triangles = numbers_flat.reshape(len(faces), -1)[:, pattern].reshape(-1, 3)
    return vertices[first], triangles, np.repeat(chosen, len(pattern))


@lru_cache(maxsize=8)
def _reference(n: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Shape functions at the lattice points of a triangle cut n times, its triangles, and the lattice itself."""
    lattice = np.array([(n - i - j, i, j) for j in range(n + 1) for i in range(n + 1 - j)])
    number = {tuple(point): index for index, point in enumerate(lattice[:, 1:].tolist())}
    pattern = []
    for j in range(n):
        for i in range(n - j):
            pattern.append((number[i, j], number[i + 1, j], number[i, j + 1]))
            if i + j < n - 1:
                pattern.append((number[i + 1, j], number[i + 1, j + 1], number[i, j + 1]))
    a, b, c = (lattice / n).T
    weights = np.stack([a * (2 * a - 1), b * (2 * b - 1), c * (2 * c - 1), 4 * a * b, 4 * b * c, 4 * c * a], axis=1)
    return weights, np.array(pattern), lattice


def _shared_numbers(faces: np.ndarray, lattice: np.ndarray) -> np.ndarray:
    """(F, V) a number for each lattice point of each face, equal where faces share the point.

    A lattice point is known by the corners of its face, in order, that it has weight on, and those weights.
    """
    n = int(lattice[0].sum())
    order = np.argsort(faces[:, :3], axis=1)
    corners = np.take_along_axis(faces[:, :3], order, axis=1).astype(np.int64)
    weights = lattice[None].repeat(len(faces), axis=0)
    weights = np.take_along_axis(weights, order[:, None, :].repeat(len(lattice), axis=1), axis=2)
    used = np.where(weights > 0, corners[:, None, :] + 1, 0)
    packed = np.argsort(used == 0, axis=2, kind="stable")  # a corner without weight says nothing: it goes last
    used, weights = (np.take_along_axis(part, packed, axis=2) for part in (used, weights))
    keys = np.concatenate([used, weights], axis=2).reshape(-1, 6)
    base = np.array([int(corners.max()) + 2] * 3 + [n + 1] * 2)
    code = np.zeros(len(keys), dtype=object if float(base.astype(float).prod()) > 2**62 else np.int64)
    for column, size in zip(keys[:, :5].T, base):
        code = code * int(size) + column
    return code
