"""Local refinement of a pad's mesh under an indenter."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from mitsuba_taxel.geometry.mirror import ACROSS_DIAGONAL, ACROSS_X, ACROSS_Y, MIRRORS, Mirror, mirrored
from mitsuba_taxel.geometry.refinement import refined
from mitsuba_taxel.geometry.volume_mesh import VolumeMesh
from mitsuba_taxel.mechanics.contact.indenter import Indenter
from mitsuba_taxel.mechanics.elements.symmetry import node_images, part_between

SMALL_DEPTH = 0.04
"""Smallest depth, relative to the pad's height, for which elements are fine enough; deeper contacts are wider, and
elements may be larger away from the centre."""
FINENESS = 0.7
"""Size of elements, relative to half the width of the contact."""
FINENESS_AT_EDGE = 0.175
"""The same at the edge of a punch, where the pressure is high."""


def mesh_under(mesh: VolumeMesh, indenter: Indenter, relative_size: float) -> VolumeMesh:
    """The mesh with elements of at most half the contact's radius, times ``relative_size``, under an indenter.

    The result keeps the common symmetries of mesh and indenter.
    """
    depth = SMALL_DEPTH * float(np.ptp(mesh.points[:, 2]))
    radius = indenter.contact_radius(depth)
    if math.isinf(radius):
        return mesh
    least = radius * (FINENESS_AT_EDGE / FINENESS if indenter.shape == "punch" else 1.0)
    top = float(mesh.points[:, 2].max())

    def size(places: np.ndarray) -> np.ndarray:
        from_contact = indenter.from_contact(places - [*indenter.at, top], depth)
        return relative_size * FINENESS * np.maximum(least, from_contact)

    images = {mirror: image for mirror, image in node_images(mesh).items() if indenter.keeps(mirror)}
    part = refined(part_between(mesh, images, tuple(images)).mesh, size)
    for mirror in (ACROSS_DIAGONAL, ACROSS_X, ACROSS_Y) if len(images) == len(MIRRORS) else images:
        part = _completed(part, mirror, _cells_of_images(mesh, mirror, images[mirror]))
    corners, others = np.unique(part.tets[:, :4]), np.unique(part.tets[:, 4:])
    order = np.concatenate([corners, others])
    number = np.argsort(order)
    return replace(part, points=part.points[order], tets=number[part.tets], faces=number[part.faces])


def _completed(part: VolumeMesh, mirror: Mirror, cells: np.ndarray) -> VolumeMesh:
    """A mesh joined with its image, whose cells get the numbers (n,) of the images of its own."""
    whole = mirrored(part, mirror)
    cell = whole.face_cell.copy()
    cell[len(part.faces) :] = cells[part.face_cell]
    return replace(whole, face_cell=cell)


def _cells_of_images(mesh: VolumeMesh, mirror: Mirror, image: np.ndarray) -> np.ndarray:
    """(cells + 1,) number of each cell's image."""
    faces, images = (np.sort(nodes[:, :3], axis=1) for nodes in (mesh.faces, image[mesh.faces]))
    own, other = np.lexsort(faces.T), np.lexsort(images.T)
    cells = np.zeros(mesh.face_cell.max() + 1, dtype=mesh.face_cell.dtype)
    cells[mesh.face_cell[other]] = mesh.face_cell[own]
    return cells
