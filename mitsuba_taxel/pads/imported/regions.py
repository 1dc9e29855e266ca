"""Regions and cells of the surface of a pad from a file."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from mitsuba_taxel.geometry.geometry_error import GeometryError, place
from mitsuba_taxel.geometry.surfaces.triangles import area_normals, components, neighbours, unit
from mitsuba_taxel.geometry.volume_mesh import VolumeMesh
from mitsuba_taxel.pads.imported.placement import AS_DRAWN, DIRECTIONS, UNMOVED, Placement
from mitsuba_taxel.pads.imported.rules import Rule
from mitsuba_taxel.pads.regions import REGIONS

ROOF_ANGLE = 60.0
"""Degrees from straight down within which the normal of a part of a hollow's face, or of a smooth patch of triangles,
makes the whole a roof, in absence of rules."""
LEAST_ROOF = 0.1
"""Least share of that part in the area: of a hemisphere it is a half, of one on a leaning wall less."""
CREASE, UPRIGHT = 35.0, 0.5
"""Degrees between the normals of neighbouring triangles above which there is an edge, and between a normal and the
horizontal below which a wall is upright."""
LEVEL_TOLERANCE = 1e-4
"""Largest distance of bottom or top from the board or the highest point, relative to the height."""
LEVEL_ANGLE = 1.0
"""Largest angle in degrees between the normal of bottom or top and the vertical."""
LEAST_FLATNESS = 0.1
"""Length of the mean normal of a face below which it counts as having none, such as the mantle of a cylinder."""
ROW_TOLERANCE = 0.25
"""Largest distance along y of cells in one row, relative to the size of a cell."""


@dataclass(frozen=True, eq=False)
class FacedSurface:
    """A closed surface of triangles grouped into faces, counter-clockwise seen from outside the silicone.

    Attributes
    ----------
    vertices : (V, 3) ndarray
        In mm.
    triangles : (T, 3) ndarray
        Vertex numbers.
    face : (T,) ndarray
        Number of the face of each triangle.
    names : sequence of str
        The faces' names, or empty if the file has none.
    """

    vertices: np.ndarray
    triangles: np.ndarray
    face: np.ndarray
    names: Sequence[str] = ()


def extents_of(corners: np.ndarray, cell: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Extents of a pad and of its cells.

    Parameters
    ----------
    corners : (T, C, 3) ndarray
        Places on the faces of its surface, mm.
    cell : (T,) ndarray
        Number of the cell of each, 0 for none.

    Returns
    -------
    (2, 3) ndarray, (K, 2, 3) ndarray
        Lowest and highest coordinates of the pad and of each cell, mm.
    """
    cells = [corners[cell == number].reshape(-1, 3) for number in range(1, int(cell.max()) + 1)]
    boxes = np.array([[places.min(axis=0), places.max(axis=0)] for places in cells]).reshape(-1, 2, 3)
    return np.array([corners.min(axis=(0, 1)), corners.max(axis=(0, 1))]), boxes


def tagged(
    surface: FacedSurface, rules: Sequence[Rule], placement: Placement = UNMOVED
) -> tuple[np.ndarray, np.ndarray]:
    """As `_tagged`; where the surface is no pad as drawn, the message names the direction ``up`` that makes it one.

    Parameters
    ----------
    surface : FacedSurface
        The closed surface, mm.
    rules : sequence of Rule
        The first that matches a face gives its region.
    placement : Placement
        By which the file was turned and moved.

    Returns
    -------
    region, cell : (F,) ndarray of int
        Code and number of the cell of each face.

    Raises
    ------
    GeometryError
        if the surface is no pad.
    """
    try:
        return _tagged(surface, rules)
    except GeometryError as error:
        standing = _standing(surface, rules) if placement.up == AS_DRAWN else []
        if not standing:
            raise
        words = " or ".join(f"{placement.prefix}file_up = {up!r}" for up in standing)
        raise GeometryError(f"{error}; {words} stands it on the board, centred at x = y = 0") from error


def _standing(surface: FacedSurface, rules: Sequence[Rule]) -> list[str]:
    """The directions of a file that point up in a pad."""
    directions = []
    for up in DIRECTIONS:
        if up != AS_DRAWN:
            try:
                _tagged(replace(surface, vertices=Placement(1.0, up).placed(surface.vertices)), rules)
                directions.append(up)
            except GeometryError:
                pass
    return directions


def _tagged(surface: FacedSurface, rules: Sequence[Rule]) -> tuple[np.ndarray, np.ndarray]:
    """Region code (T,) and number of the cell (T,) of each triangle.

    The first rule that matches a face gives its region. Other faces are bottom on the board, top at the highest z, roof
    or side in a hollow, and outer elsewhere; a roof is a face, or a smooth patch of triangles, of which a part looks
    down; bottom or top is not guessed if a rule names it. A hollow is a part of the
    surface between bottom and top that does not touch the top.

    Cells are the connected components of roof and side, numbered row by row from (-x, +y).

    Raises
    ------
    GeometryError
        if there is no bottom, no top or no cell, or a cell has no roof.
    """
    faces = _Faces(surface)
    region = np.zeros(len(faces.normal), dtype=int)
    for rule in rules:
        if rule.face is not None and rule.face not in surface.names:
            known = ", ".join(sorted(set(surface.names))) or "none"
            raise GeometryError(f"it has no face named {rule.face!r}, as a rule says; its names are: {known}")
        region[(region == 0) & faces.meet(rule)] = REGIONS[rule.region]
    for name, level in (("bottom", faces.on_board), ("top", faces.at_top)):
        if not any(rule.region == name for rule in rules):
            region[(region == 0) & level] = REGIONS[name]

    edges, pairs = neighbours(surface.triangles)
    by_triangle = region[surface.face]
    _check_ends(surface, by_triangle)
    hollow = _hollow(len(surface.triangles), pairs, by_triangle)
    group = surface.face if surface.names else _smooth_patches(surface, pairs)
    roof = _looks_down(surface, group)
    guess = np.where(hollow, np.where(roof, REGIONS["roof"], REGIONS["side"]), REGIONS["outer"])
    by_triangle = np.where(by_triangle == 0, guess, by_triangle)
    return by_triangle, _cells(surface, pairs, by_triangle)


def _smooth_patches(surface: FacedSurface, pairs: np.ndarray) -> np.ndarray:
    """(T,) number of the patch of each triangle: neighbours without a crease between them are of one patch, but
    upright walls end where the surface leans, as the wall below a dome does."""
    normal = unit(area_normals(surface.vertices, surface.triangles))
    upright = np.abs(normal[:, 2]) < math.sin(math.radians(UPRIGHT))
    cosine = np.einsum("pk,pk->p", normal[pairs[:, 0]], normal[pairs[:, 1]])
    smooth = (cosine > math.cos(math.radians(CREASE))) & (upright[pairs[:, 0]] == upright[pairs[:, 1]])
    return components(len(normal), pairs[smooth])


def _looks_down(surface: FacedSurface, group: np.ndarray) -> np.ndarray:
    """(T,) whether a part of a triangle's group (T,), as a dome's middle, lies within `ROOF_ANGLE` of facing down."""
    vector = area_normals(surface.vertices, surface.triangles)
    area = np.linalg.norm(vector, axis=1)
    down = vector[:, 2] < -math.cos(math.radians(ROOF_ANGLE)) * area
    share = np.bincount(group, down * area) / np.maximum(np.bincount(group, area), np.finfo(float).tiny)
    return (share > LEAST_ROOF)[group]


class _Faces:
    """Mean normal (F, 3) of each face, its centroid (F, 3), and whether it lies on the board or at the top."""

    def __init__(self, surface: FacedSurface) -> None:
        vector, face = area_normals(surface.vertices, surface.triangles), surface.face
        count = int(face.max()) + 1
        area = np.linalg.norm(vector, axis=1)
        corners = surface.vertices[surface.triangles]
        total = np.bincount(face, area, count)
        self.names = np.array(surface.names, dtype=object)
        self.normal = np.stack([np.bincount(face, vector[:, k], count) for k in range(3)], axis=1)
        self.normal[np.linalg.norm(self.normal, axis=1) < LEAST_FLATNESS * total] = 0
        self.normal = unit(self.normal)
        centroid = corners.mean(axis=1) * area[:, None]
        self.centroid = np.stack([np.bincount(face, centroid[:, k], count) for k in range(3)], axis=1) / total[:, None]

        lowest, highest = np.full(count, np.inf), np.full(count, -np.inf)
        np.minimum.at(lowest, face, corners[:, :, 2].min(axis=1))
        np.maximum.at(highest, face, corners[:, :, 2].max(axis=1))
        height = surface.vertices[:, 2].max()
        tolerance, level = LEVEL_TOLERANCE * abs(height), math.cos(math.radians(LEVEL_ANGLE))
        self.on_board = (np.maximum(-lowest, highest) <= tolerance) & (self.normal[:, 2] <= -level)
        self.at_top = (lowest >= height - tolerance) & (self.normal[:, 2] >= level)

    def meet(self, rule: Rule) -> np.ndarray:
        """(F,) whether each face matches all conditions of a rule."""
        met = np.ones(len(self.normal), dtype=bool)
        if rule.face is not None:
            met &= self.names == rule.face
        if rule.normal is not None:
            cosine = self.normal @ unit(np.array(rule.normal))
            met &= (cosine >= math.cos(math.radians(rule.within)) - 1e-9) & self.normal.any(axis=1)
        if rule.above is not None:
            met &= self.centroid[:, 2] >= rule.above
        if rule.below is not None:
            met &= self.centroid[:, 2] <= rule.below
        if rule.box is not None:
            met &= np.all((self.centroid >= rule.box[0]) & (self.centroid <= rule.box[1]), axis=1)
        return met


def _check_ends(surface: FacedSurface, region: np.ndarray) -> None:
    z = surface.vertices[:, 2]
    if not np.any(region == REGIONS["bottom"]):
        raise GeometryError(
            f"it has no bottom: no face lies on the board, z = 0, as its z runs from {z.min():g} to {z.max():g} mm"
        )
    if not np.any(region == REGIONS["top"]):
        raise GeometryError(
            f"it has no top: no flat face lies at its highest z = {z.max():g} mm, and no rule names another"
        )


def _hollow(count: int, pairs: np.ndarray, region: np.ndarray) -> np.ndarray:
    """(T,) whether a triangle is part of a hollow, given the region codes known so far, 0 for others."""
    bottom, top = region == REGIONS["bottom"], region == REGIONS["top"]
    between = ~(bottom | top)
    part = components(count, pairs[np.all(between[pairs], axis=1)])
    touching = np.concatenate([pairs[top[pairs[:, k]], 1 - k] for k in (0, 1)])
    return between & ~np.isin(part, part[touching[between[touching]]])


def _cells(surface: FacedSurface, pairs: np.ndarray, region: np.ndarray) -> np.ndarray:
    """(T,) number of the cell that each triangle belongs to, 0 for none."""
    in_cell = np.isin(region, (REGIONS["roof"], REGIONS["side"]))
    if not in_cell.any():
        raise GeometryError("it has no cell: no hollow is open towards the board, and no rule names a roof")
    part = components(len(region), pairs[np.all(in_cell[pairs], axis=1)])
    parts, number = np.unique(part[in_cell], return_inverse=True)
    corners = surface.vertices[surface.triangles[in_cell]]
    low, high = np.full((len(parts), 3), np.inf), np.full((len(parts), 3), -np.inf)
    np.minimum.at(low, number, corners.min(axis=1))
    np.maximum.at(high, number, corners.max(axis=1))
    without = np.setdiff1d(np.arange(len(parts)), number[region[in_cell] == REGIONS["roof"]])
    if len(without):
        raise GeometryError(f"the cell at {place(0.5 * (low + high)[without[0]])} has no roof; a rule can name one")
    cell = np.zeros(len(region), dtype=int)
    cell[in_cell] = _numbers_by_row(0.5 * (low + high)[:, :2], (high - low)[:, 1].mean())[number]
    return cell


def numbered(mesh: VolumeMesh) -> VolumeMesh:
    """The mesh with corners of elements before other nodes, and its cells numbered."""
    corner = np.zeros(len(mesh.points), dtype=bool)
    corner[mesh.tets[:, :4]] = True
    order = np.argsort(~corner, kind="stable")
    new = np.empty_like(order)
    new[order] = np.arange(len(order))
    points, faces = mesh.points[order], new[mesh.faces]
    _, pairs = neighbours(faces[:, :3])
    cell = _cells(FacedSurface(points, faces[:, :3], np.arange(len(faces))), pairs, mesh.face_region)
    return VolumeMesh(points, new[mesh.tets], faces, mesh.face_region, cell)


def _numbers_by_row(centres: np.ndarray, size: float) -> np.ndarray:
    """Numbers (C,) from 1 of cells with ``centres`` (C, 2), row by row from (-x, +y)."""
    down = np.argsort(-centres[:, 1], kind="stable")
    row = np.empty(len(centres), dtype=int)
    row[down] = np.cumsum(-np.diff(centres[down, 1], prepend=centres[down[0], 1]) > ROW_TOLERANCE * size)
    numbers = np.empty(len(centres), dtype=int)
    numbers[np.lexsort((centres[:, 0], row))] = np.arange(1, len(centres) + 1)
    return numbers
