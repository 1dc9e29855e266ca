"""Local refinement of a pad's mesh under an indenter."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.geometry.geometry_error import GeometryError
from mitsuba_taxel.geometry.mirror import ACROSS_DIAGONAL, ACROSS_X, ACROSS_Y, MIRRORS, Mirror, mirrored
from mitsuba_taxel.geometry.refinement import refined
from mitsuba_taxel.geometry.volume_mesh import VolumeMesh
from mitsuba_taxel.mechanics.contact.indenter import Indenter
from mitsuba_taxel.mechanics.contact.indenter_shape import TINY
from mitsuba_taxel.mechanics.elements.symmetry import node_images, part_between

MOST_ELEMENTS = 60_000
"""Of the symmetric part that is solved, under an indenter."""
SMALL_DEPTH = 0.04
"""Smallest depth, relative to the pad's height, for which elements are fine enough; deeper contacts are wider, and
elements may be larger away from the centre."""
FINENESS = 0.7
"""Size of elements, relative to the length over which the pressure of the contact changes."""
CLOSE = 0.5
"""Distance from where elements are small, relative to half the width of the contact, within which they are small enough
for a body."""

Leg = tuple[tuple[float, float], tuple[float, float]]
"""Start and end in mm of a straight movement of a body along x and y, from where it is placed."""


@dataclass(frozen=True)
class Refinement:
    """Where and how much a mesh is refined under an indenter.

    Attributes
    ----------
    relative_size : float
        Size of the elements, relative to :data:`FINENESS`.
    legs : tuple of Leg
        Along which the body is dragged.
    depth : float
        Smallest for which elements are small enough, relative to the pad's height.
    """

    relative_size: float = 1.0
    legs: tuple[Leg, ...] = ()
    depth: float = SMALL_DEPTH


def mesh_under(mesh: VolumeMesh, indenter: Indenter, refinement: Refinement) -> VolumeMesh:
    """The mesh with elements of at most half the contact's radius, times a relative size, wherever an indenter goes.

    The result keeps the common symmetries of mesh, indenter and legs.

    Raises
    ------
    InputError
        if these would be more than :data:`MOST_ELEMENTS`.
    """
    depth = refinement.depth * float(np.ptp(mesh.points[:, 2]))
    body = indenter.body
    least = body.pressure_length(depth)
    if math.isinf(least):
        return mesh
    top = float(mesh.points[:, 2].max())
    tips = np.array([*indenter.at, top]) + _stops(refinement.legs, least)

    def size(places: np.ndarray) -> np.ndarray:
        distance = np.full(len(places), math.inf)
        for tip in tips:
            np.minimum(distance, body.distance_to_steepest_pressure(places - tip, depth), out=distance)
        return refinement.relative_size * FINENESS * np.maximum(least, distance)

    images = {
        mirror: image
        for mirror, image in node_images(mesh).items()
        if body.keeps(mirror) and _keeps(mirror, refinement.legs)
    }
    try:
        part = refined(part_between(mesh, images, tuple(images)).mesh, size, MOST_ELEMENTS)
    except GeometryError as error:
        raise InputError(
            f"{body.size_text} is not allowed: {error} would be needed under the indenter, of "
            f"{refinement.relative_size * FINENESS * least:.2g} mm: a larger one is needed, or a larger mesh_size."
        ) from error
    for mirror in (ACROSS_DIAGONAL, ACROSS_X, ACROSS_Y) if len(images) == len(MIRRORS) else images:
        part = _completed(part, mirror, _cells_of_images(mesh, mirror, images[mirror]))
    corners, others = np.unique(part.tets[:, :4]), np.unique(part.tets[:, 4:])
    order = np.concatenate([corners, others])
    number = np.argsort(order)
    return replace(part, points=part.points[order], tets=number[part.tets], faces=number[part.faces])


def swept_legs(places: Sequence[tuple[float, float, float]], reach: float) -> tuple[Leg, ...]:
    """Legs that cover the straight ways between the ``places`` (x, y, z) of a body, in mm from where it is placed.

    Ways above z = 0 are left out. As places are added, legs change seldom: ways in one direction are one leg, whose
    length is ``reach`` in mm times a power of 2; what is within :data:`CLOSE` times that of a leg is covered by it.
    """
    legs: list[Leg] = []
    for start, end in zip([(0.0, 0.0, 0.0), *places], places, strict=False):
        way = np.array([*start[:2], *end[:2]]).reshape(2, 2)
        if min(start[2], end[2]) >= 0 or _covers(legs, way, CLOSE * reach):
            continue
        if legs and _goes_on(legs[-1], way, CLOSE * reach):
            way[0] = legs.pop()[0]
        elif not legs and np.linalg.norm(way[0]) <= CLOSE * reach:
            way[0] = 0.0
        length = float(np.linalg.norm(way[1] - way[0]))
        if length > 0:
            whole = reach * 2.0 ** max(0, math.ceil(math.log2(length / reach) - 1e-9))
            way[1] = np.round(way[0] + whole / length * (way[1] - way[0]), 9)
        first, last = way.tolist()
        legs.append(((first[0], first[1]), (last[0], last[1])))
    return tuple(legs)


def _covers(legs: Sequence[Leg], way: np.ndarray, distance: float) -> bool:
    """Whether all of a straight way (2, 2) is within a distance in mm of the start of the body or of legs."""
    count = 2 + int(np.linalg.norm(way[1] - way[0]) / distance)
    points = way[0] + np.linspace(0, 1, count)[:, None] * (way[1] - way[0])
    apart = np.linalg.norm(points, axis=1)
    for leg in legs:
        np.minimum(apart, _from_leg(points, leg), out=apart)
    return bool((apart <= distance).all())


def _goes_on(leg: Leg, way: np.ndarray, distance: float) -> bool:
    """Whether a straight way (2, 2) begins on a leg and ends beyond it, in its direction."""
    start, end = np.array(leg)
    along = (end - start) / max(float(np.linalg.norm(end - start)), TINY)
    across = way - start - np.outer((way - start) @ along, along)
    return bool(
        _from_leg(way[:1], leg)[0] <= distance
        and np.linalg.norm(across, axis=1).max() <= 1e-6 * distance
        and (way[1] - way[0]) @ along > 0
    )


def _from_leg(points: np.ndarray, leg: Leg) -> np.ndarray:
    """(n,) mm, distances of points (n, 2) from a leg."""
    start, end = np.array(leg)
    along = end - start
    position = np.clip((points - start) @ along / max(along @ along, TINY), 0, 1)
    return np.linalg.norm(points - start - np.outer(position, along), axis=1)


def _stops(legs: Sequence[Leg], spacing: float) -> np.ndarray:
    """(n, 3) mm, the start and places along legs at most a spacing in mm apart."""
    stops = [np.zeros((1, 3))]
    for start, end in np.array(legs).reshape(-1, 2, 2):
        count = 1 + math.ceil(float(np.linalg.norm(end - start)) / spacing)
        flat = start + np.linspace(0, 1, count)[:, None] * (end - start)
        stops.append(np.append(flat, np.zeros((count, 1)), axis=1))
    return np.concatenate(stops)


def _keeps(mirror: Mirror, legs: Sequence[Leg]) -> bool:
    """Whether legs are symmetric in a mirror."""
    ends = np.array(legs).reshape(-1, 2, 2)
    images = mirror.image(np.append(ends, np.zeros((len(ends), 2, 1)), axis=2))[:, :, :2]
    own, other = ({frozenset(map(tuple, leg)) for leg in each.tolist()} for each in (ends, images))
    return own == other


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
