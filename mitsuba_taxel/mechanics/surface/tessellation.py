"""The deformed surface of a pad as flat triangles, fine enough to keep the curvature of its roofs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from mitsuba_taxel.base.arguments import is_row, is_whole, refusal, require
from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.geometry.quadratic_shapes import shape_functions, shape_slopes
from mitsuba_taxel.geometry.triangles import area_normals, unit
from mitsuba_taxel.geometry.volume_mesh import VolumeMesh
from mitsuba_taxel.mechanics.path.load_path import State
from mitsuba_taxel.mechanics.surface.curvature import Corners, smooth_sheets
from mitsuba_taxel.mechanics.surface.finish import (
    MOST_TRIANGLES,
    Finish,
    Grooves,
    LayerSteps,
    RandomRoughness,
    fine_subdivision,
)
from mitsuba_taxel.mechanics.surface.relief import Relief, SmoothSurface, displacement_gradient
from mitsuba_taxel.pads.imported import round_faces
from mitsuba_taxel.pads.pad import REGIONS, Pad
from mitsuba_taxel.pads.pad_file import SURFACE_FORMATS, PadFile
from mitsuba_taxel.pads.parametric.round_walls import onto_round_walls

CREASE, FACET = 20.0, 1.0
"""Degrees between the normals of neighbouring faces above which their edge is sharp; where a file has flat triangles,
these are its geometry."""


@dataclass(frozen=True)
class Surface:
    """A closed triangle mesh.

    Attributes
    ----------
    vertices : (V, 3) ndarray
        In mm, on the surface.
    triangles : (T, 3) ndarray
        Vertex numbers, counter-clockwise seen from outside the silicone.
    region : (T,) ndarray
        Region codes.
    cell : (T,) ndarray
        Number of the cell that a roof or side belongs to, 0 elsewhere.
    offsets : (V, 3) ndarray
        mm from the vertices to where the triangles have the mean of the curved walls that they cut.
    normals : (T, 3, 3) ndarray
        Unit normals of these walls at the corners of the triangles; of others, their own.
    """

    vertices: np.ndarray
    triangles: np.ndarray
    region: np.ndarray
    cell: np.ndarray
    offsets: np.ndarray
    normals: np.ndarray

    @property
    def facing(self) -> np.ndarray:
        """(V, 3) mm, the vertices of triangles that light is to meet: with the mean of the curved walls."""
        return self.vertices + self.offsets


def tessellate(
    state: State,
    subdivision: int = 12,
    finish: Finish | None = None,
    cells: Sequence[int] | None = None,
    pad: Pad | PadFile | None = None,
) -> Surface:
    """Cut each curved face of the deformed pad into triangles.

    The longest edge of a face of ``cells`` (numbers; None for all) is cut into ``subdivision`` segments, others into as
    many as keep theirs no longer. Other faces are cut into 4 triangles, as their mid-edge nodes need, or into a fan
    where they touch a cell, so that the surface is closed. A ``finish`` is laid on the faces of the undeformed cells,
    cut as fine as it needs, and carried by the deformation: see :class:`Relief`. Of a ``pad`` with round walls, the
    undeformed surface is these walls rather than the elements that follow them.

    Raises
    ------
    InputError
        if there is no cell of such a number, a finish is asked for on a part of the cells, or it needs more than
        `MOST_TRIANGLES`.
    """
    if not isinstance(getattr(state, "mesh", None), VolumeMesh):  # of an undeformed pad nothing else is made
        raise refusal("state", state, "a State, as load_path returns it, is needed")
    if not (is_whole(subdivision) and 1 <= subdivision <= MOST_TRIANGLES):
        raise refusal("subdivision", subdivision, "a whole number above 0 is needed")
    if finish is not None:
        require("finish", finish, (LayerSteps, Grooves, RandomRoughness), "LayerSteps, Grooves or RandomRoughness")
    if pad is not None:
        require("pad", pad, (Pad, PadFile), "a Pad or a PadFile")
    mesh = state.mesh
    chosen = _chosen(mesh, cells, finish)
    if finish is not None:
        subdivision = fine_subdivision(mesh, finish, subdivision)
    cut = _cut(mesh, subdivision, chosen)
    walls = _walls(mesh, subdivision, chosen, pad)
    vertices = walls.places + cut.at_vertices(state.displacement)
    triangles, faces = cut.triangles, cut.faces
    normals = walls.normals(cut, state.displacement)
    offsets = walls.corners.offsets(vertices, normals)
    if finish is not None:
        relief = _relief(mesh, subdivision, finish, pad)
        gradient = displacement_gradient(mesh, state.displacement)
        vertices = relief.carried(vertices, cut.at_vertices(gradient.reshape(-1, 9)).reshape(-1, 3, 3))
        triangles, faces = relief.triangles, faces[relief.parents]
        offsets = relief.between(offsets)
    at_corners = np.repeat(unit(area_normals(vertices, triangles))[:, None], 3, axis=1)
    if finish is None:
        curved = walls.corners.curved
        at_corners[curved] = normals[walls.corners.points[curved]]
    return Surface(vertices, triangles, mesh.face_region[faces], mesh.face_cell[faces], offsets, at_corners)


def _chosen(mesh: VolumeMesh, cells: Sequence[int] | None, finish: Finish | None) -> tuple[int, ...] | None:
    """The cells to be cut finely, None for all."""
    if cells is None:
        return None
    if finish is not None:
        raise InputError("read_cells is not allowed with a finish: it is laid on all cells.")
    if not is_row(cells, is_whole):
        raise refusal("read_cells", cells, "a row of whole numbers is needed")
    missing = [cell for cell in cells if cell not in mesh.face_cell or cell < 1]
    if missing:
        raise InputError(
            f"read_cells = {missing[0]} is not allowed: the pad's cells have numbers from 1 to {mesh.face_cell.max()}."
        )
    return tuple(cells)


@lru_cache(maxsize=2)  # the states of a path share their mesh
def _relief(mesh: VolumeMesh, subdivision: int, finish: Finish, pad: Pad | PadFile | None) -> Relief:
    cut = _cut(mesh, subdivision)
    places = _walls(mesh, subdivision, None, pad).places
    return finish.relief(SmoothSurface(places, cut.triangles, mesh.face_region[cut.faces]))


@dataclass(frozen=True)
class _Cut:
    """Triangles, and the ``faces`` (T,) that they cut. Vertices are points of faces, one of several where faces meet.

    Points are ``weights`` (P, 6) of the ``nodes`` (P, 6) of the ``face`` (P,) that each is of; their ``slopes``
    (2, P, 6) are the derivatives of these weights along two sides of it. A vertex has the number ``of_vertex`` (V,) as
    a point, and a point the number ``vertex`` (P,) as a vertex; ``corners`` (T, 3) are the points of triangles.
    """

    nodes: np.ndarray
    weights: np.ndarray
    slopes: np.ndarray
    face: np.ndarray
    of_vertex: np.ndarray
    vertex: np.ndarray
    corners: np.ndarray
    faces: np.ndarray

    @property
    def triangles(self) -> np.ndarray:
        """(T, 3) vertex numbers."""
        return self.vertex[self.corners]

    def at_vertices(self, values: np.ndarray) -> np.ndarray:
        """(V, C) values at the vertices from those at the nodes of the mesh (N, C)."""
        return _weighted(self.weights[self.of_vertex], self.nodes[self.of_vertex], values)


def _weighted(weights: np.ndarray, nodes: np.ndarray, values: np.ndarray) -> np.ndarray:
    return sum(weights[:, k, None] * values[nodes[:, k]] for k in range(6))


@lru_cache(maxsize=4)  # the states of a path share their mesh
def _cut(mesh: VolumeMesh, subdivision: int, cells: tuple[int, ...] | None = None) -> _Cut:
    in_cell = _in_cells(mesh, cells)
    segments = _segments(mesh, in_cell, subdivision)
    kinds, kind_of = np.unique(np.column_stack([in_cell, segments]), axis=0, return_inverse=True)
    patterns = []
    for kind, (finely, *edges) in enumerate(kinds.tolist()):
        even = len(set(edges)) == 1
        cut = _grid(edges[0]) if even else _snapped(edges) if finely else _fan(edges)
        patterns.append((np.flatnonzero(kind_of == kind), cut))

    keys, weights, slopes, face, corners, faces, count = [], [], [], [], [], [], 0
    for chosen, (barycentric, pattern) in patterns:
        points = len(barycentric)
        keys.append(_keys(mesh.faces[chosen, :3], np.rint(6 * subdivision * barycentric).astype(np.int64)))
        weights.append(np.tile(shape_functions(barycentric), (len(chosen), 1)))
        slopes.append(np.tile(np.array(shape_slopes(barycentric)), (1, len(chosen), 1)))
        face.append(np.repeat(chosen, points))
        first = count + points * np.arange(len(chosen))
        corners.append((first[:, None, None] + pattern).reshape(-1, 3))
        faces.append(np.repeat(chosen, len(pattern)))
        count += points * len(chosen)
    of_point = np.concatenate(face)
    # Where a roof ends, its edge is that of the side: of the points that are one, those of sides come first.
    order = np.argsort(mesh.face_region[of_point] != REGIONS["side"], kind="stable")
    _, first, vertex = np.unique(np.concatenate(keys)[order], axis=0, return_index=True, return_inverse=True)
    number = np.empty_like(order)
    number[order] = vertex.ravel()
    return _Cut(
        mesh.faces[of_point],
        np.concatenate(weights),
        np.concatenate(slopes, axis=1),
        of_point,
        order[first],
        number.astype(np.int32),
        np.concatenate(corners),
        np.concatenate(faces),
    )


def _in_cells(mesh: VolumeMesh, cells: tuple[int, ...] | None) -> np.ndarray:
    """(F,) whether each face is a roof or side, of the ``cells`` that are to be cut finely."""
    in_cell = np.isin(mesh.face_region, (REGIONS["roof"], REGIONS["side"]))
    return in_cell if cells is None else in_cell & np.isin(mesh.face_cell, cells)


@dataclass(frozen=True)
class _Walls:
    """The walls that are cut finely, undeformed.

    Attributes
    ----------
    places : (V, 3) ndarray
        In mm, of all vertices.
    corners : Corners
        Points are those at which a normal is wanted, one for each vertex and smooth sheet.
    point : (Q,) ndarray
        The number of such a point, for each of the points ``of_cut`` (Q,) of the cut that lie there.
    tangents : (2, Q, 3) ndarray
        Along two sides of the face.
    """

    places: np.ndarray
    corners: Corners
    of_cut: np.ndarray
    point: np.ndarray
    tangents: np.ndarray

    def normals(self, cut: _Cut, displacement: np.ndarray) -> np.ndarray:
        """(P, 3) unit normals of the deformed walls: where faces meet smoothly, the mean of theirs."""
        nodes = cut.nodes[self.of_cut]
        one, other = (
            tangent + _weighted(slopes[self.of_cut], nodes, displacement)
            for tangent, slopes in zip(self.tangents, cut.slopes, strict=True)
        )
        normal = unit(np.cross(one, other))
        return unit(np.stack([np.bincount(self.point, n, len(self.corners.vertex)) for n in normal.T], axis=1))


@lru_cache(maxsize=4)  # the states of a path share their mesh
def _walls(mesh: VolumeMesh, subdivision: int, cells: tuple[int, ...] | None, pad: Pad | PadFile | None) -> _Walls:
    cut = _cut(mesh, subdivision, cells)
    chosen = np.flatnonzero(_in_cells(mesh, cells))
    sheet = np.full(len(mesh.faces), -1)
    sheet[chosen] = _sheets(mesh, chosen, pad)

    of_cut = np.flatnonzero(sheet[cut.face] >= 0)
    face, nodes = cut.face[of_cut], cut.nodes[of_cut]
    points = _weighted(cut.weights[of_cut], nodes, mesh.points)
    points, gradient = _placed(mesh, face, points, pad)
    tangents = np.stack(
        [np.einsum("qij,qj->qi", gradient, _weighted(slopes[of_cut], nodes, mesh.points)) for slopes in cut.slopes]
    )
    places = cut.at_vertices(mesh.points)
    on_wall = np.full(len(cut.face), -1)
    on_wall[of_cut] = np.arange(len(of_cut))
    walled = on_wall[cut.of_vertex] >= 0
    places[walled] = points[on_wall[cut.of_vertex[walled]]]

    key, point = np.unique(np.stack([cut.vertex[of_cut], sheet[face]]), axis=1, return_inverse=True)
    on_wall[of_cut] = point.ravel()
    corners = Corners(cut.triangles, sheet[cut.faces] >= 0, on_wall[cut.corners], key[0])
    return _Walls(places, corners, of_cut, point.ravel(), tangents)


def _placed(
    mesh: VolumeMesh, face: np.ndarray, points: np.ndarray, pad: Pad | PadFile | None
) -> tuple[np.ndarray, np.ndarray]:
    """Points (N, 3) of faces (N,), on the walls of the pad where these are known, and the derivative by the points."""
    if isinstance(pad, Pad):
        return onto_round_walls(pad, points, mesh.face_region[face], mesh.face_cell[face])
    if isinstance(pad, PadFile) and pad.suffix not in SURFACE_FORMATS:
        return round_faces.onto_round_walls(mesh, points, mesh.face_region[face], mesh.face_cell[face])
    return points, np.broadcast_to(np.eye(3), (len(points), 3, 3))


def _sheets(mesh: VolumeMesh, chosen: np.ndarray, pad: Pad | PadFile | None) -> np.ndarray:
    """Number of the smooth sheet of each of the ``chosen`` faces."""
    middles = 0.5 * (np.eye(3) + np.roll(np.eye(3), -1, axis=0))
    normals = []
    for middle in middles[:, None]:
        nodes = mesh.faces[chosen]
        at, *along = (
            _weighted(np.broadcast_to(values, nodes.shape), nodes, mesh.points)
            for values in (shape_functions(middle), *shape_slopes(middle))
        )
        _, gradient = _placed(mesh, chosen, at, pad)
        normals.append(unit(np.cross(*(np.einsum("qij,qj->qi", gradient, tangent) for tangent in along))))
    crease = FACET if isinstance(pad, PadFile) and pad.suffix in SURFACE_FORMATS else CREASE
    region = mesh.face_region[chosen]
    return smooth_sheets(mesh.faces[chosen, :3], np.stack(normals, axis=1), region, crease)


def _grid(n: int) -> tuple[np.ndarray, np.ndarray]:
    """Barycentric coordinates of the points of a triangle cut into n * n, and those triangles."""
    lattice = np.array([(n - i - j, i, j) for j in range(n + 1) for i in range(n + 1 - j)])
    number = {tuple(point): index for index, point in enumerate(lattice[:, 1:].tolist())}
    pattern = []
    for j in range(n):
        for i in range(n - j):
            pattern.append((number[i, j], number[i + 1, j], number[i, j + 1]))
            if i + j < n - 1:
                pattern.append((number[i + 1, j], number[i + 1, j + 1], number[i, j + 1]))
    return lattice / n, np.array(pattern)


def _segments(mesh: VolumeMesh, in_cell: np.ndarray, subdivision: int) -> np.ndarray:
    """(F, 3) segments that each edge of each face is cut into: in cells so many that none is longer than those of the
    longest edge, elsewhere two, as its mid-edge node needs."""
    corners = mesh.points[mesh.faces[in_cell, :3]]
    length = np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=2)
    wanted = np.ceil(subdivision * length / length.max(initial=0.0) * (1 - 1e-9)).astype(int)
    of_node = np.full(len(mesh.points), 2)
    of_node[mesh.faces[in_cell, 3:]] = np.clip(wanted, min(2, subdivision), subdivision)
    return of_node[mesh.faces[:, 3:]]


def _snapped(segments: list[int]) -> tuple[np.ndarray, np.ndarray]:
    """As :func:`_grid` of the most segments that an edge has, its points on the other edges moved to where these need
    them, and triangles left out that become lines: none gets much larger, or turns over."""
    n = max(segments)
    points, pattern = _grid(n)
    for k, count in enumerate(segments):
        start, end = np.eye(3)[[k, (k + 1) % 3]]
        on_edge = np.flatnonzero(points[:, k - 1] == 0)
        place = np.rint(n * points[on_edge, (k + 1) % 3]) * count / n
        # Ties go to the nearer end, where a triangle between two edges would become a line otherwise.
        place = np.where(2 * place < count, np.ceil(place - 0.5), np.floor(place + 0.5))
        points[on_edge] = start + place[:, None] / count * (end - start)
    points, number = np.unique(points, axis=0, return_inverse=True)
    pattern = number.ravel()[pattern]
    kept = (pattern != np.roll(pattern, 1, axis=1)).all(axis=1)
    return points, pattern[kept]


def _fan(segments: list[int]) -> tuple[np.ndarray, np.ndarray]:
    """Barycentric coordinates and triangles of a fan round the centre, with so many segments on each edge."""
    corners = np.eye(3)
    rim = np.array(
        [
            corners[k] + step / count * (corners[(k + 1) % 3] - corners[k])
            for k, count in enumerate(segments)
            for step in range(count)
        ]
    )
    around = np.arange(len(rim))
    pattern = np.stack([around, np.roll(around, -1), np.full(len(rim), len(rim))], axis=1)
    return np.concatenate([rim, np.full((1, 3), 1 / 3)]), pattern


def _keys(corners: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """(F * P, 6) what is equal for points (P, 3 whole numbers) of faces (F, 3 corners) if they are one point.

    A point is known by the corners it has weight on, in order, and those weights.
    """
    shape = (len(corners), len(weights), 3)
    weights = np.broadcast_to(weights, shape)
    used = np.where(weights > 0, corners[:, None, :], -1)
    order = np.argsort(used, axis=2)
    keys = [np.take_along_axis(part, order, axis=2) for part in (used, weights)]
    return np.concatenate(keys, axis=2).reshape(-1, 6)
