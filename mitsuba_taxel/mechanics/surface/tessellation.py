"""The deformed surface of a pad as flat triangles, fine enough to keep the curvature of its roofs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mitsuba_taxel.base.arguments import is_row, is_whole, refusal, require
from mitsuba_taxel.base.caches import kept
from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.geometry.quadratic_shapes import shape_functions, shape_slopes
from mitsuba_taxel.geometry.surfaces.triangles import area_normals, unit
from mitsuba_taxel.geometry.unique_rows import unique_rows
from mitsuba_taxel.geometry.volume_mesh import VolumeMesh
from mitsuba_taxel.mechanics.contact.barriers.shut_gaps import kept_off, widest_shut
from mitsuba_taxel.mechanics.continuation.state import State
from mitsuba_taxel.mechanics.cutting import cut_faces, in_cells, weighted
from mitsuba_taxel.mechanics.locate import displacement_gradient
from mitsuba_taxel.mechanics.results.contact_pressure import contact_pressure
from mitsuba_taxel.mechanics.surface.curvature import Corners, smooth_sheets
from mitsuba_taxel.mechanics.surface.finish import Finish
from mitsuba_taxel.mechanics.surface.relief import Relief, SmoothSurface
from mitsuba_taxel.mechanics.surface.wall_finishes import (
    KINDS,
    MOST_TRIANGLES,
    SeparateFinish,
    fine_subdivision,
    has_vertical_sides,
    relief_of,
)
from mitsuba_taxel.pads.any_pad import AnyPad
from mitsuba_taxel.pads.block import Block
from mitsuba_taxel.pads.imported import round_faces
from mitsuba_taxel.pads.pad_file import PadFile
from mitsuba_taxel.pads.parametric.pad import Pad
from mitsuba_taxel.pads.parametric.round_walls import onto_round_walls

CREASE, FACET = 20.0, 1.0
"""Angle in degrees between the normals of neighbouring faces above which their edge is sharp, and the same for pads
from files of flat triangles, which are exact."""


@dataclass(frozen=True)
class Surface:
    """A closed surface of V vertices and T triangles, with the region and cell of each triangle.

    Attributes
    ----------
    vertices : (V, 3) ndarray
        Positions in mm, on the surface.
    triangles : (T, 3) ndarray
        Vertex numbers, counter-clockwise seen from outside the silicone.
    region : (T,) ndarray
        Region codes.
    cell : (T,) ndarray
        Number of the cell of a roof or side, 0 elsewhere.
    offsets : (V, 3) ndarray
        Movements in mm of the vertices with which triangles have the mean position of their curved walls.
    normals : (T, 3, 3) ndarray
        Unit normals of curved walls at the corners of the triangles; elsewhere, those of the triangles.
    touches : (V,) ndarray
        Mask of the vertices that touch a package; no light passes between them and the package.
    """

    vertices: np.ndarray
    triangles: np.ndarray
    region: np.ndarray
    cell: np.ndarray
    offsets: np.ndarray
    normals: np.ndarray
    touches: np.ndarray

    @property
    def shut(self) -> np.ndarray:
        """Mask (T,) of the triangles that let no light pass, because all their corners touch a package."""
        return self.touches[self.triangles].all(axis=1)

    @property
    def facing(self) -> np.ndarray:
        """Vertices (V, 3) in mm for light transport, moved so that flat triangles have the mean position of the curved
        walls.
        """
        return self.vertices + self.offsets


def tessellate(
    state: State,
    subdivision: int = 12,
    finish: Finish | SeparateFinish | None = None,
    cells: Sequence[int] | None = None,
    pad: AnyPad | None = None,
    cut_of: VolumeMesh | None = None,
) -> Surface:
    """Subdivide each curved face of the deformed pad into triangles.

    Parameters
    ----------
    state : State
        Result of :func:`load_path`.
    subdivision : int
        Segments into which the longest edge of a face of ``cells`` is divided; segments of the other edges are at most
        as long. Other faces are divided into 4 triangles, as required by their mid-edge nodes, or more where they touch
        a cell, so that the surface is closed.
    finish : LayerSteps or Grooves or RandomRoughness or SeparateFinish, optional
        Relief on the faces of the undeformed cells, subdivided as finely as it needs, that moves with the deformation:
        see :class:`Relief`.
    cells : sequence of int, optional
        Numbers of the cells that are subdivided; by default all.
    pad : AnyPad, optional
        The pad, if it has round walls: the undeformed surface is then that of the walls rather than of their elements.
    cut_of : VolumeMesh, optional
        Mesh before its nodes were moved, whose subdivision into triangles is reused.

    Returns
    -------
    Surface
        A closed surface of triangles, in mm.

    Raises
    ------
    InputError
        if a cell number does not exist, a finish is requested for some cells only, or it needs more than
        `MOST_TRIANGLES`.
    """
    if not isinstance(getattr(state, "mesh", None), VolumeMesh):  # of an undeformed pad nothing else exists
        raise refusal("state", state, "a State, as load_path returns it, is needed")
    if not (is_whole(subdivision) and 1 <= subdivision <= MOST_TRIANGLES):
        raise refusal("subdivision", subdivision, "a whole number above 0 is needed")
    if finish is not None:
        require("finish", finish, (*KINDS, SeparateFinish), "LayerSteps, Grooves, RandomRoughness or SeparateFinish")
    if pad is not None:
        require("pad", pad, (Pad, PadFile, Block), "a Pad, a PadFile or a Block")
    if cut_of is not None:
        require("cut_of", cut_of, VolumeMesh, "the mesh before it was moved")

    # Cut the undeformed surface, on exact walls, and displace its vertices.
    mesh = state.mesh
    chosen = chosen_cells(mesh, cells, finish)
    if finish is not None:
        subdivision = fine_subdivision(mesh, finish, subdivision)
    cut = cut_faces(cut_of or mesh, subdivision, chosen)
    walls = _walls(mesh, subdivision, chosen, pad, cut_of)
    vertices = walls.vertices + cut.at_vertices(state.displacement)
    triangles, faces = cut.triangles, cut.faces

    # Normals of the deformed walls, and movements of the vertices to the walls' mean position.
    at_nodes = displacement_gradient(mesh, state.displacement, _on_walls(mesh))
    gradient = cut.at_vertices(at_nodes.reshape(-1, 9)).reshape(-1, 3, 3)
    normals = walls.deformed_normals(gradient)
    offsets = walls.corners.offsets(vertices, normals)

    # The relief of a finish moves with the walls.
    if finish is not None:
        relief = _relief(mesh, subdivision, finish, pad)
        vertices = relief.carried(vertices, gradient)
        triangles, faces = relief.triangles, faces[relief.parents]
        offsets = relief.between(offsets)

    # Close the gaps to bodies that hold the pad.
    touches = np.zeros(len(vertices), dtype=bool)
    bodies = getattr(state, "bodies", None)
    if bodies is not None:
        facing, touches = kept_off(vertices + offsets, bodies, widest_shut(mesh, bodies))
        vertices = np.where(touches[:, None], facing - offsets, vertices)

    # Normals at the corners: those of curved walls, else of the triangles.
    at_corners = np.repeat(unit(area_normals(vertices, triangles))[:, None], 3, axis=1)
    if finish is None:
        curved = walls.corners.curved
        at_corners[curved] = normals[walls.corners.points[curved]]
    return Surface(vertices, triangles, mesh.face_region[faces], mesh.face_cell[faces], offsets, at_corners, touches)


def contact_pressure_at_vertices(
    state: State,
    subdivision: int,
    finish: Finish | SeparateFinish | None = None,
    cells: Sequence[int] | None = None,
    pad: AnyPad | None = None,
) -> np.ndarray:
    """Pressure of an indenter at the vertices that :func:`tessellate` gives for the same arguments.

    Parameters
    ----------
    state : State
        State under an indenter.
    subdivision : int
        Segments into which the longest edge of a face of ``cells`` is divided. See :func:`tessellate`.
    finish : Finish or SeparateFinish, optional
        Relief on the faces of the undeformed cells, subdivided as finely as it needs, that moves with the deformation:
        see :class:`Relief` and :func:`tessellate`.
    cells : sequence of int, optional
        Numbers of the cells that are subdivided. See :func:`tessellate`.
    pad : AnyPad, optional
        The pad, if it has round walls: the undeformed surface is then that of the walls rather than of their elements.
        See :func:`tessellate`.

    Returns
    -------
    (V,) ndarray
        Pressures in MPa.
    """
    if finish is not None:
        subdivision = fine_subdivision(state.mesh, finish, subdivision)
    cut = cut_faces(state.mesh, subdivision, chosen_cells(state.mesh, cells, finish))
    pressure = np.maximum(cut.at_vertices(contact_pressure(state)[:, None])[:, 0], 0.0)
    return pressure if finish is None else _relief(state.mesh, subdivision, finish, pad).between(pressure)


def chosen_cells(
    mesh: VolumeMesh, cells: Sequence[int] | None, finish: Finish | SeparateFinish | None
) -> tuple[int, ...] | None:
    """The numbers of the cells to be subdivided finely.

    Parameters
    ----------
    mesh : VolumeMesh
        Mesh of the undeformed pad.
    cells : Sequence[int] or None
        Numbers of the cells that are subdivided. See :func:`tessellate`.
    finish : Finish or SeparateFinish or None
        Relief on the walls of the cells, or None. A finish applies to all cells.

    Returns
    -------
    tuple[int, ...] or None
        Numbers of the cells; None for all.

    Raises
    ------
    InputError
        if cells are chosen although there is a finish, or if the pad does not have one of the cells.
    """
    if cells is None:
        return None
    if finish is not None:
        raise InputError("read_cells is not allowed with a finish, which applies to all cells.")
    if not is_row(cells, is_whole):
        raise refusal("read_cells", cells, "a list of whole numbers is needed")
    missing = [cell for cell in cells if cell not in mesh.face_cell or cell < 1]
    if missing:
        raise InputError(
            f"read_cells = {missing[0]} is not allowed: the pad's cells have numbers from 1 to {mesh.face_cell.max()}."
        )
    return tuple(cells)


@kept(2)  # the states of a path share their mesh
def _relief(mesh: VolumeMesh, subdivision: int, finish: Finish | SeparateFinish, pad: AnyPad | None) -> Relief:
    cut = cut_faces(mesh, subdivision)
    positions = _walls(mesh, subdivision, None, pad).vertices
    is_vertical = not isinstance(pad, Pad) or has_vertical_sides(pad)
    return relief_of(finish, SmoothSurface(positions, cut.triangles, mesh.face_region[cut.faces], is_vertical))


def _on_walls(mesh: VolumeMesh) -> np.ndarray:
    """Mask (N,): whether each node is on a roof or side."""
    nodes = np.zeros(len(mesh.points), dtype=bool)
    nodes[mesh.faces[in_cells(mesh, None)]] = True
    return nodes


@dataclass(frozen=True)
class _Walls:
    """The undeformed, finely subdivided walls.

    Attributes
    ----------
    vertices : (V, 3) ndarray
        Positions of all vertices of the surface, in mm.
    corners : Corners
        Points at which normals are needed, one for each vertex and smooth sheet.
    normals : (P, 3) ndarray
        Unit normals at these points: the mean of faces that meet smoothly.
    """

    vertices: np.ndarray
    corners: Corners
    normals: np.ndarray

    def deformed_normals(self, gradient: np.ndarray) -> np.ndarray:
        """Unit normals (P, 3) of the deformed walls, from the gradient of the displacement at the vertices (V, 3, 3).

        Normals transform with the cofactors of the deformation gradient (E. J. Nanson). The gradient is the mean over
        the elements around a vertex. It is more accurate than the normals of deformed faces, which are discontinuous.
        """
        x, y, z = np.moveaxis(np.eye(3) + gradient[self.corners.vertex], 1, 0)
        cofactors = np.stack([np.cross(y, z), np.cross(z, x), np.cross(x, y)], axis=1)
        return unit(np.einsum("pij,pj->pi", cofactors, self.normals))


@kept(4)  # the states of a path share their mesh
def _walls(
    mesh: VolumeMesh,
    subdivision: int,
    cells: tuple[int, ...] | None,
    pad: AnyPad | None,
    cut_of: VolumeMesh | None = None,
) -> _Walls:
    # The smooth sheet of each face of a wall.
    cut = cut_faces(cut_of or mesh, subdivision, cells)
    chosen = np.flatnonzero(in_cells(mesh, cells))
    sheet = np.full(len(mesh.faces), -1)
    crease = FACET if isinstance(pad, PadFile) and not pad.is_drawn else CREASE
    sheet[chosen] = smooth_sheets(
        mesh.faces[chosen, :3], _side_normals(mesh, chosen, pad), mesh.face_region[chosen], crease
    )

    # Points of these faces, moved onto the exact walls, with normals there.
    of_cut = np.flatnonzero(sheet[cut.face] >= 0)
    face, nodes = cut.face[of_cut], cut.nodes[of_cut]
    points = weighted(cut.weights[of_cut], nodes, mesh.points)
    points, gradient = placed(mesh, face, points, pad)
    normal = unit(
        np.cross(*(np.einsum("qij,qj->qi", gradient, weighted(s[of_cut], nodes, mesh.points)) for s in cut.slopes))
    )
    positions = cut.at_vertices(mesh.points)
    wall_point = np.full(len(cut.face), -1)
    wall_point[of_cut] = np.arange(len(of_cut))
    on_walls = wall_point[cut.of_vertex] >= 0
    positions[on_walls] = points[wall_point[cut.of_vertex[on_walls]]]

    # One normal for each vertex and sheet: the mean over the faces of the sheet.
    pairs = np.stack([cut.vertex[of_cut], sheet[face]], axis=1)
    first, point = unique_rows(pairs)
    wall_point[of_cut] = point
    corners = Corners(cut.triangles, sheet[cut.faces] >= 0, wall_point[cut.corners], cut.vertex[of_cut][first])
    normals = np.stack([np.bincount(point, component, len(first)) for component in normal.T], axis=1)
    return _Walls(positions, corners, unit(normals))


def knows_walls(pad: AnyPad | None) -> bool:
    """Whether the exact round walls of a pad, which elements approximate by parabolas, are known."""
    return isinstance(pad, Pad) or (isinstance(pad, PadFile) and pad.is_drawn)


def placed(
    mesh: VolumeMesh, face: np.ndarray, points: np.ndarray, pad: AnyPad | None
) -> tuple[np.ndarray, np.ndarray]:
    """Move points of faces onto the exact walls of a pad, if these are known.

    Parameters
    ----------
    mesh : VolumeMesh
        Mesh of the undeformed pad.
    face : (n,) ndarray of int
        Face of each point.
    points : (n, 3) ndarray
        Positions in mm.
    pad : AnyPad or None
        Pad with the walls.

    Returns
    -------
    points : (n, 3) ndarray
        Positions in mm.
    derivative : (n, 3, 3) ndarray
        Derivative of each moved point with respect to the original point.
    """
    if isinstance(pad, Pad):
        face_centres = mesh.points[mesh.faces[face, :3]].mean(axis=1) if pad.shape.is_square else None
        return onto_round_walls(pad, points, mesh.face_region[face], mesh.face_cell[face], face_centres)
    if knows_walls(pad):
        return round_faces.onto_round_walls(mesh, points, mesh.face_region[face], mesh.face_cell[face])
    return points, np.broadcast_to(np.eye(3), (len(points), 3, 3))


def have_edges(mesh: VolumeMesh, chosen: np.ndarray, pad: AnyPad) -> bool:
    """Whether walls, the ``chosen`` faces of a mesh, meet at sharp edges or are not connected.

    Parameters
    ----------
    mesh : VolumeMesh
        Mesh of the undeformed pad.
    chosen : (n,) ndarray of int
        Numbers of faces.
    pad : AnyPad
        The pad of these walls.

    Returns
    -------
    bool
        True if there is more than one smooth sheet.
    """
    normals = _side_normals(mesh, chosen, pad)
    return bool(smooth_sheets(mesh.faces[chosen, :3], normals, np.zeros_like(chosen), CREASE).any())


def _side_normals(mesh: VolumeMesh, chosen: np.ndarray, pad: AnyPad | None) -> np.ndarray:
    """Unit normals (F, 3, 3) of the ``chosen`` faces at the middles of their sides."""
    middles = 0.5 * (np.eye(3) + np.roll(np.eye(3), -1, axis=0))
    normals = []
    for middle in middles[:, None]:
        nodes = mesh.faces[chosen]
        at, *tangents = (
            weighted(np.broadcast_to(values, nodes.shape), nodes, mesh.points)
            for values in (shape_functions(middle), *shape_slopes(middle))
        )
        _, gradient = placed(mesh, chosen, at, pad)
        normals.append(unit(np.cross(*(np.einsum("qij,qj->qi", gradient, tangent) for tangent in tangents))))
    return np.stack(normals, axis=1)
