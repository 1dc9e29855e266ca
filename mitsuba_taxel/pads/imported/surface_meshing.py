"""Second-order tetrahedral mesh of a closed surface, graded and mirrored like parametric pads.

The surface is remeshed (see `remeshing`), and Netgen meshes the volume. If this fails, fTetWild meshes the surface of
the file."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mitsuba_taxel.base.caches import kept
from mitsuba_taxel.base.errors import ComputationError
from mitsuba_taxel.geometry.element_maps import curved_volume, worst_element
from mitsuba_taxel.geometry.mirror import Mirror
from mitsuba_taxel.geometry.second_order import positive, second_order
from mitsuba_taxel.geometry.surfaces.polygons import NotSimple
from mitsuba_taxel.geometry.surfaces.triangles import volume
from mitsuba_taxel.geometry.volume_mesh import VolumeMesh
from mitsuba_taxel.pads.imported.isolated_process import run_isolated
from mitsuba_taxel.pads.imported.local_sizes import LocalSizes, SingularEdges
from mitsuba_taxel.pads.imported.placement import Placement
from mitsuba_taxel.pads.imported.regions import FacedSurface, tagged
from mitsuba_taxel.pads.imported.rules import Rule
from mitsuba_taxel.pads.imported.surfaces import VOLUME_TOLERANCE, check_mesh_size, read_surface
from mitsuba_taxel.pads.imported.symmetric_part import (
    ON_PLANE,
    PLANE,
    completed,
    exactly_on,
    mirrors_of,
    planes_of,
    symmetric_part_of,
)
from mitsuba_taxel.pads.imported.tetwild import mesh_by_tetwild
from mitsuba_taxel.pads.imported.triangles.remeshing import remeshed
from mitsuba_taxel.pads.imported.triangles.repair import faces_of, repaired
from mitsuba_taxel.pads.imported.triangles.snapping import Patches, snapped
from mitsuba_taxel.pads.meshers import has_netgen
from mitsuba_taxel.pads.parametric.grading import cut_towards
from mitsuba_taxel.pads.parametric.meshing import BULK_COARSENING, CUT, LEAST_QUALITY, REFINEMENTS

ROUNDING = 1e-7
"""Distance from a plane of symmetry, the board or the top, relative to the diagonal, that rounding explains."""


def mesh_surface(
    content: bytes, suffix: str, rules: tuple[Rule, ...], mesh_size: float, placement: Placement
) -> VolumeMesh:
    """Mesh of the pad in an STL, PLY or OBJ file, with boundary nodes on the surface of the file.

    Parameters
    ----------
    content : bytes
        Content of the file.
    suffix : str
        Ending of the file's name in small letters, with the dot.
    rules : tuple[Rule, ...]
        Rules that assign regions to faces.
    mesh_size : float
        Length of the edges of elements, mm.
    placement : Placement
        Placement by which the file is scaled, turned and moved.

    Returns
    -------
    VolumeMesh
        Undeformed quadratic tetrahedra with tagged faces.

    Raises
    ------
    GeometryError
        if the surface cannot be used.
    ComputationError
        if meshing fails.
    """
    surface, surface_part, edges = parts_of(content, suffix, rules, placement)
    check_mesh_size(mesh_size, volume(surface.vertices, surface.triangles))
    for refinement in REFINEMENTS if has_netgen() else ():
        try:
            mesh = _meshed(surface_part, edges, mesh_size, refinement)
        except ComputationError:  # fTetWild may succeed
            break
        if mesh is not None and worst_element(mesh)[0] >= LEAST_QUALITY:
            return completed(mesh, surface_part.mirrors)
    return mesh_by_tetwild(surface.vertices, surface.triangles, surface.region, surface.cell, mesh_size)


@dataclass(frozen=True, eq=False)
class SurfacePart:
    """A part of a pad's surface, such as its symmetric part.

    Attributes
    ----------
    mirrors : tuple[Mirror, ...]
        Mirrors by which the part is completed; empty for the entire surface.
    vertices : (V, 3) ndarray
        Positions in mm.
    triangles : (T, 3) ndarray of int
        Vertices of each triangle.
    region, cell : (T,) ndarray of int
        Code of the region and number of the cell of each triangle.
    """

    mirrors: tuple[Mirror, ...]
    vertices: np.ndarray
    triangles: np.ndarray
    region: np.ndarray
    cell: np.ndarray

    @property
    def diagonal(self) -> float:
        return float(np.linalg.norm(np.ptp(self.vertices, axis=0)))

    def exact(self, points: np.ndarray) -> np.ndarray:
        """Move points exactly onto the planes of symmetry, the bottom or the top if they lie within rounding errors of
        these.
        """
        return exactly_on(points, planes_of(self.mirrors), float(self.vertices[:, 2].max()), ROUNDING * self.diagonal)


@kept(4)
def surface_of(content: bytes, suffix: str, rules: tuple[Rule, ...], placement: Placement) -> SurfacePart:
    """The entire surface of the pad in a file, repaired, with regions and cells.

    Parameters
    ----------
    content : bytes
        Content of the file.
    suffix : str
        Ending of the file's name in small letters, with the dot.
    rules : tuple[Rule, ...]
        Rules that assign regions to faces.
    placement : Placement
        Placement by which the file is scaled, turned and moved.

    Returns
    -------
    SurfacePart
        Part without mirrors, mm.

    Raises
    ------
    GeometryError
        if the file is no pad.
    """
    vertices, triangles = repaired(*read_surface(content, suffix, placement))
    region, cell = tagged(FacedSurface(vertices, triangles, faces_of(vertices, triangles)), rules, placement)
    return SurfacePart((), vertices, triangles, region, cell)


@kept(4)  # used again for the second mesh of the error estimate
def parts_of(
    content: bytes, suffix: str, rules: tuple[Rule, ...], placement: Placement
) -> tuple[SurfacePart, SurfacePart, SingularEdges]:
    """The surface of the pad in a file, and the symmetric part that is meshed.

    Parameters
    ----------
    content : bytes
        Content of the file.
    suffix : str
        Ending of the file's name in small letters, with the dot.
    rules : tuple[Rule, ...]
        Rules that assign regions to faces.
    placement : Placement
        Placement by which the file is scaled, turned and moved.

    Returns
    -------
    surface : SurfacePart
        The entire surface.
    part : SurfacePart
        Symmetric part of the surface; the entire surface if it cannot be cut.
    edges : SingularEdges
        Singular edges of the entire surface.

    Raises
    ------
    GeometryError
        if the file is no pad.
    """
    surface = surface_of(content, suffix, rules, placement)
    vertices, triangles, region, cell = surface.vertices, surface.triangles, surface.region, surface.cell
    patches = Patches(vertices, triangles, region, cell)
    edges = SingularEdges(patches, region, patches.patch)
    mirrors = mirrors_of(vertices, triangles, region)
    try:
        vertices, triangles, origin = symmetric_part_of(vertices, triangles, planes_of(mirrors))
    except NotSimple:
        return surface, surface, edges
    closing = origin < 0
    region, cell = np.where(closing, PLANE, region[origin]), np.where(closing, 0, cell[origin])
    return surface, SurfacePart(mirrors, vertices, triangles, region, cell), edges


def _meshed(surface_part: SurfacePart, edges: SingularEdges, mesh_size: float, refinement: float) -> VolumeMesh | None:
    """Mesh of a part; None if some volume is lost between large elements. Raises `ComputationError` if Netgen fails.

    ``edges`` are the singular edges of the entire pad."""
    patches = Patches(surface_part.vertices, surface_part.triangles, surface_part.region, surface_part.cell)
    singular = SingularEdges(patches, surface_part.region, patches.patch)
    sizes = LocalSizes(patches, surface_part.region, singular, mesh_size, refinement)
    points, triangles, patch = remeshed(patches, sizes)
    size = BULK_COARSENING * mesh_size / refinement
    filled = run_isolated("fill", {"vertices": points, "triangles": triangles, "mesh_size": size})
    points, tets, faces = second_order(*positive(filled["points"], filled["tets"]))
    if not np.array_equal(_sorted(faces[:, :3])[0], _sorted(triangles)[0]):
        raise ComputationError(
            "the mesh does not end at the surface of the pad: try a smaller mesh_size, or repair the surface."
        )
    patch_of_face = np.empty_like(patch)
    patch_of_face[_sorted(faces[:, :3])[1]] = patch[_sorted(triangles)[1]]
    points = surface_part.exact(snapped(points, tets, faces, patch_of_face, patches, mesh_size))
    triangle_of_face = np.unique(patches.patch, return_index=True)[1][patch_of_face]
    mesh = VolumeMesh(points, tets, faces, surface_part.region[triangle_of_face], surface_part.cell[triangle_of_face])
    if abs(curved_volume(mesh) / volume(surface_part.vertices, surface_part.triangles) - 1) > VOLUME_TOLERANCE:
        return None
    at_edges = singular.nodes(points, faces, patch_of_face)
    at_edges |= edges.nodes_on_planes(points, planes_of(surface_part.mirrors), 2 * ON_PLANE * surface_part.diagonal)
    mesh = cut_towards(mesh, at_edges, CUT)
    return VolumeMesh(surface_part.exact(mesh.points), mesh.tets, mesh.faces, mesh.face_region, mesh.face_cell)


def _sorted(triangles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Sort triangles by their corner numbers; returns the sorted triangles and the order. The order does not depend on
    the corner that comes first in a triangle.
    """
    corners = np.sort(triangles, axis=1)
    order = np.lexsort(corners.T)
    return corners[order], order
