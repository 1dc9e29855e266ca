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
"""Largest number of elements of the symmetric part that is solved under an indenter."""
SMALL_DEPTH = 0.04
"""Smallest depth, relative to the pad's height, for which elements are small enough. Deeper contacts are wider, and
elements away from the centre may be larger."""
FINENESS = 0.7
"""Size of elements, relative to the length over which the pressure of the contact changes."""
CLOSE = 0.5
"""Distance from a refined position, relative to half the width of the contact, within which elements are small enough
for a body."""

Leg = tuple[tuple[float, float], tuple[float, float]]
"""Start and end in mm of a straight movement of a body along x and y, relative to its position."""


@dataclass(frozen=True)
class Refinement:
    """Where and how finely a mesh is refined under an indenter.

    Attributes
    ----------
    relative_size : float
        Size of the elements, relative to :data:`FINENESS`.
    legs : tuple of Leg
        Straight movements of the body.
    depth : float
        Smallest depth for which elements are small enough, relative to the pad's height.
    """

    relative_size: float = 1.0
    legs: tuple[Leg, ...] = ()
    depth: float = SMALL_DEPTH


def mesh_under(mesh: VolumeMesh, indenter: Indenter, refinement: Refinement) -> VolumeMesh:
    """Refine a mesh along the movements of an indenter, to elements of a fraction of the contact's radius.

    The result keeps the common symmetries of mesh, indenter and movements (legs).

    Parameters
    ----------
    mesh : VolumeMesh
        Mesh of the undeformed pad.
    indenter : Indenter
        The rigid body.
    refinement : Refinement
        Extent and fineness.

    Returns
    -------
    VolumeMesh
        The refined mesh.

    Raises
    ------
    InputError
        if more than :data:`MOST_ELEMENTS` would be needed.
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
            f"{refinement.relative_size * FINENESS * least:.2g} mm: a larger indenter or a larger mesh_size is needed."
        ) from error
    for mirror in (ACROSS_DIAGONAL, ACROSS_X, ACROSS_Y) if len(images) == len(MIRRORS) else images:
        part = _completed(part, mirror, cells_of_images(mesh, mirror, images[mirror]))
    corners, middles = np.unique(part.tets[:, :4]), np.unique(part.tets[:, 4:])
    order = np.concatenate([corners, middles])
    number = np.argsort(order)
    return replace(part, points=part.points[order], tets=number[part.tets], faces=number[part.faces])


def swept_legs(positions: Sequence[tuple[float, float, float]], reach: float) -> tuple[Leg, ...]:
    """Straight segments (legs) along which an indenter moves between successive positions.

    Movements above z = 0 are left out. To keep the legs the same as positions are added, movements in one direction are
    one leg, whose length is ``reach`` times a power of 2. A movement within :data:`CLOSE` times ``reach`` of a leg is
    covered by that leg.

    Parameters
    ----------
    positions : sequence of (float, float, float)
        Positions relative to the initial position of the body, mm.
    reach : float
        Half the width of the contact, mm.

    Returns
    -------
    tuple of Leg
        Segments in mm.
    """
    legs: list[Leg] = []
    for start, end in zip([(0.0, 0.0, 0.0), *positions], positions, strict=False):
        line = np.array([*start[:2], *end[:2]]).reshape(2, 2)
        if min(start[2], end[2]) >= 0 or _covers(legs, line, CLOSE * reach):
            continue
        if legs and _continues(legs[-1], line, CLOSE * reach):
            line[0] = legs.pop()[0]
        elif not legs and np.linalg.norm(line[0]) <= CLOSE * reach:
            line[0] = 0.0
        length = float(np.linalg.norm(line[1] - line[0]))
        if length > 0:
            extended = reach * 2.0 ** max(0, math.ceil(math.log2(length / reach) - 1e-9))
            line[1] = np.round(line[0] + extended / length * (line[1] - line[0]), 9)
        first, last = line.tolist()
        legs.append(((first[0], first[1]), (last[0], last[1])))
    return tuple(legs)


def _covers(legs: Sequence[Leg], line: np.ndarray, distance: float) -> bool:
    """Whether a horizontal line lies within a ``distance`` in mm of the indenter's start, or of a leg (straight
    movement). The line is given by its ends (2, 2) in mm.
    """
    count = 2 + int(np.linalg.norm(line[1] - line[0]) / distance)
    points = line[0] + np.linspace(0, 1, count)[:, None] * (line[1] - line[0])
    distances = np.linalg.norm(points, axis=1)
    for leg in legs:
        np.minimum(distances, _from_leg(points, leg), out=distances)
    return bool((distances <= distance).all())


def _continues(leg: Leg, line: np.ndarray, distance: float) -> bool:
    """Whether a horizontal line begins on a leg (straight movement of the indenter) and continues in its direction. The
    line is given by its ends (2, 2) in mm; it may be a ``distance`` in mm away from the leg.
    """
    start, end = np.array(leg)
    along = (end - start) / max(float(np.linalg.norm(end - start)), TINY)
    across = line - start - np.outer((line - start) @ along, along)
    return bool(
        _from_leg(line[:1], leg)[0] <= distance
        and np.linalg.norm(across, axis=1).max() <= 1e-6 * distance
        and (line[1] - line[0]) @ along > 0
    )


def _from_leg(points: np.ndarray, leg: Leg) -> np.ndarray:
    """Horizontal distances (n,) in mm of points (n, 2) from a leg, a straight movement of the indenter."""
    start, end = np.array(leg)
    along = end - start
    position = np.clip((points - start) @ along / max(along @ along, TINY), 0, 1)
    return np.linalg.norm(points - start - np.outer(position, along), axis=1)


def _stops(legs: Sequence[Leg], spacing: float) -> np.ndarray:
    """Positions (n, 3) in mm along the path of an indenter: its start, and points on its legs (straight movements) at
    most a ``spacing`` in mm apart."""
    stops = [np.zeros((1, 3))]
    for start, end in np.array(legs).reshape(-1, 2, 2):
        count = 1 + math.ceil(float(np.linalg.norm(end - start)) / spacing)
        flat = start + np.linspace(0, 1, count)[:, None] * (end - start)
        stops.append(np.append(flat, np.zeros((count, 1)), axis=1))
    return np.concatenate(stops)


def _keeps(mirror: Mirror, legs: Sequence[Leg]) -> bool:
    """Whether the legs (straight movements of an indenter) are together symmetric in a mirror."""
    ends = np.array(legs).reshape(-1, 2, 2)
    images = mirror.image(np.append(ends, np.zeros((len(ends), 2, 1)), axis=2))[:, :, :2]
    own_legs, image_legs = ({frozenset(map(tuple, leg)) for leg in lines.tolist()} for lines in (ends, images))
    return own_legs == image_legs


def _completed(part: VolumeMesh, mirror: Mirror, cells: np.ndarray) -> VolumeMesh:
    """Join a mesh with its mirror image. ``cells[c]`` is the number that a cell c gets in the image."""
    joined = mirrored(part, mirror)
    cell = joined.face_cell.copy()
    cell[len(part.faces) :] = cells[part.face_cell]
    return replace(joined, face_cell=cell)


def cells_of_images(mesh: VolumeMesh, mirror: Mirror, image: np.ndarray) -> np.ndarray:
    """For each cell of a pad, the number of the cell that is its mirror image.

    Parameters
    ----------
    mesh : VolumeMesh
        Mesh of the undeformed pad.
    mirror : Mirror
        A mirror that maps the mesh onto itself.
    image : (N,) ndarray of int
        Image of each node.

    Returns
    -------
    (cells + 1,) ndarray of int
        Number of the mirror image of each cell; 0, which is no cell, stays 0.
    """
    faces, images = (np.sort(nodes[:, :3], axis=1) for nodes in (mesh.faces, image[mesh.faces]))
    own_order, image_order = np.lexsort(faces.T), np.lexsort(images.T)
    cells = np.zeros(mesh.face_cell.max() + 1, dtype=mesh.face_cell.dtype)
    cells[mesh.face_cell[image_order]] = mesh.face_cell[own_order]
    return cells
