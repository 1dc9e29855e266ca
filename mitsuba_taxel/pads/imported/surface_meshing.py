"""Second-order tetrahedral mesh of a closed surface, graded and mirrored as those of the built-in pads are.

The surface is remeshed (see `remeshing`), and Netgen meshes the volume. Where that fails, fTetWild meshes the surface
of the file.
"""

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
    exactly_on,
    kept_part,
    mirrors_of,
    planes_of,
    whole,
)
from mitsuba_taxel.pads.imported.tetwild import mesh_by_tetwild
from mitsuba_taxel.pads.imported.triangles.remeshing import remeshed
from mitsuba_taxel.pads.imported.triangles.repair import faces_of, repaired
from mitsuba_taxel.pads.imported.triangles.snapping import Patches, snapped
from mitsuba_taxel.pads.parametric.grading import cut_towards
from mitsuba_taxel.pads.parametric.meshing import BULK_COARSENING, CUT, LEAST_QUALITY, REFINEMENTS

ROUNDING = 1e-7
"""Distance from a plane of symmetry, the board or the top, relative to the diagonal, attributed to rounding."""


def mesh_surface(
    content: bytes, suffix: str, rules: tuple[Rule, ...], mesh_size: float, placement: Placement
) -> VolumeMesh:
    """Mesh of the pad in an STL, PLY or OBJ file, its nodes on the surface of the file.

    Raises
    ------
    GeometryError
        if the surface cannot be used.
    ComputationError
        if meshing fails.
    """
    surface, part, edges = parts_of(content, suffix, rules, placement)
    check_mesh_size(mesh_size, volume(surface.vertices, surface.triangles))
    for refinement in REFINEMENTS:
        try:
            mesh = _meshed(part, edges, mesh_size, refinement)
        except ComputationError:  # fTetWild may succeed
            break
        if mesh is not None and worst_element(mesh)[0] >= LEAST_QUALITY:
            return whole(mesh, part.mirrors)
    return mesh_by_tetwild(surface.vertices, surface.triangles, surface.region, surface.cell, mesh_size)


@dataclass(frozen=True, eq=False)
class SurfacePart:
    """The symmetric part of a pad: vertices (V, 3), triangles (T, 3), their regions (T,) and cells (T,)."""

    mirrors: tuple[Mirror, ...]
    vertices: np.ndarray
    triangles: np.ndarray
    region: np.ndarray
    cell: np.ndarray

    @property
    def diagonal(self) -> float:
        return float(np.linalg.norm(np.ptp(self.vertices, axis=0)))

    def exact(self, points: np.ndarray) -> np.ndarray:
        """Nodes, those within rounding of the planes of symmetry, the bottom or the top moved exactly onto them."""
        return exactly_on(points, planes_of(self.mirrors), float(self.vertices[:, 2].max()), ROUNDING * self.diagonal)


@kept(4)
def surface_of(content: bytes, suffix: str, rules: tuple[Rule, ...], placement: Placement) -> SurfacePart:
    """The whole surface of the pad in a file, repaired, with regions and cells.

    Parameters
    ----------
    content : bytes
        Of the file.
    suffix : str
        Its ending in small letters, with the dot.
    rules : tuple[Rule, ...]
        Regions of faces.
    placement : Placement
        By which the file is scaled, turned and moved.

    Returns
    -------
    SurfacePart
        Without mirrors, mm.

    Raises
    ------
    GeometryError
        if the file is no pad.
    """
    vertices, triangles = repaired(*read_surface(content, suffix, placement))
    region, cell = tagged(FacedSurface(vertices, triangles, faces_of(vertices, triangles)), rules, placement)
    return SurfacePart((), vertices, triangles, region, cell)


@kept(4)  # for the second mesh, of the error estimate
def parts_of(
    content: bytes, suffix: str, rules: tuple[Rule, ...], placement: Placement
) -> tuple[SurfacePart, SurfacePart, SingularEdges]:
    """The pad in a file, the part of it that is meshed, and where the stress is singular in the whole."""
    surface = surface_of(content, suffix, rules, placement)
    vertices, triangles, region, cell = surface.vertices, surface.triangles, surface.region, surface.cell
    patches = Patches(vertices, triangles, region, cell)
    edges = SingularEdges(patches, region, patches.patch)
    mirrors = mirrors_of(vertices, triangles, region)
    try:
        vertices, triangles, origin = kept_part(vertices, triangles, planes_of(mirrors))
    except NotSimple:
        return surface, surface, edges
    closing = origin < 0
    region, cell = np.where(closing, PLANE, region[origin]), np.where(closing, 0, cell[origin])
    return surface, SurfacePart(mirrors, vertices, triangles, region, cell), edges


def _meshed(part: SurfacePart, edges: SingularEdges, mesh_size: float, refinement: float) -> VolumeMesh | None:
    """Mesh of a part, None if some of it is lost between large elements; raises `ComputationError` if Netgen fails.

    ``edges`` are those of the whole pad.
    """
    patches = Patches(part.vertices, part.triangles, part.region, part.cell)
    singular = SingularEdges(patches, part.region, patches.patch)
    points, triangles, patch = remeshed(patches, LocalSizes(patches, part.region, singular, mesh_size, refinement))
    size = BULK_COARSENING * mesh_size / refinement
    filled = run_isolated("fill", {"vertices": points, "triangles": triangles, "mesh_size": size})
    points, tets, faces = second_order(*positive(filled["points"], filled["tets"]))
    if not np.array_equal(_sorted(faces[:, :3])[0], _sorted(triangles)[0]):
        raise ComputationError("the mesh does not end at the surface of the pad.")
    own = np.empty_like(patch)
    own[_sorted(faces[:, :3])[1]] = patch[_sorted(triangles)[1]]
    points = part.exact(snapped(points, tets, faces, own, patches, mesh_size))
    first = np.unique(patches.patch, return_index=True)[1][own]
    mesh = VolumeMesh(points, tets, faces, part.region[first], part.cell[first])
    if abs(curved_volume(mesh) / volume(part.vertices, part.triangles) - 1) > VOLUME_TOLERANCE:
        return None
    at_edges = singular.nodes(points, faces, own)
    at_edges |= edges.nodes_on_planes(points, planes_of(part.mirrors), 2 * ON_PLANE * part.diagonal)
    mesh = cut_towards(mesh, at_edges, CUT)
    return VolumeMesh(part.exact(mesh.points), mesh.tets, mesh.faces, mesh.face_region, mesh.face_cell)


def _sorted(triangles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Triangles sorted by their corners, in any rotation, and the order."""
    corners = np.sort(triangles, axis=1)
    order = np.lexsort(corners.T)
    return corners[order], order
