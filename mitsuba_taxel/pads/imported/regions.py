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

CELL_REGIONS = REGIONS["roof"], REGIONS["side"]
ROOF_ANGLE = 60.0
"""Degrees from straight down within which a normal counts as facing down. Without rules, a face of a hollow, or a
smooth patch of triangles, is a roof if enough of its area faces down."""
LEAST_ROOF = 0.1
"""Least fraction of a roof's area that faces down. It is a half on a hemisphere, and less on a leaning hemisphere."""
CREASE, UPRIGHT = 35.0, 0.5
"""Degrees between the normals of neighbouring triangles above which there is an edge, and between a normal and the
horizontal below which a wall is upright."""
LEVEL_TOLERANCE = 1e-4
"""Largest distance of bottom or top from the board or the highest point, relative to the height."""
LEVEL_ANGLE = 1.0
"""Largest angle in degrees between the normal of bottom or top and the vertical."""
LEAST_FLATNESS = 0.1
"""Length of the mean normal of a face, relative to its area, below which the face counts as having no normal, such as
the mantle of a cylinder."""
ROW_TOLERANCE = 0.25
"""Largest distance along y of cells in one row, relative to the size of a cell."""


@dataclass(frozen=True, eq=False)
class FacedSurface:
    """A closed surface of triangles grouped into faces, counter-clockwise seen from outside the silicone.

    Attributes
    ----------
    vertices : (V, 3) ndarray
        Positions in mm.
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
        Corners of the faces of its surface, mm.
    cell : (T,) ndarray
        Number of the cell of each face, 0 for none.

    Returns
    -------
    (2, 3) ndarray, (K, 2, 3) ndarray
        Lowest and highest coordinates of the pad and of each cell, mm.
    """
    cells = [corners[cell == number].reshape(-1, 3) for number in range(1, int(cell.max()) + 1)]
    boxes = np.array([[points.min(axis=0), points.max(axis=0)] for points in cells]).reshape(-1, 2, 3)
    return np.array([corners.min(axis=(0, 1)), corners.max(axis=(0, 1))]), boxes


def tagged(
    surface: FacedSurface, rules: Sequence[Rule], placement: Placement = UNMOVED
) -> tuple[np.ndarray, np.ndarray]:
    """Assign regions and cells to the faces of a surface, by rules and by shape.

    Rules assign regions to faces first; the regions of other faces are determined from their shape, see `_tagged`. If
    the surface is no pad as drawn, the message names the direction ``up`` with which it would be a pad.

    Parameters
    ----------
    surface : FacedSurface
        The closed surface, mm.
    rules : sequence of Rule
        The first rule that matches a face gives its region.
    placement : Placement
        Placement by which the file was turned and moved.

    Returns
    -------
    region, cell : (T,) ndarray of int
        Code of the region and number of the cell of each triangle.

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
    """Values of the parameter ``up`` with which the surface of a file would be a valid pad, for an error message."""
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
    """Code of the region (T,) and number of the cell (T,) of each triangle.

    The first rule that matches a face gives its region. Other faces are bottom on the board, top at the highest z, roof
    or side in a hollow, and outer elsewhere. If a rule names a bottom or a top, no other face is assigned to that
    region. A hollow is a connected part of the surface between bottom and top that does not touch the top. A face, or a
    smooth patch of triangles, in a hollow is a roof if enough of its area faces down.

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
            names = ", ".join(sorted(set(surface.names))) or "none"
            raise GeometryError(f"a rule names the face {rule.face!r}, which it does not have; its faces are: {names}")
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
    # A pad whose top is named as its coat may have no cell, as for a camera.
    if any(rule.region == "top" for rule in rules) and not np.isin(by_triangle, CELL_REGIONS).any():
        return by_triangle, np.zeros_like(by_triangle)
    return by_triangle, _cells(surface, pairs, by_triangle)


def _smooth_patches(surface: FacedSurface, pairs: np.ndarray) -> np.ndarray:
    """Number (T,) of the smooth patch of each triangle.

    Neighbours without a crease between them are in one patch. However, an upright wall ends where the surface begins to
    lean, so that a dome and the wall below it are two patches."""
    normal = unit(area_normals(surface.vertices, surface.triangles))
    upright = np.abs(normal[:, 2]) < math.sin(math.radians(UPRIGHT))
    cosine = np.einsum("pk,pk->p", normal[pairs[:, 0]], normal[pairs[:, 1]])
    smooth = (cosine > math.cos(math.radians(CREASE))) & (upright[pairs[:, 0]] == upright[pairs[:, 1]])
    return components(len(normal), pairs[smooth])


def _looks_down(surface: FacedSurface, group: np.ndarray) -> np.ndarray:
    """Mask (T,) of the triangles whose group faces down: enough of the group's area does, as in the middle of a dome.
    ``group`` (T,) is the number of the group of each triangle.
    """
    vector = area_normals(surface.vertices, surface.triangles)
    area = np.linalg.norm(vector, axis=1)
    area_facing_down = vector[:, 2] < -math.cos(math.radians(ROOF_ANGLE)) * area
    fraction = np.bincount(group, area_facing_down * area) / np.maximum(np.bincount(group, area), np.finfo(float).tiny)
    return (fraction > LEAST_ROOF)[group]


class _Faces:
    """For each of F faces of a surface: mean normal (F, 3), centroid (F, 3), and whether it lies on the board or at the
    top."""

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
        """Mask (F,) of the faces that meet all conditions of a rule."""
        matches = np.ones(len(self.normal), dtype=bool)
        if rule.face is not None:
            matches &= self.names == rule.face
        if rule.normal is not None:
            cosine = self.normal @ unit(np.array(rule.normal))
            matches &= (cosine >= math.cos(math.radians(rule.within)) - 1e-9) & self.normal.any(axis=1)
        if rule.above is not None:
            matches &= self.centroid[:, 2] >= rule.above
        if rule.below is not None:
            matches &= self.centroid[:, 2] <= rule.below
        if rule.box is not None:
            matches &= np.all((self.centroid >= rule.box[0]) & (self.centroid <= rule.box[1]), axis=1)
        return matches


def _check_ends(surface: FacedSurface, region: np.ndarray) -> None:
    """Refuse a surface without bottom or top. Raises `GeometryError`."""
    z = surface.vertices[:, 2]
    if not np.any(region == REGIONS["bottom"]):
        raise GeometryError(
            f"it has no bottom: no face lies on the board, z = 0, as its z runs from {z.min():g} to {z.max():g} mm; "
            "place it on z = 0, or name its bottom by a rule"
        )
    if not np.any(region == REGIONS["top"]):
        raise GeometryError(
            f"it has no top: no flat face lies at its highest z = {z.max():g} mm, and no rule names another face as top"
        )


def _hollow(count: int, pairs: np.ndarray, region: np.ndarray) -> np.ndarray:
    """Mask (T,) of the triangles in hollows, that is, in cells. ``region`` (T,) is the code of the region of each
    triangle, 0 if none is assigned yet."""
    bottom, top = region == REGIONS["bottom"], region == REGIONS["top"]
    between = ~(bottom | top)
    component = components(count, pairs[np.all(between[pairs], axis=1)])
    touching = np.concatenate([pairs[top[pairs[:, k]], 1 - k] for k in (0, 1)])
    return between & ~np.isin(component, component[touching[between[touching]]])


def _cells(surface: FacedSurface, pairs: np.ndarray, region: np.ndarray) -> np.ndarray:
    """Number (T,) of the cell that each triangle belongs to, 0 for none."""
    in_cell = np.isin(region, CELL_REGIONS)
    if not in_cell.any():
        raise GeometryError(
            "it has no cell: no hollow is open towards the board, and no rule names a roof, nor a top as the coat of a "
            "pad without cells"
        )
    component = components(len(region), pairs[np.all(in_cell[pairs], axis=1)])
    components_of_cells, number = np.unique(component[in_cell], return_inverse=True)
    corners = surface.vertices[surface.triangles[in_cell]]
    low, high = np.full((len(components_of_cells), 3), np.inf), np.full((len(components_of_cells), 3), -np.inf)
    np.minimum.at(low, number, corners.min(axis=1))
    np.maximum.at(high, number, corners.max(axis=1))
    roofless = np.setdiff1d(np.arange(len(components_of_cells)), number[region[in_cell] == REGIONS["roof"]])
    if len(roofless):
        raise GeometryError(
            f"the cell at {place(0.5 * (low + high)[roofless[0]])} has no roof; name its roof by a rule"
        )
    cell = np.zeros(len(region), dtype=int)
    cell[in_cell] = _numbers_by_row(0.5 * (low + high)[:, :2], (high - low)[:, 1].mean())[number]
    return cell


def numbered(mesh: VolumeMesh) -> VolumeMesh:
    """Renumber a mesh: corners of elements before other nodes, and cells in the order of the rows."""
    corner = np.zeros(len(mesh.points), dtype=bool)
    corner[mesh.tets[:, :4]] = True
    order = np.argsort(~corner, kind="stable")
    number = np.empty_like(order)
    number[order] = np.arange(len(order))
    points, faces = mesh.points[order], number[mesh.faces]
    _, pairs = neighbours(faces[:, :3])
    cell = np.zeros_like(mesh.face_cell)
    if np.isin(mesh.face_region, CELL_REGIONS).any():
        cell = _cells(FacedSurface(points, faces[:, :3], np.arange(len(faces))), pairs, mesh.face_region)
    return VolumeMesh(points, number[mesh.tets], faces, mesh.face_region, cell)


def _numbers_by_row(centres: np.ndarray, size: float) -> np.ndarray:
    """Numbers (C,) from 1 of cells with ``centres`` (C, 2), row by row from (-x, +y)."""
    by_y = np.argsort(-centres[:, 1], kind="stable")
    row = np.empty(len(centres), dtype=int)
    row[by_y] = np.cumsum(-np.diff(centres[by_y, 1], prepend=centres[by_y[0], 1]) > ROW_TOLERANCE * size)
    numbers = np.empty(len(centres), dtype=int)
    numbers[np.lexsort((centres[:, 0], row))] = np.arange(1, len(centres) + 1)
    return numbers
